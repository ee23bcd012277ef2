/* Symmetric indefinite factorisation of a full matrix with complete pivoting (Bunch & Parlett
 * 1971), and what it shares with the sparse one (ldl.h): pivots of one or two unknowns.
 */
#ifndef DMOC_LDL_DENSE_H
#define DMOC_LDL_DENSE_H

#include "ldl.h"

#ifdef __GNUC__
#pragma GCC visibility push(hidden) /* calls between the files stay inside of the library */
#endif

/* Invert a pivot of one (b = 0) or two unknowns [[a, b], [b, c]] into D[3] and count the signs of
 * its eigenvalues. */
void ldl_invert_pivot(dmoc_ldl *f, double *D, int width, double a, double b, double c, double tiny);

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
