/* A lower bound of the cost over a box of durations: the dual at multipliers that follow the
 * durations linearly, with its first three derivatives as intervals. */
#include "box.h"
#include "convex.h"
#include "dual.h"

#include <stdlib.h>
#include <string.h>

/* How often conditions that the motion of a centre violates are priced there. */
#define MOST_ROUNDS 3
/* Every so many boxes a motion is looked for in the middle of one: in any until there is one, then
 * where the centre promises a better one. */
#define OFTEN 16
/* Boxes whose durations vary by more than these factors: multipliers that are the same all over them
 * are tried too, or are all that is tried. */
#define NARROW 1.3
#define WIDE 1.5

int engine_begin(Engine *e, const Problem *p)
{
    size_t lines = 0, inputs = 0, s = 2 * p->phase[0].r;
    memset(e, 0, sizeof *e);
    e->problem = p;
    e->best = INFINITY;
    for (int i = 0; i < p->phases; i++) {
        const size_t d = 2 * p->phase[i].r + MOST_PRICED + 1;
        lines += d * (d + 1);
        inputs += (size_t)p->phase[i].steps * p->phase[i].nb;
    }
    const size_t costates = (size_t)p->phases * MOST_COSTATE * (MOST_MULTIPLIERS + 1);
    const size_t rows = (inputs + s) * (MOST_MULTIPLIERS + 1);
    const size_t numbers = costates + rows + inputs + s;
    e->memory = calloc(1, lines * sizeof(line) + numbers * sizeof(double) + inputs * sizeof(Choice));
    if (!e->memory || cache_begin(&e->cache, p))
        return 1;
    line *at = e->memory;
    for (int i = 0; i < p->phases; i++) {
        const size_t d = 2 * p->phase[i].r + MOST_PRICED + 1;
        e->values[i].linear = at, at += d;
        e->values[i].square = at, at += d * d;
    }
    e->centre.costates = (double *)at;
    e->centre.rows = e->centre.costates + costates;
    e->centre.inputs = e->centre.rows + rows;
    e->centre.choices = (Choice *)(e->centre.inputs + inputs + s);
    return 0;
}

void engine_end(Engine *e)
{
    free(e->memory);
    cache_end(&e->cache);
    e->memory = 0;
}

/* The middle of a box, moved to where the final time is one that may be; 1 where there is none. */
static int middle_of(const Problem *p, const double *low, const double *high, double *t)
{
    double sum = 0, least = 0, most = 0, room = 0;
    for (int i = 0; i < p->phases; i++) {
        t[i] = low[i] + (high[i] - low[i]) / 2;
        sum += t[i], least += low[i], most += high[i];
    }
    if (least > p->latest * (1 + 1e-12) || most < p->earliest * (1 - 1e-12))
        return 1;
    const double excess = sum > p->latest ? sum - p->latest : sum < p->earliest ? sum - p->earliest : 0;
    for (int i = 0; i < p->phases; i++)
        room += (high[i] - low[i]) / 2;
    for (int i = 0; i < p->phases && room > 0; i++) {
        t[i] -= excess / room * (high[i] - low[i]) / 2;
        t[i] = t[i] < low[i] ? low[i] : t[i] > high[i] ? high[i] : t[i];
    }
    return 0;
}

/* The best multipliers at the centres of the steps; conditions along the phases that the motion there
 * violates are priced. 1 where it cannot be said. */
static int centre_at(Engine *e, const double *low, const double *high, double enough,
                     double *multipliers, const Steps **steps)
{
    const Problem *p = e->problem;
    Centre *c = &e->centre;
    Cache *cache = &e->cache;
    double t[MOST_PHASES];
    for (int round = 0;; round++) {
        if (centre_number(p, cache->count, c))
            return 1;
        memcpy(c->m, multipliers, sizeof(double) * MOST_MULTIPLIERS);
        for (int i = 0; i < p->phases; i++) {
            t[i] = low[i] + (high[i] - low[i]) / 2;
            steps[i] = cache_steps(cache, i, low[i], high[i]);
            if (!steps[i])
                return 1;
        }
        centre_maximise(p, t, steps, enough, c);
        memcpy(multipliers, c->m, sizeof(double) * MOST_MULTIPLIERS);
        Priced worst;
        if (!c->converged || !(c->value < e->aim) || cache->count == MOST_PRICED ||
            c->multipliers == MOST_MULTIPLIERS || round == MOST_ROUNDS)
            return 0;
        if (!centre_violated(p, steps, c, cache->count, cache->priced, &worst))
            return 0;
        cache->priced[cache->count++] = worst;
        multipliers[c->multipliers] = 0;
    }
}

/* Bound by multipliers that are the same all over the box: the best ones at its longest durations,
 * where motions cost least as a rule. */
static double by_longest(Engine *e, const double *low, const double *high, double enough,
                         double *multipliers)
{
    const Problem *p = e->problem;
    interval wide[MOST_PHASES];
    const Steps *steps[MOST_PHASES];
    static _Thread_local jet box;
    if (centre_at(e, high, high, enough, multipliers, steps))
        return -INFINITY;
    for (int i = 0; i < p->phases; i++) {
        wide[i] = (interval){low[i], high[i]};
        steps[i] = cache_steps(&e->cache, i, low[i], high[i]);
        if (!steps[i])
            return -INFINITY;
    }
    dual_jet(e, 0, steps, high, wide, wide, &box);
    return box.v.lo;
}

/* See whether the motion of durations that add up costs less than all that were met. */
static void meet(Engine *e, const double *t, const double *multipliers)
{
    const Steps *steps[MOST_PHASES];
    double m[MOST_MULTIPLIERS];
    Priced worst;
    memcpy(m, multipliers, sizeof m);
    if (centre_at(e, t, t, INFINITY, m, steps) || !e->centre.converged || !(e->centre.value < e->best))
        return;
    if (centre_violated(e->problem, steps, &e->centre, e->cache.count, e->cache.priced, &worst))
        return;
    e->best = e->centre.value;
    memcpy(e->at, t, sizeof e->at);
}

double box_bound(Engine *e, const double *low, const double *high, double enough,
                 double *multipliers, double *widths)
{
    const Problem *p = e->problem;
    Centre *c = &e->centre;
    const int n = p->phases;
    double t[MOST_PHASES], below[MOST_PHASES], above[MOST_PHASES], ratio = 1, bound = -INFINITY;
    interval wide[MOST_PHASES], away[MOST_PHASES];
    const Steps *steps[MOST_PHASES];
    const Value *values[MOST_PHASES];
    static _Thread_local jet box;
    cache_trim(&e->cache);
    if (middle_of(p, low, high, t))
        return INFINITY;
    const int often = e->boxes++ % OFTEN == 0;
    if (often && isinf(e->best))
        meet(e, t, multipliers);
    for (int i = 0; i < n; i++) {
        ratio = fmax(ratio, high[i] / low[i]);
        widths[i] = 0;
    }
    if (ratio > NARROW) {
        double others[MOST_MULTIPLIERS];
        memcpy(others, multipliers, sizeof others);
        bound = by_longest(e, low, high, enough, others);
        if (ratio > WIDE || bound >= e->aim)
            return bound;
    }
    if (centre_at(e, low, high, enough, multipliers, steps))
        return bound;
    interval known = {0, 0};
    double least = 0, most = 0;
    for (int i = 0; i < n; i++) {
        t[i] = low[i] + (high[i] - low[i]) / 2;
        wide[i] = (interval){low[i], high[i]};
        known = plus(known, interval_of(t[i]));
        least += low[i], most += high[i];
    }
    /* Distances from the centre, where the final time does not rule them out. */
    for (int i = 0; i < n; i++) {
        const double slack = 4 * n * DBL_EPSILON * most;
        const double top = fmin(high[i], p->latest - (least - low[i]) + slack);
        const double bottom = fmax(low[i], p->earliest - (most - high[i]) - slack);
        away[i] = interval_sub((interval){fmin(bottom, t[i]), fmax(top, t[i])}, interval_of(t[i]));
        below[i] = away[i].lo, above[i] = away[i].hi;
    }
    /* Slopes need the values of the phases at the centre, with the choices made there. */
    Choice *choices = c->choices;
    for (int i = 0; i < n; i++) {
        values[i] = phase_value(p->phase + i, steps[i], choices, 0, e->values + i);
        choices += p->phase[i].steps * p->phase[i].nb;
    }
    if (c->value < enough)
        centre_slopes(p, steps, values, c);
    else
        memset(c->slope, 0, sizeof c->slope);
    for (int j = 0; j < c->multipliers; j++) {
        if (c->may_be_negative[j])
            continue;
        jet m;
        multiplier_jet(c, n, j, away, &m);
        for (int i = 0; i < n && !(m.v.lo >= 0); i++)
            c->slope[i][j] = 0;
    }
    dual_jet(e, n, steps, t, wide, away, &box);
    least = interval_sub(interval_of(p->earliest), known).lo;
    most = interval_sub(interval_of(p->latest), known).hi;
    bound = fmax(bound, box.v.lo);
    bound = fmax(bound, by_slopes(n, &box, below, above, least, most));
    if (bound < e->aim)
        bound = fmax(bound, by_curvature(n, &box, below, above, least, most, widths));
    if (often && c->converged && c->value < e->best && !middle_of(p, low, high, t))
        meet(e, t, multipliers);
    return bound;
}
