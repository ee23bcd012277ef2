/* The linear system, WB (13): search directions with inertia correction. */
#include "interior_solver.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* Perturbation of the Hessian and of the constraints, WB 3.1. */
static const double DELTA_W_FIRST = 1e-4, DELTA_W_LEAST = 1e-20, DELTA_W_MOST = 1e40;
static const double KAPPA_W_LESS = 1.0/3, KAPPA_W_MORE = 8, KAPPA_W_FIRST = 100, KAPPA_C = 0.25;
static const double GOOD_RESIDUAL = 1e-10; /* of a solution that needs no refinement */
enum { MOST_REFINEMENTS = 8 };

void ip_fill_K(solver *s, int with_hessian)
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

/* Diagonal of K beside the Hessian: sigma + delta_w for unknowns; for rows what eliminating their
 * slacks and elastic variables leaves. */
static void factor(solver *s, double *base)
{
    const dmoc_kkt *k = s->kkt;
    const double t = ip_seconds(s);
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
    s->result.seconds_linear += ip_seconds(s) - t;
}

/* right -= K x, both in elimination order. */
static void subtract_product(const solver *s, const double *x, double *right)
{
    const dmoc_kkt *k = s->kkt;
    for (int j = 0; j < k->size; ++j) {
        const int last = k->start[j + 1] - 1; /* the diagonal, which every column has */
        double sum = 0;
        for (int p = k->start[j]; p < last; ++p) {
            const int i = k->row[p];
            sum += s->K[p]*x[i];
            right[i] -= s->K[p]*x[j];
        }
        right[j] -= sum + s->K[last]*x[j];
    }
}

/* Solve K solution = right with refinement; returns the residual relative to the size of the
 * system. */
double ip_solve_linear(solver *s)
{
    const int size = s->kkt->size;
    const double t = ip_seconds(s);
    memcpy(s->solution, s->right, sizeof(double)*(size_t)size);
    dmoc_ldl_solve(s->ldl, s->solution);
    const double given = largest(s->right, size);
    double previous = INFINITY, ratio = INFINITY;
    for (int refinement = 0; refinement <= MOST_REFINEMENTS; ++refinement) {
        memcpy(s->rest, s->right, sizeof(double)*(size_t)size);
        subtract_product(s, s->solution, s->rest);
        const double wrong = largest(s->rest, size);
        ratio = wrong/(min(largest(s->solution, size), 1e6*given) + given + DBL_MIN);
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
    s->result.seconds_linear += ip_seconds(s) - t;
    return isnan(ratio) ? INFINITY : ratio;
}

/* Newton step (dv, dy) for the given residual of the constraints (WB (13), slacks eliminated);
 * returns the solve's relative residual. */
double ip_newton_step(solver *s, const double *residual, double *dv, double *dy)
{
    const dmoc_kkt *k = s->kkt;
    for (int i = 0; i < s->n; ++i)
        if (k->place[i] >= 0)
            s->right[k->place[i]] = -(s->dual[i] + s->pull[i]);
    for (int r = 0; r < s->m; ++r)
        dy[r] = -residual[r];
    for (int i = s->n; i < s->nv; ++i)
        dy[aux_row(s, i)] +=
            aux_sign(s, i)*(s->dual[i] + s->pull[i])/(s->sigma[i] + s->delta_w);
    for (int r = 0; r < s->m; ++r)
        s->right[k->place[s->n + r]] = dy[r];
    const double ratio = ip_solve_linear(s);
    for (int i = 0; i < s->n; ++i)
        dv[i] = k->place[i] >= 0 ? s->solution[k->place[i]] : 0;
    for (int r = 0; r < s->m; ++r)
        dy[r] = s->solution[k->place[s->n + r]];
    for (int i = s->n; i < s->nv; ++i)
        dv[i] = -(s->dual[i] + s->pull[i] + aux_sign(s, i)*dy[aux_row(s, i)])/
                (s->sigma[i] + s->delta_w);
    return ratio;
}

/* 1/(v - lo) and 1/(up - v) of the point now, 0 where there is no bound: loops over all of v need
 * no branches, and one division for each. */
void ip_invert_distances(solver *s)
{
    for (int i = 0; i < s->nv; ++i) {
        s->below[i] = 1/(s->now.v[i] - s->lo[i]);
        s->above[i] = 1/(s->up[i] - s->now.v[i]);
    }
}

/* Curvature z/(v - lo) + z/(up - v) of the barrier (WB (11), (13)) and its slope
 * -mu/(v - lo) + mu/(up - v) with the damping of WB 3.7. */
static void bend_barrier(solver *s)
{
    const double damping = KAPPA_D*s->mu, mu = s->mu;
    ip_invert_distances(s);
    for (int i = 0; i < s->nv; ++i) {
        s->sigma[i] = s->now.zl[i]*s->below[i] + s->now.zu[i]*s->above[i];
        s->pull[i] = mu*(s->above[i] - s->below[i]) + s->open[i]*damping;
    }
}

/* Search direction with inertia correction (WB algorithm IC); 0 if no perturbation helps, or none
 * in time. */
int ip_direction(solver *s)
{
    const dmoc_kkt *k = s->kkt;
    const int unknowns = k->size - s->m;
    bend_barrier(s);
    ip_fill_K(s, 1);
    double *base = s->soc_dv; /* free here; long enough for n + m because it has an elastic part */
    for (int i = 0; i < s->n + s->m; ++i)
        base[i] = k->diagonal[i] >= 0 ? s->K[k->diagonal[i]] : 0;
    s->delta_w = s->delta_c = 0;
    for (;;) {
        factor(s, base);
        int singular = s->ldl->zero > 0;
        if (!singular && s->ldl->positive == unknowns) {
            const double ratio = ip_newton_step(s, s->now.residual, s->dv, s->dy);
            if (ratio < BAD_RESIDUAL)
                break;
            singular = 1;
        }
        if (singular && s->delta_c == 0)
            s->delta_c = DELTA_C*pow(s->mu, KAPPA_C);
        if (s->delta_w == 0)
            s->delta_w = s->last_delta_w == 0 ? DELTA_W_FIRST
                                              : max(DELTA_W_LEAST, KAPPA_W_LESS*s->last_delta_w);
        else
            s->delta_w *= s->last_delta_w == 0 ? KAPPA_W_FIRST : KAPPA_W_MORE;
        if (s->delta_w > DELTA_W_MOST || ip_late(s))
            return 0;
    }
    if (s->delta_w > 0)
        s->last_delta_w = s->delta_w;
    for (int i = 0; i < s->nv; ++i) {
        s->dzl[i] = (s->mu - s->now.zl[i]*s->dv[i])*s->below[i] - s->now.zl[i];
        s->dzu[i] = (s->mu + s->now.zu[i]*s->dv[i])*s->above[i] - s->now.zu[i];
    }
    return 1;
}
