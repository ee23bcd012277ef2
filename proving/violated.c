/* What the motion of the best multipliers violates along its phases. */
#include <string.h>

#include "centre.h"

int centre_violated(const Problem *p, const Steps *const *steps, const Centre *c, int count,
                    const Priced *priced, Priced *worst)
{
    const double *u = c->inputs;
    double state[MOST_STATE], next[MOST_STATE], most = 0;
    const double *start = c->inputs;
    for (int i = 0; i < p->phases; i++)
        start += p->phase[i].steps * p->phase[i].nb;
    for (int z = 0; z < 2 * p->phase[0].r; z++) {
        const double reach = (p->start_high[z] - p->start_low[z]) / 2;
        state[z] = p->start_low[z] + reach + (reach > 0 ? start[z] : 0);
    }
    for (int i = 0; i < p->phases; i++) {
        const Phase *ph = p->phase + i;
        const int r = ph->r, s = 2 * r, m = s + ph->nb + 1;
        const double h = interval_mid(steps[i]->h.v0);
        for (int z = r; z < s; z++)
            state[z] *= h;
        for (int k = 0; k <= ph->steps; k++) {
            for (int j = 0; j < ph->paths && k; j++) {
                double excess = -ph->most[j], size = fabs(ph->most[j]);
                for (int z = 0; z < r; z++) {
                    excess += ph->path[j * r + z] * state[z];
                    size += fabs(ph->path[j * r + z] * state[z]);
                }
                if (!(excess > 1e-9 * size && excess > most))
                    continue;
                int known = 0;
                for (int l = 0; l < count; l++)
                    known |= priced[l].phase == i && priced[l].node == k && priced[l].path == j;
                if (known)
                    continue;
                most = excess;
                *worst = (Priced){i, k, j};
            }
            if (k == ph->steps)
                break;
            for (int z = 0; z < s; z++) {
                const line *map = steps[i]->map + z * m;
                next[z] = interval_mid(map[m - 1].v0);
                for (int j = 0; j < s; j++)
                    next[z] += interval_mid(map[j].v0) * state[j];
                for (int j = 0; j < ph->nb; j++)
                    next[z] += interval_mid(map[s + j].v0) * u[j];
            }
            memcpy(state, next, sizeof state);
            u += ph->nb;
        }
        for (int z = r; z < s; z++)
            state[z] /= h;
        if (i == p->phases - 1)
            break;
        const Rows *after = &p->event[i].after;
        for (int z = 0; z < after->rows; z++) {
            next[z] = after->b[z];
            for (int j = 0; j < s; j++)
                next[z] += after->A[z * s + j] * state[j];
        }
        memcpy(state, next, sizeof state);
    }
    return most > 0;
}
