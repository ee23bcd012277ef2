/* See centre.h: the dual and its derivatives by the multipliers, at durations that are given. */
#include "centre.h"
#include "costates.h"
#include "small.h"

#include <string.h>

/* Constants of the dual in the multipliers, (multipliers + 1,). */
static void constants_of(const Problem *p, const Centre *c, Point *at)
{
    const Steps *const *steps = at->steps;
    double time = 0, *constant = at->constant, shift[MOST_SHIFTS], slope[MOST_SHIFTS], row[WIDTH];
    Along along;
    memset(constant, 0, sizeof(double) * WIDTH);
    for (int i = 0; i < p->phases; i++) {
        time += at->t[i];
        const double *L = COSTATES(at, i);
        for (int k = 0; k < steps[i]->d; k++)
            for (int j = 0; j <= c->multipliers; j++)
                constant[j] += interval_mid(steps[i]->without.linear[k].v0) * L[k * WIDTH + j];
        for (int k = 0; k < steps[i]->priced; k++)
            constant[c->first_priced + steps[i]->which[k]] += shift_along(p, c, steps, i, k, &along);
        if (p->phase[i].given) {
            moved_row(p, c, i, steps[i], at->moved + moved_before(p, i), 0, L, 0, row);
            for (int j = 0; j <= c->multipliers; j++)
                constant[j] += row[j];
        }
        shifts_at(p, time, shift, slope);
        const int last = i == p->phases - 1;
        const Rows *zero = last ? &p->goal_zero : &p->event[i].zero;
        const Rows *most = last ? &p->goal_most : &p->event[i].most;
        const int first = last ? 0 : c->first_event[i];
        for (int k = 0; k < zero->rows; k++)
            constant[first + k] += zero->b[k] + shifted(p, zero, k, shift);
        for (int k = 0; k < most->rows; k++)
            constant[first + zero->rows + k] += most->b[k] + shifted(p, most, k, shift);
        if (!last && p->shifts.shifts) {
            after_row(p, c, steps[i + 1], i, shift, COSTATES(at, i + 1), 0, row);
            for (int j = 0; j <= c->multipliers; j++)
                constant[j] += row[j];
        }
    }
    if (p->goal_cost.rows)
        constant[c->multipliers] += p->goal_cost.b[0] + shifted(p, &p->goal_cost, 0, shift);
}

/* The shifts at the nodes of all phases, and their rates. */
static void follow_shifts(const Problem *p, Point *at)
{
    double shift[MOST_SHIFTS], rate[MOST_SHIFTS], time = 0;
    size_t next = 0;
    for (int i = 0; i < p->phases; time += at->t[i++]) {
        const Phase *ph = p->phase + i;
        const int last = ph->nodes - 1;
        for (int node = 0; node < nodes_of(ph) && ph->given; node++) {
            const double passed = (node / last + ph->place[node % last]) / ph->steps;
            shifts_at(p, time + at->t[i] * passed, shift, rate);
            for (int g = 0; g < ph->given; g++, next++) {
                at->moved[next] = shift[(int)ph->drives[g]];
                at->rate[next] = rate[(int)ph->drives[g]];
            }
        }
    }
}

/* The dual by the best inputs of all steps, which it keeps. */
static double dual_by_inputs(const Problem *p, const Centre *c, const Point *at, const double *m,
                             double *gradient, double *H)
{
    const Steps *const *steps = at->steps;
    const int n = c->multipliers;
    const double *constant = at->constant, *row = at->rows;
    double value = constant[n], *u = at->inputs;
    for (int j = 0; j < n; j++)
        value += constant[j] * m[j];
    if (gradient)
        memcpy(gradient, constant, sizeof(double) * n);
    if (H)
        memset(H, 0, sizeof(double) * n * n);
    for (int i = 0; i < p->phases; i++) {
        const Phase *ph = p->phase + i;
        const int nb = ph->nb;
        const double h = interval_mid(steps[i]->h.v0);
        double R[MOST_INPUTS * MOST_INPUTS], inverse[MOST_INPUTS * MOST_INPUTS], y[MOST_INPUTS];
        for (int a = 0; a < nb * nb; a++)
            R[a] = h * ph->R[a];
        for (int a = 0; a < nb; a++) {
            const double width = ph->upper[a] - ph->lower[a];
            if (!(R[a * nb + a] > 0))
                R[a * nb + a] = h * SMOOTHING * p->scale / (p->latest * width * width);
        }
        small_inverse(nb, R, inverse);
        for (int k = 0; k < ph->steps; k++, u += nb, row += nb * WIDTH) {
            for (int a = 0; a < nb; a++) {
                y[a] = row[a * WIDTH + n];
                for (int j = 0; j < n; j++)
                    y[a] += row[a * WIDTH + j] * m[j];
            }
            const unsigned mask = least_inputs(nb, R, inverse, y, ph->lower, ph->upper, u);
            for (int a = 0; a < nb; a++) {
                double curved = 0;
                for (int b = 0; b < nb; b++)
                    curved += R[a * nb + b] * u[b];
                value += u[a] * (y[a] + curved / 2);
                for (int j = 0; j < n && gradient; j++)
                    gradient[j] += row[a * WIDTH + j] * u[a];
            }
            if (!H || !mask)
                continue;
            /* rows of the free inputs times the inverse of their part of R, by elimination */
            double A[MOST_INPUTS * MOST_INPUTS], B[MOST_INPUTS * WIDTH];
            for (int a = 0; a < nb; a++) {
                const int on = mask >> a & 1;
                for (int b = 0; b < nb; b++)
                    A[a * nb + b] = on && mask >> b & 1 ? R[a * nb + b] : a == b;
                for (int j = 0; j < n; j++)
                    B[a * WIDTH + j] = on ? row[a * WIDTH + j] : 0;
            }
            /* L D L^T of A: H += B^T A^-1 B */
            for (int a = 0; a < nb; a++) {
                for (int b = a + 1; b < nb; b++) {
                    const double factor = A[b * nb + a] / A[a * nb + a];
                    if (factor == 0)
                        continue;
                    for (int g = a; g < nb; g++)
                        A[b * nb + g] -= factor * A[a * nb + g];
                    for (int j = 0; j < n; j++)
                        B[b * WIDTH + j] -= factor * B[a * WIDTH + j];
                }
                for (int j = 0; j < n; j++) {
                    const double share = B[a * WIDTH + j] / A[a * nb + a];
                    for (int l = 0; l <= j && share != 0; l++)
                        H[j * n + l] += share * B[a * WIDTH + l];
                }
            }
        }
    }
    for (int j = 0; j < p->goal_zero.rows; j++) { /* squares at the end */
        value -= p->soft[j] * m[j] * m[j] / 2;
        if (gradient)
            gradient[j] -= p->soft[j] * m[j];
        if (H)
            H[j * n + j] += p->soft[j];
    }
    /* A start within a range is an input that costs nothing. */
    for (int k = 0; k < p->spreads; k++, row += WIDTH, u++) {
        const double R = START_SMOOTHING(p), inverse = 1 / R, low = -1, high = 1;
        double y = row[n];
        for (int j = 0; j < n; j++)
            y += row[j] * m[j];
        const unsigned mask = least_inputs(1, &R, &inverse, &y, &low, &high, u);
        value += *u * (y + R * *u / 2);
        for (int j = 0; j < n && gradient; j++)
            gradient[j] += row[j] * *u;
        for (int j = 0; j < n && H && mask; j++)
            for (int l = 0; l <= j; l++)
                H[j * n + l] += row[j] * row[l] / R;
    }
    for (int j = 0; j < n && H; j++)
        for (int l = 0; l < j; l++)
            H[l * n + j] = H[j * n + l];
    return value;
}

/* The dual where it is one quadratic function, as no input has bounds. */
static double quadratic_dual(int n, const Point *at, const double *m, double *gradient, double *H)
{
    double value = at->constant[n];
    for (int j = 0; j < n; j++) {
        double bent = 0;
        for (int l = 0; l < n; l++)
            bent += at->curved[j * n + l] * m[l];
        value += m[j] * (at->constant[j] - bent / 2);
        if (gradient)
            gradient[j] = at->constant[j] - bent;
    }
    if (H)
        memcpy(H, at->curved, sizeof(double) * (size_t)(n * n));
    return value;
}

double point_dual(const Problem *p, const Centre *c, const Point *at, const double *m,
                  double *gradient, double *H)
{
    if (at->quadratic)
        return quadratic_dual(c->multipliers, at, m, gradient, H);
    return dual_by_inputs(p, c, at, m, gradient, H);
}

/* What the multipliers make of the inputs of all steps. */
static void rows_of(const Problem *p, const Centre *c, const Point *at)
{
    const Steps *const *steps = at->steps;
    double *row = at->rows;
    for (int i = 0; i < p->phases; i++) {
        const int d = steps[i]->d, count = p->phase[i].steps * p->phase[i].nb;
        const double *L = COSTATES(at, i);
        for (int k = 0; k < count; k++, row += WIDTH) {
            memset(row, 0, sizeof(double) * (c->multipliers + 1));
            for (int a = 0; a < d; a++) {
                const double share = interval_mid(steps[i]->response[k * d + a].v0);
                for (int j = 0; j <= c->multipliers && share != 0; j++)
                    row[j] += share * L[a * WIDTH + j];
            }
        }
    }
    start_rows(p, c, steps[0], COSTATES(at, 0), 0, row);
    const int s = 2 * p->phase[0].r;
    for (int k = 0; k < p->spreads; k++, row += WIDTH)
        for (int j = 0; j < p->goal_zero.rows + p->goal_most.rows; j++)
            for (int z = 0; z < s; z++)
                row[j] += p->spread[k * s + z] * p->tie[j * s + z];
}

/* Whether neither inputs nor the start have bounds. */
static int is_quadratic(const Problem *p)
{
    for (int i = 0; i < p->phases; i++)
        for (int j = 0; j < p->phase[i].nb; j++)
            if (!isinf(p->phase[i].lower[j]) || !isinf(p->phase[i].upper[j]))
                return 0;
    return !p->spreads;
}

/* Take what inputs without bounds make of the dual: minus its second derivatives, and what that adds
 * to its constants. */
static void take_inputs(const Problem *p, const Centre *c, Point *at)
{
    const int n = c->multipliers;
    double bent[WIDTH], *H = at->curved;
    memset(H, 0, sizeof(double) * (size_t)(n * n));
    for (int j = 0; j < p->goal_zero.rows; j++)
        H[j * n + j] = p->soft[j];
    for (int i = 0; i < p->phases; i++) {
        const int d = at->steps[i]->d;
        const double *L = COSTATES(at, i);
        for (int a = 0; a < d; a++, L += WIDTH) {
            memset(bent, 0, sizeof(double) * (size_t)(n + 1));
            for (int b = 0; b < d; b++) {
                const double share = interval_mid(at->steps[i]->unbounded.square[a * d + b].v0);
                for (int j = 0; j <= n && share != 0; j++)
                    bent[j] += share * COSTATES(at, i)[b * WIDTH + j];
            }
            for (int j = 0; j < n; j++) {
                at->constant[j] -= L[j] * bent[n];
                for (int l = 0; l < n && L[j] != 0; l++)
                    H[j * n + l] += L[j] * bent[l];
            }
            at->constant[n] -= L[n] * bent[n] / 2;
        }
    }
}

void point_begin(const Problem *p, const Centre *c, const double *t, const Steps *const *steps,
                 Point *at)
{
    at->t = t, at->steps = steps;
    follow_shifts(p, at);
    for (int i = p->phases - 1; i >= 0; i--)
        costates_of(p, steps, c, -1, i, i + 1 < p->phases ? COSTATES(at, i + 1) : 0, 0,
                    COSTATES(at, i));
    constants_of(p, c, at);
    at->quadratic = is_quadratic(p);
    if (at->quadratic)
        take_inputs(p, c, at);
    else
        rows_of(p, c, at);
}

void point_inputs(const Problem *p, const Centre *c, const Point *at, const double *m)
{
    if (at->quadratic)
        rows_of(p, c, at);
    dual_by_inputs(p, c, at, m, 0, 0);
}
