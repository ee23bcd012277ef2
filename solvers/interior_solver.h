/* What the files of the interior-point method share (interior_point.h is its interface).
 *
 *   interior_evaluation.c   values, slopes and curvatures of a point
 *   interior_optimality.c   optimality error, WB (5)
 *   interior_system.c       linear system and search direction, WB (13), 3.1
 *   interior_search.c       filter line search, WB 2.3, 2.4
 *   interior_start.c        first point, scaling, multipliers, WB 3.6, 3.8
 *   interior_restoration.c  restoration, WB 3.3
 *   interior_point.c        iteration, WB algorithm A; parts of the memory, and entry
 *   interior_starts.c       the same from many starts, by the clock of the system
 *
 * Constants have the letters and mostly the values of WB.
 */
#ifndef DMOC_INTERIOR_SOLVER_H
#define DMOC_INTERIOR_SOLVER_H

#include "interior_point.h"

#include <math.h>

static const double KAPPA_D = 1e-5;                          /* damping, WB 3.7 */
static const double DELTA_C = 1e-8;                          /* perturbation of rows, WB 3.1 */
static const double RHO = 1000;                              /* price of a violation, WB (29) */
static const double TINY_PIVOT = 1e-20, BAD_RESIDUAL = 1e-5; /* linear system */
enum { MOST_FILTER = 400 };

/* v = (x | slacks | a | b): a and b relax every row in the restoration only. A trial point has no
 * multipliers. */
typedef struct {
    double *v, *y, *zl, *zu;
    double f, theta, phi; /* objective (scaled), violation |residual|_1, barrier function */
    double logs;          /* phi = f + mu*logs */
    double *residual;     /* [m] scaled constraints, slacks and elastic variables included */
} point;

/* What the optimality error WB (5) of a point is made of, in scaled terms. */
typedef struct {
    double dual, residual;         /* largest entries */
    double least, most;            /* products of bounds and their multipliers */
    double mean_multiplier, mean_z; /* mean sizes: of all multipliers, and of those of bounds */
    int bounds;
} error_parts;

typedef struct {
    double theta[MOST_FILTER], phi[MOST_FILTER];
    int count;
    double theta_max, theta_min;
} filter;

typedef struct {
    const dmoc_program *program;
    const dmoc_kkt *kkt;
    const dmoc_options *options;
    const double *size, *stretch;
    dmoc_ldl *ldl;
    int n, m, eq, slacks, most; /* most: length of v with elastic variables */
    int elastic, nv;            /* restoration or not; length of v in use */
    double *lo, *up;            /* [most] bounds of v; none where v is fixed */
    double *open;               /* [most] 1 where it has a lower bound alone, -1 an upper one */
    double *below, *above;      /* [most] inverse distances of the point now from its bounds */
    double *values, *slopes, *hess, *K;
    double *fs_rows;            /* [m] scaling of rows */
    double fs;                  /* scaling of the objective */
    point now, trial;
    double *gradient;           /* [most] of the objective, scaled */
    double *dual;               /* [most] gradient + A'y */
    double *dv, *dy, *dzl, *dzu, *soc_dv, *soc_dy, *soc_residual;
    double *sigma, *pull;       /* [most] of the barrier: curvature and slope */
    double *right, *solution, *rest, *change;
    double delta_w, delta_c, last_delta_w;
    error_parts errors;              /* of the point now */
    filter front;
    double mu, tau;
    int patience;               /* iterations in a row that met the demanded tolerance */
    int tiny;                   /* steps in a row below rounding errors */
    /* restoration */
    double *reference, *weight, *rho, zeta; /* rho[m]: price of a violation of each row */
    double saved_mu;
    filter saved_front;
    dmoc_result result;
    double begin;
} solver;

/* Not fmax and fmin, which are calls. */
static inline double max(double a, double b) { return a > b ? a : b; }
static inline double min(double a, double b) { return a < b ? a : b; }

static inline int fixed(const solver *s, int i) { return i < s->n && s->kkt->place[i] < 0; }

/* Row and sign of a slack or elastic variable: residual = c - s - a + b. */
static inline int aux_row(const solver *s, int i)
{
    const int a = i - s->n;
    return a < s->slacks ? s->eq + a : (a - s->slacks) % s->m;
}

static inline double aux_sign(const solver *s, int i)
{
    return i - s->n < s->slacks + s->m ? -1 : 1;
}

static inline double largest(const double *x, int n)
{
    enum { LANES = 4 }; /* none of which waits for another */
    double most[LANES] = {0};
    int unknown = 0; /* how many are not numbers */
    for (int i = 0; i < n; i += LANES)
        for (int k = 0; k < LANES && i + k < n; ++k) {
            most[k] = max(most[k], fabs(x[i + k]));
            unknown += x[i + k] != x[i + k];
        }
    return unknown ? NAN : max(max(most[0], most[1]), max(most[2], most[3]));
}

/* Calls between the files stay inside of the library. */
#ifdef __GNUC__
#pragma GCC visibility push(hidden)
#endif

/* interior_evaluation.c */
void ip_evaluate_values(solver *s, const double *x);
int ip_evaluate(solver *s, point *p);
double ip_violation(const solver *s);
void ip_evaluate_slopes(solver *s);
void ip_evaluate_curvatures(solver *s);
void ip_evaluate_dual(solver *s);

/* interior_optimality.c */
void ip_measure(solver *s);
double ip_barrier_error(const solver *s, double mu);
double ip_cost_size(const solver *s);
int ip_converged(const solver *s);

/* interior_system.c */
void ip_invert_distances(solver *s);
void ip_fill_K(solver *s, int with_hessian);
double ip_solve_linear(solver *s);
double ip_newton_step(solver *s, const double *residual, double *dv, double *dy);
int ip_direction(solver *s);

/* interior_search.c */
int ip_filter_accepts(const filter *f, double theta, double phi);
void ip_filter_add(filter *f, double theta, double phi);
void ip_filter_reset(filter *f, double theta);
void ip_keep_multipliers(solver *s);
int ip_line_search(solver *s);

/* interior_start.c */
void ip_estimate_multipliers(solver *s);
void ip_start(solver *s, const double *x, const double *y, const double *z_lower,
              const double *z_upper);

/* interior_restoration.c */
void ip_begin_restoration(solver *s);
int ip_restore(solver *s);

/* interior_point.c */
double ip_seconds(const solver *s);
int ip_late(const solver *s);
void ip_set_barrier(solver *s, double mu);
int ip_iterate(solver *s);

#ifdef __GNUC__
#pragma GCC visibility pop
#endif

#endif
