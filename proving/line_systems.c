/* See line_systems.h. */
#include "line_systems.h"

#include "linear_program.h"

/* The inverse of a matrix (n, n) of numbers by Gauss and Jordan; 0, or 1 where it has none. */
static int inverted(int n, double *a, double *inverse)
{
    for (int i = 0; i < n * n; i++)
        inverse[i] = i % (n + 1) == 0;
    for (int k = 0; k < n; k++) {
        int best = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(a[i * n + k]) > fabs(a[best * n + k]))
                best = i;
        if (!(fabs(a[best * n + k]) > 0))
            return 1;
        for (int j = 0; j < n && best != k; j++) {
            double t = a[k * n + j];
            a[k * n + j] = a[best * n + j], a[best * n + j] = t;
            t = inverse[k * n + j];
            inverse[k * n + j] = inverse[best * n + j], inverse[best * n + j] = t;
        }
        const double pivot = 1 / a[k * n + k];
        for (int j = 0; j < n; j++)
            a[k * n + j] *= pivot, inverse[k * n + j] *= pivot;
        for (int i = 0; i < n; i++) {
            const double factor = a[i * n + k];
            if (i == k || factor == 0)
                continue;
            for (int j = 0; j < n; j++) {
                a[i * n + j] -= factor * a[k * n + j];
                inverse[i * n + j] -= factor * inverse[k * n + j];
            }
        }
    }
    return 0;
}

/* Solve A X = B, shapes (n, n) and (n, m), for matrices of lines; A and B are used up. */
int solve_lines(int n, int m, line *A, line *B)
{
    double mid[MOST_NODES * MOST_NODES], inverse[MOST_NODES * MOST_NODES];
    line row[MOST_NODES + 2 * MOST_STATE];
    for (int i = 0; i < n * n; i++)
        mid[i] = interval_mid(A[i].v);
    if (inverted(n, mid, inverse))
        return 1;
    /* The product with the inverse of the middle is nearly the identity. */
    for (int part = 0; part < 2; part++) {
        line *of = part ? B : A;
        const int columns = part ? m : n;
        for (int j = 0; j < columns; j++) {
            for (int i = 0; i < n; i++) {
                row[i] = line_of(0);
                for (int k = 0; k < n; k++)
                    if (inverse[i * n + k] != 0)
                        row[i] = line_add(row[i], line_scaled(of[k * columns + j], inverse[i * n + k]));
            }
            for (int i = 0; i < n; i++)
                of[i * columns + j] = row[i];
        }
    }
    for (int k = 0; k < n; k++) {
        if (!(A[k * n + k].v.lo > 0))
            return 1;
        const line pivot = line_inverse(A[k * n + k]);
        for (int i = 0; i < n; i++) {
            if (i == k || line_is_zero(A[i * n + k]))
                continue;
            const line factor = line_scaled(line_mul(A[i * n + k], pivot), -1);
            for (int j = k + 1; j < n; j++)
                A[i * n + j] = line_add_mul(A[i * n + j], factor, A[k * n + j]);
            for (int j = 0; j < m; j++)
                B[i * m + j] = line_add_mul(B[i * m + j], factor, B[k * m + j]);
        }
        for (int j = k + 1; j < n; j++)
            A[k * n + j] = line_mul(A[k * n + j], pivot);
        for (int j = 0; j < m; j++)
            B[k * m + j] = line_mul(B[k * m + j], pivot);
    }
    return 0;
}
