/* The value of a phase at given prices of the state at its end: least cost of its inputs beside
 * these prices, as function of its duration. See linear_program.h. */
#include <string.h>

#include "line_systems.h"
#include "step_map.h"

size_t steps_size(const Phase *p, int d)
{
    const size_t s = 2 * p->r, values = s * d + 2 * d + (size_t)d * d; /* curves have less room */
    const size_t of_steps = (size_t)p->steps * p->nb + 2 * moved_in_phase(p);
    return (s + p->na - p->r + p->rows) * columns_of(p) + of_steps * d + 2 * values;
}

void steps_place(Steps *steps, const Phase *p, int d, line *at)
{
    const int s = 2 * p->r, m = columns_of(p);
    steps->map = at, at += s * m;
    steps->inner = at, at += (p->na - p->r) * m;
    steps->rows = at, at += p->rows * m;
    steps->response = at, at += p->steps * p->nb * d;
    steps->moved = at, at += moved_in_phase(p) * d;
    steps->moved_curves = (curve *)at, at += moved_in_phase(p) * d;
    steps->start = at, at += s * d;
    steps->without.linear = at, at += d;
    steps->without.square = 0, steps->without.curves = 0;
    steps->unbounded.linear = at, at += d;
    steps->unbounded.square = at, at += d * d;
    steps->unbounded.curves = (curve *)at, at += d + d * d;
    steps->start_curves = (curve *)at;
}

/* The sum that a value takes from the inputs of all steps by choices. */
static void add_inputs(const Phase *p, const Steps *steps, Choice *choices, const interval *costate,
                       Value *value);

static void subtract_limit(const Phase *p, const Priced *at, line *price)
{
    *price = line_add(*price, line_of(-p->most[at->path]));
}

/* Where a step has what one of (y, h p, u, s, 1) costs: in the prices of the state (y, h p) before
 * it, (2 r, d), in what its inputs cost, or what shifts cost at its nodes, which steps share. */
static line *prices_of(const Phase *p, int k, const Steps *steps, int column, line *prices)
{
    const int s = 2 * p->r, d = steps->d, shift = column - s - p->nb;
    return column < s                 ? prices + column * d
           : shift < 0                ? steps->response + (k * p->nb + column - s) * d
           : shift < moved_in_step(p) ? steps->moved + (k * (p->nodes - 1) * p->given + shift) * d
                                      : steps->without.linear;
}

/* The row of a condition in a step; none where it is one of other steps. */
static const line *row_in_step(const Phase *p, const Priced *at, int k, const Steps *steps)
{
    const double *of = p->condition + 5 * at->path;
    const int row = at->inside != IN_STEP   ? -1
                    : of[4] == IN_SUM || at->node == k ? (int)of[0]
                    : at->node == k - 1     ? (int)of[1]
                                            : -1;
    return row < 0 ? 0 : steps->rows + row * columns_of(p);
}

/* Add the conditions inside a step to what its start and its inputs cost. */
static void add_inside(const Phase *p, int k, const Priced *priced, const Steps *steps, line *prices)
{
    const int r = p->r, s = 2 * r, d = steps->d, m = columns_of(p);
    for (int i = s; i < d - 1; i++) {
        const Priced *at = priced + steps->which[i - s];
        const line *row = row_in_step(p, at, k, steps);
        const int place = at->node == k && at->inside >= 0;
        for (int column = 0; column < m && (row || place); column++) {
            line *to = prices_of(p, k, steps, column, prices) + i;
            if (row)
                *to = line_add(*to, row[column]);
            for (int y = 0; y < r && place; y++)
                *to = line_add(*to, line_scaled(steps->inner[(at->inside * r + y) * m + column],
                                                p->path[at->path * r + y]));
        }
        if (place)
            subtract_limit(p, at, steps->without.linear + i);
    }
}

/* Add what a step costs beside its inputs. */
static void add_cost(const Phase *p, int k, const Steps *steps, line *prices)
{
    const int d = steps->d, m = columns_of(p);
    for (int column = 0; column < m && p->cost >= 0; column++) {
        line *to = prices_of(p, k, steps, column, prices) + d - 1;
        *to = line_add(*to, steps->rows[p->cost * m + column]);
    }
}

/* Add the conditions at a node to the prices of the state there, (2 r, d). */
static void add_conditions(const Phase *p, int node, const Priced *priced, const Steps *steps,
                           line *prices)
{
    const int r = p->r, d = steps->d;
    for (int i = 2 * r; i < d - 1; i++) {
        const Priced *at = priced + steps->which[i - 2 * r];
        if (at->node != node || at->inside != AT_NODE)
            continue;
        for (int y = 0; y < r; y++)
            prices[y * d + i] = line_add(prices[y * d + i], line_of(p->path[at->path * r + y]));
        subtract_limit(p, at, steps->without.linear + i);
    }
}

int phase_steps(const Phase *p, int number, double centre, interval duration, int count,
                const Priced *priced, const double *begin, Steps *steps)
{
    const int r = p->r, s = 2 * r, nb = p->nb, m = columns_of(p);
    const size_t moved = moved_in_phase(p);
    const interval none = {0, 0}, N = interval_of(p->steps);
    const interval share = interval_div(interval_of(1), N);
    const line h = {interval_div(interval_of(centre), N), share, none, interval_div(duration, N), share, none, none};
    const interval away = interval_sub(duration, interval_of(centre));
    steps->h = h, steps->away = away, steps->most = interval_mag(away);
    steps->priced = 0;
    for (int i = 0; i < count; i++)
        if (priced[i].phase == number)
            steps->which[steps->priced++] = i;
    const int d = steps->d = s + steps->priced + 1;
    if (step_map(p, h, steps->map, steps->inner, steps->rows))
        return 1;
    for (int i = 0; i < s * m; i++)
        steps->map[i] = line_centred(steps->map[i], away);
    for (int i = 0; i < (p->na - r) * m; i++)
        steps->inner[i] = line_centred(steps->inner[i], away);
    for (int i = 0; i < p->rows * m; i++)
        steps->rows[i] = line_centred(steps->rows[i], away);
    line now[MOST_STATE * MOST_COSTATE], next[MOST_STATE * MOST_COSTATE];
    const line by_h = line_inverse(h);
    for (int i = 0; i < s; i++)
        for (int j = 0; j < d; j++)
            now[i * d + j] = i == j ? (i < r ? line_of(1) : by_h) : line_of(0);
    line *linear = steps->without.linear;
    for (int j = 0; j < d; j++)
        linear[j] = line_of(0);
    linear[d - 1] = line_scaled(line_scaled(h, p->steps), p->c_0);
    memset(steps->moved, 0, sizeof(line) * moved * d);
    add_conditions(p, p->steps, priced, steps, now);
    for (int k = p->steps - 1; k >= 0; k--) {
        for (int column = 0; column < m; column++) {
            line *to = prices_of(p, k, steps, column, next);
            for (int j = 0; j < d; j++) {
                line sum = column >= s + nb ? to[j] : line_of(0);
                for (int i = 0; i < s; i++)
                    sum = line_add_mul(sum, steps->map[i * m + column], now[i * d + j]);
                to[j] = line_centred(sum, away);
            }
        }
        for (int i = 0; i < nb; i++) {
            line *one = steps->response + (k * nb + i) * d + d - 1;
            *one = line_add(*one, line_scaled(h, p->c[i]));
        }
        add_inside(p, k, priced, steps, next);
        add_cost(p, k, steps, next);
        add_conditions(p, k, priced, steps, next);
        memcpy(now, next, sizeof(line) * s * d);
    }
    for (int i = 0; i < s; i++)
        for (int j = 0; j < d; j++) {
            line *at = steps->start + i * d + j;
            *at = i < r ? now[i * d + j] : line_centred(line_mul(h, now[i * d + j]), away);
            if (begin[i] != 0)
                linear[j] = line_add(linear[j], line_scaled(*at, begin[i]));
            steps->start_curves[i * d + j] = curve_of(*at, steps->most);
        }
    for (int j = 0; j < d; j++)
        linear[j] = line_centred(linear[j], away);
    for (size_t j = 0; j < moved * d; j++) {
        steps->moved[j] = line_centred(steps->moved[j], away);
        steps->moved_curves[j] = curve_of(steps->moved[j], steps->most);
    }
    for (int i = 0; i < nb; i++)
        if (!(p->R[i * nb + i] > 0))
            return 0; /* what costs nothing has bounds */
    add_inputs(p, steps, 0, 0, &steps->unbounded);
    return 0;
}

/* The inverse of the rows and columns of R that a mask has, as intervals (nb, nb), zero elsewhere:
 * whole lines where it cannot be found. */
static void inverse_of(const Phase *p, unsigned mask, interval *inverse)
{
    int at[MOST_INPUTS], n = 0;
    for (int i = 0; i < p->nb; i++)
        if (mask >> i & 1)
            at[n++] = i;
    line A[MOST_INPUTS * MOST_INPUTS], B[MOST_INPUTS * MOST_INPUTS];
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            A[i * n + j] = line_of(p->R[at[i] * p->nb + at[j]]);
            B[i * n + j] = line_of(i == j);
        }
    const int none = solve_lines(n, n, A, B);
    for (int i = 0; i < p->nb * p->nb; i++)
        inverse[i] = interval_of(0);
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
            inverse[at[i] * p->nb + at[j]] = none ? (interval){-INFINITY, INFINITY} : B[i * n + j].v;
}

/* Range of what a row (d,) of lines makes of costates. */
static interval over(int d, const line *row, const interval *costate)
{
    interval sum = {0, 0};
    for (int j = 0; j < d; j++)
        sum = plus_times(sum, row[j].v, costate[j]);
    return sum;
}

/* What keeps an input in place where it is not sure to stay at its bound: a price of the bound. */
static void give_price(const Phase *p, Choice *choice, int i, interval slope)
{
    const int low = choice->kind == AT_LOWER;
    const double price = interval_mid(slope);
    if (p->R[i * p->nb + i] > 0) {
        choice->kind = (low ? price > 0 : price < 0) ? PUSHED : FREE;
        choice->price = choice->kind == PUSHED ? price : 0;
        return;
    }
    /* A cost without curvature: below the least of lower y and upper y lies the chord. */
    const interval lo = interval_of(slope.lo), hi = interval_of(slope.hi);
    interval a = times(lo, interval_of(slope.lo > 0 ? p->lower[i] : p->upper[i]));
    interval b = times(hi, interval_of(slope.hi > 0 ? p->lower[i] : p->upper[i]));
    choice->kind = CHORD;
    choice->price = slope.hi > slope.lo ? (b.lo - a.lo) / (slope.hi - slope.lo) : 0;
    a = interval_sub(a, times(lo, interval_of(choice->price)));
    b = interval_sub(b, times(hi, interval_of(choice->price)));
    choice->offset = a.lo < b.lo ? a.lo : b.lo;
}

/* Slopes h R u + y of the cost in the inputs that are at their bounds, (nb,), over a range. */
static void slopes_at_bounds(const Phase *p, interval h, const Choice *choices, unsigned mask,
                             const interval *inverse, const interval *y, interval *slope)
{
    const int nb = p->nb;
    interval u[MOST_INPUTS], rest[MOST_INPUTS];
    for (int i = 0; i < nb; i++) {
        const int kind = choices[i].kind;
        u[i] = kind == AT_LOWER   ? interval_of(p->lower[i])
               : kind == AT_UPPER ? interval_of(p->upper[i])
                                  : interval_of(0);
    }
    for (int i = 0; i < nb; i++) {
        interval sum = {0, 0};
        for (int j = 0; j < nb; j++)
            sum = plus_times(sum, interval_of(p->R[i * nb + j]), u[j]);
        rest[i] = plus_times(y[i], h, sum);
        if (choices[i].kind == PUSHED)
            rest[i] = plus(rest[i], interval_of(-choices[i].price));
    }
    for (int i = 0; i < nb; i++) {
        slope[i] = rest[i];
        for (int f = 0; f < nb && !(mask >> i & 1); f++) {
            interval step = {0, 0}; /* h (u_f), what a free input becomes */
            for (int g = 0; g < nb; g++)
                step = plus_times(step, inverse[f * nb + g], rest[g]);
            slope[i] = interval_sub(slope[i], times(interval_of(p->R[i * nb + f]), step));
        }
    }
}

/* Choices of the inputs of a step that hold over the range of y; their free ones as a mask. */
static unsigned settle(const Phase *p, interval h, Choice *choices, const interval *y,
                       interval *inverse, unsigned *last)
{
    const int nb = p->nb;
    for (;;) {
        unsigned mask = 0;
        int fixed = 0, changed = 0;
        for (int i = 0; i < nb; i++) {
            mask |= (unsigned)(choices[i].kind == FREE || choices[i].kind == PUSHED) << i;
            fixed |= choices[i].kind == AT_LOWER || choices[i].kind == AT_UPPER;
        }
        if (mask != *last) {
            inverse_of(p, mask, inverse);
            *last = mask;
        }
        if (!y || !fixed)
            return mask;
        interval slope[MOST_INPUTS];
        slopes_at_bounds(p, h, choices, mask, inverse, y, slope);
        for (int i = 0; i < nb && !changed; i++) {
            const int kind = choices[i].kind;
            if ((kind == AT_LOWER && !(slope[i].lo >= 0)) || (kind == AT_UPPER && !(slope[i].hi <= 0))) {
                give_price(p, choices + i, i, p->R[i * nb + i] > 0 ? slope[i] : y[i]);
                changed = 1;
            }
        }
        if (!changed)
            return mask;
    }
}

static void add_inputs(const Phase *p, const Steps *steps, Choice *choices, const interval *costate,
                       Value *value)
{
    const int nb = p->nb, d = steps->d, one = d - 1;
    interval inverse[MOST_INPUTS * MOST_INPUTS], y[MOST_INPUTS];
    line rows[MOST_INPUTS * MOST_COSTATE], solved[MOST_INPUTS * MOST_COSTATE];
    Choice free_ones[MOST_INPUTS];
    unsigned last = ~0u;
    line *W = value->square, *w = value->linear;
    const line h = steps->h, by_h = line_inverse(h);
    memset(free_ones, 0, sizeof free_ones);
    memcpy(w, steps->without.linear, sizeof(line) * d);
    for (int i = 0; i < d * d; i++)
        W[i] = line_of(0);
    for (int k = 0; k < p->steps; k++) {
        const line *response = steps->response + k * nb * d;
        Choice *chosen = choices ? choices + k * nb : free_ones;
        for (int i = 0; i < nb && costate; i++)
            y[i] = over(d, response + i * d, costate);
        const unsigned mask = settle(p, h.v, chosen, costate ? y : 0, inverse, &last);
        for (int i = 0; i < nb; i++) {
            const double u = chosen[i].kind == AT_LOWER ? p->lower[i] : p->upper[i];
            if (chosen[i].kind == CHORD) {
                for (int j = 0; j < d; j++)
                    w[j] = line_add(w[j], line_scaled(response[i * d + j], chosen[i].price));
                w[one] = line_add(w[one], line_of(chosen[i].offset));
            } else if (!(mask >> i & 1)) {
                for (int j = 0; j < d; j++)
                    w[j] = line_add(w[j], line_scaled(response[i * d + j], u));
                interval sum = {0, 0}; /* u R u/2 of what is at its bound */
                for (int j = 0; j < nb; j++) {
                    if (mask >> j & 1 || chosen[j].kind == CHORD)
                        continue;
                    const double v = chosen[j].kind == AT_LOWER ? p->lower[j] : p->upper[j];
                    sum = plus(sum, times(times(interval_of(p->R[i * nb + j] / 2), interval_of(u)),
                                          interval_of(v)));
                }
                w[one] = line_add(w[one], line_mul(h, line_constant(sum)));
            }
        }
        if (!mask)
            continue;
        for (int i = 0; i < nb; i++) {
            if (!(mask >> i & 1))
                continue;
            line *row = rows + i * d;
            memcpy(row, response + i * d, sizeof(line) * d);
            interval sum = {0, 0};
            for (int j = 0; j < nb; j++)
                if (chosen[j].kind == AT_LOWER || chosen[j].kind == AT_UPPER)
                    sum = plus_times(sum, interval_of(p->R[i * nb + j]),
                                     interval_of(chosen[j].kind == AT_LOWER ? p->lower[j] : p->upper[j]));
            row[one] = line_add(row[one], line_mul(h, line_constant(sum)));
            if (chosen[i].kind == PUSHED) {
                /* price > 0 holds it at the lower bound: cost + price (lower - u) */
                const double price = chosen[i].price;
                const interval bound = interval_of(price > 0 ? p->lower[i] : p->upper[i]);
                row[one] = line_add(row[one], line_of(-price));
                w[one] = line_add(w[one], line_constant(times(interval_of(price), bound)));
            }
        }
        for (int i = 0; i < nb; i++)
            for (int j = 0; j < d && mask >> i & 1; j++) {
                line sum = line_of(0);
                for (int g = 0; g < nb; g++)
                    if (mask >> g & 1)
                        sum = line_add_mul(sum, line_constant(inverse[i * nb + g]), rows[g * d + j]);
                solved[i * d + j] = sum;
            }
        for (int i = 0; i < nb; i++)
            for (int a = 0; a < d && mask >> i & 1; a++)
                for (int b = a; b < d; b++)
                    W[a * d + b] = line_add_mul(W[a * d + b], rows[i * d + a], solved[i * d + b]);
    }
    for (int a = 0; a < d; a++)
        for (int b = a; b < d; b++)
            W[b * d + a] = W[a * d + b] =
                line_centred(line_mul(line_centred(W[a * d + b], steps->away), by_h), steps->away);
    for (int a = 0; a < d; a++) {
        w[a] = line_centred(w[a], steps->away);
        value->curves[a] = curve_of(w[a], steps->most);
    }
    for (int i = 0; i < d * d; i++)
        value->curves[d + i] = curve_of(W[i], steps->most);
}

const Value *phase_value(const Phase *p, const Steps *steps, Choice *choices,
                         const interval *costate, Value *value)
{
    int all_free = 1;
    for (int i = 0; i < p->steps * p->nb && all_free; i++)
        all_free = choices[i].kind == FREE;
    if (all_free)
        return &steps->unbounded;
    add_inputs(p, steps, choices, costate, value);
    return value;
}
