/* The dual over a box at multipliers that are given, for test_dual_in_c.py. */
#include <string.h>

#include "convex.h"
#include "dual.h"

/* ``to`` becomes the polynomial in distances from the middle, in units of the largest ones: its
 * coefficients (of two durations, 10), its rest; what it is at least, by itself and by its curvature where
 * the sum of durations is within a range; the same at multipliers that do not follow the durations; and
 * the dual at the middle as floating point has it. */
int dual_of_a_box(const Problem *p, int count, const Priced *priced, const double *low,
                  const double *high, const double *m, const double *slope, const double *sum, double *to)
{
    static Engine e;
    const Steps *steps[MOST_PHASES];
    interval wide[MOST_PHASES];
    double t[MOST_PHASES], below[MOST_PHASES], above[MOST_PHASES], widths[MOST_PHASES], middle = 0;
    if (engine_begin(&e, p, 1))
        return 1;
    Centre *c = &e.centre;
    e.cache.count = count;
    memcpy(e.cache.priced, priced, sizeof(Priced) * (size_t)count);
    int failed = centre_number(p, count, e.cache.priced, c);
    for (int i = 0; i < p->phases && !failed; i++) {
        t[i] = low[i] + (high[i] - low[i]) / 2;
        wide[i] = (interval){low[i], high[i]};
        failed = !(steps[i] = cache_steps(&e.cache, i, low[i], high[i]));
        e.frame.most[i] = failed ? 0 : steps[i]->most;
        below[i] = low[i] - t[i], above[i] = high[i] - t[i];
        middle += t[i];
        memcpy(c->slope[i], slope + i * c->multipliers, sizeof(double) * (size_t)c->multipliers);
    }
    if (!failed) {
        memcpy(c->m, m, sizeof(double) * (size_t)c->multipliers);
        point_begin(p, c, t, steps, &c->at);
        centre_choose(p, c);
        const Range range = {below, above, sum[0] - middle, sum[1] - middle};
        const model *value = &e.dual.value;
        dual_model(&e, &e.frame, steps, t, 0);
        memcpy(to, value->c, sizeof(double) * (size_t)e.frame.terms);
        to[10] = value->rest;
        to[11] = model_range(value).lo;
        to[12] = by_curvature(&e.frame, value, &range, widths);
        centre_choose(p, c);
        dual_model(&e, &e.point, steps, t, wide);
        to[13] = model_range(value).lo;
        to[14] = point_dual(p, c, &c->at, c->m, 0, 0);
    }
    engine_end(&e);
    return failed;
}

/* What a polynomial of two durations, whose distances from the centre are at most ``far``, is at least by
 * its curvature where their sum is within a range. */
double least_by_curvature(const double *far, const double *c, double rest, const double *sum)
{
    Frame f;
    model m;
    double below[2], above[2], widths[2];
    frame_begin(2, &f);
    memcpy(m.c, c, sizeof(double) * (size_t)f.terms);
    m.rest = rest;
    model_settle(&f, &m);
    for (int i = 0; i < 2; i++)
        f.most[i] = above[i] = far[i], below[i] = -far[i];
    return by_curvature(&f, &m, &(Range){below, above, sum[0], sum[1]}, widths);
}

/* What a phase makes of costates within ranges (d, 2) for choices of its inputs: ``linear`` (d,) and
 * ``square`` (d, d); and without inputs (d,), and what these add, (steps, inputs, d). */
int phase_of_costates(const Phase *p, double duration, const double *begin, const unsigned char *kinds,
                      const interval *costate, double *linear, double *square, double *without,
                      double *response)
{
    static line memory[10000], own[2000];
    const int d = 2 * p->r + 1;
    Steps steps;
    Choice choices[64] = {{0}};
    Value value = {own, own + d, (curve *)(own + d + d * d)};
    steps_place(&steps, p, d, memory);
    if (phase_steps(p, 0, duration, (interval){duration, duration}, 0, 0, begin, &steps))
        return 1;
    for (int k = 0; k < p->steps * p->nb; k++)
        choices[k].kind = kinds[k];
    const Value *of = phase_value(p, &steps, choices, costate, &value);
    for (int a = 0; a < d; a++) {
        linear[a] = interval_mid(of->linear[a].v);
        without[a] = interval_mid(steps.without.linear[a].v);
        for (int b = 0; b < d; b++)
            square[a * d + b] = interval_mid(of->square[a * d + b].v);
    }
    for (int k = 0; k < p->steps * p->nb * d; k++)
        response[k] = interval_mid(steps.response[k].v);
    return 0;
}
