/* What the motion of the best multipliers violates along its phases. */
#include <string.h>

#include "centre.h"
#include "costates.h"

/* Rows (rows, columns) of a state (y, h p), inputs, shifts at nodes and 1, at the centre. */
static void linear(int rows, const Phase *p, const line *map, const double *state, const double *u,
                   const double *moved, double *to)
{
    const int s = 2 * p->r, m = columns_of(p);
    for (int z = 0; z < rows; z++, map += m) {
        to[z] = interval_mid(map[m - 1].v0);
        for (int j = 0; j < s; j++)
            to[z] += interval_mid(map[j].v0) * state[j];
        for (int j = 0; j < p->nb; j++)
            to[z] += interval_mid(map[s + j].v0) * u[j];
        for (int j = 0; j < moved_in_step(p); j++)
            to[z] += interval_mid(map[s + p->nb + j].v0) * moved[j];
    }
}

/* Whether a condition is among those that are priced. */
static int is_priced(Priced at, int count, const Priced *priced)
{
    for (int l = 0; l < count; l++)
        if (priced[l].phase == at.phase && priced[l].node == at.node &&
            priced[l].inside == at.inside && priced[l].path == at.path)
            return 1;
    return 0;
}

/* See which of the conditions of a phase, at a place of a step, places y violate most, where shifts
 * are what they are at that time. */
static void compare(const Phase *p, int shifts, Priced at, int step, const double *y,
                    const double *shift, int count, const Priced *priced, double *most, Priced *worst)
{
    for (at.path = 0; at.path < p->paths; at.path++) {
        const double *moves = moves_of(p, shifts, &at);
        double excess = -p->most[at.path], size = fabs(excess);
        if (step < p->since[at.path] || (at.inside >= 0 && !p->within[at.path]))
            continue;
        for (int j = 0; j < shifts; j++) {
            excess += moves[j] * shift[j];
            size += fabs(moves[j] * shift[j]);
        }
        for (int z = 0; z < p->r; z++) {
            excess += p->path[at.path * p->r + z] * y[z];
            size += fabs(p->path[at.path * p->r + z] * y[z]);
        }
        if (excess > 1e-9 * size && excess > *most && !is_priced(at, count, priced)) {
            *most = excess;
            *worst = at;
        }
    }
}

/* What the conditions of a step make of a state (y, h p) and its inputs; ``before`` has what their
 * first rows made of the step before, and gets that of this one, and ``sums`` what all rows made of
 * the steps of the phase. */
static void compare_rows(const Phase *p, int phase, int k, const line *rows, const double *state,
                         const double *u, const double *moved, int count, const Priced *priced,
                         double *before, double *sums, double *most, Priced *worst)
{
    double now[MOST_STEP_ROWS];
    linear(p->rows, p, rows, state, u, moved, now);
    for (int i = 0; i < p->rows; i++)
        sums[i] = (k ? sums[i] : 0) + now[i];
    for (int i = 0; i < p->conditions; i++) {
        const double *of = p->condition + 5 * i;
        const int next = of[1] >= 0, in_sum = of[4] == IN_SUM;
        if (in_sum && k < of[3])
            continue;
        const double one = in_sum ? sums[(int)of[0]] : next ? before[(int)of[0]] : now[(int)of[0]];
        const double other = next ? now[(int)of[1]] : 0;
        const Priced at = {phase, in_sum ? (int)of[2] : k - next, IN_STEP, i};
        const double excess = one + other, size = fabs(one) + fabs(other);
        if (at.node >= of[2] && at.node <= of[3] && excess > 1e-9 * size && excess > *most &&
            !is_priced(at, count, priced)) {
            *most = excess;
            *worst = at;
        }
    }
    memcpy(before, now, sizeof *now * (size_t)p->rows);
}

int centre_violated(const Problem *p, const Steps *const *steps, const Centre *c, int count,
                    const Priced *priced, Priced *worst)
{
    const double *u = c->at.inputs;
    double state[MOST_STATE], next[MOST_STATE], inner[MOST_STATE], most = 0;
    double rows[MOST_STEP_ROWS], sums[MOST_STEP_ROWS], shift[MOST_SHIFTS], rate[MOST_SHIFTS], time = 0;
    int paths = 0;
    for (int i = 0; i < p->phases; i++)
        paths += p->phase[i].paths + p->phase[i].conditions;
    if (!paths)
        return 0;
    if (c->at.quadratic)
        point_inputs(p, c, &c->at, c->m);
    const int size = 2 * p->phase[0].r;
    const double *share = c->at.inputs;
    for (int i = 0; i < p->phases; i++)
        share += p->phase[i].steps * p->phase[i].nb;
    memcpy(state, p->middle, sizeof *state * (size_t)size);
    for (int k = 0; k < p->spreads; k++)
        for (int z = 0; z < size; z++)
            state[z] += share[k] * p->spread[k * size + z];
    for (int i = 0; i < p->phases; i++) {
        const Phase *ph = p->phase + i;
        const int r = ph->r, s = 2 * r, m = columns_of(ph), shifts = p->shifts.shifts;
        const double *moved = c->at.moved + moved_before(p, i);
        const double h = interval_mid(steps[i]->h.v0);
        for (int z = r; z < s; z++)
            state[z] *= h;
        for (int k = 0; k <= ph->steps; k++) {
            if (k) {
                shifts_at(p, time + h * k, shift, rate);
                compare(ph, shifts, (Priced){i, k, AT_NODE, 0}, k - 1, state, shift, count, priced, &most, worst);
            }
            if (k == ph->steps)
                break;
            for (int j = 0; j < ph->nodes - 2; j++) {
                shifts_at(p, time + h * (k + ph->place[1 + j]), shift, rate);
                linear(r, ph, steps[i]->inner + j * r * m, state, u, moved, inner);
                compare(ph, shifts, (Priced){i, k, j, 0}, k, inner, shift, count, priced, &most, worst);
            }
            compare_rows(ph, i, k, steps[i]->rows, state, u, moved, count, priced, rows, sums, &most, worst);
            linear(s, ph, steps[i]->map, state, u, moved, next);
            memcpy(state, next, sizeof state);
            u += ph->nb;
            moved += (ph->nodes - 1) * ph->given;
        }
        for (int z = r; z < s; z++)
            state[z] /= h;
        if (i == p->phases - 1)
            break;
        const Rows *after = &p->event[i].after;
        shifts_at(p, time += h * ph->steps, shift, rate);
        for (int z = 0; z < after->rows; z++) {
            next[z] = after->b[z] + shifted(p, after, z, shift);
            for (int j = 0; j < s; j++)
                next[z] += after->A[z * s + j] * state[j];
        }
        memcpy(state, next, sizeof state);
    }
    return most > 0;
}
