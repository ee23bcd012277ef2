/* A primal-dual interior-point method with a filter line search, after
 *
 *   A. Waechter, L. T. Biegler: On the implementation of an interior-point filter line-search
 *   algorithm for large-scale nonlinear programming. Mathematical Programming 106 (2006) 25-57.
 *   "WB" and an equation or section number refer to it.
 *
 * for minimise f(x) subject to c(x) = 0, d(x) >= 0, lower <= x <= upper. Every inequality gets a
 * slack. What differs from the paper:
 *
 * - Unknowns have sizes: stationarity, perturbations of the Hessian and the distance of the start
 *   from its bounds are measured in them. A step size h of a millisecond would otherwise be pushed
 *   to ten (WB 3.6), and weigh a thousand times too much.
 * - Step sizes change by a limited factor in one iteration. They multiply everything that happens
 *   in a phase, and a linearisation in them holds no further; without the limit a quarter of the
 *   iterates leaves the motion for one that winds through several turns.
 * - The end is decided in the units of the problem, not in scaled ones: largest violation,
 *   stationarity and complementarity.
 * - Slacks, and the elastic variables of the restoration, are eliminated from the linear system
 *   row by row; the system keeps its size and pattern.
 * - The order of the pivots is fixed. A solution whose residual stays large counts as singular, so
 *   that the perturbations grow.
 * - The restoration's first multipliers of the constraints are zero, it may not call a restoration
 *   of its own (WB 3.3.1), and after it the bound multipliers begin anew at mu/(x - lower).
 * - No watchdog. A point that meets the demanded tolerance and gets no sharper in three iterations
 *   is a solution.
 */
#ifndef DMOC_INTERIOR_POINT_H
#define DMOC_INTERIOR_POINT_H

#include "interior_status.h"
#include "ldl.h"
#include "passes.h"

typedef struct {
    double optimality;  /* stationarity and complementarity to aim at, scaled as in WB (5) */
    double demanded;    /* the same, of a solution that rounding errors keep from getting sharper */
    double violation;   /* largest violation of a solution, in the units of the constraints */
    double least_cost;  /* a smaller cost counts as this much where residuals are compared */
    double infeasible;  /* a larger least violation means infeasible, a smaller one stalled */
    double mu;          /* first barrier parameter */
    int warm;           /* y, z_lower, z_upper are given */
    const double *price; /* [m] price of a violation in the restoration, in the units of the rows;
                            NULL for 1 on scaled rows */
    int least_violation; /* minimise the violation alone: solved where there is none */
    int iterations;
    double seconds;      /* limit, by the clock */
    double (*clock)(void); /* seconds since some time; NULL for no clock, and no limit */
    dmoc_report *report;
    void *user;
} dmoc_options;

/* The linear system: K index i < n is unknown i, n + r is row r. All arrays are the caller's.
 *   place[n + m]: position in the elimination order, -1 for fixed unknowns
 *   start[size + 1], row[]: upper triangle by columns in elimination order, rows ascending, with all
 *   of the diagonal
 *   first[pivots + 1]: pivots
 *   from_hess[], from_jac[]: entry of K that each entry of the Hessian and of the Jacobian is added
 *   to, -1 for none
 *   diagonal[n + m]: entry of K on the diagonal, -1 for fixed unknowns
 */
typedef struct {
    int size, pivots;
    const int *place, *start, *row, *first, *from_hess, *from_jac, *diagonal;
} dmoc_kkt;

typedef struct {
    int status, iterations, restorations;
    long factorisations;
    double seconds_kernels, seconds_linear, seconds; /* where the time went */
} dmoc_result;

/* Memory that a solve needs beside its arguments and the factorisation, in bytes. */
size_t dmoc_interior_memory(const dmoc_program *program, const dmoc_kkt *kkt);

/* x[n], y[m], z_lower[n], z_upper[n]: start and result; size[n]: typical changes of the unknowns;
 * stretch[n] > 1: the largest ratio of an unknown in two iterates, for unknowns that are positive,
 * INFINITY for the others. After a restoration without success the multipliers are those of the
 * least violation. L = f + y . (c | d) - z_lower . (x - lower) - z_upper . (upper - x), and y <= 0
 * on rows d. memory is aligned as a double; ldl is an analysis of kkt. Neither allocates.
 */
dmoc_result dmoc_interior_point(const dmoc_program *program, const dmoc_kkt *kkt,
                                const dmoc_options *options, const double *size,
                                const double *stretch, double *x, double *y, double *z_lower,
                                double *z_upper, dmoc_ldl *ldl, void *memory);

/* The clock of the system, in seconds. */
double dmoc_clock(void);

/* Starts of one program, which threads take one after the other, each with a program that works in
 * memory of its own: arrays have a row for each start. */
typedef struct {
    int count;
    const double *size, *mu;           /* rows of n, and one number each */
    const int *hurried;                /* whether each is given up, as at its limit of iterations,
                                          where it comes no nearer to a motion */
    double *x, *y, *z_lower, *z_upper; /* rows of n, y of m */
    int *status, *iterations;          /* as they were where there was no time */
    int *turn;                         /* the start that is next, in whatever thread */
    const int *stop;                   /* not 0 ends all */
} dmoc_starts;

/* Minimise from the starts whose turn comes here, within the seconds of the options, by the clock
 * of the system; reports are not heard. */
void dmoc_interior_starts(const dmoc_program *program, const dmoc_kkt *kkt,
                          const dmoc_options *options, const double *stretch,
                          const dmoc_starts *starts, dmoc_ldl *ldl, void *memory);

#endif
