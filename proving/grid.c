/* See grid.h: a range of a duration is divided into cells of equal ratios. A part of it begins and
 * ends at multiples of a power of two of them, of which it has no more than twice FINE. */
#include "grid.h"

#include <math.h>

#define CELLS 1073741824.
#define FINE 4

/* The number of a cell that begins at a duration, and that duration. */
static double number_of(const Grid *g, int i, double t)
{
    return log(t / g->low[i]) / log(g->high[i] / g->low[i]) * CELLS;
}

static double place_of(const Grid *g, int i, double number)
{
    return g->low[i] * pow(g->high[i] / g->low[i], number / CELLS);
}

/* Cells between neighbouring places where a part may begin and end. */
static double spacing(double cells) { return exp2(floor(log2(fmax(cells, 1) / FINE))); }

double grid_middle(const Grid *g, int i, double low, double high)
{
    const double a = number_of(g, i, low), b = number_of(g, i, high), apart = spacing(b - a);
    const double middle = place_of(g, i, round((a + b) / 2 / apart) * apart);
    if (low < middle && middle < high)
        return middle;
    const double between = sqrt(low) * sqrt(high);
    return low < between && between < high ? between : low;
}

void grid_contract(const Grid *g, const Problem *p, double *low, double *high)
{
    const int n = p->phases;
    double least = 0, most = 0;
    for (int i = 0; i < n; i++)
        least += low[i], most += high[i];
    const double slack = 8 * n * DBL_EPSILON * most;
    for (int i = 0; i < 2 * n; i++) {
        const int k = i % n;
        const double top = p->latest - (least - low[k]) + slack;
        const double bottom = p->earliest - (most - high[k]) - slack;
        if (top >= high[k] && bottom <= low[k])
            continue;
        const double a = number_of(g, k, low[k]), b = number_of(g, k, high[k]), apart = spacing(b - a);
        if (top > low[k]) {
            const double cut = place_of(g, k, ceil(number_of(g, k, top) / apart) * apart);
            if (top <= cut && low[k] < cut && cut < high[k]) {
                most -= high[k] - cut;
                high[k] = cut;
            }
        }
        if (bottom < high[k]) {
            const double cut = place_of(g, k, floor(number_of(g, k, bottom) / apart) * apart);
            if (cut <= bottom && low[k] < cut && cut < high[k]) {
                least += cut - low[k];
                low[k] = cut;
            }
        }
    }
}
