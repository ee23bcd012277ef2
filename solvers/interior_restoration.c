/* Restoration: from a point that no step leads on from to one of less violation, WB 3.3. */
#include "interior_solver.h"

#include <float.h>
#include <math.h>
#include <string.h>

static const double KAPPA_RESTO = 0.9;

/* Elastic variables that minimise the barrier function for a residual c = p - n, WB (33), (34). */
static void elastic_pair(double c, double mu, double rho, double *p, double *n)
{
    const double half = (mu - rho*c)/(2*rho);
    *n = half + sqrt(half*half + mu*c/(2*rho));
    *p = c + *n;
}

void ip_begin_restoration(solver *s)
{
    s->patience = 0;
    s->saved_mu = s->mu;
    s->saved_front = s->front;
    memcpy(s->reference, s->now.v, sizeof(double)*(size_t)s->n);
    for (int i = 0; i < s->n; ++i)
        s->weight[i] = min(1/s->size[i], 1/max(fabs(s->reference[i]), DBL_MIN));
    s->elastic = 1;
    s->nv = s->most;
    const double mu = max(s->mu, largest(s->now.residual, s->m));
    ip_set_barrier(s, mu);
    s->zeta = sqrt(mu);
    for (int r = 0; r < s->m; ++r) {
        const int p = s->n + s->slacks + r, n = p + s->m;
        elastic_pair(s->now.residual[r], mu, s->rho[r], &s->now.v[p], &s->now.v[n]);
        s->now.zl[p] = mu/s->now.v[p];
        s->now.zl[n] = mu/s->now.v[n];
        s->now.zu[p] = s->now.zu[n] = 0;
        s->now.y[r] = 0;
    }
    for (int i = 0; i < s->n + s->slacks; ++i) {
        s->now.zl[i] = min(s->now.zl[i], RHO);
        s->now.zu[i] = min(s->now.zu[i], RHO);
    }
    ip_evaluate(s, &s->now);
    ip_filter_reset(&s->front, s->now.theta);
    s->last_delta_w = 0;
}

static void end_restoration(solver *s)
{
    s->patience = 0;
    s->elastic = 0;
    s->nv = s->n + s->slacks;
    ip_set_barrier(s, s->saved_mu);
    s->front = s->saved_front;
    s->last_delta_w = 0;
}

/* Whether the point of the restoration is acceptable to the filter of the problem and less
 * infeasible than where it began. */
static int restored(solver *s, double theta_before)
{
    double theta = 0;
    for (int r = 0; r < s->m; ++r) {
        const double slack = r < s->eq ? 0 : s->now.v[s->n + r - s->eq];
        theta += fabs(s->fs_rows[r]*s->values[1 + r] - slack);
    }
    if (!(theta <= KAPPA_RESTO*theta_before))
        return 0;
    const double mu = s->mu;
    s->elastic = 0, s->nv = s->n + s->slacks, s->mu = s->saved_mu;
    const int finite = ip_evaluate(s, &s->now);
    const int good = finite && ip_filter_accepts(&s->saved_front, s->now.theta, s->now.phi);
    s->elastic = 1, s->nv = s->most, s->mu = mu;
    ip_evaluate(s, &s->now);
    return good;
}

/* Find a point that the filter accepts; returns -1 if the search goes on from it, else the final
 * status. */
int ip_restore(solver *s)
{
    if (largest(s->now.residual, s->m) <= s->options->violation)
        return DMOC_STALLED; /* feasible already: nothing to restore */
    s->result.restorations += 1;
    ip_filter_add(&s->front, s->now.theta, s->now.phi);
    const double theta_before = s->now.theta;
    ip_begin_restoration(s);
    int status = ip_iterate(s);
    while (status < 0 && !restored(s, theta_before))
        status = ip_iterate(s);
    end_restoration(s);
    ip_evaluate(s, &s->now);
    if (status == DMOC_SOLVED || status == DMOC_STALLED) {
        const double least = ip_violation(s);
        if (least > s->options->infeasible)
            return DMOC_INFEASIBLE;
        if (status == DMOC_STALLED || s->now.theta > theta_before)
            return DMOC_STALLED;
        s->front.count = 0; /* a point of least violation, which is next to none: go on from it */
        status = -1;
    }
    if (status >= 0)
        return status;
    ip_evaluate_slopes(s);
    /* Those of the restoration belong to another objective and another mu. */
    ip_invert_distances(s);
    for (int i = 0; i < s->nv; ++i) {
        s->now.zl[i] = s->mu*s->below[i];
        s->now.zu[i] = s->mu*s->above[i];
    }
    ip_estimate_multipliers(s);
    return -1;
}
