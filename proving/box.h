/* A lower bound of the cost over a box of durations. */
#ifndef DMOC_BOX_H
#define DMOC_BOX_H

#include "centre.h"
#include "models.h"
#include "steps_cache.h"

/* The time at a place of a motion, over a box: its centre up to rounding, its range, and powers of its
 * distance from the centre in units of ``reach``, which it is at most. */
typedef struct {
    interval centre, range;
    double reach;
    model power[DEGREE + 1];
} Clock;

/* Memory for the dual over a box. */
typedef struct {
    model costate[MOST_COSTATE], start[MOST_STATE], price, bent, value;
    Clock clock;
} Dual;

typedef struct {
    const Problem *problem;
    Cache cache;
    double aim;                 /* a cost below which nothing is of interest */
    double best, at[MOST_PHASES]; /* the least cost that was met, and its durations */
    long number;                /* of the box */
    Centre centre;
    Frame frame, point;         /* of all durations, of none */
    Dual dual;
    Point ends[MOST_POINTS - 1];
    Value values[MOST_PHASES];  /* memory for values */
    void *memory;
} Engine;

/* Memory for bounds of a problem, one of so many; 0, or 1 where there is none. */
int engine_begin(Engine *engine, const Problem *problem, int workers);
void engine_end(Engine *engine);

/* Whether durations of a box add up to a final time that may be. */
int box_has_time(const Problem *problem, const double *low, const double *high);

/* A number that no motion with durations in a box costs less than; infinity where there are none.
 * ``multipliers`` are those of a larger box, and become those of this one; ``widths`` say by which
 * duration the box ought to be divided. Beyond ``enough`` a bound may be as it is. */
double box_bound(Engine *engine, const double *low, const double *high, double enough,
                 double *multipliers, double *widths);

#endif
