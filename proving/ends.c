/* See ends.h.
 *
 * A goal such as to be at rest in a place that no input reaches fixes a duration. At any other one
 * there is no motion, and the dual grows for ever: with prices of one sign at shorter durations, of
 * the other one at longer ones. Prices for all of them maximise the lesser of the duals at two ends:
 * for some share this is the maximum of the mean by shares, which is as large at both.
 */
#include "ends.h"

#include <string.h>

/* How often the share is halved; how nearly both ends are as good then: far less than a gap; how little
 * a final time varies that counts as known; how much of the largest change takes part. */
#define HALVINGS 40
#define EVEN 1e-6
#define NEAR 1e-3
#define TAKES_PART 0.1

/* The two ends of a box; 1 where nothing changes between them. */
static int ends_of(int n, const double *t, const Range *range, const double *slope, double (*end)[MOST_PHASES])
{
    double mean = 0, most = 0, change[MOST_PHASES], total = 0;
    for (int i = 0; i < n; i++)
        mean += slope[i] / n, total += range->above[i] - range->below[i];
    if (range->most - range->least > NEAR * total)
        mean = 0; /* the final time may vary */
    for (int i = 0; i < n; i++) {
        change[i] = (slope[i] - mean) * (range->above[i] - range->below[i]);
        most = fmax(most, fabs(change[i]));
    }
    for (int i = 0; i < n; i++) {
        const int part = fabs(change[i]) > TAKES_PART * most, up = change[i] > 0;
        end[0][i] = t[i] + (!part ? 0 : up ? range->below[i] : range->above[i]);
        end[1][i] = t[i] + (!part ? 0 : up ? range->above[i] : range->below[i]);
    }
    return !(most > 0 && isfinite(most));
}

/* The larger one of the lesser of both duals that the shares lead to; its multipliers are those of
 * the centre then. Minus infinity where there is none. */
static double maximise_lesser(Engine *e, double enough)
{
    Centre *c = &e->centre;
    const Point *at[2] = {e->ends, e->ends + 1};
    double best = -INFINITY, low = 0, high = 1, found[MOST_MULTIPLIERS];
    for (int round = 0; round < HALVINGS; round++) {
        const double share = (low + high) / 2;
        e->ends[0].share = share, e->ends[1].share = 1 - share;
        centre_maximise(e->problem, 2, at, enough, c);
        const double first = point_dual(e->problem, c, at[0], c->m, 0, 0);
        const double second = point_dual(e->problem, c, at[1], c->m, 0, 0);
        if (!isfinite(first) || !isfinite(second))
            break;
        if (fmin(first, second) > best) {
            best = fmin(first, second);
            memcpy(found, c->m, sizeof found);
        }
        if (best >= enough || fabs(first - second) <= EVEN * fabs(best))
            break;
        if (first > second)
            high = share;
        else
            low = share;
    }
    if (best > -INFINITY)
        memcpy(c->m, found, sizeof found);
    return best;
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

int ends_maximise(Engine *e, const double *low, const double *high, const double *t,
                  const Range *range, const double *slope, double enough, const Steps **steps)
{
    const Problem *p = e->problem;
    Centre *c = &e->centre;
    Cache *cache = &e->cache;
    double end[2][MOST_PHASES];
    const Steps *at_end[2][MOST_PHASES];
    if (ends_of(p->phases, t, range, slope, end))
        return 1;
    memset(c->m, 0, sizeof c->m);
    memset(c->slope, 0, sizeof c->slope);
    for (int round = 0;; round++) {
        if (centre_number(p, cache->count, cache->priced, c) || begin(e, low, high, t, steps, &c->at))
            return 1;
        for (int k = 0; k < 2; k++)
            if (begin(e, end[k], end[k], end[k], at_end[k], e->ends + k))
                return 1;
        const double lesser = maximise_lesser(e, enough);
        if (isinf(lesser))
            return 1;
        centre_choose(p, c);
        Priced worst;
        if (!(lesser < e->aim) || round == MOST_ROUNDS || cache->count == MOST_PRICED ||
            c->multipliers == MOST_MULTIPLIERS ||
            !centre_violated(p, steps, c, cache->count, cache->priced, &worst))
            return 0;
        cache->priced[cache->count++] = worst;
        c->m[c->multipliers] = 0;
    }
}
