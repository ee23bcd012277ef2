/* Least squares of small dense matrices, stored row by row.
 *
 * The caller owns all arrays; work has dmoc_work_size(m, n) values. What is not finite gives what is
 * not a number.
 */
#ifndef DMOC_LEAST_SQUARES_H
#define DMOC_LEAST_SQUARES_H

#include <stddef.h>

ptrdiff_t dmoc_work_size(int m, int n);
/* inverse[n*m]: that of A[m*n] by least squares, the shortest solution where there are many;
 * singular values up to cut times the largest one count as none. */
void dmoc_pseudo_inverse(int m, int n, const double *A, double cut, double *inverse, double *work);
/* The smallest of the min(m, n) singular values of A[m*n]; 0 where A is not finite or empty. */
double dmoc_smallest_singular(int m, int n, const double *A, double *work);
/* rows[(m - n)*m]: an orthonormal basis of what is orthogonal to the columns of A[m*n], n < m. */
void dmoc_complement(int m, int n, const double *A, double *rows, double *work);

#endif
