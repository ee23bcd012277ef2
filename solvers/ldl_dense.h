/* Symmetric indefinite factorisation of a full matrix with complete pivoting (Bunch & Parlett
 * 1971), and what it shares with the sparse one (ldl.h): pivots of one or two unknowns.
 */
#ifndef DMOC_LDL_DENSE_H
#define DMOC_LDL_DENSE_H

#include "ldl.h"

#include <math.h>

static inline void count_sign(dmoc_ldl *f, double d) { *(d > 0 ? &f->positive : &f->negative) += 1; }

/* Invert a pivot of one (b = 0) or two unknowns [[a, b], [b, c]] into D[3] and count the signs of
 * its eigenvalues. */
static inline void ldl_invert_pivot(dmoc_ldl *f, double *D, int width, double a, double b, double c,
                                    double tiny)
{
    if (width == 1) {
        if (!(fabs(a) > tiny)) {
            f->zero += 1;
            a = a < 0 ? -tiny : tiny;
        }
        count_sign(f, a);
        D[0] = 1/a, D[1] = D[2] = 0;
        return;
    }
    double det = a*c - b*b;
    const double size = fabs(a*c) > b*b ? fabs(a*c) : b*b;
    if (!(fabs(det) > 1e-14*size && fabs(det) > tiny*tiny)) {
        f->zero += 1;
        det = 1e-14*size > tiny*tiny ? -1e-14*size : -tiny*tiny;
    }
    if (det < 0) {
        f->positive += 1, f->negative += 1;
    } else {
        count_sign(f, a), count_sign(f, a);
    }
    D[0] = c/det, D[1] = -b/det, D[2] = a/det;
}

#ifdef __GNUC__
#pragma GCC visibility push(hidden) /* calls between the files stay inside of the library */
#endif

/* Factorise A[n][n]: L below the diagonal, the inverse pivots on it and beside it, and the
 * permutation in exchange[n], where a negative entry ~j marks the first of two unknowns in one
 * pivot. */
void ldl_factor_dense(dmoc_ldl *f, double *A, int n, double tiny);
/* Solve A x = b in place. */
void ldl_solve_dense(const double *A, const int *exchange, int n, double *x);

#ifdef __GNUC__
#pragma GCC visibility pop
#endif

#endif
