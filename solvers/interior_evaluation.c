/* Values, slopes and curvatures of the problem and of its restoration at a point. */
#include "interior_solver.h"

#include <math.h>
#include <string.h>

/* Distances from bounds of which the product, and one more, is far from over- and underflow. */
enum { TOGETHER = 4 };

void ip_evaluate_values(solver *s, const double *x)
{
    const double t = ip_seconds(s);
    dmoc_put(s->program, x);
    dmoc_assemble(&s->program->values, s->program->pool, s->values);
    s->result.seconds_kernels += ip_seconds(s) - t;
}

/* Objective, residual, violation and barrier function of a point (WB (3a), and (30a) in the
 * restoration); 0 if they are not finite. */
int ip_evaluate(solver *s, point *p)
{
    ip_evaluate_values(s, p->v);
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
    double logs = 0, damping = 0, product = 1, least = INFINITY;
    int factors = 0;
    for (int i = 0; i < s->nv; ++i) {
        const double down = p->v[i] - s->lo[i], up = s->up[i] - p->v[i];
        if (down < INFINITY)
            product *= down, least = min(least, down), ++factors;
        if (up < INFINITY)
            product *= up, least = min(least, up), ++factors;
        damping += s->open[i] > 0 ? down : s->open[i] < 0 ? up : 0;
        if (factors >= TOGETHER) { /* one logarithm for several */
            logs += log(product);
            product = 1, factors = 0;
        }
    }
    logs += log(least > 0 ? product : NAN); /* outside is no point */
    p->logs = KAPPA_D*damping - logs;
    p->phi = p->f + s->mu*p->logs;
    return isfinite(p->phi) && isfinite(p->theta);
}

/* Largest violation of c = 0, d >= 0 in the units of the constraints, from the values that were
 * evaluated last. */
double ip_violation(const solver *s)
{
    double worst = 0;
    for (int r = 0; r < s->m; ++r)
        worst = max(worst, r < s->eq ? fabs(s->values[1 + r]) : -s->values[1 + r]);
    return worst;
}

void ip_evaluate_slopes(solver *s)
{
    const double t = ip_seconds(s);
    dmoc_put(s->program, s->now.v);
    dmoc_assemble(&s->program->slopes, s->program->pool, s->slopes);
    s->result.seconds_kernels += ip_seconds(s) - t;
    double *jac = s->slopes + s->n;
    for (int r = 0; r < s->m; ++r)
        for (int e = s->program->row_start[r]; e < s->program->row_start[r + 1]; ++e)
            jac[e] *= s->fs_rows[r];
    for (int i = 0; i < s->n; ++i)
        s->gradient[i] = s->elastic
            ? s->zeta*s->weight[i]*s->weight[i]*(s->now.v[i] - s->reference[i])
            : s->fs*s->slopes[i];
    for (int i = s->n; i < s->nv; ++i)
        s->gradient[i] = i < s->n + s->slacks ? 0 : s->rho[aux_row(s, i)];
}

void ip_evaluate_curvatures(solver *s)
{
    const double t = ip_seconds(s);
    double *pool = s->program->pool;
    const double *sizes = s->program->sizes;
    dmoc_put(s->program, s->now.v);
    for (int r = 0; r < s->m; ++r)
        pool[s->n + r] = sizes[s->n + r]*s->fs_rows[r]*s->now.y[r];
    pool[s->n + s->m] = s->elastic ? 0 : sizes[s->n + s->m]*s->fs;
    dmoc_assemble(&s->program->curvatures, pool, s->hess);
    s->result.seconds_kernels += ip_seconds(s) - t;
}

/* dual = gradient + A'y, without bound multipliers. */
void ip_evaluate_dual(solver *s)
{
    memcpy(s->dual, s->gradient, sizeof(double)*(size_t)s->nv);
    const double *jac = s->slopes + s->n;
    for (int r = 0; r < s->m; ++r)
        for (int e = s->program->row_start[r]; e < s->program->row_start[r + 1]; ++e)
            s->dual[s->program->column[e]] += jac[e]*s->now.y[r];
    for (int i = s->n; i < s->nv; ++i)
        s->dual[i] += aux_sign(s, i)*s->now.y[aux_row(s, i)];
}
