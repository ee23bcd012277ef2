/* Small systems in numbers without intervals. */
#ifndef DMOC_SMALL_H
#define DMOC_SMALL_H

/* The inverse of a positive definite matrix (n, n). */
void small_inverse(int n, const double *H, double *inverse);

/* Least of u H u/2 + y u within bounds, with the inverse of H; the free inputs as a mask. */
unsigned least_inputs(int n, const double *H, const double *inverse, const double *y,
                             const double *lower, const double *upper, double *u);

/* Solve the symmetric positive system A x = b of the rows that are free, with a little more on its
 * diagonal where it needs it. */
void solve_free(int n, double *A, const double *b, const unsigned char *is_free, double *x);

#endif
