/* Whether the laws that an end goes by are laws: with other parameters a mass may be none on the
 * way, and coefficients that depend on the motion may create energy. */
#include "dmoc_inside.h"

/* What rounding leaves of a pivot of a mass with ones on its diagonal, dmoc.mechanics.algebra. */
static const double DEFINITE = 1e-14;

int carried_positive(double *M, int n)
{
    for (int i = 0; i < n; ++i) {
        const double whole = M[i*n + i];
        for (int k = 0; k < i; ++k)
            M[i*n + i] -= M[i*n + k]*M[i*n + k];
        if (!(M[i*n + i] > DEFINITE*whole))
            return 0;
        M[i*n + i] = sqrt(M[i*n + i]);
        for (int j = i + 1; j < n; ++j) {
            for (int k = 0; k < i; ++k)
                M[j*n + i] -= M[j*n + k]*M[i*n + k];
            M[j*n + i] /= M[i*n + i];
        }
    }
    return 1;
}

int carried_mass_at(const dmoc_solver *s, const double *q, double time, const double *parameters)
{
    const int n = s->c->places.nq;
    double *zeros = s->work + n + s->c->places.parameters, *force = zeros + n + s->c->motion.inputs;
    double *M = force + n;
    const double *in[DMOC_MOST] = {q, zeros, zeros, &time, parameters};
    memset(zeros, 0, sizeof(double)*(size_t)(n + s->c->motion.inputs));
    carried_call(s->c->motion.dynamics, in, M, force);
    return carried_positive(M, n);
}

/* A moment of an end, and room: coefficients of sliding and of sticking [nt], when something begins
 * to slide too. */
typedef struct {
    const dmoc_laws *laws;
    const double *q, *v, *t, *parameters;
    double *u, *slides, *still, *pressed, *kinetic, *resting, *begins, *rates, *returned;
} moment;

static moment moment_in(const dmoc_solver *s, int phase)
{
    const dmoc_places *p = &s->c->places;
    const int nt = p->nt, nc = p->nc;
    moment at;
    double *free = s->work;
    memset(&at, 0, sizeof at);
    at.laws = &s->c->laws, at.parameters = free;
    carried_parameters(s, phase, free);
    at.u = free += p->parameters;
    at.slides = free += s->c->motion.inputs;
    at.still = free += nt;
    at.pressed = free += nt;
    at.kinetic = free += nt > nc ? nt : nc;
    at.resting = free += nt;
    at.begins = free += nt;
    at.rates = free += nt;
    at.returned = free + nc;
    memset(at.u, 0, sizeof(double)*(size_t)s->c->motion.inputs);
    memset(at.still, 0, sizeof(double)*(size_t)nt);
    for (int k = 0; k < nt || k < nc; ++k)
        at.pressed[k] = 1;
    return at;
}

/* Friction at a moment, where things slide with some speeds [nt]. */
static void rub(const moment *at, const double *speeds, double *kinetic, double *resting)
{
    const double whole = 0;
    const double *in[DMOC_MOST] = {at->q, speeds, at->u, at->u, &whole, at->pressed, at->t,
                                   at->parameters};
    carried_call(at->laws->kinetic, in, kinetic, NULL);
    if (at->laws->resting && resting)
        carried_call(at->laws->resting, in, resting, NULL);
}

/* Whether the friction of what rubs along a phase is one. */
static int rubs(const dmoc_solver *s, moment *at, int phase)
{
    const dmoc_laws *laws = at->laws;
    const int nt = s->c->places.nt, *kinds = laws->rubs + phase*nt;
    const double *in[DMOC_MOST] = {at->q, at->v, at->t, at->parameters};
    carried_call(laws->slide_rate, in, at->slides, NULL);
    for (int k = 0; k < nt; ++k)
        at->slides[k] = fabs(at->slides[k]);
    rub(at, at->slides, at->kinetic, NULL);
    rub(at, at->still, at->begins, at->resting);
    for (int k = 0; k < nt; ++k) {
        const double slack = CARRIED_KEPT*fabs(at->begins[k]);
        if ((kinds[k] && !(at->kinetic[k] >= -slack && at->begins[k] >= 0)) ||
            (kinds[k] == 2 && !(at->begins[k] <= at->resting[k] + slack)))
            return 0;
    }
    return 1;
}

/* Whether the hit at the end of a phase returns what a hit does, and is rubbed as one. */
static int hits(const dmoc_solver *s, moment *at, int phase)
{
    const double *in[DMOC_MOST] = {at->q, at->v, at->pressed, at->t, at->parameters};
    const ptrdiff_t stride[DMOC_MOST] = {0};
    const int nt = s->c->places.nt, hit = at->laws->hit[phase];
    if (hit >= 0) { /* of unit impulses */
        double work, *results[DMOC_MOST] = {at->rates, at->returned, &work};
        at->laws->restitution->kernel(1, in, stride, results);
        const double e = at->returned[hit];
        if (!(e >= -CARRIED_KEPT && e <= 1 + CARRIED_KEPT))
            return 0;
    }
    if (at->laws->kinetic) {
        rub(at, at->still, at->kinetic, NULL);
        for (int k = 0; k < nt; ++k)
            if (at->laws->struck[phase*nt + k] && !(at->kinetic[k] >= 0))
                return 0;
    }
    return 1;
}

static void put_inputs(const dmoc_solver *s, moment *at, int side, int step)
{
    const int inputs = s->c->motion.inputs;
    for (int i = 0; i < inputs; ++i)
        at->u[i] = s->physical[s->c->motion.input[side][step*inputs + i]];
}

int carried_lawful(const dmoc_solver *s)
{
    const dmoc_carried *c = s->c;
    const dmoc_laws *laws = &c->laws;
    const int n = c->places.nq;
    const double *v = s->results + (carried_nodes(c) - 1 + c->phases)*n;
    for (int i = 0, first = 0; i < c->phases; first += c->steps[i++])
        for (int k = 0; k <= c->steps[i]; ++k) {
            moment at = moment_in(s, i);
            at.q = s->physical + c->places.q + (first + k)*n, at.t = s->times + first + k;
            at.v = v + (first + k + i)*n;
            for (int j = 0; j < n; ++j)
                if (!isfinite(at.v[j]))
                    return 0;
            for (int side = 0; c->steps[i] && laws->kinetic && side < 2; ++side) {
                const int step = k - side;
                if (step < 0 || step >= c->steps[i])
                    continue;
                put_inputs(s, &at, side, first + step);
                if (!rubs(s, &at, i))
                    return 0;
            }
            if (k == c->steps[i] && i + 1 < c->phases && !hits(s, &at, i))
                return 0;
            if (c->together.mass && !carried_mass_at(s, at.q, *at.t, at.parameters))
                return 0;
        }
    return 1;
}
