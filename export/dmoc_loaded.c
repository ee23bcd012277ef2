/* A carried solver as a shared library, which dmoc.load_solver compiles beside its sources.
 *
 * DMOC_PROBLEM is the problem. A row is all that an end has: cost, optimality and violation; times;
 * the tables; multipliers of rows and of bounds. counts[4]: the status, iterations, the number that
 * was refused, starts; expected: what was expected of that number. */
#define _POSIX_C_SOURCE 199309L

#include "dmoc_solver.h"

#include <string.h>
#include <time.h>

extern const dmoc_carried DMOC_PROBLEM;

enum { COUNTS = 4, HEAD = 3 };

double dmoc_loaded_clock(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9*(double)t.tv_nsec;
}

const dmoc_carried *dmoc_loaded(void) { return &DMOC_PROBLEM; }

static int stopped(void *stop, int iteration, double cost, double violation, double mu, int elastic)
{
    (void)iteration, (void)cost, (void)violation, (void)mu, (void)elastic;
    return *(const volatile int *)stop;
}

/* Doubles of a row. */
size_t dmoc_loaded_row(const dmoc_solver *s)
{
    const dmoc_carried *c = &DMOC_PROBLEM;
    int count, rows, columns;
    dmoc_solver_times(s, &count);
    size_t size = HEAD + (size_t)(count + dmoc_solver_rows(c) + dmoc_solver_size(c));
    for (int i = 0; i < dmoc_solver_tables(c); ++i) {
        dmoc_solver_table(s, i, &rows, &columns);
        size += (size_t)rows*(size_t)columns;
    }
    return size;
}

static double *put(double *row, const double *values, int count)
{
    memcpy(row, values, sizeof(double)*(size_t)count);
    return row + count;
}

static void read_end(const dmoc_solver *s, int status, double *row, int *counts,
                     const char **expected)
{
    const dmoc_carried *c = &DMOC_PROBLEM;
    const dmoc_end end = dmoc_solver_end(s);
    const double head[HEAD] = {end.cost, end.optimality, end.violation};
    int count, rows, columns;
    const double *times = dmoc_solver_times(s, &count);
    row = put(put(row, head, HEAD), times, count);
    for (int i = 0; i < dmoc_solver_tables(c); ++i) {
        const double *table = dmoc_solver_table(s, i, &rows, &columns);
        row = put(row, table, rows*columns);
    }
    dmoc_solver_multipliers(s, row, row + dmoc_solver_rows(c));
    counts[0] = status, counts[1] = end.iterations;
    counts[2] = dmoc_solver_wrong(s, expected), counts[3] = end.starts;
}

/* Solve until a moment of the clock, or until stop is not 0; with starts > 0 from several. */
void dmoc_loaded_solve(dmoc_solver *s, int iterations, double until, int starts,
                       unsigned long long seed, int *stop, double *row, int *counts,
                       const char **expected)
{
    dmoc_limits limits = dmoc_solver_limits();
    limits.iterations = iterations, limits.seconds = until - dmoc_loaded_clock();
    limits.clock = dmoc_loaded_clock, limits.report = stopped, limits.user = stop;
    const int status = starts ? dmoc_solver_explore(s, starts, seed, &limits)
                              : dmoc_solver_solve(s, &limits);
    read_end(s, status, row, counts, expected);
}

/* Solve instances that differ in numbers [count][numbers], each from the answer of the day of
 * export; rows [count][row] and counts [count][COUNTS]. Those that do not get their turn have
 * counts as they were. */
void dmoc_loaded_many(void *memory, size_t bytes, const double *numbers, int count, int iterations,
                      double until, int *stop, double *rows, int *counts, const char **expected)
{
    const int size = dmoc_solver_numbers(&DMOC_PROBLEM);
    for (int k = 0; k < count; ++k) {
        if (stopped(stop, 0, 0, 0, 0, 0) || !(dmoc_loaded_clock() < until))
            return;
        dmoc_solver *s = dmoc_solver_begin(&DMOC_PROBLEM, memory, bytes);
        for (int i = 0; i < size; ++i)
            dmoc_solver_set(s, i, numbers[(size_t)k*(size_t)size + (size_t)i]);
        dmoc_loaded_solve(s, iterations, until, 0, 0, stop, rows + (size_t)k*dmoc_loaded_row(s),
                          counts + COUNTS*k, expected + k);
    }
}
