/* A problem that is linear between its events, as dmoc.proving.linear states it, and what a bound
 * for a box of durations needs of it.
 *
 * Numbers of a phase: r coordinates y, nb inputs of a step, na = r (nodes inside and at the end of
 * a step), ns = given (nodes of a step) shifts s of surfaces that its contacts are closed with, which
 * drive its steps as inputs do. Its state is (y, p), costates are the prices of a state, (2 r); beside them stand the
 * prices of the conditions along the phase that are priced, and a 1: a costate of the size d.
 */
#ifndef DMOC_LINEAR_PROGRAM_H
#define DMOC_LINEAR_PROGRAM_H

#include <stddef.h>

#include "shifts.h"
#include "taylor.h"

/* Inputs of a step, conditions along the phases that are priced at one time, rows of a step,
 * multipliers. */
#define MOST_PHASES 10
#ifndef MOST_INPUTS
#define MOST_INPUTS 8
#endif
#ifndef MOST_PRICED
#define MOST_PRICED 16
#endif
#ifndef MOST_STEP_ROWS
#define MOST_STEP_ROWS 96
#endif
#ifndef MOST_MULTIPLIERS
#define MOST_MULTIPLIERS 48
#endif
#define MOST_STATE 16
#define MOST_NODES_OF_STEP 4
#define MOST_GIVEN 8            /* shifts of what the contacts of a phase are closed with */
#define MOST_MOVED (MOST_NODES_OF_STEP * MOST_GIVEN)
#define MOST_COSTATE (MOST_STATE + MOST_PRICED + 1)

typedef struct {
    int r, na, nb, steps, paths;
    int nodes, given;           /* of a step; shifts that move what its contacts are closed with */
    const double *place;        /* of its nodes, from 0 to 1, (nodes,) */
    const double *drives;       /* the numbers of these shifts, (given,) */
    const double *P;            /* (3, na + r, r + na + nb + ns + 1) */
    const double *R, *c;        /* (nb, nb), (nb,) */
    double c_0;
    const double *lower, *upper; /* of the inputs, (nb,) */
    const double *path, *most;  /* (paths, r), (paths,): path y <= most */
    const double *since;        /* (paths,): the step from which on it holds, inside and at its end */
    const double *moves;        /* (paths, shifts): what shifts add to path y */
    const double *within;       /* (paths,): whether it holds inside steps too */
    int rows, conditions;
    const double *S;            /* (rows, 3, 2 r + na + nb + ns + 1): rows (S_0 + h S_1 + h^2 S_2) of
                                   (y, h p, a, u, s, 1) in a step */
    int cost;                   /* the row of a step that is added to the cost, or -1 */
    const double *condition;    /* (conditions, 5): a row of a step and one of the next step, or -1,
                                   whose sum is not positive; the first step and the last one;
                                   and what it is */
} Phase;

/* Shifts at the nodes of a step, and numbers that rows of a step are functions of: y, h p, u, s, 1. */
static inline int moved_in_step(const Phase *p) { return p->nodes * p->given; }
static inline int columns_of(const Phase *p) { return 2 * p->r + p->nb + moved_in_step(p) + 1; }
/* Nodes of a phase, which steps share where they meet. */
static inline int nodes_of(const Phase *p) { return p->steps * (p->nodes - 1) + 1; }
/* Shifts at all of them. */
static inline size_t moved_in_phase(const Phase *p) { return (size_t)nodes_of(p) * (size_t)p->given; }

/* rows functions A z + b + shifted s(t) of a state z at the time t, whose shifts are s */
typedef struct {
    int rows, columns;
    const double *A, *b;
    const double *shifted;      /* (rows, shifts) */
} Rows;

/* rows functions b + shifted s(t) of the time alone, that vanish or are not positive */
typedef struct {
    int rows;
    const double *b;
    const double *shifted;      /* (rows, shifts) */
    const double *vanish;       /* (rows,) */
} Times;

typedef struct {
    Rows after, zero, most;
    Times when;
} Event;

typedef struct {
    int phases;
    const Phase *phase;         /* (phases,) */
    const Event *event;         /* (phases - 1,) */
    Rows goal_zero, goal_most;
    Rows goal_cost;             /* what the end costs beside, a row or none */
    Times goal_when;
    const double *soft;         /* (goal_zero rows,): a row w costs w^2/(2 soft), where that is not 0 */
    const double *middle;       /* of the state at the start, (2 r,) */
    int spreads;
    const double *spread;       /* (spreads, 2 r): of each any share from -1 to 1 is added */
    const double *tie;          /* (goal rows, 2 r): what the start adds to what is asked at the end,
                                   zero or most, beside what the middle does */
    const double *shortest, *longest;     /* durations, (phases,) */
    double earliest, latest;    /* final time */
    Shifts shifts;
    int definitions;            /* conditions that vanish, in all steps: they are priced first */
    double scale;               /* of the cost: for the multipliers of inputs that cost nothing */
} Problem;

/* A condition along a phase that is priced: row ``path`` at node ``node``, or at a place inside the
 * step that begins there; or condition ``path`` of this step. */
enum { AT_NODE = -1, IN_STEP = -2 };
/* What a condition is: it holds in each of its steps, it vanishes there, or its sum over them holds,
 * which is priced in the first one. */
enum { IN_EACH, VANISHES, IN_SUM };
typedef struct {
    int phase, node, inside, path;
} Priced;

/* What so many shifts add to a condition along a phase, (shifts,); none where it is one of rows of
 * steps, which have them at their nodes. */
static inline const double *moves_of(const Phase *phase, int shifts, const Priced *at)
{
    return at->inside == IN_STEP ? 0 : phase->moves + at->path * shifts;
}

/* The place of a condition along a phase, in steps from its begin. */
static inline double steps_until(const Phase *phase, const Priced *at)
{
    return at->node + (at->inside < 0 ? 0 : phase->place[1 + at->inside]);
}

/* What one input of one step does at the multipliers of the centre. */
enum { FREE, AT_LOWER, AT_UPPER, PUSHED, CHORD };
typedef struct {
    unsigned char kind;
    double price;               /* PUSHED: price of the bound, CHORD: slope */
    double offset;              /* CHORD: value at 0 */
} Choice;

/* What a phase makes of costates: linear.costate - costate.square.costate/2. */
typedef struct {
    line *linear;               /* (d,) */
    line *square;               /* (d, d) */
    curve *curves;              /* of both, (d + d d,) */
} Value;

/* The steps of a phase over a range of durations. */
typedef struct {
    int d, priced;              /* size of the costate; conditions along this phase */
    int which[MOST_PRICED];     /* their numbers among all that are priced */
    line h;
    interval away;              /* of the duration from its centre */
    double most;                /* its size */
    line *map;                  /* (2 r, columns): state after a step of (y, h p, u, s, 1) */
    line *inner;                /* (na - r, columns): places inside a step */
    line *rows;                 /* (rows, columns): those of S */
    line *response;             /* (steps, nb, d): what a unit of an input costs at its end */
    line *moved;                /* (nodes, given, d): what a unit of a shift at a node costs there */
    curve *moved_curves;        /* of these */
    line *start;                /* (2 r, d): prices of the state at the start */
    curve *start_curves;        /* (2 r, d) */
    Value without;              /* inputs left out but for their linear part; squares are unused */
    Value unbounded;            /* inputs without bounds, where they have a cost */
} Steps;

/* Memory of steps whose costates have the size d, and its parts. */
size_t steps_size(const Phase *phase, int d);
void steps_place(Steps *steps, const Phase *phase, int d, line *memory);

/* The steps of a phase over a range of durations, with conditions that are priced, where the state
 * at its start is (2 r,) without what the phase before makes of it; 0, or 1 where the steps are too
 * long for their equations to be solved. */
int phase_steps(const Phase *phase, int number, double centre, interval duration, int count,
                const Priced *priced, const double *begin, Steps *steps);

/* The value of a phase for choices of its inputs, in ``value`` or, where it is known, in place;
 * where costates over the range are given, choices that do not hold there are replaced. */
const Value *phase_value(const Phase *phase, const Steps *steps, Choice *choices,
                         const interval *costate, Value *value);

#endif
