/* Optimality error, WB (5), and the decision that a point is a solution. */
#include "interior_solver.h"

#include <float.h>
#include <math.h>

static const double S_MAX = 100; /* scaling by the size of the multipliers, WB (6) */
/* A violation that counts as none where it is this many rounding errors of its row, and below the
 * second: on fine meshes a row subtracts what is large beside it. */
static const double ROUNDINGS = 2, MOST_ROUNDED = 1e-9;

/* Take the product of a bound with its multiplier into account. */
static inline void take_bound(error_parts *e, double z, double distance)
{
    const double product = z*distance;
    e->least = min(e->least, product);
    e->most = max(e->most, product);
    e->mean_z += z;
    e->bounds += 1;
}

/* The errors of the point now, whose dual is known. */
void ip_measure(solver *s)
{
    error_parts e = {0, 0, INFINITY, -INFINITY, 0, 0, 0};
    double sum_y = 0;
    for (int i = 0; i < s->n; ++i) {
        if (fixed(s, i))
            continue;
        double d = s->dual[i];
        if (s->lo[i] > -INFINITY) {
            d -= s->now.zl[i];
            take_bound(&e, s->now.zl[i], s->now.v[i] - s->lo[i]);
        }
        if (s->up[i] < INFINITY) {
            d += s->now.zu[i];
            take_bound(&e, s->now.zu[i], s->up[i] - s->now.v[i]);
        }
        e.dual = max(e.dual, fabs(d)*s->size[i]);
    }
    for (int i = s->n; i < s->nv; ++i) {
        take_bound(&e, s->now.zl[i], s->now.v[i]);
        e.dual = max(e.dual, fabs(s->dual[i] - s->now.zl[i]));
    }
    for (int r = 0; r < s->m; ++r) {
        sum_y += fabs(s->now.y[r]);
        e.residual = max(e.residual, fabs(s->now.residual[r]));
    }
    const int all = s->m + e.bounds;
    e.mean_multiplier = all ? (sum_y + e.mean_z)/all : 0;
    e.mean_z = e.bounds ? e.mean_z/e.bounds : 0;
    s->errors = e;
}

/* Largest distance of a product of a bound and its multiplier from mu. */
static double complementarity(const error_parts *e, double mu)
{
    return e->bounds ? max(e->most - mu, mu - e->least) : 0;
}

/* E_mu of WB (5), in scaled terms. */
double ip_barrier_error(const solver *s, double mu)
{
    const error_parts *e = &s->errors;
    const double dual = e->dual/(max(S_MAX, e->mean_multiplier)/S_MAX);
    const double products = complementarity(e, mu)/(max(S_MAX, e->mean_z)/S_MAX);
    return max(e->residual, max(dual, products));
}

/* Size that stationarity and complementarity are compared with: the cost's, not below a share of
 * its first one. */
double ip_cost_size(const solver *s) { return max(fabs(s->values[0]), s->options->least_cost); }

/* Rounding errors of a row, by its terms of first order. */
static double rounding(const solver *s, int r)
{
    double sum = 0;
    for (int e = s->program->row_start[r]; e < s->program->row_start[r + 1]; ++e)
        sum += fabs(s->slopes[s->n + e]*s->now.v[s->program->column[e]]);
    return ROUNDINGS*DBL_EPSILON*sum/s->fs_rows[r];
}

/* Whether the point keeps all rows but for rounding errors. */
static int keeps_rows(const solver *s, double tolerance)
{
    for (int r = 0; r < s->m; ++r) {
        const double own = r < s->eq ? fabs(s->values[1 + r]) : -s->values[1 + r];
        const double wrong = max(own, fabs(s->now.residual[r])/s->fs_rows[r]);
        if (wrong > tolerance && !(wrong <= min(MOST_ROUNDED, rounding(s, r))))
            return 0;
    }
    return 1;
}

/* Whether the point meets the tolerances: 2 the sharp one, 1 the demanded one, 0 none. */
int ip_converged(const solver *s)
{
    const error_parts *e = &s->errors;
    const double size = s->elastic ? 1 : s->fs*ip_cost_size(s);
    const double fs = s->elastic ? 1 : s->fs;
    const double dual = e->dual/size/(max(S_MAX, e->mean_multiplier/fs)/S_MAX);
    const double products = complementarity(e, 0)/size/(max(S_MAX, e->mean_z/fs)/S_MAX);
    const double left = max(dual, products);
    if (left > s->options->demanded)
        return 0;
    if (s->elastic ? e->residual > s->options->optimality
                   : !keeps_rows(s, s->options->violation))
        return 0;
    return left*(s->elastic ? 1 : max(ip_cost_size(s), 1)) <= s->options->optimality ? 2 : 1;
}
