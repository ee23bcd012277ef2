/* See step_map.h. */
#include "step_map.h"

#include <string.h>

#include "line_systems.h"

/* A polynomial in h whose coefficients stand so far from each other. */
static line polynomial(const double *at, int apart, line h, line h2)
{
    line sum = line_of(at[0]);
    if (at[apart] != 0)
        sum = line_add(sum, line_scaled(h, at[apart]));
    if (at[2 * apart] != 0)
        sum = line_add(sum, line_scaled(h2, at[2 * apart]));
    return sum;
}

/* P_0 + h P_1 + h^2 P_2 at one place. */
static line power(const Phase *p, line h, line h2, int row, int column)
{
    const int columns = columns_of(p) + p->na - p->r;
    return polynomial(p->P + row * columns + column, (p->na + p->r) * columns, h, h2);
}

/* Rows S as functions of (y, h p, u, s, 1), from the nodes (na, columns) as such functions. */
static void step_rows(const Phase *p, line h, line h2, const line *nodes, line *rows)
{
    const int s = 2 * p->r, m = columns_of(p), columns = m + p->na;
    for (int i = 0; i < p->rows; i++)
        for (int j = 0; j < m; j++) {
            const double *at = p->S + 3 * i * columns;
            line sum = polynomial(at + (j < s ? j : j + p->na), columns, h, h2);
            for (int k = 0; k < p->na; k++) {
                const line by_node = polynomial(at + s + k, columns, h, h2);
                if (!line_is_zero(by_node))
                    sum = line_add_mul(sum, by_node, nodes[k * m + j]);
            }
            rows[i * m + j] = sum;
        }
}

/* The state (y, h p) after a step and the places inside it as functions of (y, h p, u, s, 1) before. */
int step_map(const Phase *p, line h, line *map, line *inner, line *rows)
{
    const int r = p->r, na = p->na, m = columns_of(p);
    const line h2 = line_mul(h, h);
    line A[MOST_NODES * MOST_NODES], B[MOST_NODES * (MOST_STATE + MOST_INPUTS + MOST_MOVED + 1)];
    for (int i = 0; i < na; i++) {
        for (int j = 0; j < na; j++)
            A[i * na + j] = power(p, h, h2, i, r + j);
        for (int j = 0; j < r; j++) {
            B[i * m + j] = line_scaled(power(p, h, h2, i, j), -1);
            B[i * m + r + j] = line_of(i == na - r + j ? -1 : 0);
        }
        for (int j = 2 * r; j < m; j++)
            B[i * m + j] = line_scaled(power(p, h, h2, i, na + j - r), -1);
    }
    if (solve_lines(na, m, A, B))
        return 1;
    memcpy(inner, B, sizeof(line) * (na - r) * m);
    step_rows(p, h, h2, B, rows);
    for (int j = 0; j < m; j++)
        for (int i = 0; i < r; i++) {
            map[i * m + j] = B[(na - r + i) * m + j];
            line sum = line_of(0);
            for (int k = 0; k < na; k++)
                sum = line_add_mul(sum, power(p, h, h2, na + i, r + k), B[k * m + j]);
            if (j < r)
                sum = line_add(sum, power(p, h, h2, na + i, j));
            if (j >= 2 * r)
                sum = line_add(sum, power(p, h, h2, na + i, na + j - r));
            map[(r + i) * m + j] = sum;
        }
    return 0;
}
