/* A lower bound of the cost over a box of durations: the dual at multipliers that follow the
 * durations linearly, with its first three derivatives as intervals. */
#include "box.h"
#include "convex.h"
#include "dual.h"
#include "ends.h"

#include <stdlib.h>
#include <string.h>

/* Every so many boxes a motion is looked for in the middle of one: in any until there is one, then
 * where the centre promises a better one. */
#define OFTEN 16
/* Boxes whose durations vary by more than these factors: multipliers that are the same all over them
 * are tried too, or are all that is tried. */
#define NARROW 1.3
#define WIDE 1.5
/* Boxes whose durations vary by less than this factor are as good as points, which are not divided:
 * all that is violated in them is priced at once. */
#define POINTED (1 + 1e-9)

int engine_begin(Engine *e, const Problem *p, int workers)
{
    size_t lines = 0, inputs = 0, s = p->spreads, moved = moved_before(p, p->phases);
    memset(e, 0, sizeof *e);
    e->problem = p;
    e->best = INFINITY;
    frame_begin(p->phases, &e->frame);
    frame_begin(0, &e->point);
    for (int i = 0; i < p->phases; i++) {
        const size_t d = 2 * p->phase[i].r + MOST_PRICED + 1;
        lines += 2 * d * (d + 1); /* a curve has less room than a line */
        inputs += (size_t)p->phase[i].steps * p->phase[i].nb;
    }
    const size_t costates = (size_t)p->phases * MOST_COSTATE * (MOST_MULTIPLIERS + 1);
    const size_t rows = (inputs + s) * (MOST_MULTIPLIERS + 1);
    const size_t of_point = costates + rows + inputs + s + 2 * moved;
    const size_t numbers = (p->phases + 3) * of_point;
    e->memory = calloc(1, lines * sizeof(line) + numbers * sizeof(double) + inputs * sizeof(Choice));
    if (!e->memory || cache_begin(&e->cache, p, workers))
        return 1;
    line *at = e->memory;
    for (int i = 0; i < p->phases; i++) {
        const size_t d = 2 * p->phase[i].r + MOST_PRICED + 1;
        e->values[i].linear = at, at += d;
        e->values[i].square = at, at += d * d;
        e->values[i].curves = (curve *)at, at += d + d * d;
    }
    double *number = (double *)at;
    for (int i = 0; i < p->phases + 3; i++, number += of_point) {
        Point *point = i ? e->ends + i - 1 : &e->centre.at;
        point->count = (int)inputs;
        point->costates = number;
        point->rows = number + costates;
        point->inputs = point->rows + rows;
        point->moved = point->inputs + inputs + s;
        point->rate = point->moved + moved;
    }
    e->centre.choices = (Choice *)number;
    return 0;
}

void engine_end(Engine *e)
{
    free(e->memory);
    cache_end(&e->cache);
    e->memory = 0;
}

int box_has_time(const Problem *p, const double *low, const double *high)
{
    double least = 0, most = 0;
    for (int i = 0; i < p->phases; i++)
        least += low[i], most += high[i];
    return least <= p->latest * (1 + 1e-12) && most >= p->earliest * (1 - 1e-12);
}

/* The middle of a box, moved to where the final time is one that may be. */
static void middle_of(const Problem *p, const double *low, const double *high, double *t)
{
    double sum = 0, room = 0;
    for (int i = 0; i < p->phases; i++) {
        t[i] = low[i] + (high[i] - low[i]) / 2;
        sum += t[i];
    }
    const double excess = sum > p->latest ? sum - p->latest : sum < p->earliest ? sum - p->earliest : 0;
    for (int i = 0; i < p->phases; i++)
        room += (high[i] - low[i]) / 2;
    for (int i = 0; i < p->phases && room > 0; i++) {
        t[i] -= excess / room * (high[i] - low[i]) / 2;
        t[i] = t[i] < low[i] ? low[i] : t[i] > high[i] ? high[i] : t[i];
    }
}

/* The best multipliers at the centres of the steps; conditions along the phases that the motion there
 * violates are priced, so many at most. 1 where it cannot be said. */
static int centre_at(Engine *e, const double *low, const double *high, double enough, int rounds,
                     double *multipliers, const Steps **steps)
{
    const Problem *p = e->problem;
    Centre *c = &e->centre;
    Cache *cache = &e->cache;
    double t[MOST_PHASES];
    for (int round = 0;; round++) {
        if (centre_number(p, cache->count, cache->priced, c))
            return 1;
        memcpy(c->m, multipliers, sizeof(double) * MOST_MULTIPLIERS);
        for (int i = 0; i < p->phases; i++) {
            t[i] = low[i] + (high[i] - low[i]) / 2;
            steps[i] = cache_steps(cache, i, low[i], high[i]);
            if (!steps[i])
                return 1;
        }
        point_begin(p, c, t, steps, &c->at);
        centre_maximise(p, 1, (const Point *[]){&c->at}, 1, enough, c);
        centre_choose(p, c);
        memcpy(multipliers, c->m, sizeof(double) * MOST_MULTIPLIERS);
        Priced worst;
        if (!c->converged || !(c->value < e->aim) || cache->count == MOST_PRICED ||
            c->multipliers == MOST_MULTIPLIERS || round == rounds)
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
    if (centre_at(e, high, high, enough, MOST_ROUNDS, multipliers, steps))
        return -INFINITY;
    for (int i = 0; i < p->phases; i++) {
        wide[i] = (interval){low[i], high[i]};
        steps[i] = cache_steps(&e->cache, i, low[i], high[i]);
        if (!steps[i])
            return -INFINITY;
    }
    dual_model(e, &e->point, steps, high, wide);
    return model_range(&e->dual.value).lo;
}

/* See whether the motion of durations that add up costs less than all that were met. */
static void meet(Engine *e, const double *t, const double *multipliers)
{
    const Steps *steps[MOST_PHASES];
    double m[MOST_MULTIPLIERS];
    Priced worst;
    memcpy(m, multipliers, sizeof m);
    if (centre_at(e, t, t, INFINITY, MOST_ROUNDS, m, steps) || !e->centre.converged || !(e->centre.value < e->best))
        return;
    if (centre_violated(e->problem, steps, &e->centre, e->cache.count, e->cache.priced, &worst))
        return;
    e->best = e->centre.value;
    memcpy(e->at, t, sizeof e->at);
}

/* Bound by the dual at the multipliers of the centre, and its slopes there. */
static double over_range(Engine *e, const Steps *const *steps, const double *t, const Range *range,
                         double *widths, double *slope)
{
    const Frame *f = &e->frame;
    const model *value = &e->dual.value;
    dual_model(e, f, steps, t, 0);
    for (int i = 0; i < f->n; i++)
        slope[i] = value->c[1 + i] / f->most[i];
    const double bound = model_range(value).lo;
    return bound < e->aim ? fmax(bound, by_curvature(f, value, range, widths)) : bound;
}

/* Bound by the dual at multipliers that are good at several ends of a box at once, from its ``slope``
 * at the centre. */
static double by_ends(Engine *e, const double *low, const double *high, const double *t,
                      const Range *range, double enough, const Steps **steps, double *widths,
                      double *slope)
{
    Ends ends;
    double best = -INFINITY, own[MOST_PHASES] = {0};
    ends_begin(e, t, range, slope, &ends);
    while (!ends_maximise(e, low, high, t, enough, steps, &ends)) {
        const double bound = over_range(e, steps, t, range, own, slope);
        if (bound > best) {
            best = bound;
            memcpy(widths, own, sizeof own);
        }
        if (best >= e->aim || ends_add(t, range, slope, &ends))
            break;
    }
    return best;
}

double box_bound(Engine *e, const double *low, const double *high, double enough,
                 double *multipliers, double *widths)
{
    const Problem *p = e->problem;
    Centre *c = &e->centre;
    const int n = p->phases;
    double t[MOST_PHASES], below[MOST_PHASES], above[MOST_PHASES], slope[MOST_PHASES];
    double ratio = 1, bound = -INFINITY;
    interval away[MOST_PHASES];
    const Steps *steps[MOST_PHASES];
    const Value *values[MOST_PHASES];
    cache_trim(&e->cache);
    middle_of(p, low, high, t);
    const int often = e->number % OFTEN == 0;
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
    const int rounds = ratio < POINTED ? MOST_PRICED : MOST_ROUNDS;
    if (centre_at(e, low, high, enough, rounds, multipliers, steps))
        return bound;
    interval known = {0, 0};
    double least = 0, most = 0;
    for (int i = 0; i < n; i++) {
        t[i] = low[i] + (high[i] - low[i]) / 2;
        e->frame.most[i] = steps[i]->most;
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
        model m;
        multiplier_model(c, &e->frame, j, &m);
        for (int i = 0; i < n && !(model_range(&m).lo >= 0); i++)
            c->slope[i][j] = 0;
    }
    const Range range = {below, above, interval_sub(interval_of(p->earliest), known).lo,
                         interval_sub(interval_of(p->latest), known).hi};
    bound = fmax(bound, over_range(e, steps, t, &range, widths, slope));
    /* Where what is asked decides durations, the dual of the centre grows for ever, or nearly so: its
     * prices promise twice the cost there, and nothing in the rest of the box. */
    const int promises = c->value >= enough && bound < e->aim - fabs(e->aim);
    if (bound < e->aim && (c->grows || promises)) {
        double others[MOST_PHASES];
        const double best = by_ends(e, low, high, t, &range, enough, steps, others, slope);
        if (best > bound) {
            bound = best;
            memcpy(widths, others, sizeof others);
        }
    }
    if (often && c->converged && c->value < e->best) {
        middle_of(p, low, high, t);
        meet(e, t, multipliers);
    }
    return bound;
}
