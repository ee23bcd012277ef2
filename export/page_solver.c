/* The solver of a page that plans, and the drawing of its model: what its scripts call. Numbers and
 * positions are put into arrays whose places it tells; what comes back lies in others. */
#include "kernels.h"
#include "planned.h"

#define EXPORT(name) __attribute__((export_name(#name)))

static const double SECONDS = 1; /* for a solve, and once more for several starts */
enum { STARTS = 8, SEED = 1 };

static double memory[PLANNED_MEMORY];
static double value[PLANNED_NUMBERS + 1];
static double q[PAGE_ROWS*PAGE_COORDINATES], t[PAGE_ROWS], parameter[PAGE_PARAMETERS + 1];
static double shape[PAGE_ROWS*PAGE_COLUMNS];
static dmoc_solver *solver;

__attribute__((import_module("page"), import_name("seconds"))) double seconds(void);

static dmoc_solver *begun(void)
{
    if (!solver)
        solver = dmoc_solver_begin(&planned_problem, memory, sizeof memory);
    return solver;
}

EXPORT(numbers) double *numbers(void) { return value; }

/* Solve with the numbers: from the last motion, or else from several starts. */
EXPORT(solve) int solve(void)
{
    dmoc_solver *s = begun();
    dmoc_limits limits = dmoc_solver_limits();
    limits.seconds = SECONDS, limits.clock = seconds;
    for (int i = 0; i < PLANNED_NUMBERS; ++i)
        dmoc_solver_set(s, i, value[i]);
    int status = dmoc_solver_solve(s, &limits);
    if (status != DMOC_SOLVED && status != DMOC_BAD_NUMBER) {
        dmoc_solver_from_answer(s);
        status = dmoc_solver_explore(s, STARTS, SEED, &limits);
        if (status != DMOC_SOLVED)
            dmoc_solver_from_answer(s);
    }
    return status;
}

EXPORT(wrong) int wrong(void) { return dmoc_solver_wrong(begun(), NULL); }

/* What is told of an end: what was expected of a number, or how it ended. */
EXPORT(sentence) const char *sentence(int status)
{
    const char *expected = NULL;
    return dmoc_solver_wrong(begun(), &expected) < 0 ? dmoc_solver_sentence(status) : expected;
}

EXPORT(cost) double cost(void) { return dmoc_solver_end(begun()).cost; }
EXPORT(iterations) int iterations(void) { return dmoc_solver_end(begun()).iterations; }
EXPORT(size) int size(void) { return dmoc_solver_size(&planned_problem); }
EXPORT(unknowns) const double *unknowns(void) { return dmoc_solver_unknowns(begun()); }
EXPORT(times) const double *times(void) { return dmoc_solver_times(begun(), NULL); }

EXPORT(nodes) int nodes(void)
{
    int count;
    dmoc_solver_times(begun(), &count);
    return count;
}

EXPORT(positions) double *positions(void) { return q; }
EXPORT(moments) double *moments(void) { return t; }
EXPORT(parameters) double *parameters(void) { return parameter; }

/* The drawing at some rows of positions and times. */
EXPORT(draw) const double *draw(int rows)
{
    const double *const in[] = {q, t, parameter};
    const ptrdiff_t stride[] = {PAGE_COORDINATES, 1, 0};
    double *const out[] = {shape};
    PAGE_DRAWING(rows, in, stride, out);
    return shape;
}
