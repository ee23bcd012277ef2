/* A solver of one optimal control problem, without Python, heap or globals.
 *
 * The header of the problem, which includes this one, names its numbers (start, goal, final time,
 * bounds, parameters) and its tables (unknowns), and says how much memory a solver takes:
 *
 *     static double memory[SWING_UP_MEMORY];
 *     dmoc_solver *s = dmoc_solver_begin(&swing_up, memory, sizeof memory);
 *     dmoc_solver_set(s, SWING_UP_START_ALPHA, 0.1);
 *     if (dmoc_solver_solve(s, NULL) == DMOC_SOLVED)
 *         ... dmoc_solver_table(s, SWING_UP_TABLE_Q, NULL, NULL) ...
 *
 * A solver lies in the caller's memory alone: several may work at the same time, each in its own.
 * Nothing else is kept or written, and nothing needs to be given back. Units are those of the
 * problem everywhere.
 */
#ifndef DMOC_SOLVER_H
#define DMOC_SOLVER_H

#include "interior_status.h"

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The form of these sources, which dmoc.load_solver asks for. */
enum { DMOC_SOLVER_FORMAT = 4 };

typedef struct dmoc_carried dmoc_carried; /* a problem, as constants */
typedef struct dmoc_solver dmoc_solver;

/* How a solve ends beside DMOC_SOLVED (a local minimum: the conditions of first order hold),
 * DMOC_INFEASIBLE, DMOC_ITERATION_LIMIT, DMOC_TIME_LIMIT, DMOC_STALLED and DMOC_INTERRUPTED. */
enum {
    DMOC_BAD_NUMBER = DMOC_NO_MEMORY + 1, /* see dmoc_solver_wrong; nothing was solved */
    /* The motion penetrates a surface, leaves a contact or a constraint, slides against the direction
     * of a phase, or moves where it sticks. */
    DMOC_OUTSIDE,
    /* With the parameters as they are, a mass is not positive somewhere along the motion, friction
     * is below zero or static friction below kinetic, or a hit returns more than it takes. */
    DMOC_UNPHYSICAL,
    DMOC_NO_REST  /* see dmoc_solver_shift; nothing was changed */
};

/* Limits and tolerances of a solve. */
typedef struct {
    int iterations;
    double seconds;        /* by the clock */
    double (*clock)(void); /* seconds since some time; NULL: no limit of the time */
    double optimality;     /* largest stationarity and complementarity, relative to the cost */
    double violation;      /* largest violation, relative to the size of the constraint */
    dmoc_report *report;   /* NULL for none; its cost is in units of dmoc_solver_cost */
    void *user;
} dmoc_limits;

/* What a solve leaves. */
typedef struct {
    double cost, optimality, violation;
    int iterations, restorations;
    long factorisations;
    int starts; /* that were tried */
} dmoc_end;

/* Bytes of memory that a solver of a problem takes. */
size_t dmoc_solver_memory(const dmoc_carried *problem);
/* Make a solver in memory that is aligned as a double: it has the numbers of the day of export and
 * starts from its answer. NULL where the memory is too small. */
dmoc_solver *dmoc_solver_begin(const dmoc_carried *problem, void *memory, size_t bytes);

/* Numbers: how many, the name of one, the one of a name (-1 for none), its value, a new value. A
 * value that does not fit is told by the next solve, and so is one that was set of a number that
 * there is not, as of -1: its name is NULL, its value not a number. */
int dmoc_solver_numbers(const dmoc_carried *problem);
const char *dmoc_solver_number(const dmoc_carried *problem, int number);
int dmoc_solver_find(const dmoc_carried *problem, const char *name);
double dmoc_solver_get(const dmoc_solver *s, int number);
void dmoc_solver_set(dmoc_solver *s, int number, double value);

/* Where the next solve starts: by default where the last one ended, with its multipliers if that
 * was a solution. Or from the answer of the day of export with its multipliers; without any, from
 * the first motion that a solve had then, or from given unknowns [dmoc_solver_size]. */
void dmoc_solver_from_answer(dmoc_solver *s);
void dmoc_solver_from_first_motion(dmoc_solver *s);
void dmoc_solver_from(dmoc_solver *s, const double *unknowns);

/* To the rest of the motion that the last solve has found: it starts with the state at a time of
 * the first phase, and what is fixed or bounded of its final time, and of the duration of that
 * phase, is shorter by so much. Unknowns and multipliers are interpolated for the next solve. A
 * start that was measured may be set afterwards. DMOC_SOLVED, or DMOC_NO_REST where the first event
 * is over at that time, the last end violates constraints by more than 1e-4 of their sizes, or the
 * problem has no such rest: the start has to be fixed, and nothing may depend on the time, on
 * integrals, on peaks or on both ends. */
int dmoc_solver_shift(dmoc_solver *s, double elapsed);

/* The limits that the package has by default. */
dmoc_limits dmoc_solver_limits(void);
/* Solve; limits may be NULL for the default ones. Returns how it ended. */
int dmoc_solver_solve(dmoc_solver *s, const dmoc_limits *limits);
/* Solve from several starts and end with the best: the solution of least cost; where there is none,
 * the least violation. The first starts are that of dmoc_solver_solve and the first motion. Those
 * that follow are random: every second one is the answer of the day of export, the others are the
 * first motion, with coordinates moved by up to some of their sizes along cubics that vanish at
 * both ends, and step sizes between half and one and a half of what they were. A seed gives the
 * same starts on all machines. Limits of iterations are for each start, of seconds for all. */
int dmoc_solver_explore(dmoc_solver *s, int starts, unsigned long long seed,
                        const dmoc_limits *limits);
/* The sentence that belongs to an end. */
const char *dmoc_solver_sentence(int status);
dmoc_end dmoc_solver_end(const dmoc_solver *s);
/* The number that a solve has refused, -1 for one that there is not and for its limits, and what it
 * expected of it; -1 and NULL for none. */
int dmoc_solver_wrong(const dmoc_solver *s, const char **expected);

/* The motion: all unknowns, and how many; a table of them, or of what follows from them, with rows
 * and columns if they are asked for, by rows; the times of the nodes, of which there are as many as
 * rows of q. Momenta, velocities and forces have a row for every node of every phase, so that an
 * event has two: node k of phase i is row k + i. Forces of what is open are zero, and so are those
 * after an event that ends the motion; where contacts hold a motion twice they are the impulses by
 * the time, of which the motion determines sums alone. */
int dmoc_solver_size(const dmoc_carried *problem);
const double *dmoc_solver_unknowns(const dmoc_solver *s);
int dmoc_solver_tables(const dmoc_carried *problem);
const char *dmoc_solver_table_name(const dmoc_carried *problem, int table);
const double *dmoc_solver_table(const dmoc_solver *s, int table, int *rows, int *columns);
const double *dmoc_solver_times(const dmoc_solver *s, int *count);

/* Multipliers: of the rows (c | d) [dmoc_solver_rows] in L = f + y . (c | d) - z . x, y <= 0 on
 * rows d >= 0, and of the bounds [dmoc_solver_size], z >= 0 at a lower one. */
int dmoc_solver_rows(const dmoc_carried *problem);
void dmoc_solver_multipliers(const dmoc_solver *s, double *y, double *z);

#ifdef __cplusplus
}
#endif

#endif
