/* The best multipliers at given durations: the dual is concave and piecewise quadratic, and its
 * maximum is found by Newton's method with the signs that multipliers must have. */
#include "centre.h"
#include "costates.h"
#include "small.h"

#include <string.h>

#define MOST_ITERATIONS 60
/* How much a step may raise the dual, beside its value. */
#define FARTHEST 1e3

int centre_number(const Problem *p, int count, const Priced *priced, Centre *c)
{
    int n = 0;
    memset(c->may_be_negative, 0, sizeof c->may_be_negative);
    int total = p->goal_zero.rows + p->goal_most.rows + count;
    for (int i = 0; i + 1 < p->phases; i++)
        total += p->event[i].zero.rows + p->event[i].most.rows;
    if (total > MOST_MULTIPLIERS)
        return 1;
    for (int j = 0; j < p->goal_zero.rows; j++)
        c->may_be_negative[n++] = 1;
    n += p->goal_most.rows;
    for (int i = 0; i + 1 < p->phases; i++) {
        c->first_event[i] = n;
        for (int j = 0; j < p->event[i].zero.rows; j++)
            c->may_be_negative[n++] = 1;
        n += p->event[i].most.rows;
    }
    c->first_priced = n;
    c->priced = priced;
    c->multipliers = n + count;
    for (int j = 0; j < p->definitions; j++)
        c->may_be_negative[n + j] = 1;
    return 0;
}

/* The least of the duals at some points, with its derivatives; of several a smooth function that is
 * less than all, by no more than the heat times the logarithm of their number:
 * -heat log(sum exp(-dual/heat)). */
static double dual_at(const Problem *p, const Centre *c, int points, const Point *const *at, double heat,
                      const double *m, double *gradient, double *H)
{
    const int n = c->multipliers;
    if (points == 1)
        return point_dual(p, c, at[0], m, gradient, H);
    double value[MOST_POINTS], slope[MOST_POINTS][MOST_MULTIPLIERS], least = INFINITY, sum = 0;
    double curved[MOST_MULTIPLIERS * MOST_MULTIPLIERS];
    for (int i = 0; i < points; i++) {
        value[i] = point_dual(p, c, at[i], m, 0, 0);
        least = fmin(least, value[i]);
    }
    for (int i = 0; i < points; i++)
        sum += exp((least - value[i]) / heat);
    for (int j = 0; j < n && gradient; j++)
        gradient[j] = 0;
    for (int j = 0; j < n * n && H; j++)
        H[j] = 0;
    for (int i = 0; i < points && gradient; i++) {
        const double share = exp((least - value[i]) / heat) / sum;
        point_dual(p, c, at[i], m, slope[i], H ? curved : 0);
        for (int j = 0; j < n; j++)
            gradient[j] += share * slope[i][j];
        for (int j = 0; j < n * n && H; j++)
            H[j] += share * curved[j];
    }
    for (int i = 0; i < points && H; i++) {
        const double share = exp((least - value[i]) / heat) / sum;
        for (int j = 0; j < n; j++)
            for (int l = 0; l < n; l++)
                H[j * n + l] += share / heat * (slope[i][j] - gradient[j]) * (slope[i][l] - gradient[l]);
    }
    return least - heat * log(sum);
}

/* Choices for the bounds: what is at its bound and kept there. */
static void choose(const Problem *p, Centre *c)
{
    const double *u = c->at.inputs;
    Choice *choice = c->choices;
    for (int i = 0; i < p->phases; i++) {
        const Phase *ph = p->phase + i;
        for (int k = 0; k < ph->steps * ph->nb; k++, u++, choice++) {
            const int a = k % ph->nb;
            const int flat = !(ph->R[a * ph->nb + a] > 0);
            choice->price = choice->offset = 0;
            choice->kind = FREE;
            if (c->at.quadratic)
                continue;
            choice->kind = *u <= ph->lower[a] ? AT_LOWER : *u >= ph->upper[a] ? AT_UPPER : FREE;
            if (flat && choice->kind == FREE)
                choice->kind = AT_LOWER; /* no bound of it can be left out: a chord follows */
        }
    }
}

/* Multipliers no larger than is enough, on the way to zero: large ones make poor bounds of large
 * boxes. The dual is nearly a parabola there. */
static void shrink(const Problem *p, int points, const Point *const *at, double heat, double enough,
                   Centre *c)
{
    const int n = c->multipliers;
    double gradient[MOST_MULTIPLIERS], next[MOST_MULTIPLIERS] = {0};
    const double none = dual_at(p, c, points, at, heat, next, 0, 0);
    for (int round = 0; round < 6 && c->value > enough + fabs(enough) / 4 && none < enough; round++) {
        double slope = 0;
        c->value = dual_at(p, c, points, at, heat, c->m, gradient, 0);
        for (int j = 0; j < n; j++)
            slope += gradient[j] * c->m[j];
        /* none + a s - b s^2 with its value and slope at s = 1; the root of what is enough */
        const double rise = c->value - none, a = 2 * rise - slope, b = rise - slope;
        const double wanted = enough + fabs(enough) / 8 - none;
        const double root = a * a - 4 * b * wanted;
        double share = root > 0 ? 2 * wanted / (a + sqrt(root)) : 0.5;
        share = share > 0 && share < 1 ? share : 0.5;
        for (int j = 0; j < n; j++)
            next[j] = share * c->m[j];
        const double value = dual_at(p, c, points, at, heat, next, 0, 0);
        if (value < enough)
            break;
        memcpy(c->m, next, sizeof(double) * n);
        c->value = value;
    }
}

void centre_maximise(const Problem *p, int points, const Point *const *at, double heat, double enough,
                     Centre *c)
{
    const int n = c->multipliers;
    double gradient[MOST_MULTIPLIERS], step[MOST_MULTIPLIERS];
    double H[MOST_MULTIPLIERS * MOST_MULTIPLIERS], next[MOST_MULTIPLIERS];
    double copy[MOST_MULTIPLIERS * MOST_MULTIPLIERS];
    unsigned char moves[MOST_MULTIPLIERS] = {0};
    for (int j = 0; j < n; j++)
        if (!c->may_be_negative[j] && !(c->m[j] > 0))
            c->m[j] = 0;
    /* The multipliers that move: those of a sign stay at zero until all others are at their best. */
    for (int j = 0; j < n; j++)
        moves[j] = c->may_be_negative[j] || c->m[j] > 0;
    c->converged = c->grows = 0;
    c->value = dual_at(p, c, points, at, heat, c->m, gradient, H);
    for (int round = 0; round < MOST_ITERATIONS; round++) {
        memcpy(copy, H, sizeof(double) * n * n);
        solve_free(n, copy, gradient, moves, step);
        double rise = 0, share = 1, value = c->value;
        int first = -1;
        for (int j = 0; j < n; j++) {
            rise += gradient[j] * step[j];
            if (moves[j] && !c->may_be_negative[j] && c->m[j] + share * step[j] < 0)
                share = -c->m[j] / step[j], first = j;
        }
        int settled = !(rise > 1e-13 * fabs(c->value));
        /* Where nothing bends the dual, a step would lead as far as there are numbers. */
        const double most = FARTHEST * (fabs(c->value) + p->scale);
        const int far = rise * share > most;
        if (far) {
            c->grows = 1;
            share = most / rise;
            first = -1;
        }
        for (int cut = 0; cut < 40 && !settled; cut++, share /= 2, first = -1) {
            for (int j = 0; j < n; j++)
                next[j] = j == first ? 0 : c->m[j] + share * step[j];
            value = dual_at(p, c, points, at, heat, next, 0, 0);
            if (value >= c->value + 1e-4 * share * rise)
                break;
        }
        if (settled || (!(value > c->value) && first < 0)) {
            int best = -1;
            double most = 0;
            for (int j = 0; j < n; j++) {
                const double gain = gradient[j] * gradient[j] / (H[j * n + j] + 1e-300);
                if (!moves[j] && gradient[j] > 0 && gain > most)
                    best = j, most = gain;
            }
            if (best < 0 || !(most > 1e-12 * fabs(c->value))) {
                c->converged = settled || rise <= 1e-9 * fabs(c->value);
                break;
            }
            moves[best] = 1;
            continue;
        }
        if (first >= 0)
            moves[first] = 0;
        memcpy(c->m, next, sizeof(double) * n);
        c->value = dual_at(p, c, points, at, heat, c->m, gradient, H);
        if (c->value >= enough && (far || share == 1))
            break;
    }
    shrink(p, points, at, heat, enough, c);
    for (int j = 0; j < n; j++) /* steps that end at zero may miss it by rounding */
        if (!c->may_be_negative[j] && !(c->m[j] > 0))
            c->m[j] = 0;
}

void centre_choose(const Problem *p, Centre *c)
{
    if (!c->at.quadratic)
        point_inputs(p, c, &c->at, c->m);
    choose(p, c);
}

/* Add to minus the second derivatives of the dual what a start between its bounds makes of them. */
static void add_start_curvature(const Problem *p, const Centre *c, double *H)
{
    const int n = c->multipliers;
    const double *share = c->at.inputs + c->at.count, *row = c->at.rows + (size_t)c->at.count * WIDTH;
    for (int k = 0; k < p->spreads; k++, row += WIDTH)
        for (int j = 0; j < n && fabs(share[k]) < 1; j++)
            for (int l = 0; l < n; l++)
                H[j * n + l] += row[j] * row[l] / START_SMOOTHING(p);
}

/* Add to the derivative of its gradient by a duration what the start makes of it: from slopes of
 * the costates of the first phase, and those costates where the duration is its own. */
static void add_start_cross(const Problem *p, const Centre *c, const Steps *steps, int own,
                            const double *slopes, double *cross)
{
    const int n = c->multipliers;
    const double *share = c->at.inputs + c->at.count, *row = c->at.rows + (size_t)c->at.count * WIDTH;
    double moved[MOST_STATE * WIDTH], *by = moved;
    start_rows(p, c, steps, slopes, own ? COSTATES(&c->at, 0) : 0, moved);
    for (int k = 0; k < p->spreads; k++, row += WIDTH, by += WIDTH) {
        double change = by[n];
        for (int j = 0; j < n; j++)
            change += by[j] * c->m[j];
        if (!(fabs(share[k]) < 1))
            change = 0; /* it stays at its bound */
        for (int j = 0; j < n; j++)
            cross[j] += by[j] * share[k] - row[j] * change / START_SMOOTHING(p);
    }
}

/* Add to it what shifts of an event make of the state after it, as start_rows. */
static void add_after(const Problem *p, const Centre *c, const Steps *steps, int event,
                      const double *shift, const double *L, const double *by_duration, double *cross)
{
    double row[WIDTH];
    after_row(p, c, steps, event, shift, L, by_duration, row);
    for (int j = 0; j < c->multipliers; j++)
        cross[j] += row[j];
}

/* Add to it what shifts at the nodes of a phase, of those of all phases, make of it. */
static void add_moved(const Problem *p, const Centre *c, int i, const Steps *steps, const double *x,
                      int passing, const double *L, const double *by_duration, double *cross)
{
    double row[WIDTH];
    if (!p->phase[i].given)
        return;
    moved_row(p, c, i, steps, x + moved_before(p, i), passing, L, by_duration, row);
    for (int j = 0; j < c->multipliers; j++)
        cross[j] += row[j];
}

void centre_slopes(const Problem *p, const Steps *const *steps, const Value *const *values, Centre *c)
{
    const int n = c->multipliers, K = p->phases;
    double H[MOST_MULTIPLIERS * MOST_MULTIPLIERS];
    double residual[MOST_PHASES][MOST_COSTATE], costate[MOST_COSTATE];
    unsigned char is_free[MOST_MULTIPLIERS];
    memset(H, 0, sizeof(double) * n * n);
    for (int j = 0; j < n; j++)
        is_free[j] = c->may_be_negative[j] || c->m[j] > 0;
    for (int i = 0; i < K; i++) {
        const int d = steps[i]->d;
        const double *L = COSTATES(&c->at, i);
        double WL[MOST_COSTATE * WIDTH];
        for (int a = 0; a < d; a++) {
            costate[a] = L[a * WIDTH + n];
            for (int j = 0; j < n; j++)
                costate[a] += L[a * WIDTH + j] * c->m[j];
        }
        for (int a = 0; a < d; a++) {
            residual[i][a] = interval_mid(values[i]->linear[a].v0);
            for (int b = 0; b < d; b++)
                residual[i][a] -= interval_mid(values[i]->square[a * d + b].v0) * costate[b];
            for (int j = 0; j < n; j++) {
                double sum = 0;
                for (int b = 0; b < d; b++)
                    sum += interval_mid(values[i]->square[a * d + b].v0) * L[b * WIDTH + j];
                WL[a * WIDTH + j] = sum;
            }
        }
        for (int a = 0; a < d; a++)
            for (int j = 0; j < n; j++)
                for (int l = 0; l < n; l++)
                    H[j * n + l] += L[a * WIDTH + j] * WL[a * WIDTH + l];
    }
    add_start_curvature(p, c, H);
    double shift[MOST_PHASES][MOST_SHIFTS], rate[MOST_PHASES][MOST_SHIFTS], time = 0;
    for (int i = 0; i < K; i++)
        shifts_at(p, time += interval_mid(steps[i]->h.v0) * p->phase[i].steps, shift[i], rate[i]);
    for (int j = 0; j < p->goal_zero.rows; j++)
        H[j * n + j] += p->soft[j];
    for (int j = 0; j < n; j++) /* what no input between its bounds answers to stays where it is */
        is_free[j] = is_free[j] && H[j * n + j] > 0;
    for (int by = 0; by < K; by++) {
        double cross[MOST_MULTIPLIERS], A[MOST_MULTIPLIERS * MOST_MULTIPLIERS];
        static _Thread_local double slopes[2][MOST_COSTATE * WIDTH];
        memset(cross, 0, sizeof cross);
        for (int i = by; i >= 0; i--) {
            const int d = steps[i]->d;
            const double *L = COSTATES(&c->at, i);
            double *own = slopes[i % 2], change[MOST_COSTATE];
            for (int a = 0; a < d; a++)
                memset(own + a * WIDTH, 0, sizeof(double) * (size_t)(n + 1));
            if (i < by)
                costates_of(p, steps, c, by, i, COSTATES(&c->at, i + 1), slopes[(i + 1) % 2], own);
            for (int a = 0; a < d; a++) {
                change[a] = own[a * WIDTH + n];
                for (int j = 0; j < n; j++)
                    change[a] += own[a * WIDTH + j] * c->m[j];
            }
            for (int a = 0; a < d; a++) {
                double sum = 0;
                for (int b = 0; b < d; b++)
                    sum -= interval_mid(values[i]->square[a * d + b].v0) * change[b];
                if (i == by) {
                    sum += interval_mid(values[i]->linear[a].d0);
                    for (int b = 0; b < d; b++) {
                        double costate_b = L[b * WIDTH + n];
                        for (int j = 0; j < n; j++)
                            costate_b += L[b * WIDTH + j] * c->m[j];
                        sum -= interval_mid(values[i]->square[a * d + b].d0) * costate_b;
                    }
                }
                for (int j = 0; j < n; j++)
                    cross[j] += L[a * WIDTH + j] * sum + own[a * WIDTH + j] * residual[i][a];
            }
            add_moved(p, c, i, steps[i], c->at.moved, 0, own, i == by ? COSTATES(&c->at, i) : 0, cross);
            if (i == 0)
                add_start_cross(p, c, steps[0], by == 0, own, cross);
            else if (p->shifts.shifts)
                add_after(p, c, steps[i], i - 1, shift[i - 1], own,
                          i == by ? COSTATES(&c->at, i) : 0, cross);
        }
        for (int i = by; i < K; i++) {
            for (int k = 0; k < steps[i]->priced; k++) {
                Along along;
                shift_along(p, c, steps, i, k, &along);
                cross[c->first_priced + steps[i]->which[k]] += along.rate * (i == by ? along.share : 1);
            }
            add_moved(p, c, i, steps[i], c->at.rate, i == by, COSTATES(&c->at, i), 0, cross);
            const int last = i == K - 1, first = last ? 0 : c->first_event[i];
            const Rows *zero = last ? &p->goal_zero : &p->event[i].zero;
            const Rows *most = last ? &p->goal_most : &p->event[i].most;
            for (int k = 0; k < zero->rows; k++)
                cross[first + k] += shifted(p, zero, k, rate[i]);
            for (int k = 0; k < most->rows; k++)
                cross[first + zero->rows + k] += shifted(p, most, k, rate[i]);
            if (!last && p->shifts.shifts)
                add_after(p, c, steps[i + 1], i, rate[i], COSTATES(&c->at, i + 1), 0, cross);
        }
        memcpy(A, H, sizeof(double) * n * n);
        solve_free(n, A, cross, is_free, c->slope[by]);
        for (int j = 0; j < n; j++)
            if (!isfinite(c->slope[by][j]))
                c->slope[by][j] = 0;
    }
}

