/* Branch and bound over boxes of durations, those with the least bounds first. */
#include "tree.h"
#include "times.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

/* Boxes of a batch, whatever the number of threads is. */
#define MOST_TAKEN 64
/* Of the widest duration of a box, beside its own size, so much has one by which it is divided. */
#define NARROWEST 0.45
/* Where a box has the least bound of all though no duration varies by this share, which costs its
 * square, prices are what it lacks. */
#define STUCK 1e-3

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
    const double near = t->best - fmax(t->gap * fabs(t->best), t->least_gap);
    return isinf(t->best) ? t->limit : fmin(t->limit, near);
}

/* The duration by which a box is divided: what loses most of the bound, or, where that is not known,
 * the one that is widest beside its own size. */
static int worst(const Problem *p, const double *low, const double *high, const double *widths)
{
    int at = 0, known = 1;
    double most = 0, widest = 0;
    for (int i = 0; i < p->phases; i++) {
        known &= isfinite(widths[i]);
        if (log(high[i] / low[i]) > widest)
            widest = log(high[i] / low[i]), at = i;
    }
    for (int i = 0; i < p->phases && known; i++)
        if (widths[i] > most && log(high[i] / low[i]) > NARROWEST * widest)
            most = widths[i], at = i;
    return at;
}

/* What the time alone costs at least, where inputs cost nothing less than that. */
static double cost_of_time(const Problem *p, const double *low)
{
    interval sum = {0, 0};
    if (p->goal_cost.rows)
        return -INFINITY;
    for (int i = 0; i < p->phases; i++) {
        const Phase *ph = p->phase + i;
        for (int j = 0; j < ph->nb; j++)
            if (ph->c[j] != 0)
                return -INFINITY;
        if (ph->c_0 < 0 || ph->cost >= 0)
            return -INFINITY;
        sum = plus_times(sum, interval_of(ph->c_0), interval_of(low[i]));
    }
    const interval all = times(interval_of(p->phase[0].c_0), interval_of(p->earliest));
    return all.lo > sum.lo ? all.lo : sum.lo;
}

/* Be done with a box. */
static void leave(Tree *t, const double *box)
{
    const size_t w = 1 + 2 * (size_t)t->problem->phases;
    t->shed = box[0] < t->shed ? box[0] : t->shed;
    if (t->left < t->keep)
        memcpy(t->leaves + t->left * w, box, w * sizeof(double));
    t->left++;
}

/* Look at a box of the batch, whose bound is that of a larger one. */
static void look(const Tree *t, Engine *e, size_t k)
{
    const Problem *p = t->problem;
    double *box = t->batch + k * t->width, *low = box + 1, *high = low + p->phases;
    double widths[MOST_PHASES];
    const double now = aim(t);
    const double enough = isinf(t->best) ? 2 * fabs(t->limit) + t->limit : now + fabs(now);
    e->aim = now, e->best = t->best, e->number = t->boxes + (long)k;
    memcpy(e->at, t->at, sizeof e->at);
    memcpy(e->cache.priced, t->priced, sizeof t->priced);
    e->cache.count = t->count_priced;
    const double bound = box_bound(e, low, high, enough, high + p->phases, widths);
    box[0] = fmax(box[0], fmax(bound, cost_of_time(p, low)));
    box[t->width - 1] = worst(p, low, high, widths);
    Told *told = t->told + k;
    told->best = e->best;
    memcpy(told->at, e->at, sizeof told->at);
    told->added = e->cache.count - t->count_priced;
    memcpy(told->priced, e->cache.priced + t->count_priced, sizeof(Priced) * (size_t)told->added);
}

typedef struct {
    Tree *tree;
    Engine *engine;
} Worker;

static void *work(void *of)
{
    const Worker *w = of;
    for (size_t k; (k = atomic_fetch_add(&w->tree->next, 1)) < w->tree->taken;)
        look(w->tree, w->engine, k);
    return 0;
}

/* Look at all boxes of the batch; threads that cannot be had leave them to the others. */
static void look_at_all(Tree *t)
{
    pthread_t threads[MOST_THREADS];
    Worker workers[MOST_THREADS];
    int made = 0;
    atomic_store(&t->next, 0);
    for (int i = 0; i < t->workers; i++)
        workers[i] = (Worker){t, t->engines + i};
    while (made + 1 < t->workers && (size_t)made + 1 < t->taken &&
           !pthread_create(threads + made, 0, work, workers + made + 1))
        made++;
    work(workers);
    for (int i = 0; i < made; i++)
        pthread_join(threads[i], 0);
}

/* Whether no more conditions along the phases can have prices. */
static int is_full(const Tree *t)
{
    return t->count_priced == MOST_PRICED || t->fixed + t->count_priced == MOST_MULTIPLIERS;
}

static int going_on(const Tree *t) { return t->count && t->waiting[0] < aim(t); }

int tree_has_missed(const Tree *t) { return t->shed < aim(t); }

int tree_is_stuck(const Tree *t)
{
    if (!is_full(t) || tree_has_missed(t))
        return is_full(t);
    if (!going_on(t))
        return 0;
    const double *low = t->waiting + 1, *high = low + t->problem->phases;
    for (int i = 0; i < t->problem->phases; i++)
        if (log(high[i] / low[i]) > STUCK)
            return 0;
    return 1;
}

/* The number of a condition that is priced from now on; -1 where there is no room. */
static int number_of(Tree *t, Priced at)
{
    for (int i = 0; i < t->count_priced; i++)
        if (!memcmp(t->priced + i, &at, sizeof at))
            return i;
    if (is_full(t))
        return -1;
    t->priced[t->count_priced] = at;
    return t->count_priced++;
}

/* Keep what the boxes of a batch have told, in their order, and those that are of interest. */
static int keep_batch(Tree *t)
{
    const int before = t->count_priced;
    int failed = 0;
    t->boxes += (long)t->taken;
    for (size_t k = 0; k < t->taken; k++) {
        const Told *told = t->told + k;
        if (told->best < t->best) {
            t->best = told->best;
            memcpy(t->at, told->at, sizeof t->at);
        }
        double *own = t->batch + k * t->width + 1 + 2 * t->problem->phases + t->fixed + before;
        double price[MOST_PRICED];
        memcpy(price, own, sizeof(double) * (size_t)told->added);
        memset(own, 0, sizeof(double) * (size_t)(MOST_MULTIPLIERS - t->fixed - before));
        for (int i = 0; i < told->added; i++) {
            const int at = number_of(t, told->priced[i]);
            if (at >= 0)
                own[at - before] = price[i];
        }
    }
    for (size_t k = 0; k < t->taken && !failed; k++) {
        const double *box = t->batch + k * t->width;
        if (box[0] >= aim(t))
            leave(t, box);
        else
            failed = tree_push(t, box);
    }
    t->taken = 0;
    return failed;
}

/* Add what has time of a box to the batch, whose place it may have; be done with it where no time is
 * left for it. */
static void add(Tree *t, double *box)
{
    const int n = t->problem->phases;
    grid_contract(&t->grid, t->problem, box + 1, box + 1 + n);
    if (times_contract(t->problem, box + 1, box + 1 + n) && box_has_time(t->problem, box + 1, box + 1 + n)) {
        memmove(t->batch + t->taken++ * t->width, box, t->width * sizeof(double));
    } else {
        box[0] = INFINITY;
        leave(t, box);
    }
}

static int begin_memory(Tree *t, const Problem *p, int workers, size_t keep)
{
    t->width = 2 + 2 * (size_t)p->phases + MOST_MULTIPLIERS;
    t->engines = calloc((size_t)workers, sizeof *t->engines);
    t->batch = calloc(MOST_TAKEN, t->width * sizeof(double));
    t->told = calloc(MOST_TAKEN, sizeof *t->told);
    t->leaves = keep ? malloc(keep * (1 + 2 * (size_t)p->phases) * sizeof(double)) : 0;
    if (!t->engines || !t->batch || !t->told || (keep && !t->leaves))
        return 1;
    for (; t->workers < workers; t->workers++)
        if (engine_begin(t->engines + t->workers, p, workers)) {
            engine_end(t->engines + t->workers);
            return 1;
        }
    return 0;
}

/* Price what is to vanish in all steps. */
static void price_definitions(Tree *t)
{
    const Problem *p = t->problem;
    for (int i = 0; i < p->phases; i++)
        for (int j = 0; j < p->phase[i].conditions; j++) {
            const double *of = p->phase[i].condition + 5 * j;
            for (int k = (int)of[2]; k <= of[3] && of[4] == VANISHES; k++)
                t->priced[t->count_priced++] = (Priced){i, k, IN_STEP, j};
        }
}

int tree_begin(Tree *t, const Problem *p, int workers, double best, double limit, double gap,
               double least_gap, size_t keep)
{
    memset(t, 0, sizeof *t);
    t->problem = p;
    t->best = best, t->limit = limit, t->gap = gap, t->least_gap = least_gap;
    t->shed = INFINITY, t->keep = keep;
    workers = workers < 1 ? 1 : workers > MOST_THREADS ? MOST_THREADS : workers;
    if (begin_memory(t, p, workers, keep))
        return 1;
    t->fixed = p->goal_zero.rows + p->goal_most.rows;
    for (int i = 0; i + 1 < p->phases; i++)
        t->fixed += p->event[i].zero.rows + p->event[i].most.rows;
    price_definitions(t);
    double *box = t->batch, least = 0, most = 0;
    box[0] = -INFINITY;
    for (int i = 0; i < p->phases; i++)
        least += p->shortest[i], most += p->longest[i];
    for (int i = 0; i < p->phases; i++) {
        const double slack = 4 * p->phases * DBL_EPSILON * most;
        const double low = p->earliest - (most - p->longest[i]) - slack;
        const double high = p->latest - (least - p->shortest[i]) + slack;
        box[1 + i] = t->grid.low[i] = fmax(p->shortest[i], low);
        box[1 + p->phases + i] = t->grid.high[i] = fmin(p->longest[i], high);
    }
    add(t, box);
    look_at_all(t);
    return keep_batch(t);
}

void tree_end(Tree *t)
{
    for (int i = 0; i < t->workers; i++)
        engine_end(t->engines + i);
    free(t->engines), free(t->batch), free(t->told);
    free(t->waiting), free(t->leaves);
    memset(t, 0, sizeof *t);
}

/* Take boxes and divide them. */
static void take(Tree *t)
{
    while (t->taken + 2 <= MOST_TAKEN && going_on(t)) {
        double *box = t->batch + t->taken * t->width, *half = box + t->width;
        pop(t, box);
        double *low = box + 1, *high = low + t->problem->phases;
        const int i = (int)box[t->width - 1];
        const double middle = grid_middle(&t->grid, i, low[i], high[i]);
        if (middle == low[i]) { /* nothing is left to divide */
            leave(t, box);
            continue;
        }
        memcpy(half, box, t->width * sizeof(double));
        half[1 + i] = middle;
        high[i] = middle;
        add(t, box);
        add(t, half);
    }
}

int tree_run(Tree *t, long boxes)
{
    const long until = t->boxes + boxes;
    while (going_on(t) && t->boxes < until) {
        take(t);
        look_at_all(t);
        if (keep_batch(t))
            return NO_MEMORY;
    }
    return going_on(t) ? GOING_ON : PROVED;
}

double tree_bound(const Tree *t)
{
    const double waiting = t->count ? t->waiting[0] : INFINITY;
    return waiting < t->shed ? waiting : t->shed;
}
