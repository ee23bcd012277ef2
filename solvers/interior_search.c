/* The step: fraction to the boundary, filter line search, second-order correction; WB 2.3, 2.4. */
#include "interior_solver.h"

#include <float.h>
#include <math.h>
#include <string.h>

static const double KAPPA_SIGMA = 1e10; /* WB (16) */
/* Filter, WB (18), (23). */
static const double GAMMA_THETA = 1e-5, GAMMA_PHI = 1e-5, GAMMA_ALPHA = 0.05;
/* Switching and Armijo, WB (19), (20). */
static const double DELTA = 1, S_THETA = 1.1, S_PHI = 2.3, ETA_PHI = 1e-8;
static const double KAPPA_SOC = 0.99; /* second-order correction, WB */
static const double SHORTEST_STEP = 1e-14;
static const double ROUNDING = 1e-10; /* relative step that counts as one */
enum { MOST_SOC = 4, MOST_TINY = 2 };

/* Longest share of a step that keeps v at a share 1 - tau of its distance from the bounds, WB
 * (15a), and the stretch of unknowns. */
static double longest_primal(const solver *s, const double *dv)
{
    const double *v = s->now.v;
    double alpha = 1;
    for (int i = 0; i < s->nv; ++i) {
        const double to_lo = s->tau*(s->lo[i] - v[i]), to_up = s->tau*(s->up[i] - v[i]);
        if (alpha*dv[i] < to_lo)
            alpha = to_lo/dv[i];
        if (alpha*dv[i] > to_up)
            alpha = to_up/dv[i];
    }
    for (int i = 0; i < s->n; ++i)
        if (s->stretch[i] < INFINITY) { /* the ratio of two iterates is limited */
            const double share = dv[i] < 0 ? 1 - 1/s->stretch[i] : s->stretch[i] - 1;
            alpha = min(alpha, share*v[i]/fabs(dv[i]));
        }
    return alpha;
}

static double longest_dual(const solver *s)
{
    double alpha = 1;
    for (int i = 0; i < s->nv; ++i) {
        const double to_l = -s->tau*s->now.zl[i], to_u = -s->tau*s->now.zu[i];
        if (alpha*s->dzl[i] < to_l)
            alpha = to_l/s->dzl[i];
        if (alpha*s->dzu[i] < to_u)
            alpha = to_u/s->dzu[i];
    }
    return alpha;
}

int ip_filter_accepts(const filter *f, double theta, double phi)
{
    if (theta > f->theta_max)
        return 0;
    for (int i = 0; i < f->count; ++i)
        if (theta >= f->theta[i] && phi >= f->phi[i])
            return 0;
    return 1;
}

void ip_filter_add(filter *f, double theta, double phi)
{
    const double t = (1 - GAMMA_THETA)*theta, p = phi - GAMMA_PHI*theta;
    int kept = 0;
    for (int i = 0; i < f->count; ++i)
        if (f->theta[i] < t || f->phi[i] < p) {
            f->theta[kept] = f->theta[i];
            f->phi[kept++] = f->phi[i];
        }
    if (kept == MOST_FILTER) { /* forget the oldest entry */
        --kept;
        memmove(f->theta, f->theta + 1, sizeof(double)*(size_t)kept);
        memmove(f->phi, f->phi + 1, sizeof(double)*(size_t)kept);
    }
    f->theta[kept] = t, f->phi[kept] = p;
    f->count = kept + 1;
}

void ip_filter_reset(filter *f, double theta)
{
    f->count = 0;
    f->theta_max = 1e4*max(1, theta);
    f->theta_min = 1e-4*max(1, theta);
}

/* Put now + alpha dv into the trial point and evaluate it. */
static int try_step(solver *s, const double *dv, double alpha)
{
    for (int i = 0; i < s->nv; ++i)
        s->trial.v[i] = s->now.v[i] + alpha*dv[i];
    return ip_evaluate(s, &s->trial);
}

/* WB: 0 rejected, 1 accepted with the Armijo condition, 2 accepted with
 * sufficient progress. */
static int acceptable(const solver *s, double alpha, double slope, int switching)
{
    const double slack = 10*DBL_EPSILON*fabs(s->now.phi);
    if (!ip_filter_accepts(&s->front, s->trial.theta, s->trial.phi))
        return 0;
    if (switching && s->now.theta <= s->front.theta_min)
        return s->trial.phi - s->now.phi - slack <= ETA_PHI*alpha*slope;
    const int closer = s->trial.theta <= (1 - GAMMA_THETA)*s->now.theta;
    return closer || s->trial.phi - s->now.phi - slack <= -GAMMA_PHI*s->now.theta ? 2 : 0;
}

/* Second-order correction (WB 2.4): returns the acceptance of the corrected step and its length
 * in alpha. */
static int correct(solver *s, double *alpha, double slope, int switching)
{
    const double full = *alpha;
    double theta_old = s->now.theta;
    for (int r = 0; r < s->m; ++r)
        s->soc_residual[r] = full*s->now.residual[r] + s->trial.residual[r];
    for (int k = 0; k < MOST_SOC; ++k) {
        if (ip_newton_step(s, s->soc_residual, s->soc_dv, s->soc_dy) > BAD_RESIDUAL)
            return 0;
        const double length = longest_primal(s, s->soc_dv);
        if (!try_step(s, s->soc_dv, length))
            return 0;
        const int accepted = acceptable(s, full, slope, switching);
        if (accepted) {
            *alpha = length;
            return accepted;
        }
        if (s->trial.theta > KAPPA_SOC*theta_old)
            return 0;
        theta_old = s->trial.theta;
        for (int r = 0; r < s->m; ++r)
            s->soc_residual[r] = length*s->soc_residual[r] + s->trial.residual[r];
    }
    return 0;
}

static void take_dual_step(solver *s, const double *dy, double alpha, double alpha_z)
{
    for (int r = 0; r < s->m; ++r)
        s->now.y[r] += alpha*dy[r];
    for (int i = 0; i < s->nv; ++i) {
        s->now.zl[i] += alpha_z*s->dzl[i];
        s->now.zu[i] += alpha_z*s->dzu[i];
    }
}

static void exchange_points(solver *s)
{
    const point p = s->now;
    s->now.v = s->trial.v, s->now.residual = s->trial.residual;
    s->now.f = s->trial.f, s->now.theta = s->trial.theta, s->now.phi = s->trial.phi;
    s->now.logs = s->trial.logs;
    s->trial.v = p.v, s->trial.residual = p.residual;
}

/* Keep the bound multipliers within reach of mu/(v - lo), WB (16). */
void ip_keep_multipliers(solver *s)
{
    ip_invert_distances(s);
    for (int i = 0; i < s->nv; ++i) {
        const double zl = s->mu*s->below[i], zu = s->mu*s->above[i];
        s->now.zl[i] = max(min(s->now.zl[i], KAPPA_SIGMA*zl), zl*(1/KAPPA_SIGMA));
        s->now.zu[i] = max(min(s->now.zu[i], KAPPA_SIGMA*zu), zu*(1/KAPPA_SIGMA));
    }
}

/* Find and take a step along the direction; 0 if every step is too short, -1 if steps below
 * rounding errors lead nowhere. */
int ip_line_search(solver *s)
{
    double slope = 0, change = 0;
    for (int i = 0; i < s->nv; ++i) {
        slope += (s->gradient[i] + s->pull[i])*s->dv[i];
        change = max(change, fabs(s->dv[i])/((i < s->n ? s->size[i] : 1) + fabs(s->now.v[i])));
    }
    const double theta = s->now.theta;
    const double alpha_max = longest_primal(s, s->dv), alpha_z = longest_dual(s);
    double alpha_min = GAMMA_THETA;
    if (slope < 0) {
        alpha_min = min(alpha_min, GAMMA_PHI*theta/-slope);
        if (theta <= s->front.theta_min)
            alpha_min = min(alpha_min, DELTA*pow(theta, S_THETA)/pow(-slope, S_PHI));
    }
    alpha_min = max(GAMMA_ALPHA*alpha_min, SHORTEST_STEP);
    /* Whether rounding errors decide what costs less: then no share of a step says more than the
     * whole one, and the multipliers need that. */
    const int feasible = largest(s->now.residual, s->m) <= s->options->violation;
    const int rounding = change < ROUNDING && feasible;
    for (double alpha = alpha_max; alpha >= alpha_min; alpha /= 2) {
        if (!try_step(s, s->dv, alpha))
            continue;
        if (change < 10*DBL_EPSILON) { /* rounding errors decide: take the step, WB 3.9 */
            if (++s->tiny > MOST_TINY)
                return -1;
            take_dual_step(s, s->dy, alpha, alpha_z);
            exchange_points(s);
            return 1;
        }
        s->tiny = 0;
        const int switching = slope < 0 && alpha*pow(-slope, S_PHI) > DELTA*pow(theta, S_THETA);
        const double *dy = s->dy;
        double length = alpha;
        int accepted = acceptable(s, alpha, slope, switching);
        if (!accepted && alpha == alpha_max && s->trial.theta >= theta) {
            accepted = correct(s, &length, slope, switching);
            dy = s->soc_dy;
        }
        if (!accepted && rounding)
            break;
        if (!accepted)
            continue;
        if (!(accepted == 1 && switching))
            ip_filter_add(&s->front, theta, s->now.phi);
        take_dual_step(s, dy, length, alpha_z);
        exchange_points(s);
        return 1;
    }
    if (rounding && ++s->tiny <= MOST_TINY && try_step(s, s->dv, alpha_max)) {
        take_dual_step(s, s->dy, alpha_max, alpha_z);
        exchange_points(s);
        return 1;
    }
    return 0;
}
