#include "least_squares.h"

#include <float.h>
#include <math.h>

enum { SWEEPS = 60 }; /* of Jacobi's method, which takes some six */

ptrdiff_t dmoc_work_size(int m, int n)
{
    const ptrdiff_t least = m < n ? m : n;
    return (ptrdiff_t)m*n + least*least + least;
}

static double dot(ptrdiff_t n, const double *a, const double *b)
{
    double sum = 0.0;
    for (ptrdiff_t i = 0; i < n; ++i)
        sum += a[i]*b[i];
    return sum;
}

/* The largest absolute value; not a number where one is not finite. */
static double largest(ptrdiff_t n, const double *a)
{
    double most = 0.0;
    for (ptrdiff_t i = 0; i < n; ++i) {
        if (!isfinite(a[i]))
            return NAN;
        most = fmax(most, fabs(a[i]));
    }
    return most;
}

static void rotate(int n, double *a, double *b, double c, double s)
{
    for (int i = 0; i < n; ++i) {
        const double x = a[i], y = b[i];
        a[i] = c*x - s*y;
        b[i] = s*x + c*y;
    }
}

/* One-sided Jacobi rotations of k columns c[k][n], which become orthogonal, and of the identity
 * v[k][k]: c_before = v' c_after. */
static void orthogonalise(int n, int k, double *c, double *v)
{
    for (int i = 0; i < k*k; ++i)
        v[i] = i % (k + 1) ? 0.0 : 1.0;
    for (int sweep = 0, turned = 1; turned && sweep < SWEEPS; ++sweep) {
        turned = 0;
        for (int p = 0; p < k - 1; ++p)
            for (int q = p + 1; q < k; ++q) {
                double *a = c + (ptrdiff_t)p*n, *b = c + (ptrdiff_t)q*n;
                const double aa = dot(n, a, a), bb = dot(n, b, b), ab = dot(n, a, b);
                if (!(fabs(ab) > DBL_EPSILON*sqrt(aa)*sqrt(bb)))
                    continue;
                const double zeta = (bb - aa)/(2.0*ab);
                const double t = copysign(1.0, zeta)/(fabs(zeta) + sqrt(1.0 + zeta*zeta));
                const double cosine = 1.0/sqrt(1.0 + t*t), sine = cosine*t;
                rotate(n, a, b, cosine, sine);
                rotate(k, v + (ptrdiff_t)p*k, v + (ptrdiff_t)q*k, cosine, sine);
                turned = 1;
            }
    }
}

/* The shorter sides of A/size as rows of c[k][n], k = min(m, n). */
static void collect(int m, int n, const double *A, double size, double *c)
{
    const int wide = m < n, k = wide ? m : n, length = wide ? n : m;
    for (int i = 0; i < k; ++i)
        for (int j = 0; j < length; ++j)
            c[(ptrdiff_t)i*length + j] = A[wide ? (ptrdiff_t)i*n + j : (ptrdiff_t)j*n + i]/size;
}

void dmoc_pseudo_inverse(int m, int n, const double *A, double cut, double *inverse, double *work)
{
    const int wide = m < n, k = wide ? m : n, length = wide ? n : m;
    const double size = largest((ptrdiff_t)m*n, A);
    double *c = work, *v = c + (ptrdiff_t)m*n, *squares = v + (ptrdiff_t)k*k;
    for (ptrdiff_t i = 0; i < (ptrdiff_t)m*n; ++i)
        inverse[i] = isfinite(size) ? 0.0 : NAN;
    if (!(size > 0.0))
        return;
    if (m == 1 && n == 1) {
        inverse[0] = 1.0/A[0];
        return;
    }
    collect(m, n, A, size, c);
    orthogonalise(length, k, c, v);
    double most = 0.0;
    for (int i = 0; i < k; ++i) {
        squares[i] = dot(length, c + (ptrdiff_t)i*length, c + (ptrdiff_t)i*length);
        most = fmax(most, squares[i]);
    }
    for (int r = 0; r < k; ++r) {
        if (!(sqrt(squares[r]) > cut*sqrt(most)))
            continue;
        for (int i = 0; i < k; ++i) {
            const double factor = v[(ptrdiff_t)r*k + i]/squares[r]/size;
            for (int j = 0; j < length; ++j)
                inverse[wide ? (ptrdiff_t)j*m + i : (ptrdiff_t)i*m + j] +=
                    factor*c[(ptrdiff_t)r*length + j];
        }
    }
}

double dmoc_smallest_singular(int m, int n, const double *A, double *work)
{
    const int k = m < n ? m : n, length = m < n ? n : m;
    const double size = largest((ptrdiff_t)m*n, A);
    double *c = work, *v = c + (ptrdiff_t)m*n;
    if (!(size > 0.0) || k == 0)
        return 0.0;
    collect(m, n, A, size, c);
    orthogonalise(length, k, c, v);
    double least = INFINITY;
    for (int i = 0; i < k; ++i)
        least = fmin(least, dot(length, c + (ptrdiff_t)i*length, c + (ptrdiff_t)i*length));
    return size*sqrt(least);
}

/* x - 2 w (w . x), the mirror image of x behind the plane with the normal w. */
static void mirror(int n, const double *w, double *x)
{
    const double along = 2.0*dot(n, w, x);
    for (int i = 0; i < n; ++i)
        x[i] -= along*w[i];
}

void dmoc_complement(int m, int n, const double *A, double *rows, double *work)
{
    double *w = work; /* normals of mirrors that turn A's columns into a triangle: w[n][m] */
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < m; ++i)
            w[(ptrdiff_t)j*m + i] = A[(ptrdiff_t)i*n + j];
    for (int j = 0; j < n; ++j) {
        double *column = w + (ptrdiff_t)j*m;
        for (int before = 0; before < j; ++before)
            mirror(m, w + (ptrdiff_t)before*m, column);
        for (int i = 0; i < j; ++i)
            column[i] = 0.0;
        const double size = largest(m, column);
        for (int i = j; i < m && size > 0.0; ++i)
            column[i] /= size;
        const double tail = dot(m - j - 1, column + j + 1, column + j + 1);
        const double length = sqrt(column[j]*column[j] + tail);
        column[j] += copysign(length, column[j]);
        const double norm = sqrt(column[j]*column[j] + tail);
        for (int i = j; i < m; ++i)
            column[i] = tail > 0.0 ? column[i]/norm : 0.0;
    }
    for (int r = 0; r < m - n; ++r) {
        double *row = rows + (ptrdiff_t)r*m;
        for (int i = 0; i < m; ++i)
            row[i] = i == n + r ? 1.0 : 0.0;
        for (int j = n - 1; j >= 0; --j)
            mirror(m, w + (ptrdiff_t)j*m, row);
    }
}
