/* The dual over a box of durations, as a jet. */
#include "dual.h"

/* A multiplier as function of the durations. */
void multiplier_jet(const Centre *c, int n, int j, const interval *away, jet *m)
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

/* Add what ties of both ends make of the prices of the start, (2 r,). */
static void add_ties(const Problem *p, const Centre *c, int n, const interval *away, jet *start)
{
    const int s = 2 * p->phase[0].r;
    for (int k = 0; k < p->goal_zero.rows + p->goal_most.rows; k++) {
        jet m;
        multiplier_jet(c, n, k, away, &m);
        for (int z = 0; z < s; z++)
            jet_add_scaled(n, start + z, p->tie[k * s + z], &m);
    }
}

/* Subtract what prices of squares at the end make of the value. */
static void subtract_squares(const Problem *p, const Centre *c, int n, const interval *away, jet *value)
{
    for (int k = 0; k < p->goal_zero.rows; k++)
        if (p->soft[k] > 0) {
            jet m, half;
            multiplier_jet(c, n, k, away, &m);
            jet_zero(n, &half);
            jet_add_scaled(n, &half, -p->soft[k] / 2, &m);
            jet_add_mul(n, value, &half, &m);
        }
}

/* Subtract what a start within a range makes of its prices, at most |price| of each spread: by a
 * chord above the absolute value, which is the same in the box and in its centre. */
static void subtract_start(const Problem *p, int n, const interval *away, const jet *start, jet *value)
{
    const int s = 2 * p->phase[0].r;
    static _Thread_local jet price;
    for (int k = 0; k < p->spreads; k++) {
        jet_zero(n, &price);
        for (int z = 0; z < s; z++)
            jet_add_scaled(n, &price, p->spread[k * s + z] * (1 + 4 * DBL_EPSILON), start + z);
        jet_centred(n, &price, away);
        const double lo = price.v.lo, hi = price.v.hi;
        const double slope = lo >= 0 ? 1 : hi <= 0 ? -1 : (hi + lo) / (hi - lo);
        const interval at_lo = interval_sub(interval_of(fabs(lo)), times(interval_of(slope), interval_of(lo)));
        const interval at_hi = interval_sub(interval_of(fabs(hi)), times(interval_of(slope), interval_of(hi)));
        const double offset = lo >= 0 || hi <= 0 ? 0 : at_lo.hi > at_hi.hi ? at_lo.hi : at_hi.hi;
        jet_add_scaled(n, value, -slope, &price);
        const interval lost = interval_of(-offset);
        value->v = plus(value->v, lost), value->v0 = plus(value->v0, lost);
    }
}

/* The dual as function of durations in a box, at distances ``away`` from its centre t. */
void dual_jet(Engine *e, int n, const Steps *const *all, const double *t, const interval *box,
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
    add_ties(p, c, n, away, start);
    subtract_squares(p, c, n, away, value);
    subtract_start(p, n, away, start, value);
}
