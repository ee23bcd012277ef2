#define _POSIX_C_SOURCE 199309L

#include "interior_point.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* Constants of the algorithm, in the letters and mostly with the values of WB. */
static const double KAPPA_EPS = 10, KAPPA_MU = 0.2, THETA_MU = 1.5, TAU_MIN = 0.99;         /* barrier parameter, WB (7), (8) */
static const double KAPPA_1 = 1e-2, KAPPA_2 = 1e-2, KAPPA_SIGMA = 1e10, KAPPA_D = 1e-5;     /* WB 3.6, (16), 3.7 */
static const double GAMMA_THETA = 1e-5, GAMMA_PHI = 1e-5, GAMMA_ALPHA = 0.05;               /* filter, WB (18), (23) */
static const double DELTA = 1, S_THETA = 1.1, S_PHI = 2.3, ETA_PHI = 1e-8;                  /* switching and Armijo, WB (19), (20) */
static const double KAPPA_SOC = 0.99;                                                      /* second-order correction, WB */
static const double DELTA_W_FIRST = 1e-4, DELTA_W_LEAST = 1e-20, DELTA_W_MOST = 1e40;       /* perturbation of the Hessian, WB 3.1 */
static const double KAPPA_W_LESS = 1.0/3, KAPPA_W_MORE = 8, KAPPA_W_FIRST = 100, DELTA_C = 1e-8, KAPPA_C = 0.25;
static const double S_MAX = 100, G_MAX = 100, Y_MAX = 1e3;                                   /* scalings, WB (6), 3.8; multipliers, 3.6 */
static const double RHO = 1000, KAPPA_RESTO = 0.9;                                         /* restoration, WB (29), 3.3 */
static const double SHORTEST_STEP = 1e-14;
static const double ROUNDING = 1e-10; /* relative step that counts as one */
static const double TINY_PIVOT = 1e-20, GOOD_RESIDUAL = 1e-10, BAD_RESIDUAL = 1e-5;         /* linear system */
enum { MOST_SOC = 4, MOST_REFINEMENTS = 8, MOST_FILTER = 400, MOST_PATIENCE = 3, MOST_TINY = 2 };

/* v = (x | slacks | p | n): p and n relax every row in the restoration only. A trial point has no multipliers. */
typedef struct {
    double *v, *y, *zl, *zu;
    double f, theta, phi; /* objective (scaled), violation |residual|_1, barrier function */
    double *residual;     /* [m] scaled constraints, slacks and elastic variables included */
} point;

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
    double *memory;
    double *lo, *up;            /* [most] bounds of v; none where v is fixed */
    double *values, *slopes, *hess, *K;
    double *fs_rows;            /* [m] scaling of rows */
    double fs;                  /* scaling of the objective */
    point now, trial;
    double *gradient;           /* [most] of the objective, scaled */
    double *dual;               /* [most] gradient + A'y */
    double *dv, *dy, *dzl, *dzu, *soc_dv, *soc_dy, *soc_residual, *sigma, *right, *solution, *rest, *change;
    double delta_w, delta_c, last_delta_w;
    filter front;
    double mu, tau;
    int patience, tiny;         /* iterations in a row that met the demanded tolerance; steps in a row below rounding errors */
    /* restoration */
    double *reference, *weight, *rho, zeta; /* rho[m]: price of a violation of each row */
    double held_mu;
    filter held_front;
    dmoc_result result;
    double begin;
} solver;

/* Not fmax and fmin, which are calls. */
static inline double max(double a, double b) { return a > b ? a : b; }
static inline double min(double a, double b) { return a < b ? a : b; }

static double now_seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9*(double)t.tv_nsec;
}

static int late(const solver *s) { return now_seconds() - s->begin > s->options->seconds; }

static int fixed(const solver *s, int i) { return i < s->n && s->kkt->place[i] < 0; }

/* Row and sign of a slack or elastic variable: residual = c - s - p + n. */
static int aux_row(const solver *s, int i)
{
    const int a = i - s->n;
    return a < s->slacks ? s->eq + a : (a - s->slacks) % s->m;
}
static double aux_sign(const solver *s, int i) { return i - s->n < s->slacks + s->m ? -1 : 1; }

/* ---- Evaluation ---------------------------------------------------------------------------------------------------------------- */

static void evaluate_values(solver *s, const double *x)
{
    const double t = now_seconds();
    dmoc_put(s->program, x);
    dmoc_assemble(&s->program->values, s->program->pool, s->values);
    s->result.seconds_kernels += now_seconds() - t;
}

/* Objective, residual, violation and barrier function of a point (WB (3a), and (30a) in the restoration); 0 if they are not finite. */
static int evaluate(solver *s, point *p)
{
    evaluate_values(s, p->v);
    p->f = s->fs*s->values[0];
    if (s->elastic) {
        p->f = 0;
        for (int i = 0; i < s->n; ++i) {
            const double d = s->weight[i]*(p->v[i] - s->reference[i]);
            p->f += s->zeta/2*d*d;
        }
        for (int i = s->n + s->slacks; i < s->nv; ++i)
            p->f += s->rho[aux_row(s, i)]*p->v[i];
    }
    for (int r = 0; r < s->m; ++r)
        p->residual[r] = s->fs_rows[r]*s->values[1 + r];
    for (int i = s->n; i < s->nv; ++i)
        p->residual[aux_row(s, i)] += aux_sign(s, i)*p->v[i];
    p->theta = 0;
    for (int r = 0; r < s->m; ++r)
        p->theta += fabs(p->residual[r]);
    p->phi = p->f;
    double logs = 0, damping = 0;
    for (int i = 0; i < s->nv; ++i) {
        const int below = s->lo[i] > -INFINITY, above = s->up[i] < INFINITY;
        if (below)
            logs += log(p->v[i] - s->lo[i]);
        if (above)
            logs += log(s->up[i] - p->v[i]);
        if (below && !above)
            damping += (p->v[i] - s->lo[i]);
        if (above && !below)
            damping += (s->up[i] - p->v[i]);
    }
    p->phi += s->mu*(KAPPA_D*damping - logs);
    return isfinite(p->phi) && isfinite(p->theta);
}

/* Largest violation of c = 0, d >= 0 in the units of the constraints, from the values that were evaluated last. */
static double violation(const solver *s)
{
    double worst = 0;
    for (int r = 0; r < s->m; ++r)
        worst = max(worst, r < s->eq ? fabs(s->values[1 + r]) : -s->values[1 + r]);
    return worst;
}

static void evaluate_slopes(solver *s)
{
    const double t = now_seconds();
    dmoc_put(s->program, s->now.v);
    dmoc_assemble(&s->program->slopes, s->program->pool, s->slopes);
    s->result.seconds_kernels += now_seconds() - t;
    double *jac = s->slopes + s->n;
    for (int r = 0; r < s->m; ++r)
        for (int e = s->program->row_start[r]; e < s->program->row_start[r + 1]; ++e)
            jac[e] *= s->fs_rows[r];
    for (int i = 0; i < s->n; ++i)
        s->gradient[i] = s->elastic ? s->zeta*s->weight[i]*s->weight[i]*(s->now.v[i] - s->reference[i]) : s->fs*s->slopes[i];
    for (int i = s->n; i < s->nv; ++i)
        s->gradient[i] = i < s->n + s->slacks ? 0 : s->rho[aux_row(s, i)];
}

static void evaluate_curvatures(solver *s)
{
    const double t = now_seconds();
    double *pool = s->program->pool;
    const double *unit = s->program->unit;
    dmoc_put(s->program, s->now.v);
    for (int r = 0; r < s->m; ++r)
        pool[s->n + r] = unit[s->n + r]*s->fs_rows[r]*s->now.y[r];
    pool[s->n + s->m] = s->elastic ? 0 : unit[s->n + s->m]*s->fs;
    dmoc_assemble(&s->program->curvatures, pool, s->hess);
    s->result.seconds_kernels += now_seconds() - t;
}

/* dual = gradient + A'y, without bound multipliers. */
static void evaluate_dual(solver *s)
{
    memcpy(s->dual, s->gradient, sizeof(double)*(size_t)s->nv);
    const double *jac = s->slopes + s->n;
    for (int r = 0; r < s->m; ++r)
        for (int e = s->program->row_start[r]; e < s->program->row_start[r + 1]; ++e)
            s->dual[s->program->column[e]] += jac[e]*s->now.y[r];
    for (int i = s->n; i < s->nv; ++i)
        s->dual[i] += aux_sign(s, i)*s->now.y[aux_row(s, i)];
}

/* ---- Optimality error, WB (5) ----------------------------------------------------------------------------------------------------- */

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
            e.complementarity = max(e.complementarity, fabs(s->now.zl[i]*(s->now.v[i] - s->lo[i]) - mu));
            e.mean_z += s->now.zl[i], ++bounds;
        }
        if (s->up[i] < INFINITY) {
            d += s->now.zu[i];
            e.complementarity = max(e.complementarity, fabs(s->now.zu[i]*(s->up[i] - s->now.v[i]) - mu));
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
static double barrier_error(const solver *s, double mu)
{
    const errors e = optimality(s, mu);
    double worst = 0;
    for (int r = 0; r < s->m; ++r)
        worst = max(worst, fabs(s->now.residual[r]));
    return max(worst, max(e.dual/(max(S_MAX, e.mean_y)/S_MAX), e.complementarity/(max(S_MAX, e.mean_z)/S_MAX)));
}

/* Size that stationarity and complementarity are compared with: the cost's, not below a share of its first one. */
static double cost_size(const solver *s) { return max(fabs(s->values[0]), s->options->least_cost); }

/* Whether the point meets the tolerances: 2 the sharp one, 1 the demanded one, 0 none. */
static int converged(const solver *s)
{
    const errors e = optimality(s, 0);
    const double unit = s->elastic ? 1 : s->fs*cost_size(s);
    const double fs = s->elastic ? 1 : s->fs;
    const double dual = e.dual/unit/(max(S_MAX, e.mean_y/fs)/S_MAX);
    const double complementarity = e.complementarity/unit/(max(S_MAX, e.mean_z/fs)/S_MAX);
    const double left = max(dual, complementarity);
    if (left > s->options->demanded)
        return 0;
    double worst = s->elastic ? 0 : violation(s);
    for (int r = 0; r < s->m; ++r)
        worst = max(worst, fabs(s->now.residual[r])/(s->elastic ? 1 : s->fs_rows[r]));
    if (worst > (s->elastic ? s->options->optimality : s->options->violation))
        return 0;
    return left*(s->elastic ? 1 : max(cost_size(s), 1)) <= s->options->optimality ? 2 : 1;
}

/* ---- Linear system, WB (13) ---------------------------------------------------------------------------------------------------------- */

static void fill_K(solver *s, int with_hessian)
{
    const dmoc_kkt *k = s->kkt;
    const int entries = k->start[k->size];
    memset(s->K, 0, sizeof(double)*(size_t)entries);
    if (with_hessian)
        for (int e = 0; e < s->program->hess_start[s->n]; ++e)
            if (k->from_hess[e] >= 0)
                s->K[k->from_hess[e]] += s->hess[e];
    const double *jac = s->slopes + s->n;
    for (int e = 0; e < s->program->row_start[s->m]; ++e)
        if (k->from_jac[e] >= 0)
            s->K[k->from_jac[e]] += jac[e];
}

/* Diagonal of K beside the Hessian: sigma + delta_w for unknowns; for rows what eliminating their slacks and elastic variables leaves. */
static void factor(solver *s, double *base)
{
    const dmoc_kkt *k = s->kkt;
    const double t = now_seconds();
    for (int r = 0; r < s->m; ++r)
        s->rest[r] = -s->delta_c;
    for (int i = s->n; i < s->nv; ++i)
        s->rest[aux_row(s, i)] -= 1/(s->sigma[i] + s->delta_w);
    for (int i = 0; i < s->n; ++i)
        if (k->diagonal[i] >= 0) {
            double d = s->sigma[i] + s->delta_w/(s->size[i]*s->size[i]);
            if (s->elastic)
                d += s->zeta*s->weight[i]*s->weight[i];
            s->K[k->diagonal[i]] = base[i] + d;
        }
    for (int r = 0; r < s->m; ++r)
        s->K[k->diagonal[s->n + r]] = base[s->n + r] + s->rest[r];
    dmoc_ldl_factor(s->ldl, s->K, TINY_PIVOT);
    s->result.factorisations += 1;
    s->result.seconds_linear += now_seconds() - t;
}

/* right -= K x, both in elimination order. */
static void subtract_product(const solver *s, const double *x, double *right)
{
    const dmoc_kkt *k = s->kkt;
    for (int j = 0; j < k->size; ++j) {
        double sum = 0;
        for (int p = k->start[j]; p < k->start[j + 1]; ++p) {
            const int i = k->row[p];
            sum += s->K[p]*x[i];
            if (i != j)
                right[i] -= s->K[p]*x[j];
        }
        right[j] -= sum;
    }
}

static double largest(const double *x, int n)
{
    double most = 0;
    for (int i = 0; i < n; ++i)
        most = fabs(x[i]) > most || isnan(x[i]) ? fabs(x[i]) : most;
    return most;
}

/* Solve K solution = right with refinement; returns the residual relative to the size of the system. */
static double solve_linear(solver *s)
{
    const int size = s->kkt->size;
    const double t = now_seconds();
    memcpy(s->solution, s->right, sizeof(double)*(size_t)size);
    dmoc_ldl_solve(s->ldl, s->solution);
    double previous = INFINITY, ratio = INFINITY;
    for (int refinement = 0; refinement <= MOST_REFINEMENTS; ++refinement) {
        memcpy(s->rest, s->right, sizeof(double)*(size_t)size);
        subtract_product(s, s->solution, s->rest);
        const double wrong = largest(s->rest, size);
        ratio = wrong/(min(largest(s->solution, size), 1e6*largest(s->right, size)) + largest(s->right, size) + DBL_MIN);
        if (ratio > previous) { /* the correction made it worse: take it back */
            for (int i = 0; i < size; ++i)
                s->solution[i] -= s->change[i];
            ratio = previous;
            break;
        }
        if (!(ratio > GOOD_RESIDUAL) || !(ratio < 0.5*previous) || refinement == MOST_REFINEMENTS)
            break;
        previous = ratio;
        memcpy(s->change, s->rest, sizeof(double)*(size_t)size);
        dmoc_ldl_solve(s->ldl, s->change);
        for (int i = 0; i < size; ++i)
            s->solution[i] += s->change[i];
    }
    s->result.seconds_linear += now_seconds() - t;
    return isnan(ratio) ? INFINITY : ratio;
}

/* Barrier part of the gradient of variable i: -mu/(v - lo) + mu/(up - v), with the damping of WB 3.7. */
static double barrier_slope(const solver *s, int i)
{
    const int below = s->lo[i] > -INFINITY, above = s->up[i] < INFINITY;
    double g = 0;
    if (below)
        g -= s->mu/(s->now.v[i] - s->lo[i]);
    if (above)
        g += s->mu/(s->up[i] - s->now.v[i]);
    if (below && !above)
        g += KAPPA_D*s->mu;
    if (above && !below)
        g -= KAPPA_D*s->mu;
    return g;
}

/* Newton step (dv, dy) for the given residual of the constraints (WB (13), slacks eliminated); returns the solve's relative residual. */
static double newton_step(solver *s, const double *residual, double *dv, double *dy)
{
    const dmoc_kkt *k = s->kkt;
    for (int i = 0; i < s->n; ++i)
        if (k->place[i] >= 0)
            s->right[k->place[i]] = -(s->dual[i] + barrier_slope(s, i));
    for (int r = 0; r < s->m; ++r)
        dy[r] = -residual[r];
    for (int i = s->n; i < s->nv; ++i)
        dy[aux_row(s, i)] += aux_sign(s, i)*(s->dual[i] + barrier_slope(s, i))/(s->sigma[i] + s->delta_w);
    for (int r = 0; r < s->m; ++r)
        s->right[k->place[s->n + r]] = dy[r];
    const double ratio = solve_linear(s);
    for (int i = 0; i < s->n; ++i)
        dv[i] = k->place[i] >= 0 ? s->solution[k->place[i]] : 0;
    for (int r = 0; r < s->m; ++r)
        dy[r] = s->solution[k->place[s->n + r]];
    for (int i = s->n; i < s->nv; ++i)
        dv[i] = -(s->dual[i] + barrier_slope(s, i) + aux_sign(s, i)*dy[aux_row(s, i)])/(s->sigma[i] + s->delta_w);
    return ratio;
}

/* Search direction with inertia correction (WB algorithm IC); 0 if no perturbation helps, or none in time. */
static int direction(solver *s)
{
    const dmoc_kkt *k = s->kkt;
    const int unknowns = k->size - s->m;
    for (int i = 0; i < s->nv; ++i) {
        s->sigma[i] = 0;
        if (s->lo[i] > -INFINITY)
            s->sigma[i] += s->now.zl[i]/(s->now.v[i] - s->lo[i]);
        if (s->up[i] < INFINITY)
            s->sigma[i] += s->now.zu[i]/(s->up[i] - s->now.v[i]);
    }
    fill_K(s, 1);
    double *base = s->soc_dv; /* free here; long enough for n + m because it has an elastic part */
    for (int i = 0; i < s->n + s->m; ++i)
        base[i] = k->diagonal[i] >= 0 ? s->K[k->diagonal[i]] : 0;
    s->delta_w = s->delta_c = 0;
    for (;;) {
        factor(s, base);
        int singular = s->ldl->zero > 0;
        if (!singular && s->ldl->positive == unknowns) {
            const double ratio = newton_step(s, s->now.residual, s->dv, s->dy);
            if (ratio < BAD_RESIDUAL)
                break;
            singular = 1;
        }
        if (singular && s->delta_c == 0)
            s->delta_c = DELTA_C*pow(s->mu, KAPPA_C);
        if (s->delta_w == 0)
            s->delta_w = s->last_delta_w == 0 ? DELTA_W_FIRST : max(DELTA_W_LEAST, KAPPA_W_LESS*s->last_delta_w);
        else
            s->delta_w *= s->last_delta_w == 0 ? KAPPA_W_FIRST : KAPPA_W_MORE;
        if (s->delta_w > DELTA_W_MOST || late(s))
            return 0;
    }
    if (s->delta_w > 0)
        s->last_delta_w = s->delta_w;
    for (int i = 0; i < s->nv; ++i) {
        s->dzl[i] = s->dzu[i] = 0;
        if (s->lo[i] > -INFINITY)
            s->dzl[i] = (s->mu - s->now.zl[i]*s->dv[i])/(s->now.v[i] - s->lo[i]) - s->now.zl[i];
        if (s->up[i] < INFINITY)
            s->dzu[i] = (s->mu + s->now.zu[i]*s->dv[i])/(s->up[i] - s->now.v[i]) - s->now.zu[i];
    }
    return 1;
}

/* ---- Filter line search, WB 2.3 -------------------------------------------------------------------------------------------------------- */

/* Longest share of a step that keeps v at a share 1 - tau of its distance from the bounds, WB (15a), and the stretch of unknowns. */
static double longest_primal(const solver *s, const double *dv)
{
    double alpha = 1;
    for (int i = 0; i < s->nv; ++i) {
        if (dv[i] < 0 && s->lo[i] > -INFINITY)
            alpha = min(alpha, -s->tau*(s->now.v[i] - s->lo[i])/dv[i]);
        if (dv[i] > 0 && s->up[i] < INFINITY)
            alpha = min(alpha, s->tau*(s->up[i] - s->now.v[i])/dv[i]);
        if (i < s->n && s->stretch[i] < INFINITY) /* positive unknowns: the ratio of two iterates is limited */
            alpha = min(alpha, (dv[i] < 0 ? 1 - 1/s->stretch[i] : s->stretch[i] - 1)*s->now.v[i]/fabs(dv[i]));
    }
    return alpha;
}

static double longest_dual(const solver *s)
{
    double alpha = 1;
    for (int i = 0; i < s->nv; ++i) {
        if (s->dzl[i] < 0)
            alpha = min(alpha, -s->tau*s->now.zl[i]/s->dzl[i]);
        if (s->dzu[i] < 0)
            alpha = min(alpha, -s->tau*s->now.zu[i]/s->dzu[i]);
    }
    return alpha;
}

static int filter_accepts(const filter *f, double theta, double phi)
{
    if (theta > f->theta_max)
        return 0;
    for (int i = 0; i < f->count; ++i)
        if (theta >= f->theta[i] && phi >= f->phi[i])
            return 0;
    return 1;
}

static void filter_add(filter *f, double theta, double phi)
{
    const double t = (1 - GAMMA_THETA)*theta, p = phi - GAMMA_PHI*theta;
    int kept = 0;
    for (int i = 0; i < f->count; ++i)
        if (f->theta[i] < t || f->phi[i] < p) {
            f->theta[kept] = f->theta[i];
            f->phi[kept++] = f->phi[i];
        }
    if (kept == MOST_FILTER) /* forget the oldest entry */
        memmove(f->theta, f->theta + 1, sizeof(double)*(size_t)--kept), memmove(f->phi, f->phi + 1, sizeof(double)*(size_t)kept);
    f->theta[kept] = t, f->phi[kept] = p;
    f->count = kept + 1;
}

static void filter_reset(filter *f, double theta)
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
    return evaluate(s, &s->trial);
}

/* WB: 0 rejected, 1 accepted with the Armijo condition, 2 accepted with sufficient progress. */
static int acceptable(const solver *s, double alpha, double slope, int switching)
{
    const double slack = 10*DBL_EPSILON*fabs(s->now.phi);
    if (!filter_accepts(&s->front, s->trial.theta, s->trial.phi))
        return 0;
    if (switching && s->now.theta <= s->front.theta_min)
        return s->trial.phi - s->now.phi - slack <= ETA_PHI*alpha*slope;
    return s->trial.theta <= (1 - GAMMA_THETA)*s->now.theta || s->trial.phi - s->now.phi - slack <= -GAMMA_PHI*s->now.theta ? 2 : 0;
}

/* Second-order correction (WB 2.4): returns the acceptance of the corrected step and its length in alpha. */
static int correct(solver *s, double *alpha, double slope, int switching)
{
    const double full = *alpha;
    double theta_old = s->now.theta;
    for (int r = 0; r < s->m; ++r)
        s->soc_residual[r] = full*s->now.residual[r] + s->trial.residual[r];
    for (int k = 0; k < MOST_SOC; ++k) {
        if (newton_step(s, s->soc_residual, s->soc_dv, s->soc_dy) > BAD_RESIDUAL)
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
    s->trial.v = p.v, s->trial.residual = p.residual;
}

/* Keep the bound multipliers within reach of mu/(v - lo), WB (16). */
static void keep_multipliers(solver *s)
{
    for (int i = 0; i < s->nv; ++i) {
        if (s->lo[i] > -INFINITY) {
            const double z = s->mu/(s->now.v[i] - s->lo[i]);
            s->now.zl[i] = max(min(s->now.zl[i], KAPPA_SIGMA*z), z/KAPPA_SIGMA);
        }
        if (s->up[i] < INFINITY) {
            const double z = s->mu/(s->up[i] - s->now.v[i]);
            s->now.zu[i] = max(min(s->now.zu[i], KAPPA_SIGMA*z), z/KAPPA_SIGMA);
        }
    }
}

/* Find and take a step along the direction; 0 if every step is too short, -1 if steps below rounding errors lead nowhere. */
static int line_search(solver *s)
{
    double slope = 0, change = 0;
    for (int i = 0; i < s->nv; ++i) {
        slope += (s->gradient[i] + barrier_slope(s, i))*s->dv[i];
        change = max(change, fabs(s->dv[i])/((i < s->n ? s->size[i] : 1) + fabs(s->now.v[i])));
    }
    const double theta = s->now.theta, alpha_max = longest_primal(s, s->dv), alpha_z = longest_dual(s);
    double alpha_min = GAMMA_THETA;
    if (slope < 0) {
        alpha_min = min(alpha_min, GAMMA_PHI*theta/-slope);
        if (theta <= s->front.theta_min)
            alpha_min = min(alpha_min, DELTA*pow(theta, S_THETA)/pow(-slope, S_PHI));
    }
    alpha_min = max(GAMMA_ALPHA*alpha_min, SHORTEST_STEP);
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
        if (!accepted)
            continue;
        if (!(accepted == 1 && switching))
            filter_add(&s->front, theta, s->now.phi);
        take_dual_step(s, dy, length, alpha_z);
        exchange_points(s);
        return 1;
    }
    /* A step this small that no length of makes acceptable fails on rounding errors too. */
    if (change < ROUNDING && largest(s->now.residual, s->m) <= s->options->violation && ++s->tiny <= MOST_TINY && try_step(s, s->dv, alpha_max)) {
        take_dual_step(s, s->dy, alpha_max, alpha_z);
        exchange_points(s);
        return 1;
    }
    return 0;
}

/* ---- Start ------------------------------------------------------------------------------------------------------------------------------ */

/* Move a value into the interior of its bounds, WB 3.6, with distances in the variable's own size. */
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

/* Gradient-based scaling of objective and rows, WB 3.8; the cost's gradient is taken in the sizes of the unknowns. */
static void choose_scaling(solver *s)
{
    for (int r = 0; r < s->m; ++r)
        s->fs_rows[r] = 1;
    s->fs = 1;
    evaluate_slopes(s);
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

/* Least-squares multipliers of the constraints, WB (36); zero where they are large. Expects slopes. */
static void estimate_multipliers(solver *s)
{
    const dmoc_kkt *k = s->kkt;
    memset(s->now.y, 0, sizeof(double)*(size_t)s->m);
    evaluate_dual(s);
    fill_K(s, 0);
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
    if (solve_linear(s) > BAD_RESIDUAL)
        return;
    double most = 0;
    for (int r = 0; r < s->m; ++r)
        most = max(most, fabs(s->solution[k->place[s->n + r]]));
    if (!(most <= Y_MAX))
        return;
    for (int r = 0; r < s->m; ++r)
        s->now.y[r] = s->solution[k->place[s->n + r]];
}

static void set_barrier(solver *s, double mu)
{
    s->mu = mu;
    s->tau = max(TAU_MIN, 1 - mu);
}

/* ---- Restoration, WB 3.3 -------------------------------------------------------------------------------------------------------------- */

static int iterate(solver *s);

/* Elastic variables that minimise the barrier function for a residual c = p - n, WB (33), (34). */
static void elastic_pair(double c, double mu, double rho, double *p, double *n)
{
    const double half = (mu - rho*c)/(2*rho);
    *n = half + sqrt(half*half + mu*c/(2*rho));
    *p = c + *n;
}

static void begin_restoration(solver *s)
{
    s->patience = 0;
    s->held_mu = s->mu;
    s->held_front = s->front;
    memcpy(s->reference, s->now.v, sizeof(double)*(size_t)s->n);
    for (int i = 0; i < s->n; ++i)
        s->weight[i] = min(1/s->size[i], 1/max(fabs(s->reference[i]), DBL_MIN));
    s->elastic = 1;
    s->nv = s->most;
    const double mu = max(s->mu, largest(s->now.residual, s->m));
    set_barrier(s, mu);
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
    evaluate(s, &s->now);
    filter_reset(&s->front, s->now.theta);
    s->last_delta_w = 0;
}

static void end_restoration(solver *s)
{
    s->patience = 0;
    s->elastic = 0;
    s->nv = s->n + s->slacks;
    set_barrier(s, s->held_mu);
    s->front = s->held_front;
    s->last_delta_w = 0;
}

/* Whether the point of the restoration is acceptable to the filter of the problem and less infeasible than where it began. */
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
    s->elastic = 0, s->nv = s->n + s->slacks, s->mu = s->held_mu;
    const int finite = evaluate(s, &s->now);
    const int good = finite && filter_accepts(&s->held_front, s->now.theta, s->now.phi);
    s->elastic = 1, s->nv = s->most, s->mu = mu;
    evaluate(s, &s->now);
    return good;
}

/* Find a point that the filter accepts; returns -1 if the search goes on from it, else the final status. */
static int restore(solver *s)
{
    if (largest(s->now.residual, s->m) <= s->options->violation) /* feasible already: nothing to restore */
        return DMOC_STALLED;
    s->result.restorations += 1;
    filter_add(&s->front, s->now.theta, s->now.phi);
    const double theta_before = s->now.theta;
    begin_restoration(s);
    int status = iterate(s);
    while (status < 0 && !restored(s, theta_before))
        status = iterate(s);
    end_restoration(s);
    evaluate(s, &s->now);
    if (status == DMOC_SOLVED || status == DMOC_STALLED) {
        const double least = violation(s);
        if (least > s->options->infeasible)
            return DMOC_INFEASIBLE;
        if (status == DMOC_STALLED || s->now.theta > theta_before)
            return DMOC_STALLED;
        s->front.count = 0; /* a point of least violation, which is next to none: go on from it */
        status = -1;
    }
    if (status >= 0)
        return status;
    evaluate_slopes(s);
    /* Those of the restoration belong to another objective and another mu. */
    for (int i = 0; i < s->nv; ++i) {
        s->now.zl[i] = s->lo[i] > -INFINITY ? s->mu/(s->now.v[i] - s->lo[i]) : 0;
        s->now.zu[i] = s->up[i] < INFINITY ? s->mu/(s->up[i] - s->now.v[i]) : 0;
    }
    estimate_multipliers(s);
    return -1;
}

/* ---- Iteration, WB algorithm A ----------------------------------------------------------------------------------------------------------- */

/* One iteration from an evaluated point; returns -1 to go on, else a status. */
static int iterate(solver *s)
{
    evaluate_slopes(s);
    evaluate_dual(s);
    const int good = converged(s);
    s->patience = good ? s->patience + 1 : 0;
    if (good == 2 || s->patience > MOST_PATIENCE)
        return DMOC_SOLVED;
    const double least_mu = s->options->optimality/(KAPPA_EPS + 1)*(s->elastic ? 1 : s->fs*min(cost_size(s), 1));
    /* A step below rounding errors ends the barrier problem too: only its multipliers could still gain, WB 3.9. */
    while (s->mu > least_mu && (barrier_error(s, s->mu) <= KAPPA_EPS*s->mu || s->tiny > 0)) {
        s->tiny = 0;
        set_barrier(s, max(least_mu, min(KAPPA_MU*s->mu, pow(s->mu, THETA_MU))));
        if (s->elastic)
            s->zeta = sqrt(s->mu);
        evaluate(s, &s->now);
        evaluate_slopes(s);
        evaluate_dual(s);
        filter_reset(&s->front, s->now.theta);
    }
    if (s->result.iterations >= s->options->iterations)
        return DMOC_ITERATION_LIMIT;
    if (late(s))
        return DMOC_TIME_LIMIT;
    evaluate_curvatures(s);
    if (!direction(s))
        return late(s) ? DMOC_TIME_LIMIT : DMOC_STALLED;
    const int stepped = line_search(s);
    if (stepped < 0)
        return DMOC_STALLED;
    if (!stepped) {
        evaluate(s, &s->now);
        if (s->elastic)
            return DMOC_STALLED;
        return restore(s); /* counts its own iterations */
    }
    keep_multipliers(s);
    s->result.iterations += 1;
    if (s->options->report && s->options->report(s->options->user, s->result.iterations, s->values[0], violation(s), s->mu, s->elastic))
        return DMOC_INTERRUPTED;
    return -1;
}

/* ---- Memory and entry ------------------------------------------------------------------------------------------------------------------------ */

static int allocate(solver *s)
{
    const size_t n = (size_t)s->n, m = (size_t)s->m, most = (size_t)s->most, size = (size_t)s->kkt->size;
    const size_t hess = (size_t)s->program->hess_start[n], jac = (size_t)s->program->row_start[m], entries = (size_t)s->kkt->start[size];
    struct {
        double **at;
        size_t count;
    } parts[] = {
        {&s->lo, most}, {&s->up, most}, {&s->values, m + 1}, {&s->slopes, n + jac}, {&s->hess, hess}, {&s->K, entries},
        {&s->fs_rows, m}, {&s->now.v, most}, {&s->now.y, m}, {&s->now.zl, most}, {&s->now.zu, most}, {&s->now.residual, m},
        {&s->trial.v, most}, {&s->trial.residual, m}, {&s->gradient, most}, {&s->dual, most}, {&s->dv, most}, {&s->dy, m},
        {&s->dzl, most}, {&s->dzu, most}, {&s->soc_dv, most}, {&s->soc_dy, m}, {&s->soc_residual, m}, {&s->sigma, most},
        {&s->right, n + m}, {&s->solution, n + m}, {&s->rest, n + m}, {&s->change, n + m}, {&s->reference, n}, {&s->weight, n}, {&s->rho, m},
    };
    size_t total = 0;
    for (size_t i = 0; i < sizeof parts/sizeof *parts; ++i)
        total += parts[i].count + 1;
    s->memory = calloc(total, sizeof(double));
    if (!s->memory)
        return 0;
    double *next = s->memory;
    for (size_t i = 0; i < sizeof parts/sizeof *parts; ++i) {
        *parts[i].at = next;
        next += parts[i].count + 1;
    }
    return 1;
}

static void start(solver *s, const double *x, const double *y, const double *z_lower, const double *z_upper)
{
    const int n = s->n;
    const double share = s->options->warm ? 1e-4 : 1;
    for (int i = 0; i < s->most; ++i) {
        s->lo[i] = i >= n ? 0 : fixed(s, i) ? -INFINITY : s->program->lower[i];
        s->up[i] = i >= n || fixed(s, i) ? INFINITY : s->program->upper[i];
        if (i < n)
            s->now.v[i] = fixed(s, i) ? s->program->lower[i] : inside(x[i], s->lo[i], s->up[i], s->size[i], share);
    }
    s->nv = n; /* no slacks yet: they start at the inequalities */
    evaluate_values(s, s->now.v);
    choose_scaling(s);
    for (int r = 0; r < s->m; ++r)
        s->rho[r] = s->options->price ? RHO*s->options->price[r]/s->fs_rows[r] : RHO;
    s->nv = n + s->slacks;
    for (int a = 0; a < s->slacks; ++a)
        s->now.v[n + a] = inside(s->fs_rows[s->eq + a]*s->values[1 + s->eq + a], 0, INFINITY, 1, share);
    set_barrier(s, s->options->mu);
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
    evaluate(s, &s->now);
    filter_reset(&s->front, s->now.theta);
    evaluate_slopes(s);
    if (s->options->warm)
        for (int r = 0; r < s->m; ++r)
            s->now.y[r] = s->fs*y[r]/s->fs_rows[r];
    else
        estimate_multipliers(s);
    keep_multipliers(s);
}

static int minimise(solver *s)
{
    int status = -1;
    while (status < 0)
        status = iterate(s);
    return status;
}

static int least_violation(solver *s)
{
    begin_restoration(s);
    const int status = minimise(s);
    evaluate_values(s, s->now.v);
    if (status == DMOC_SOLVED || status == DMOC_STALLED)
        return violation(s) <= s->options->infeasible ? DMOC_SOLVED : status == DMOC_SOLVED ? DMOC_INFEASIBLE : DMOC_STALLED;
    return status;
}

dmoc_result dmoc_interior_point(const dmoc_program *program, const dmoc_kkt *kkt, const dmoc_options *options, const double *size,
                                const double *stretch, double *x, double *y, double *z_lower, double *z_upper)
{
    solver *s = calloc(1, sizeof *s);
    dmoc_result result = {.status = DMOC_NO_MEMORY};
    if (!s)
        return result;
    s->begin = now_seconds();
    s->program = program, s->kkt = kkt, s->options = options, s->size = size, s->stretch = stretch;
    s->n = (int)program->n, s->m = (int)program->m, s->eq = (int)program->equalities;
    s->slacks = s->m - s->eq;
    s->most = s->n + s->slacks + 2*s->m;
    s->ldl = dmoc_ldl_new(kkt->size, kkt->pivots, kkt->first, kkt->start, kkt->row);
    if (s->ldl && allocate(s)) {
        start(s, x, y, z_lower, z_upper);
        s->result.status = options->least_violation ? least_violation(s) : minimise(s);
        memcpy(x, s->now.v, sizeof(double)*(size_t)s->n);
        /* Multipliers of the objective, or of the least violation: in the units of the problem. */
        const double unit = options->least_violation || s->result.status == DMOC_INFEASIBLE ? RHO : s->fs;
        for (int r = 0; r < s->m; ++r)
            y[r] = s->now.y[r]*s->fs_rows[r]/unit;
        for (int i = 0; i < s->n; ++i) {
            z_lower[i] = s->now.zl[i]/unit;
            z_upper[i] = s->now.zu[i]/unit;
        }
        s->result.seconds = now_seconds() - s->begin;
        result = s->result;
    }
    dmoc_ldl_free(s->ldl);
    free(s->memory);
    free(s);
    return result;
}
