/* See times.h. */
#include "times.h"

/* Parts of the time that are shorter than this share of it are not cut off. */
#define SHORTEST_PART 1e-13

/* Whether a condition holds nowhere in a range of the time. */
static int is_ruled_out(const Problem *p, const Times *when, int row, double from, double to)
{
    const int count = p->shifts.shifts;
    line shifts[MOST_SHIFTS];
    shifts_over(&p->shifts, interval_of(from + (to - from) / 2), (interval){from, to}, shifts);
    interval value = interval_of(when->b[row]);
    for (int j = 0; j < count; j++)
        value = plus_times(value, interval_of(when->shifted[row * count + j]), shifts[j].v);
    return value.lo > 0 || (when->vanish[row] && value.hi < 0);
}

/* Cut off both ends of a range what a condition rules out; 0 where that is all of it. */
static int cut(const Problem *p, const Times *when, int row, double *from, double *to)
{
    const double shortest = SHORTEST_PART * *to;
    if (is_ruled_out(p, when, row, *from, *to))
        return 0;
    for (double part = (*to - *from) / 2; part > shortest;)
        if (part < *to - *from && is_ruled_out(p, when, row, *from, *from + part))
            *from += part;
        else
            part /= 2;
    for (double part = (*to - *from) / 2; part > shortest;)
        if (part < *to - *from && is_ruled_out(p, when, row, *to - part, *to))
            *to -= part;
        else
            part /= 2;
    return 1;
}

int times_contract(const Problem *p, double *low, double *high)
{
    interval least = {0, 0}, most = {0, 0};
    for (int i = 0; i < p->phases; i++) {
        const Times *when = i == p->phases - 1 ? &p->goal_when : &p->event[i].when;
        least = interval_add(least, interval_of(low[i]));
        most = interval_add(most, interval_of(high[i]));
        double from = least.lo, to = most.hi;
        for (int row = 0; row < when->rows; row++)
            if (!cut(p, when, row, &from, &to))
                return 0;
        if (!when->rows)
            continue;
        for (int j = 0; j <= i; j++) { /* from <= t_j + the others <= to */
            const interval least_others = interval_sub(least, interval_of(low[j]));
            const interval most_others = interval_sub(most, interval_of(high[j]));
            const double bottom = fmax(low[j], interval_sub(interval_of(from), most_others).lo);
            const double top = fmin(high[j], interval_sub(interval_of(to), least_others).hi);
            if (bottom > top)
                return 0;
            least = interval_add(least_others, interval_of(bottom));
            most = interval_add(most_others, interval_of(top));
            low[j] = bottom, high[j] = top;
        }
    }
    return 1;
}
