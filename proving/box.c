/* A lower bound of the cost over a box of durations: the dual at multipliers that follow the
 * durations linearly, with its first and second derivatives as intervals. */
#include "box.h"

#include <stdlib.h>
#include <string.h>

/* Boxes whose durations vary by more than these factors: multipliers that are the same all over them
 * are tried too, or are all that is tried. */
#define MOST_ROUNDS 3
/* Every so many boxes a motion is looked for in the middle of one. */
#define OFTEN 16
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

/* A multiplier as function of the durations. */
static void multiplier_jet(const Centre *c, int n, int j, const interval *away, jet *m)
{
    jet_zero(n, m);
    m->v = m->v0 = interval_of(c->m[j]);
    for (int i = 0; i < n; i++) {
        m->g[i] = m->g0[i] = interval_of(c->slope[i][j]);
        m->v = plus(m->v, times(m->g[i], away[i]));
    }
}

/* Add what rows A z + b + b_t t, priced from multiplier ``first`` on, make of the costate and of
 * the value. */
static void add_priced(const Centre *c, int n, const Rows *rows, int first, const interval *away,
                       const jet *time, jet *costate, jet *value)
{
    for (int k = 0; k < rows->rows; k++) {
        jet m, rest;
        multiplier_jet(c, n, first + k, away, &m);
        for (int z = 0; z < rows->columns; z++)
            jet_add_scaled(n, costate + z, rows->A[k * rows->columns + z], &m);
        jet_zero(n, &rest);
        rest.v = rest.v0 = interval_of(rows->b[k]);
        jet_add_scaled(n, &rest, rows->b_t[k], time);
        jet_add_mul(n, value, &m, &rest);
    }
}

/* Subtract what a start within a range makes of its prices, at most reach |price|: by a chord above
 * the absolute value, which is the same in the box and in its centre. */
static void subtract_start(Engine *e, int n, const jet *start, jet *value)
{
    const Problem *p = e->problem;
    for (int z = 0; z < 2 * p->phase[0].r; z++) {
        const double middle = p->start_low[z] + (p->start_high[z] - p->start_low[z]) / 2;
        const double reach =
            fmax(p->start_high[z] - middle, middle - p->start_low[z]) * (1 + 4 * DBL_EPSILON);
        if (!(reach > 0))
            continue;
        const double lo = start[z].v.lo, hi = start[z].v.hi;
        const double slope = lo >= 0 ? 1 : hi <= 0 ? -1 : (hi + lo) / (hi - lo);
        const interval at_lo = interval_sub(interval_of(fabs(lo)), times(interval_of(slope), interval_of(lo)));
        const interval at_hi = interval_sub(interval_of(fabs(hi)), times(interval_of(slope), interval_of(hi)));
        const double offset = lo >= 0 || hi <= 0 ? 0 : at_lo.hi > at_hi.hi ? at_lo.hi : at_hi.hi;
        jet_add_scaled(n, value, -reach * slope, start + z);
        const interval lost = times(interval_of(-reach), interval_of(offset));
        value->v = plus(value->v, lost), value->v0 = plus(value->v0, lost);
    }
}

/* The dual as function of durations in a box, at distances ``away`` from its centre t. */
static void dual_jet(Engine *e, int n, const Steps *const *all, const double *t, const interval *box,
                     const interval *away, jet *value)
{
    const Problem *p = e->problem;
    const Centre *c = &e->centre;
    const int phases = p->phases;
    const interval one = {1, 1};
    static _Thread_local jet costate[MOST_COSTATE], start[MOST_STATE], bent;
    Choice *choices = c->choices;
    jet time;
    jet_zero(n, value);
    jet_zero(n, &time);
    for (int i = 0; i < phases; i++) {
        time.v = plus(time.v, box[i]), time.v0 = plus(time.v0, interval_of(t[i]));
        if (n)
            time.g[i] = time.g0[i] = one;
        choices += p->phase[i].steps * p->phase[i].nb;
    }
    for (int i = phases - 1; i >= 0; i--) {
        const Phase *ph = p->phase + i;
        const Steps *steps = all[i];
        const int s = 2 * ph->r, d = steps->d, last = i == phases - 1;
        const Rows *zero = last ? &p->goal_zero : &p->event[i].zero;
        const Rows *most = last ? &p->goal_most : &p->event[i].most;
        const int first = last ? 0 : c->first_event[i];
        for (int a = 0; a < d; a++)
            jet_zero(n, costate + a);
        if (!last)
            for (int z = 0; z < s; z++)
                for (int k = 0; k < p->event[i].after.rows; k++)
                    jet_add_scaled(n, costate + z, p->event[i].after.A[k * s + z], start + k);
        add_priced(c, n, zero, first, away, &time, costate, value);
        add_priced(c, n, most, first + zero->rows, away, &time, costate, value);
        for (int z = 0; z < s; z++)
            jet_centred(n, costate + z, away);
        for (int k = 0; k < steps->priced; k++)
            multiplier_jet(c, n, c->first_priced + steps->which[k], away, costate + s + k);
        costate[d - 1].v = costate[d - 1].v0 = one;
        choices -= ph->steps * ph->nb;
        interval range[MOST_COSTATE];
        for (int a = 0; a < d; a++)
            range[a] = costate[a].v;
        const Value *v = phase_value(ph, steps, choices, range, e->values + i);
        for (int a = 0; a < d; a++) {
            jet_add_line(n, i, value, v->linear[a], costate + a);
            jet_zero(n, &bent);
            for (int b = 0; b < d; b++)
                jet_add_line(n, i, &bent, line_scaled(v->square[a * d + b], -0.5), costate + b);
            jet_centred(n, &bent, away);
            jet_add_mul(n, value, &bent, costate + a);
        }
        jet_centred(n, value, away);
        for (int z = 0; z < s; z++) {
            jet_zero(n, start + z);
            for (int a = 0; a < d; a++)
                jet_add_line(n, i, start + z, steps->start[z * d + a], costate + a);
            jet_centred(n, start + z, away);
        }
        time.v = interval_sub(time.v, box[i]), time.v0 = interval_sub(time.v0, interval_of(t[i]));
        if (n)
            time.g[i] = time.g0[i] = interval_of(0);
    }
    subtract_start(e, n, start, value);
}


/* Cholesky's factor of a matrix (n, n); 1 where it is not positive definite. */
static int factored(int n, const double *A, double *L)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            double sum = A[i * n + j];
            for (int k = 0; k < j; k++)
                sum -= L[i * n + k] * L[j * n + k];
            if (i == j && !(sum > 0))
                return 1;
            L[i * n + j] = i == j ? sqrt(sum) : sum / L[j * n + j];
        }
    return 0;
}

/* How far a matrix may be from L L^T, which has no negative eigenvalue: a bound of the norm. */
static double remainder_of(int n, const double *A, const double *L)
{
    double most = 0;
    for (int i = 0; i < n; i++) {
        double row = 0;
        for (int j = 0; j < n; j++) {
            interval sum = interval_of(-A[i > j ? i * n + j : j * n + i]);
            for (int k = 0; k <= (i < j ? i : j); k++)
                sum = plus_times(sum, interval_of(L[i * n + k]), interval_of(L[j * n + k]));
            row += interval_mag(sum);
        }
        most = row > most ? row : most;
    }
    return most * (1 + 1e-12);
}

/* Least g.x + x A x/2 for x in a box whose sum lies within a range, roughly: by turns in each
 * direction at a price of the sum, which is found by halving. */
static double roughly_least(int n, const double *A, const double *g, const double *low,
                            const double *high, double least, double most, double *x)
{
    double below = -INFINITY, above = INFINITY, price = 0, reach = 0;
    for (int i = 0; i < n; i++)
        reach = fmax(reach, fabs(g[i]) + fabs(A[i * n + i]) * fmax(-low[i], high[i]));
    for (int i = 0; i < n; i++)
        x[i] = 0;
    for (int round = 0; round < 50; round++) {
        double sum = 0;
        for (int sweep = 0; sweep < 30; sweep++) {
            double moved = 0;
            for (int i = 0; i < n; i++) {
                double slope = g[i] + price, next;
                for (int j = 0; j < n; j++)
                    slope += i == j ? 0 : A[i * n + j] * x[j];
                next = A[i * n + i] > 0 ? -slope / A[i * n + i] : slope > 0 ? low[i] : high[i];
                next = next < low[i] ? low[i] : next > high[i] ? high[i] : next;
                moved = fmax(moved, fabs(next - x[i]) / (high[i] - low[i] + 1e-300));
                x[i] = next;
            }
            if (moved < 1e-9)
                break;
        }
        for (int i = 0; i < n; i++)
            sum += x[i];
        const double slack = 1e-9 * (most - least) + 1e-12 * fabs(most);
        if (sum > most + slack)
            below = price;
        else if (sum < least - slack)
            above = price;
        else if (price == 0 || (price > 0 && sum >= most - slack) || (price < 0 && sum <= least + slack))
            break;
        else if (price > 0)
            above = price;
        else
            below = price;
        if (isinf(below) && isinf(above))
            break;
        if (isinf(below))
            price = fmin(0, above) - 2 * (reach + fabs(above));
        else if (isinf(above))
            price = fmax(0, below) + 2 * (reach + fabs(below));
        else
            price = (below + above) / 2;
    }
    return price;
}

/* Least of a convex function with the value v and slopes g at x, by its tangent there: in a box,
 * with a price of the sum, which lies within a range. */
static double below_tangent(int n, interval v, const interval *g, const double *x, const double *low,
                            const double *high, double least, double most, double price)
{
    interval sum = {0, 0};
    for (int i = 0; i < n; i++) {
        const interval slope = interval_add(g[i], interval_of(price));
        const interval to_low = times(slope, interval_sub(interval_of(low[i]), interval_of(x[i])));
        const interval to_high = times(slope, interval_sub(interval_of(high[i]), interval_of(x[i])));
        v = plus(v, interval_of(fmin(to_low.lo, to_high.lo)));
        sum = plus(sum, interval_of(x[i]));
    }
    if (price != 0) {
        const interval rest = interval_sub(interval_of(price > 0 ? most : least), sum);
        v = interval_sub(v, times(interval_of(price), rest));
    }
    return v.lo;
}

/* Bound by the second derivatives over the box: what is missing to a convex function is taken off,
 * then the tangent of this at its least point is below it. */
static double by_curvature(int n, const jet *box, const double *low,
                           const double *high, double least, double most, double *widths)
{
    double A[MOST_PHASES * MOST_PHASES], L[MOST_PHASES * MOST_PHASES], reach[MOST_PHASES];
    double x[MOST_PHASES], g[MOST_PHASES], size = 0, radius = 0;
    interval lost = {0, 0};
    for (int i = 0; i < n; i++)
        reach[i] = fmax(fmax(-low[i], high[i]), 1e-300);
    for (int i = 0; i < n; i++) {
        double row = 0;
        for (int j = 0; j < n; j++) {
            const interval h = box->H[i < j ? second_at(n, i, j) : second_at(n, j, i)];
            const double mid = interval_mid(h);
            A[i * n + j] = mid;
            row += fmax(h.hi - mid, mid - h.lo) * (1 + 1e-14) * reach[j];
        }
        if (!isfinite(row))
            return -INFINITY;
        widths[i] = row * reach[i];
        A[i * n + i] -= row / reach[i] * (1 + 1e-14);
        size = fmax(size, fabs(A[i * n + i]) * reach[i] * reach[i]);
        radius = fmax(radius, reach[i]);
    }
    /* Where the sum is known, its square says nothing new. */
    const double known = most - least <= 1e-12 * fabs(most) + 1e-15 ? 4 * size / (radius * radius) : 0;
    for (int i = 0; i < n * n; i++)
        A[i] += known;
    double shift = 0;
    for (int round = 0; round < 60; round++) {
        double shifted[MOST_PHASES * MOST_PHASES];
        memcpy(shifted, A, sizeof shifted);
        for (int i = 0; i < n; i++)
            shifted[i * n + i] += shift / (reach[i] * reach[i]);
        if (!factored(n, shifted, L)) {
            memcpy(A, shifted, sizeof shifted);
            break;
        }
        if (round == 59)
            return -INFINITY;
        shift = shift > 0 ? 1.5 * shift : 1e-6 * size + 1e-300;
    }
    /* shift x^2/(2 reach^2) was added to each, at most shift/2 */
    lost = plus(lost, times(interval_of(n * shift / 2), interval_of(1 + 1e-12)));
    double rest = remainder_of(n, A, L), far = 0;
    for (int i = 0; i < n; i++) /* what rounding took away when A was made */
        rest += 8 * DBL_EPSILON * (fabs(A[i * n + i]) + widths[i] / (reach[i] * reach[i]) + known);
    for (int i = 0; i < n; i++) {
        far += (high[i] - low[i]) * (high[i] - low[i]) * (1 + 1e-12);
        g[i] = interval_mid(box->g0[i]);
    }
    lost = plus(lost, times(interval_of(rest / 2), interval_of(far)));
    if (known > 0) {
        const double most_sum = fmax(fabs(least), fabs(most));
        lost = plus(lost, times(interval_of(known / 2), interval_sqr(interval_of(most_sum))));
    }
    const double price = roughly_least(n, A, g, low, high, least, most, x);
    interval v = box->v0, slope[MOST_PHASES];
    for (int i = 0; i < n; i++) {
        interval row = {0, 0};
        for (int j = 0; j < n; j++)
            row = plus_times(row, interval_of(i >= j ? A[i * n + j] : A[j * n + i]), interval_of(x[j]));
        slope[i] = plus(box->g0[i], row);
        v = plus(v, times(interval_of(x[i]), plus(box->g0[i], scaled(row, 0.5))));
    }
    v = interval_sub(v, lost);
    return below_tangent(n, v, slope, x, low, high, least, most, price);
}

/* Bound by the slopes over the box, from its centre. */
static double by_slopes(int n, const jet *box, const double *low,
                        const double *high, double least, double most)
{
    double bound = -INFINITY, mean = 0;
    for (int i = 0; i < n; i++)
        mean -= interval_mid(box->g0[i]) / n;
    for (int priced = 0; priced < 2; priced++) {
        interval v = box->v0;
        const double price = priced ? mean : 0;
        for (int i = 0; i < n; i++) {
            const interval slope = interval_add(box->g[i], interval_of(price));
            const interval away = {low[i], high[i]};
            v = plus(v, interval_of(times(slope, away).lo));
        }
        if (price != 0)
            v = interval_sub(v, times(interval_of(price), interval_of(price > 0 ? most : least)));
        bound = v.lo > bound ? v.lo : bound;
    }
    return bound;
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
    if (e->boxes++ % OFTEN == 0)
        meet(e, t, multipliers);
    for (int i = 0; i < n; i++) {
        ratio = fmax(ratio, high[i] / low[i]);
        widths[i] = 0;
    }
    if (ratio > NARROW) {
        double others[MOST_MULTIPLIERS];
        memcpy(others, multipliers, sizeof others);
        bound = by_longest(e, low, high, enough, others);
        if (ratio > WIDE || bound >= enough)
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
    const double bounds[] = {
        box.v.lo, by_slopes(n, &box, below, above, least, most),
        by_curvature(n, &box, below, above, least, most, widths),
    };
    for (int i = 0; i < 3; i++)
        bound = bounds[i] > bound ? bounds[i] : bound;
    return bound;
}
