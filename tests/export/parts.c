/* Parts of a carried solver alone, with what their files keep to themselves: one number a line.
 *
 *   parts positive n M...                   whether a matrix [n*n] is positive definite
 *   parts solve n rows A... B...           the rows of B[rows*n] by elimination in A[n*n]
 *   parts room nq inputs parameters nc nj nt functions[3] entries[3]
 *                                           the areas that a node has, one after the other, and
 *                                           what is left behind them
 */
#include "dmoc_motion.c"

#include <stdio.h>
#include <stdlib.h>

enum { MOST = 9 };

static void positive(char **words)
{
    double M[MOST];
    const int n = atoi(words[0]);
    for (int i = 0; i < n*n; ++i)
        M[i] = strtod(words[1 + i], NULL);
    printf("%d\n", carried_positive(M, n));
}

static void eliminate(char **words)
{
    double A[MOST], B[MOST];
    const int n = atoi(words[0]), rows = atoi(words[1]);
    for (int i = 0; i < n*n; ++i)
        A[i] = strtod(words[2 + i], NULL);
    for (int i = 0; i < rows*n; ++i)
        B[i] = strtod(words[2 + n*n + i], NULL);
    solve(A, n, B, rows);
    for (int i = 0; i < rows*n; ++i)
        printf("%.17g\n", B[i]);
}

static void room(char **words)
{
    static double pool[2];
    static const int chosen[MOST] = {-1, -1, -1, -1, -1, -1, -1, -1, -1};
    dmoc_carried c;
    dmoc_solver s;
    memset(&c, 0, sizeof c), memset(&s, 0, sizeof s);
    c.places.nq = atoi(words[0]), c.motion.inputs = atoi(words[1]);
    c.places.nc = atoi(words[3]), c.places.nj = atoi(words[4]), c.places.nt = atoi(words[5]);
    for (int kind = 0; kind < DMOC_KINDS; ++kind) {
        c.motion.functions[kind].count = atoi(words[6 + kind]);
        c.motion.functions[kind].entries = atoi(words[9 + kind]);
    }
    c.places.parameters = atoi(words[2]), c.places.chosen = chosen;
    s.c = &c, s.pool = pool;
    const size_t size = carried_work_size(&c);
    s.work = malloc(sizeof(double)*size);
    double *parameters = malloc(sizeof(double)*(2 + (size_t)c.places.parameters));
    s.pool = parameters;
    memset(parameters, 0, sizeof(double)*(2 + (size_t)c.places.parameters));
    const node_of at = node_in(&s, 0);
    const double *area[] = {
        at.parameters, at.zeros, at.mass, at.copy, at.rest, at.column, at.spare, at.slopes, at.push,
        at.response, at.product, at.rates, at.multiplier, at.stored, s.work + size,
    };
    for (size_t i = 0; i + 1 < sizeof area/sizeof *area; ++i)
        printf("%td\n", area[i + 1] - area[i]);
    free(parameters), free(s.work);
}

int main(int count, char **words)
{
    (void)count;
    if (!strcmp(words[1], "solve"))
        eliminate(words + 2);
    else
        (strcmp(words[1], "room") ? positive : room)(words + 2);
    return 0;
}
