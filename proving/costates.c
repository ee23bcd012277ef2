/* See costates.h. */
#include "costates.h"

#include <string.h>

/* costates += multiplier row of functions A z + b, which are numbered from ``first``. */
static void add_rows(const Rows *rows, int first, double *L)
{
    for (int i = 0; i < rows->rows; i++)
        for (int z = 0; z < rows->columns; z++)
            L[z * WIDTH + first + i] += rows->A[i * rows->columns + z];
}

/* The costates of each phase as functions of the multipliers and 1, and by one duration where
 * ``by`` is not negative. */
void costates_of(const Problem *p, const Steps *const *steps, const Centre *c, int by, int i,
                        const double *later, const double *later_slope, double *L)
{
    const int n = c->multipliers, s = 2 * p->phase[i].r;
    for (int z = 0; z < steps[i]->d; z++)
        memset(L + z * WIDTH, 0, sizeof(double) * (size_t)(n + 1));
    if (i == p->phases - 1) {
        if (by < 0) {
            add_rows(&p->goal_zero, 0, L);
            add_rows(&p->goal_most, p->goal_zero.rows, L);
            for (int z = 0; z < s && p->goal_cost.rows; z++)
                L[z * WIDTH + n] = p->goal_cost.A[z];
        }
    } else {
        const Event *e = p->event + i;
        const int s_after = e->after.rows, d = steps[i + 1]->d;
        double start[MOST_STATE * WIDTH];
        for (int z = 0; z < s_after; z++)
            for (int j = 0; j <= n; j++) {
                double sum = 0;
                for (int k = 0; k < d; k++) {
                    const line at = steps[i + 1]->start[z * d + k];
                    if (by < 0)
                        sum += interval_mid(at.v0) * later[k * WIDTH + j];
                    else
                        sum += interval_mid(at.v0) * later_slope[k * WIDTH + j] +
                               (by == i + 1 ? interval_mid(at.d0) * later[k * WIDTH + j] : 0);
                }
                start[z * WIDTH + j] = sum;
            }
        for (int z = 0; z < s; z++)
            for (int j = 0; j <= n; j++)
                for (int k = 0; k < s_after; k++)
                    L[z * WIDTH + j] += e->after.A[k * s + z] * start[k * WIDTH + j];
        if (by < 0) {
            add_rows(&e->zero, c->first_event[i], L);
            add_rows(&e->most, c->first_event[i] + e->zero.rows, L);
        }
    }
    if (by < 0) {
        for (int k = 0; k < steps[i]->priced; k++)
            L[(s + k) * WIDTH + c->first_priced + steps[i]->which[k]] = 1;
        L[(steps[i]->d - 1) * WIDTH + n] = 1;
    }
}

/* row (columns,) += share * L */
static void add_row(int columns, double share, const double *L, double *row)
{
    for (int j = 0; j < columns && share != 0; j++)
        row[j] += share * L[j];
}

/* What the multipliers make of a state (s,) at the start of a phase, as start_rows. */
static void state_row(int s, int columns, const double *state, const Steps *steps, const double *L,
                      const double *by_duration, double *row)
{
    const int d = steps->d;
    memset(row, 0, sizeof(double) * columns);
    for (int z = 0; z < s; z++)
        for (int a = 0; a < d && state[z] != 0; a++) {
            const line at = steps->start[z * d + a];
            add_row(columns, state[z] * interval_mid(at.v0), L + a * WIDTH, row);
            if (by_duration)
                add_row(columns, state[z] * interval_mid(at.d0), by_duration + a * WIDTH, row);
        }
}

void start_rows(const Problem *p, const Centre *c, const Steps *steps, const double *L,
                const double *by_duration, double *row)
{
    const int s = 2 * p->phase[0].r;
    for (int k = 0; k < p->spreads; k++, row += WIDTH)
        state_row(s, c->multipliers + 1, p->spread + k * s, steps, L, by_duration, row);
}

void after_row(const Problem *p, const Centre *c, const Steps *steps, int event, const double *shift,
               const double *L, const double *by_duration, double *row)
{
    const Rows *after = &p->event[event].after;
    double state[MOST_STATE];
    for (int z = 0; z < after->rows; z++)
        state[z] = shifted(p, after, z, shift);
    state_row(after->rows, c->multipliers + 1, state, steps, L, by_duration, row);
}

void shifts_at(const Problem *p, double time, double *shift, double *rate)
{
    line values[MOST_SHIFTS];
    shifts_over(&p->shifts, interval_of(time), interval_of(time), values);
    for (int j = 0; j < p->shifts.shifts; j++) {
        shift[j] = interval_mid(values[j].v0);
        rate[j] = interval_mid(values[j].d0);
        if (!isfinite(rate[j]))
            rate[j] = 0; /* as at the begin of a power with a broken exponent */
    }
}

void moved_row(const Problem *p, const Centre *c, int phase, const Steps *steps, const double *x,
               int passing, const double *L, const double *by_duration, double *row)
{
    const Phase *ph = p->phase + phase;
    const int d = steps->d, last = ph->nodes - 1;
    const line *at = steps->moved;
    memset(row, 0, sizeof(double) * (size_t)(c->multipliers + 1));
    for (int node = 0; node < nodes_of(ph); node++) {
        const double passed = (node / last + ph->place[node % last]) / ph->steps;
        for (int g = 0; g < ph->given; g++, x++)
            for (int a = 0; a < d; a++, at++) {
                const double share = passing ? *x * passed : *x;
                add_row(c->multipliers + 1, share * interval_mid(at->v0), L + a * WIDTH, row);
                if (by_duration)
                    add_row(c->multipliers + 1, share * interval_mid(at->d0), by_duration + a * WIDTH, row);
            }
    }
}

double shift_along(const Problem *p, const Centre *c, const Steps *const *steps, int i, int k,
                   Along *along)
{
    const Priced *at = c->priced + steps[i]->which[k];
    const double *moves = moves_of(p->phase + i, p->shifts.shifts, at);
    *along = (Along){0, 0};
    if (!moves)
        return 0;
    double values[MOST_SHIFTS], rates[MOST_SHIFTS], time = 0, value = 0;
    for (int j = 0; j < i; j++)
        time += interval_mid(steps[j]->h.v0) * p->phase[j].steps;
    const double passed = steps_until(p->phase + i, at);
    shifts_at(p, time + interval_mid(steps[i]->h.v0) * passed, values, rates);
    along->share = passed / p->phase[i].steps;
    for (int j = 0; j < p->shifts.shifts; j++) {
        value += moves[j] * values[j];
        along->rate += moves[j] * rates[j];
    }
    return value;
}
