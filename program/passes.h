/* Sums of kernel results: the values and derivatives of a nonlinear program, element by element.
 *
 * An element is n rows of one kernel (dmoc_kernel.h). Input a of row i is read at
 * pool + base[a] + i*stride[a] where gather[a] is NULL, and collected from
 * pool[gather[a][i*size + j]] otherwise, with its size in the kernel's entry. Value j of output b
 * of row i, times factor[b][i*size + j], is added to target[slot[b][i*size + j]]; a slot of -1
 * drops it, a slot array of NULL drops all of output b.
 */
#ifndef DMOC_PASSES_H
#define DMOC_PASSES_H

#include "dmoc_kernel.h"

typedef struct {
    const dmoc_entry *entry;
    ptrdiff_t n;
    ptrdiff_t base[DMOC_MOST], stride[DMOC_MOST];
    const ptrdiff_t *gather[DMOC_MOST];
    const ptrdiff_t *slot[DMOC_MOST];
    const double *factor[DMOC_MOST];
} dmoc_element;

/* One pass over elements: target = constant + linear part + elements.
 *   constant[targets]
 *   the linear part as triplets: target[row[k]] += coefficient[k]*pool[column[k]]
 *   scratch[dmoc_scratch_size()]
 */
typedef struct {
    ptrdiff_t targets;
    const double *constant;
    ptrdiff_t terms;
    const ptrdiff_t *row, *column;
    const double *coefficient;
    ptrdiff_t elements;
    dmoc_element *element;
    double *scratch;
} dmoc_pass;

/* A nonlinear program: minimise f subject to c = 0, d >= 0, lower <= x <= upper, with rows
 * (c | d), m of them, and r = (f | c | d).
 *   pool = (x[n] | y[m] | sigma | 0 | parameters), each of the first n + m + 1 multiplied by its
 *     sizes[n + m + 1]: dmoc_put
 *   values: r[1 + m]
 *   slopes: gradient[n], then the entries of d(c | d)/dx by rows: row_start[m + 1], column[entries]
 *   curvatures: the entries of the upper triangle of the Hessian of sigma f + y . (c | d), by rows:
 *     hess_start[n + 1], hess_column[]
 */
typedef struct {
    ptrdiff_t n, m, equalities;
    const double *lower, *upper;
    const double *sizes;
    double *pool;
    dmoc_pass values, slopes, curvatures;
    const int *row_start, *column;
    const int *hess_start, *hess_column;
} dmoc_program;

ptrdiff_t dmoc_scratch_size(const dmoc_pass *pass);
/* Put scaled unknowns into the pool. */
void dmoc_put(const dmoc_program *program, const double *x);
void dmoc_assemble(const dmoc_pass *pass, const double *pool, double *target);

#endif
