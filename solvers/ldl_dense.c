#include "ldl_dense.h"

#include <math.h>

/* Exchange rows and columns i and j of a symmetric matrix stored in full; finished columns of L
 * follow. */
static void swap(double *A, int n, int i, int j)
{
    for (int c = 0; c < n; ++c) {
        const double t = A[i*n + c];
        A[i*n + c] = A[j*n + c], A[j*n + c] = t;
    }
    for (int r = 0; r < n; ++r) {
        const double t = A[r*n + i];
        A[r*n + i] = A[r*n + j], A[r*n + j] = t;
    }
}

void ldl_factor_dense(dmoc_ldl *f, double *A, int n, double tiny)
{
    const double ratio = 0.6403882032022076; /* (1 + sqrt(17))/8 bounds the growth */
    for (int k = 0; k < n;) {
        int d = k, r = k, s = k;
        for (int i = k; i < n; ++i)
            for (int j = k; j <= i; ++j) {
                if (i == j && fabs(A[i*n + i]) > fabs(A[d*n + d]))
                    d = i;
                if (i != j && (r == s || fabs(A[i*n + j]) > fabs(A[r*n + s])))
                    r = i, s = j;
            }
        const int width = r == s || fabs(A[d*n + d]) >= ratio*fabs(A[r*n + s]) ? 1 : 2;
        double D[3];
        if (width == 1) {
            swap(A, n, k, d);
            f->exchange[k] = d;
            ldl_invert_pivot(f, D, 1, A[k*n + k], 0, 0, tiny);
        } else {
            swap(A, n, k, s);
            swap(A, n, k + 1, r);
            f->exchange[k] = ~s;
            f->exchange[k + 1] = r;
            ldl_invert_pivot(f, D, 2, A[k*n + k], A[(k + 1)*n + k], A[(k + 1)*n + k + 1], tiny);
        }
        for (int i = k + width; i < n; ++i) {
            const double a = A[i*n + k], b = width == 2 ? A[i*n + k + 1] : 0;
            const double la = D[0]*a + D[1]*b, lb = D[1]*a + D[2]*b;
            for (int j = k + width; j < n; ++j)
                A[i*n + j] -= la*A[k*n + j] + (width == 2 ? lb*A[(k + 1)*n + j] : 0);
        }
        for (int i = k + width; i < n; ++i) {
            const double a = A[i*n + k], b = width == 2 ? A[i*n + k + 1] : 0;
            A[i*n + k] = D[0]*a + D[1]*b;
            if (width == 2)
                A[i*n + k + 1] = D[1]*a + D[2]*b;
        }
        A[k*n + k] = D[0];
        if (width == 2)
            A[(k + 1)*n + k] = D[1], A[(k + 1)*n + k + 1] = D[2];
        k += width;
    }
}

/* Exchange unknowns k and its partner. */
static void swap_with_partner(const int *exchange, double *x, int k)
{
    const int other = exchange[k] < 0 ? ~exchange[k] : exchange[k];
    const double t = x[k];
    x[k] = x[other], x[other] = t;
}

void ldl_solve_dense(const double *A, const int *exchange, int n, double *x)
{
    for (int k = 0; k < n; ++k)
        swap_with_partner(exchange, x, k);
    for (int k = 0; k < n;) {
        const int width = exchange[k] < 0 ? 2 : 1;
        for (int i = k + width; i < n; ++i)
            x[i] -= A[i*n + k]*x[k] + (width == 2 ? A[i*n + k + 1]*x[k + 1] : 0);
        const double a = x[k];
        x[k] *= A[k*n + k];
        if (width == 2) {
            x[k] += A[(k + 1)*n + k]*x[k + 1];
            x[k + 1] = A[(k + 1)*n + k]*a + A[(k + 1)*n + k + 1]*x[k + 1];
        }
        k += width;
    }
    for (int k = n - 1; k >= 0; --k) {
        /* The second unknown of a pivot of two has no entry beside it. */
        const int last = k > 0 && exchange[k - 1] < 0 ? 1 : 0;
        for (int i = k + (last || exchange[k] >= 0 ? 1 : 2); i < n; ++i)
            x[k] -= A[i*n + k]*x[i];
    }
    for (int k = n - 1; k >= 0; --k)
        swap_with_partner(exchange, x, k);
}
