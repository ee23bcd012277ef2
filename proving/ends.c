/* See ends.h.
 *
 * A goal such as to be at rest in a place that no input reaches fixes a duration. At any other one
 * there is no motion, and the dual grows for ever: with prices of one sign at shorter durations, of
 * the other one at longer ones. Where several durations are fixed, so it is in each direction. Prices
 * for a whole box maximise the least of the duals at some of its ends: at first two, then also those
 * where the bound with these prices is least. Where the dual was linear in the durations, as many as
 * there are durations and one more would do.
 */
#include "ends.h"

#include <string.h>

/* The least of the duals is smoothed by this share of the cost that is of interest at first, which is
 * lessened by a factor until it is far less than a gap. */
#define HOT 0.25
#define COLD 1e-6
#define COOLING 16
/* The least cost that counts as one, as a share of the scale of the problem. */
#define CHEAP 1e-8

int ends_add(const double *t, const Range *range, const double *slope, Ends *ends)
{
    const int n = ends->n;
    if (ends->count == n + 2)
        return 1;
    double *end = ends->t[ends->count];
    for (int i = 0; i < n; i++)
        end[i] = t[i] + (slope[i] > 0 ? range->below[i] : range->above[i]);
    for (int k = 0; k < ends->count; k++)
        if (!memcmp(end, ends->t[k], sizeof(double) * (size_t)n))
            return 1;
    ends->count++;
    return 0;
}

void ends_begin(const Engine *e, const double *t, const Range *range, const double *slope, Ends *ends)
{
    double against[MOST_PHASES];
    ends->n = e->problem->phases, ends->count = 0;
    for (int i = 0; i < ends->n; i++)
        against[i] = -slope[i];
    ends_add(t, range, slope, ends);
    ends_add(t, range, against, ends);
}

/* The steps of all phases over ranges, and what the multipliers make of them at durations t; 1 where
 * they cannot be had. */
static int begin(Engine *e, const double *low, const double *high, const double *t, const Steps **steps,
                 Point *point)
{
    for (int i = 0; i < e->problem->phases; i++) {
        steps[i] = cache_steps(&e->cache, i, low[i], high[i]);
        if (!steps[i])
            return 1;
    }
    point_begin(e->problem, &e->centre, t, steps, point);
    return 0;
}

/* Multipliers at which the least of the duals at some points is large; that one. */
static double maximise_least(Engine *e, int points, double enough)
{
    Centre *c = &e->centre;
    const Point *at[MOST_POINTS];
    const double size = fmax(fabs(e->aim), CHEAP * e->problem->scale);
    double least = INFINITY;
    for (int k = 0; k < points; k++)
        at[k] = e->ends + k;
    for (double share = HOT; share > COLD; share /= COOLING) {
        centre_maximise(e->problem, points, at, share * size, enough, c);
        if (c->value >= enough)
            break;
    }
    for (int k = 0; k < points; k++)
        least = fmin(least, point_dual(e->problem, c, at[k], c->m, 0, 0));
    return least;
}

int ends_maximise(Engine *e, const double *low, const double *high, const double *t, double enough,
                  const Steps **steps, const Ends *ends)
{
    const Problem *p = e->problem;
    Centre *c = &e->centre;
    Cache *cache = &e->cache;
    const Steps *at_end[MOST_POINTS][MOST_PHASES];
    memset(c->m, 0, sizeof c->m);
    memset(c->slope, 0, sizeof c->slope);
    for (int round = 0;; round++) {
        if (centre_number(p, cache->count, cache->priced, c) || begin(e, low, high, t, steps, &c->at))
            return 1;
        for (int k = 0; k < ends->count; k++)
            if (begin(e, ends->t[k], ends->t[k], ends->t[k], at_end[k], e->ends + k))
                return 1;
        const double least = maximise_least(e, ends->count, enough);
        if (!isfinite(least))
            return 1;
        centre_choose(p, c);
        Priced worst;
        if (!(least < e->aim) || round == MOST_ROUNDS || cache->count == MOST_PRICED ||
            c->multipliers == MOST_MULTIPLIERS ||
            !centre_violated(p, steps, c, cache->count, cache->priced, &worst))
            return 0;
        cache->priced[cache->count++] = worst;
        c->m[c->multipliers] = 0;
    }
}
