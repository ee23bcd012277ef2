/* See dual.h. */
#include "dual.h"

void multiplier_model(const Centre *c, const Frame *f, int j, model *m)
{
    double sum = 0;
    model_zero(f, m);
    m->c[0] = c->m[j];
    for (int i = 0; i < f->n; i++) {
        m->c[1 + i] = c->slope[i][j] * f->most[i];
        sum += fabs(m->c[1 + i]);
    }
    m->size[0] = fabs(m->c[0]), m->size[1] = upward(sum);
}

/* The time at a share of a phase, (share 1: at its end), and its distance from that at the centre, in
 * units of the largest one, with its powers. */
static void clock_at(const Frame *f, int phase, interval share, const double *t, const interval *box,
                     Clock *clock)
{
    interval centre = {0, 0}, range = {0, 0};
    double reach = 0;
    for (int i = 0; i <= phase; i++) {
        const interval part = i < phase ? interval_of(1) : share;
        const interval own = f->n ? (interval){-f->most[i], f->most[i]} : interval_sub(box[i], interval_of(t[i]));
        centre = plus_times(centre, part, interval_of(t[i]));
        range = plus_times(range, part, own);
    }
    clock->centre = centre, clock->range = plus(centre, range);
    clock->reach = reach = interval_mag(range);
    for (int d = 1; d <= DEGREE && f->n; d++)
        model_zero(f, clock->power + d);
    for (int i = 0; i <= phase && f->n && reach > 0; i++)
        clock->power[1].c[1 + i] = (i < phase ? 1 : interval_mid(share)) * f->most[i] / reach;
    for (int d = 1; d <= DEGREE && f->n; d++) {
        if (d > 1)
            model_add_mul(f, 1, clock->power + 1, clock->power + d - 1, clock->power + d);
        model_settle(f, clock->power + d);
        model_round(1, clock->power + d);
    }
}

/* A function of the time as one of all durations. */
static void model_of_shift(const Frame *f, const Clock *clock, line shift, model *m)
{
    if (!f->n) {
        model_constant(f, shift.v, m);
        return;
    }
    const curve at = curve_of(shift, clock->reach);
    model_zero(f, m);
    m->c[0] = at.c[0], m->size[0] = fabs(at.c[0]);
    for (int d = 1; d <= DEGREE; d++)
        model_add_scaled(f, at.c[d], clock->power + d, m);
    m->rest = upward(m->rest + at.rest);
    model_settle(f, m);
}

/* The prices of rows that have no multipliers: those of the state after an event, and 1. */
enum { OF_STATE = -1, OF_COST = -2 };

/* Add what shifts of the rows of an event make of the value, beside multipliers from number ``first``
 * on or other prices. */
static void add_shifts(const Problem *p, const Centre *c, const Frame *f, const Rows *rows, int first,
                       const line *shifts, Dual *dual)
{
    const int count = p->shifts.shifts;
    for (int k = 0; k < rows->rows; k++)
        for (int j = 0; j < count; j++) {
            const double share = rows->shifted[k * count + j];
            if (share == 0)
                continue;
            if (first >= 0)
                multiplier_model(c, f, first + k, &dual->price);
            else if (first == OF_COST)
                model_constant(f, interval_of(1), &dual->price);
            model_of_shift(f, &dual->clock, shifts[j], &dual->bent);
            model_add_mul(f, share, first == OF_STATE ? dual->start + k : &dual->price, &dual->bent, &dual->value);
        }
}

/* Add what shifts at the event after a phase make of the value. */
static void add_moved(const Problem *p, const Centre *c, const Frame *f, int phase, const double *t,
                      const interval *box, Dual *dual)
{
    const int last = phase == p->phases - 1;
    const Rows *zero = last ? &p->goal_zero : &p->event[phase].zero;
    const Rows *most = last ? &p->goal_most : &p->event[phase].most;
    const int first = last ? 0 : c->first_event[phase];
    line shifts[MOST_SHIFTS];
    if (!p->shifts.shifts)
        return;
    clock_at(f, phase, interval_of(1), t, box, &dual->clock);
    shifts_over(&p->shifts, dual->clock.centre, dual->clock.range, shifts);
    add_shifts(p, c, f, zero, first, shifts, dual);
    add_shifts(p, c, f, most, first + zero->rows, shifts, dual);
    if (last)
        add_shifts(p, c, f, &p->goal_cost, OF_COST, shifts, dual);
    else
        add_shifts(p, c, f, &p->event[phase].after, OF_STATE, shifts, dual);
}

/* Add what shifts of the conditions along a phase make of the value. */
static void add_along(const Engine *e, const Frame *f, int phase, const Steps *steps, const double *t,
                      const interval *box, Dual *dual)
{
    const Problem *p = e->problem;
    const Phase *ph = p->phase + phase;
    const int count = p->shifts.shifts;
    line shifts[MOST_SHIFTS];
    for (int k = 0; k < steps->priced; k++) {
        const Priced *at = e->cache.priced + steps->which[k];
        const double *moves = moves_of(ph, count, at);
        int any = 0;
        for (int j = 0; j < count && moves; j++)
            any |= moves[j] != 0;
        if (!any)
            continue;
        const interval passed = plus(interval_of(at->node), interval_of(at->inside < 0 ? 0 : ph->place[1 + at->inside]));
        clock_at(f, phase, interval_div(passed, interval_of(ph->steps)), t, box, &dual->clock);
        shifts_over(&p->shifts, dual->clock.centre, dual->clock.range, shifts);
        multiplier_model(&e->centre, f, e->centre.first_priced + steps->which[k], &dual->price);
        for (int j = 0; j < count; j++)
            if (moves[j] != 0) {
                model_of_shift(f, &dual->clock, shifts[j], &dual->bent);
                model_add_mul(f, moves[j], &dual->price, &dual->bent, &dual->value);
            }
    }
}

/* Add what shifts of what is closed along a phase make of the value, from its costates. */
static void add_driven(const Problem *p, const Frame *f, int phase, const Steps *steps, const double *t,
                       const interval *box, Dual *dual)
{
    const Phase *ph = p->phase + phase;
    const int d = steps->d, last = ph->nodes - 1;
    line shifts[MOST_SHIFTS];
    for (int node = 0; node < nodes_of(ph) && ph->given; node++) {
        const interval passed = plus(interval_of(node / last), interval_of(ph->place[node % last]));
        clock_at(f, phase, interval_div(passed, interval_of(ph->steps)), t, box, &dual->clock);
        shifts_over(&p->shifts, dual->clock.centre, dual->clock.range, shifts);
        for (int g = 0; g < ph->given; g++) {
            const int first = (node * ph->given + g) * d;
            int any = 0;
            model_zero(f, &dual->price);
            for (int a = 0; a < d; a++) {
                if (line_is_zero(steps->moved[first + a]))
                    continue;
                const curve at = f->n ? steps->moved_curves[first + a] : curve_over(steps->moved[first + a]);
                model_add_curve(f, 1, phase, &at, dual->costate + a, &dual->price);
                any = 1;
            }
            if (!any)
                continue;
            model_settle(f, &dual->price);
            model_of_shift(f, &dual->clock, shifts[(int)ph->drives[g]], &dual->bent);
            model_add_mul(f, 1, &dual->price, &dual->bent, &dual->value);
        }
    }
}

/* Add what the end costs beside to its prices and to the value. */
static void add_end(const Problem *p, const Frame *f, Dual *dual)
{
    const Rows *cost = &p->goal_cost;
    for (int z = 0; z < cost->columns && cost->rows; z++) {
        model_constant(f, interval_of(cost->A[z]), &dual->price);
        model_add_scaled(f, 1, &dual->price, dual->costate + z);
    }
    if (cost->rows) {
        model_constant(f, interval_of(cost->b[0]), &dual->price);
        model_add_scaled(f, 1, &dual->price, &dual->value);
    }
}

/* Add what rows A z + b, priced from multiplier ``first`` on, make of the costate and of the value. */
static void add_priced(const Centre *c, const Frame *f, const Rows *rows, int first, Dual *dual)
{
    model *m = &dual->price;
    for (int k = 0; k < rows->rows; k++) {
        multiplier_model(c, f, first + k, m);
        for (int z = 0; z < rows->columns; z++)
            model_add_scaled(f, rows->A[k * rows->columns + z], m, dual->costate + z);
        model_add_scaled(f, rows->b[k], m, &dual->value);
    }
}

/* Add what ties of both ends make of the prices of the start, (2 r,). */
static void add_ties(const Problem *p, const Centre *c, const Frame *f, Dual *dual)
{
    const int s = 2 * p->phase[0].r;
    for (int k = 0; k < p->goal_zero.rows + p->goal_most.rows; k++) {
        multiplier_model(c, f, k, &dual->price);
        for (int z = 0; z < s; z++)
            model_add_scaled(f, p->tie[k * s + z], &dual->price, dual->start + z);
    }
}

/* Subtract what prices of squares at the end make of the value. */
static void subtract_squares(const Problem *p, const Centre *c, const Frame *f, Dual *dual)
{
    for (int k = 0; k < p->goal_zero.rows; k++)
        if (p->soft[k] > 0) {
            multiplier_model(c, f, k, &dual->price);
            model_add_mul(f, -p->soft[k] / 2, &dual->price, &dual->price, &dual->value);
        }
}

/* Subtract what a start within a range makes of its prices, at most |price| of each spread: by a
 * chord above the absolute value, which is the same in the box and in its centre. */
static void subtract_start(const Problem *p, const Frame *f, Dual *dual)
{
    const int s = 2 * p->phase[0].r;
    model *price = &dual->price;
    for (int k = 0; k < p->spreads; k++) {
        model_zero(f, price);
        for (int z = 0; z < s; z++)
            model_add_scaled(f, p->spread[k * s + z] * (1 + 4 * DBL_EPSILON), dual->start + z, price);
        model_settle(f, price);
        const interval range = model_range(price);
        const double lo = range.lo, hi = range.hi;
        const double slope = lo >= 0 ? 1 : hi <= 0 ? -1 : (hi + lo) / (hi - lo);
        const interval at_lo = interval_sub(interval_of(fabs(lo)), times(interval_of(slope), interval_of(lo)));
        const interval at_hi = interval_sub(interval_of(fabs(hi)), times(interval_of(slope), interval_of(hi)));
        const double offset = lo >= 0 || hi <= 0 ? 0 : at_lo.hi > at_hi.hi ? at_lo.hi : at_hi.hi;
        model_add_scaled(f, -slope, price, &dual->value);
        model lost;
        model_constant(f, interval_of(-offset), &lost);
        model_add_scaled(f, 1, &lost, &dual->value);
    }
}

/* Add what a phase makes of its costates, the last of which is 1: w.costate - costate.W.costate/2. */
static void add_value(const Frame *f, int i, int d, const Value *v, Dual *dual)
{
    model *bent = &dual->bent;
    for (int a = 0; a < d; a++) {
        const curve linear = f->n ? v->curves[a] : curve_over(v->linear[a]);
        model_of_curve(f, i, &linear, bent);
        for (int b = a; b < d; b++) {
            const int at = a * d + b;
            const curve square = f->n ? v->curves[d + at] : curve_over(v->square[at]);
            model_add_curve(f, a == b ? -0.5 : -1, i, &square, dual->costate + b, bent);
        }
        model_settle(f, bent);
        model_add_mul(f, 1, bent, dual->costate + a, &dual->value);
    }
}

void dual_model(Engine *e, const Frame *f, const Steps *const *all, const double *t,
                const interval *box)
{
    const Problem *p = e->problem;
    const Centre *c = &e->centre;
    const int phases = p->phases;
    Dual *dual = &e->dual;
    Choice *choices = c->choices;
    for (int i = 0; i < phases; i++)
        choices += p->phase[i].steps * p->phase[i].nb;
    model_zero(f, &dual->value);
    for (int i = phases - 1; i >= 0; i--) {
        const Phase *ph = p->phase + i;
        const Steps *steps = all[i];
        const int s = 2 * ph->r, d = steps->d, last = i == phases - 1;
        const Rows *zero = last ? &p->goal_zero : &p->event[i].zero;
        const Rows *most = last ? &p->goal_most : &p->event[i].most;
        const int first = last ? 0 : c->first_event[i];
        for (int z = 0; z < s; z++)
            model_zero(f, dual->costate + z);
        if (!last)
            for (int z = 0; z < s; z++)
                for (int k = 0; k < p->event[i].after.rows; k++)
                    model_add_scaled(f, p->event[i].after.A[k * s + z], dual->start + k,
                                     dual->costate + z);
        add_moved(p, c, f, i, t, box, dual);
        add_along(e, f, i, steps, t, box, dual);
        add_priced(c, f, zero, first, dual);
        add_priced(c, f, most, first + zero->rows, dual);
        if (last)
            add_end(p, f, dual);
        for (int z = 0; z < s; z++)
            model_settle(f, dual->costate + z);
        for (int k = 0; k < steps->priced; k++)
            multiplier_model(c, f, c->first_priced + steps->which[k], dual->costate + s + k);
        model_constant(f, interval_of(1), dual->costate + d - 1);
        choices -= ph->steps * ph->nb;
        interval range[MOST_COSTATE];
        for (int a = 0; a < d; a++)
            range[a] = model_range(dual->costate + a);
        add_value(f, i, d, phase_value(ph, steps, choices, range, e->values + i), dual);
        add_driven(p, f, i, steps, t, box, dual);
        for (int z = 0; z < s; z++) {
            model_zero(f, dual->start + z);
            for (int a = 0; a < d; a++) {
                const int k = z * d + a;
                const curve at = f->n ? steps->start_curves[k] : curve_over(steps->start[k]);
                model_add_curve(f, 1, i, &at, dual->costate + a, dual->start + z);
            }
            model_settle(f, dual->start + z);
        }
    }
    add_ties(p, c, f, dual);
    subtract_squares(p, c, f, dual);
    subtract_start(p, f, dual);
    model_settle(f, &dual->value);
}
