/* Optimality error, WB (5), and the decision that a point is a solution. */
#include "interior_solver.h"

#include <math.h>

static const double S_MAX = 100; /* scaling by the size of the multipliers, WB (6) */

typedef struct {
    double dual, complementarity, mean_y, mean_z;
} errors;

static errors optimality(const solver *s, double mu)
{
    errors e = {0, 0, 0, 0};
    long bounds = 0;
    for (int i = 0; i < s->nv; ++i) {
        if (fixed(s, i))
            continue;
        double d = s->dual[i];
        if (s->lo[i] > -INFINITY) {
            d -= s->now.zl[i];
            const double product = s->now.zl[i]*(s->now.v[i] - s->lo[i]);
            e.complementarity = max(e.complementarity, fabs(product - mu));
            e.mean_z += s->now.zl[i], ++bounds;
        }
        if (s->up[i] < INFINITY) {
            d += s->now.zu[i];
            const double product = s->now.zu[i]*(s->up[i] - s->now.v[i]);
            e.complementarity = max(e.complementarity, fabs(product - mu));
            e.mean_z += s->now.zu[i], ++bounds;
        }
        e.dual = max(e.dual, fabs(d)*(i < s->n ? s->size[i] : 1));
    }
    for (int r = 0; r < s->m; ++r)
        e.mean_y += fabs(s->now.y[r]);
    const double total = s->m + bounds ? (e.mean_y + e.mean_z)/(double)(s->m + bounds) : 0;
    e.mean_z = bounds ? e.mean_z/(double)bounds : 0;
    e.mean_y = total;
    return e;
}

/* E_mu of WB (5), in scaled terms. */
double ip_barrier_error(const solver *s, double mu)
{
    const errors e = optimality(s, mu);
    double worst = 0;
    for (int r = 0; r < s->m; ++r)
        worst = max(worst, fabs(s->now.residual[r]));
    const double dual = e.dual/(max(S_MAX, e.mean_y)/S_MAX);
    return max(worst, max(dual, e.complementarity/(max(S_MAX, e.mean_z)/S_MAX)));
}

/* Size that stationarity and complementarity are compared with: the cost's, not below a share of
 * its first one. */
double ip_cost_size(const solver *s) { return max(fabs(s->values[0]), s->options->least_cost); }

/* Whether the point meets the tolerances: 2 the sharp one, 1 the demanded one, 0 none. */
int ip_converged(const solver *s)
{
    const errors e = optimality(s, 0);
    const double unit = s->elastic ? 1 : s->fs*ip_cost_size(s);
    const double fs = s->elastic ? 1 : s->fs;
    const double dual = e.dual/unit/(max(S_MAX, e.mean_y/fs)/S_MAX);
    const double complementarity = e.complementarity/unit/(max(S_MAX, e.mean_z/fs)/S_MAX);
    const double left = max(dual, complementarity);
    if (left > s->options->demanded)
        return 0;
    double worst = s->elastic ? 0 : ip_violation(s);
    for (int r = 0; r < s->m; ++r)
        worst = max(worst, fabs(s->now.residual[r])/(s->elastic ? 1 : s->fs_rows[r]));
    if (worst > (s->elastic ? s->options->optimality : s->options->violation))
        return 0;
    return left*(s->elastic ? 1 : max(ip_cost_size(s), 1)) <= s->options->optimality ? 2 : 1;
}
