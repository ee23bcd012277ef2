/* What the files of a carried solver share; dmoc_solver.h is its interface.
 *
 *   dmoc_numbers.c   numbers into the program, and those that do not fit
 *   dmoc_judge.c     residuals of an end, and whether positions keep what they must
 *   dmoc_laws.c      whether the laws that an end goes by are laws
 *   dmoc_motion.c    tables of an end: times, momenta, velocities, forces
 *   dmoc_events.c    what tells that an event has happened
 *   dmoc_starts.c    where a solve starts, solves from several starts, the rest of a motion
 *   dmoc_solver.c    memory, a solve
 *   dmoc_planner.c   the rest of a motion again and again, from measured states
 */
#ifndef DMOC_INSIDE_H
#define DMOC_INSIDE_H

#include "dmoc_carried.h"

#include <math.h>
#include <string.h>

/* As dmoc.base.tolerances has them. */
static const double CARRIED_LEAST_COST = 1e-2, CARRIED_INFEASIBLE = 1e-6, CARRIED_KEPT = 1e-6;

struct dmoc_solver {
    const dmoc_carried *c;
    dmoc_program program;
    dmoc_ldl ldl;
    dmoc_pass momenta;
    double *array[DMOC_ARRAYS]; /* those that numbers move */
    dmoc_element *elements;     /* of all passes, where numbers move factors */
    double *numbers, *pool;
    double *x, *y, *z;          /* scaled unknowns, multipliers of rows and of bounds */
    double *best;               /* the three of them, of several starts */
    double *size, *stretch, *z_lower, *z_upper, *values, *slopes;
    double *physical, *times, *results, *work;
    void *memory;               /* of the method */
    int warm, wrong;
    int strays;                 /* whether something slides otherwise than said where phases end */
    int unnamed;                /* whether a number was set that there is not */
    const char *expected;
    dmoc_end end;
};

static inline void carried_copy(double *to, const double *from, ptrdiff_t count)
{
    if (count > 0)
        memcpy(to, from, sizeof(double)*(size_t)count);
}

/* One row of a kernel, of which the first results are wanted. */
static inline void carried_call(const dmoc_entry *entry, const double *const in[], double *first,
                                double *second)
{
    const ptrdiff_t stride[DMOC_MOST] = {0};
    double *results[DMOC_MOST] = {first, second};
    entry->kernel(1, in, stride, results);
}

/* Where the parameters of a phase begin in the pool. */
static inline ptrdiff_t carried_first_parameter(const dmoc_solver *s, int phase)
{
    const dmoc_places *p = &s->c->places;
    return s->program.n + s->program.m + 2 + (p->by_phase ? phase*p->parameters : 0);
}

static inline int carried_nodes(const dmoc_carried *c)
{
    int count = 1;
    for (int i = 0; i < c->phases; ++i)
        count += c->steps[i];
    return count;
}

/* Phases with steps, whose sizes are the first unknowns: all, or all but the last. */
static inline int carried_stepped(const dmoc_carried *c)
{
    return c->phases - !c->steps[c->phases - 1];
}

/* Calls between the files stay inside of the library. */
#ifdef __GNUC__
#pragma GCC visibility push(hidden)
#endif

/* dmoc_numbers.c */
int carried_apply(dmoc_solver *s);
int carried_limited(dmoc_solver *s, const dmoc_limits *limits);

/* dmoc_judge.c */
void carried_evaluate(dmoc_solver *s);
int carried_judge(dmoc_solver *s, int word, const dmoc_limits *limits);
int carried_all_inside(const dmoc_solver *s);
/* Whether something slides against its direction, or moves where it sticks, in a state (q, v, t,
 * parameters) of a phase in which tangential positions have slopes[nt*nq]; rates[nt] is room. */
int carried_strays(const dmoc_solver *s, int phase, const double *const in[], const double *slopes,
                   double *rates);

/* dmoc_laws.c */
/* Whether M[n*n] is positive definite; in its place comes its Cholesky factor. */
int carried_positive(double *M, int n);
/* The same of the mass at a position, which lies outside of what is worked with there. */
int carried_mass_at(const dmoc_solver *s, const double *q, double time, const double *parameters);
int carried_lawful(const dmoc_solver *s);

/* dmoc_motion.c */
size_t carried_results_size(const dmoc_carried *c);
size_t carried_work_size(const dmoc_carried *c);
void carried_parameters(const dmoc_solver *s, int phase, double *parameters);
void carried_read_out(dmoc_solver *s);
/* A state near the start moved, by the reach of coordinates and the masses of velocities, to where
 * what is held then is in place, without rates, and in front of the surfaces that are open. */
void carried_keep(const dmoc_solver *s, double *q, double *v);

/* dmoc_events.c */
/* The value of what passes zero at an event of a kind (DMOC_OF_GAP, ...), and its rate. */
void carried_event(const dmoc_solver *s, int kind, int number, const double *q, const double *v,
                   double *value, double *rate);

#ifdef __GNUC__
#pragma GCC visibility pop
#endif

#endif
