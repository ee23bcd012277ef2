/* Planning in a loop: the rest of a motion, again and again, from states that are measured.
 *
 *     static double memory[SWING_UP_PLANNER_MEMORY];
 *     dmoc_planner *p = dmoc_planner_begin(&swing_up_rests, memory, sizeof memory);
 *     ... every few milliseconds:
 *     dmoc_planner_replan(p, time, state, -1, &limits);
 *     ... and until the next plan:
 *     dmoc_planner_input(p, time, u);
 *
 * A planner lies in the caller's memory alone. Times are seconds from the beginning of the motion,
 * a state is (q | v).
 */
#ifndef DMOC_PLANNER_H
#define DMOC_PLANNER_H

#include "dmoc_solver.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The programs of the rests of a motion from each of its phases on. begin: when that phase is
 * planned to begin. event[phases - 1]: the surface that is hit or lands after a phase, the switch
 * that is passed, or the surface whose end is, by kind[phases - 1] (DMOC_OF_GAP, ...); -1 for
 * none. */
typedef struct {
    const dmoc_carried *problem;
    double begin;
} dmoc_rest_from;

typedef struct {
    int phases, rests, recedes;
    const int *event, *kind;
    const dmoc_rest_from *rest;
} dmoc_rests;

typedef struct dmoc_planner dmoc_planner;

/* How planning ends beside the ends of a solve. DMOC_BAD_NUMBER: the time is before that of the
 * last state, the phase is over or none, or the state is not finite; DMOC_NO_REST: the motion, or
 * what its bounds leave of it, is over. */
enum {
    DMOC_BEHIND = DMOC_NO_REST + 1, /* the state lies far behind a surface that is open */
    DMOC_NEARLY, /* the next event is sooner than a phase may last */
    DMOC_AGAINST /* the state slides against the direction of its phase */
};

/* Bytes of memory that a planner takes. */
size_t dmoc_planner_memory(const dmoc_rests *rests);
/* Make a planner in memory that is aligned as a double; its first plan is the answer of the day of
 * export. NULL where the memory is too small. */
dmoc_planner *dmoc_planner_begin(const dmoc_rests *rests, void *memory, size_t bytes);

/* Plan from a state that was measured at a time, in a phase of the whole motion: where it is known,
 * as from a switch at a stop; -1 reads it from the state. limits may be NULL: 60 iterations.
 * Returns how it ended. dmoc_planner_new says whether there is a new plan; the last one goes on
 * where there is none. A motion that a limit cuts off is a plan where it is feasible to 1e-4 of the
 * sizes of its constraints. No input may be asked for while a plan is made. */
int dmoc_planner_replan(dmoc_planner *p, double time, const double *state, int phase,
                        const dmoc_limits *limits);
/* The inputs of the plan at a time; at its ends those there. */
void dmoc_planner_input(const dmoc_planner *p, double time, double *u);

int dmoc_planner_phase(const dmoc_planner *p);     /* that the last state was in */
int dmoc_planner_new(const dmoc_planner *p);
double dmoc_planner_origin(const dmoc_planner *p); /* when the plan was made that is followed */
double dmoc_planner_end(const dmoc_planner *p);    /* when it ends */
/* The solver of the plan that is followed, whose times begin at the origin. Its numbers may be
 * changed, except for its start, final time and durations, which are the planner's: goal, bounds
 * and parameters go over to the rest from another phase by their names. */
dmoc_solver *dmoc_planner_solver(const dmoc_planner *p);
const char *dmoc_planner_sentence(int status);

#ifdef __cplusplus
}
#endif

#endif
