/* Residuals of an end, dmoc.solvers.judge, and whether positions keep what they must. */
#include "dmoc_inside.h"

/* As dmoc.solvers and dmoc.base.tolerances have them. */
static const double SCALE_FROM = 100, ROUNDED_OPTIMALITY = 1e-5, ROUNDED_VIOLATION = 1e-9;

void carried_evaluate(dmoc_solver *s)
{
    dmoc_put(&s->program, s->x);
    dmoc_assemble(&s->program.values, s->pool, s->values);
    dmoc_assemble(&s->program.slopes, s->pool, s->slopes);
}

static double larger(double a, double b) { return a > b || a != a ? a : b; }

/* Residuals of the optimality conditions at the point, with its multipliers or with none. */
static double optimality(const dmoc_solver *s, double *slope, int alone)
{
    const dmoc_program *p = &s->program;
    double worst = 0, sum = 0;
    const double *jac = s->slopes + p->n;
    carried_copy(slope, s->slopes, p->n);
    for (ptrdiff_t r = 0; r < p->m; ++r) {
        const double y = alone ? 0 : r < p->equalities ? s->y[r] : fmin(s->y[r], 0);
        for (int e = p->row_start[r]; e < p->row_start[r + 1]; ++e)
            slope[p->column[e]] += jac[e]*y;
        sum += fabs(y);
        if (r >= p->equalities)
            worst = larger(fabs(y*s->values[1 + r]), worst);
    }
    for (ptrdiff_t i = 0; i < p->n; ++i) {
        if (!(p->lower[i] < p->upper[i]))
            continue;
        const double z = alone ? 0 : s->z[i];
        const double distance = z > 0 ? s->x[i] - p->lower[i] : z < 0 ? p->upper[i] - s->x[i] : 0;
        sum += fabs(z);
        worst = larger(fabs((slope[i] - z)*(i < carried_stepped(s->c) ? s->x[i] : 1)), worst);
        worst = larger(fabs(z*distance), worst);
    }
    const double mean = p->n + p->m ? sum/(double)(p->n + p->m) : 0;
    worst /= fmax(SCALE_FROM, mean)/SCALE_FROM*fmax(fabs(s->values[0]), CARRIED_LEAST_COST);
    return isfinite(worst) ? worst : (double)INFINITY;
}

static double violation(const dmoc_solver *s)
{
    const dmoc_program *p = &s->program;
    double worst = 0;
    for (ptrdiff_t r = 0; r < p->m; ++r)
        worst = larger(r < p->equalities ? fabs(s->values[1 + r]) : -s->values[1 + r], worst);
    for (ptrdiff_t i = 0; i < p->n; ++i)
        worst = larger(fmax(p->lower[i] - s->x[i], s->x[i] - p->upper[i]), worst);
    return isfinite(worst) ? worst : (double)INFINITY;
}

/* What the residuals say of the point where the method has ended, dmoc.solvers.judge. */
int carried_judge(dmoc_solver *s, int word, const dmoc_limits *limits)
{
    dmoc_end *end = &s->end;
    carried_evaluate(s);
    end->optimality = optimality(s, s->z_lower, 0);
    if (fabs(s->values[0]) <= CARRIED_LEAST_COST) {
        const double alone = optimality(s, s->z_lower, 1);
        if (alone < end->optimality) {
            end->optimality = alone;
            memset(s->y, 0, sizeof(double)*(size_t)s->program.m);
            memset(s->z, 0, sizeof(double)*(size_t)s->program.n);
        }
    }
    end->violation = violation(s);
    end->cost = s->c->cost*s->values[0];
    if (word == DMOC_INTERRUPTED)
        return word;
    if (end->optimality <= limits->optimality && end->violation <= limits->violation)
        return DMOC_SOLVED;
    if (word == DMOC_ITERATION_LIMIT || word == DMOC_TIME_LIMIT)
        return word;
    if (end->optimality <= ROUNDED_OPTIMALITY && end->violation <= ROUNDED_VIOLATION)
        return DMOC_SOLVED;
    const int finite = isfinite(end->optimality) && isfinite(end->violation);
    return finite && end->violation > CARRIED_INFEASIBLE ? DMOC_INFEASIBLE : DMOC_STALLED;
}

/* Whether nothing is penetrated and all that is closed, held or stuck is kept, at all nodes of a
 * phase:
 * rows that fixed values have settled are not in the program. */
static int inside(const dmoc_solver *s, int phase, int first, int last)
{
    const dmoc_places *p = &s->c->places;
    double *result = s->work, *at = result + p->nc + p->nj, *parameters = at + 2*p->nt;
    carried_parameters(s, phase, parameters);
    for (int k = first; k <= last; ++k) {
        const double *in[DMOC_MOST] = {s->physical + p->q + k*p->nq, s->times + k, parameters};
        for (int closed = 0; closed < (p->surface ? 2 : 0); ++closed) {
            if (!closed || p->barrier != p->surface)
                carried_call(closed ? p->surface : p->barrier, in, result, NULL);
            for (int j = 0; j < p->nc; ++j) {
                const double g = closed ? fabs(result[j]) : result[j];
                if (p->held[phase*p->nc + j] == 1 + closed && !(g <= CARRIED_KEPT*p->gap[j]))
                    return 0;
            }
        }
        if (p->joint) {
            carried_call(p->joint, in, result, NULL);
            for (int j = 0; j < p->nj; ++j)
                if (!(fabs(result[j]) <= CARRIED_KEPT*p->joint_size[j]))
                    return 0;
        }
        if (p->tangent) {
            carried_call(p->tangent, in, k == first ? at : at + p->nt, NULL);
            for (int j = 0; k > first && j < p->nt; ++j)
                if (p->stuck[phase*p->nt + j] &&
                    !(fabs(at[p->nt + j] - at[j]) <= CARRIED_KEPT*p->tangent_size[j]))
                    return 0;
        }
    }
    return 1;
}

int carried_strays(const dmoc_solver *s, int phase, const double *const in[], const double *slopes,
                   double *rates)
{
    const dmoc_places *p = &s->c->places;
    const int *stuck = p->stuck + phase*p->nt, *slides = p->slides + phase*p->nt;
    carried_call(s->c->motion.functions[DMOC_TANGENTIAL].rates, in, rates, NULL);
    for (int k = 0; k < p->nt; ++k) {
        double made = 0;
        for (int i = 0; i < p->nq; ++i)
            made += fabs(slopes[k*p->nq + i]*in[1][i]);
        const double kept = CARRIED_KEPT*fmax(p->slide_size[k], made);
        if (stuck[k] && !(fabs(rates[k]) <= kept))
            return 1;
        if (slides[k] && !(slides[k]*rates[k] >= -kept))
            return 1;
    }
    return 0;
}

int carried_all_inside(const dmoc_solver *s)
{
    if (s->strays)
        return 0;
    for (int i = 0, node = 0; i < s->c->phases; node += s->c->steps[i++])
        if (!inside(s, i, node, node + s->c->steps[i]))
            return 0;
    return 1;
}
