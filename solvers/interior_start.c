/* The first point: into the interior of the bounds, scaling, multipliers; WB 3.6, 3.8. */
#include "interior_solver.h"

#include <math.h>
#include <string.h>

static const double KAPPA_1 = 1e-2, KAPPA_2 = 1e-2; /* distance from the bounds, WB 3.6 */
static const double G_MAX = 100;                    /* largest scaled slope, WB 3.8 */
static const double Y_MAX = 1e3;                    /* largest first multiplier, WB 3.6 */

/* Move a value into the interior of its bounds, WB 3.6, with distances in the variable's own
 * size. */
static double inside(double v, double lo, double up, double size, double share)
{
    const double below = share*min(KAPPA_1*max(size, fabs(lo)), KAPPA_2*(up - lo));
    const double above = share*min(KAPPA_1*max(size, fabs(up)), KAPPA_2*(up - lo));
    if (lo > -INFINITY && v < lo + below)
        v = lo + below;
    if (up < INFINITY && v > up - above)
        v = up - above;
    return v;
}

/* Gradient-based scaling of objective and rows, WB 3.8; the cost's gradient is taken in the sizes
 * of the unknowns. */
static void choose_scaling(solver *s)
{
    for (int r = 0; r < s->m; ++r)
        s->fs_rows[r] = 1;
    s->fs = 1;
    ip_evaluate_slopes(s);
    double most = 0;
    for (int i = 0; i < s->n; ++i)
        if (!fixed(s, i))
            most = max(most, fabs(s->slopes[i])*s->size[i]);
    s->fs = isfinite(most) && most > G_MAX ? max(G_MAX/most, 1e-8) : 1;
    const double *jac = s->slopes + s->n;
    for (int r = 0; r < s->m; ++r) {
        most = 0;
        for (int e = s->program->row_start[r]; e < s->program->row_start[r + 1]; ++e)
            most = max(most, fabs(jac[e])*s->size[s->program->column[e]]);
        s->fs_rows[r] = isfinite(most) && most > G_MAX ? max(G_MAX/most, 1e-8) : 1;
    }
}

/* Least-squares multipliers of the constraints, WB (36); zero where they are large. Expects
 * slopes. */
void ip_estimate_multipliers(solver *s)
{
    const dmoc_kkt *k = s->kkt;
    memset(s->now.y, 0, sizeof(double)*(size_t)s->m);
    ip_evaluate_dual(s);
    ip_fill_K(s, 0);
    for (int i = 0; i < s->n; ++i)
        if (k->diagonal[i] >= 0) {
            s->K[k->diagonal[i]] = 1/(s->size[i]*s->size[i]);
            s->right[k->place[i]] = -(s->dual[i] - s->now.zl[i] + s->now.zu[i]);
        }
    for (int r = 0; r < s->m; ++r) {
        s->K[k->diagonal[s->n + r]] = r < s->eq ? -DELTA_C : -1;
        s->right[k->place[s->n + r]] = r < s->eq ? 0 : s->now.zl[s->n + r - s->eq];
    }
    dmoc_ldl_factor(s->ldl, s->K, TINY_PIVOT);
    if (ip_solve_linear(s) > BAD_RESIDUAL)
        return;
    double most = 0;
    for (int r = 0; r < s->m; ++r)
        most = max(most, fabs(s->solution[k->place[s->n + r]]));
    if (!(most <= Y_MAX))
        return;
    for (int r = 0; r < s->m; ++r)
        s->now.y[r] = s->solution[k->place[s->n + r]];
}

void ip_start(solver *s, const double *x, const double *y, const double *z_lower,
              const double *z_upper)
{
    const int n = s->n;
    const double share = s->options->warm ? 1e-4 : 1;
    for (int i = 0; i < s->most; ++i) {
        s->lo[i] = i >= n ? 0 : fixed(s, i) ? -INFINITY : s->program->lower[i];
        s->up[i] = i >= n || fixed(s, i) ? INFINITY : s->program->upper[i];
        s->open[i] = (s->lo[i] > -INFINITY) - (s->up[i] < INFINITY);
        if (i < n)
            s->now.v[i] = fixed(s, i) ? s->program->lower[i]
                                      : inside(x[i], s->lo[i], s->up[i], s->size[i], share);
    }
    s->nv = n; /* no slacks yet: they start at the inequalities */
    ip_evaluate_values(s, s->now.v);
    choose_scaling(s);
    for (int r = 0; r < s->m; ++r)
        s->rho[r] = s->options->price ? RHO*s->options->price[r]/s->fs_rows[r] : RHO;
    s->nv = n + s->slacks;
    for (int a = 0; a < s->slacks; ++a) {
        const double d = s->fs_rows[s->eq + a]*s->values[1 + s->eq + a];
        s->now.v[n + a] = inside(d, 0, INFINITY, 1, share);
    }
    ip_set_barrier(s, s->options->mu);
    for (int i = 0; i < s->nv; ++i) {
        const int below = s->lo[i] > -INFINITY, above = s->up[i] < INFINITY;
        if (!s->options->warm) {
            s->now.zl[i] = below, s->now.zu[i] = above;
        } else if (i < n) {
            s->now.zl[i] = below ? max(s->fs*z_lower[i], 0) : 0;
            s->now.zu[i] = above ? max(s->fs*z_upper[i], 0) : 0;
        } else {
            s->now.zl[i] = max(-s->fs*y[s->eq + i - n]/s->fs_rows[s->eq + i - n], 0);
        }
    }
    ip_evaluate(s, &s->now);
    ip_filter_reset(&s->front, s->now.theta);
    ip_evaluate_slopes(s);
    if (s->options->warm)
        for (int r = 0; r < s->m; ++r)
            s->now.y[r] = s->fs*y[r]/s->fs_rows[r];
    else
        ip_estimate_multipliers(s);
    ip_keep_multipliers(s);
}
