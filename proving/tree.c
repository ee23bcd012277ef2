/* Branch and bound over boxes of durations, the box with the least bound first. */
#include "tree.h"

#include <stdlib.h>
#include <string.h>

int tree_push(Tree *t, const double *box)
{
    const size_t w = t->width;
    if (t->count == t->room) {
        const size_t room = t->room ? 2 * t->room : 256;
        double *more = realloc(t->waiting, room * w * sizeof(double));
        if (!more)
            return 1;
        t->waiting = more, t->room = room;
    }
    size_t i = t->count++;
    while (i && t->waiting[(i - 1) / 2 * w] > box[0]) {
        memcpy(t->waiting + i * w, t->waiting + (i - 1) / 2 * w, w * sizeof(double));
        i = (i - 1) / 2;
    }
    memcpy(t->waiting + i * w, box, w * sizeof(double));
    return 0;
}

static void pop(Tree *t, double *box)
{
    const size_t w = t->width;
    memcpy(box, t->waiting, w * sizeof(double));
    const double *last = t->waiting + --t->count * w;
    size_t i = 0;
    for (size_t child; (child = 2 * i + 1) < t->count; i = child) {
        if (child + 1 < t->count && t->waiting[(child + 1) * w] < t->waiting[child * w])
            child++;
        if (last[0] <= t->waiting[child * w])
            break;
        memcpy(t->waiting + i * w, t->waiting + child * w, w * sizeof(double));
    }
    memmove(t->waiting + i * w, last, w * sizeof(double));
}

/* A cost below which nothing is of interest any more. */
static double aim(const Tree *t)
{
    const double best = t->engine.best;
    return isinf(best) ? t->limit : best - fmax(t->gap * fabs(best), t->least_gap);
}

/* The duration by which a box is divided: what loses most of the bound, or, where that is not known,
 * the one that is widest beside its own size. */
static int worst(const Problem *p, const double *low, const double *high, const double *widths)
{
    int at = 0, known = 0;
    double most = 0;
    for (int i = 0; i < p->phases; i++)
        known |= isfinite(widths[i]) && widths[i] > 0;
    for (int i = 0; i < p->phases; i++) {
        const double width = known ? widths[i] : log(high[i] / low[i]);
        if (width > most)
            most = width, at = i;
    }
    return at;
}

/* What the time alone costs at least, where inputs cost nothing less than that. */
static double cost_of_time(const Problem *p, const double *low)
{
    interval sum = {0, 0};
    for (int i = 0; i < p->phases; i++) {
        const Phase *ph = p->phase + i;
        for (int j = 0; j < ph->nb; j++)
            if (ph->c[j] != 0)
                return -INFINITY;
        if (ph->c_0 < 0)
            return -INFINITY;
        sum = plus_times(sum, interval_of(ph->c_0), interval_of(low[i]));
    }
    const interval all = times(interval_of(p->phase[0].c_0), interval_of(p->earliest));
    return all.lo > sum.lo ? all.lo : sum.lo;
}

/* Be done with a box. */
static void leave(Tree *t, const double *box)
{
    const size_t w = 1 + 2 * (size_t)t->engine.problem->phases;
    t->shed = box[0] < t->shed ? box[0] : t->shed;
    if (t->left < t->keep)
        memcpy(t->leaves + t->left * w, box, w * sizeof(double));
    t->left++;
}

/* Look at a box whose bound is that of a larger one, and keep it if it is of interest. */
static int look(Tree *t, double *box)
{
    const Problem *p = t->engine.problem;
    double *low = box + 1, *high = low + p->phases, widths[MOST_PHASES];
    const double best = t->engine.best, now = aim(t);
    const double enough = isinf(best) ? 2 * fabs(t->limit) + t->limit : now + fabs(now);
    t->engine.aim = now;
    double *m = box + 1 + 2 * p->phases;
    const double bound = box_bound(&t->engine, low, high, enough, m, widths);
    if (bound > box[0])
        box[0] = bound;
    const double idle = cost_of_time(p, low);
    if (idle > box[0])
        box[0] = idle;
    box[t->width - 1] = worst(p, low, high, widths);
    if (box[0] >= aim(t)) {
        leave(t, box);
        return 0;
    }
    return tree_push(t, box);
}

int tree_begin(Tree *t, const Problem *p, double best, double limit, double gap, double least_gap,
               size_t keep)
{
    memset(t, 0, sizeof *t);
    if (engine_begin(&t->engine, p))
        return 1;
    t->leaves = keep ? malloc(keep * (1 + 2 * (size_t)p->phases) * sizeof(double)) : 0;
    if (keep && !t->leaves)
        return 1;
    t->keep = keep;
    t->limit = limit, t->gap = gap, t->least_gap = least_gap, t->shed = INFINITY;
    t->engine.best = best;
    t->width = 2 + 2 * p->phases + MOST_MULTIPLIERS;
    double *box = calloc(t->width, sizeof(double));
    if (!box)
        return 1;
    box[0] = -INFINITY;
    double least = 0, most = 0;
    for (int i = 0; i < p->phases; i++)
        least += p->shortest[i], most += p->longest[i];
    for (int i = 0; i < p->phases; i++) {
        const double slack = 4 * p->phases * DBL_EPSILON * most;
        const double low = p->earliest - (most - p->longest[i]) - slack;
        const double high = p->latest - (least - p->shortest[i]) + slack;
        box[1 + i] = fmax(p->shortest[i], low);
        box[1 + p->phases + i] = fmin(p->longest[i], high);
    }
    const int failed = look(t, box);
    free(box);
    return failed;
}

void tree_end(Tree *t)
{
    free(t->waiting);
    free(t->leaves);
    engine_end(&t->engine);
    t->waiting = t->leaves = 0;
}

int tree_run(Tree *t, long boxes)
{
    const Problem *p = t->engine.problem;
    const long until = t->engine.boxes + boxes;
    double *box = malloc(2 * t->width * sizeof(double)), *half = box + t->width;
    if (!box)
        return NO_MEMORY;
    int failed = 0;
    while (!failed && t->count && t->engine.boxes < until && t->waiting[0] < aim(t)) {
        pop(t, box);
        double *low = box + 1, *high = low + p->phases;
        const int i = (int)box[t->width - 1];
        const double middle = sqrt(low[i]) * sqrt(high[i]);
        if (!(low[i] < middle && middle < high[i])) { /* nothing is left to divide */
            leave(t, box);
            continue;
        }
        memcpy(half, box, t->width * sizeof(double));
        high[i] = middle;
        half[1 + i] = middle;
        failed = look(t, box) || look(t, half);
    }
    free(box);
    return failed ? NO_MEMORY : t->count && t->waiting[0] < aim(t) ? GOING_ON : PROVED;
}

double tree_bound(const Tree *t)
{
    const double waiting = t->count ? t->waiting[0] : INFINITY;
    return waiting < t->shed ? waiting : t->shed;
}
