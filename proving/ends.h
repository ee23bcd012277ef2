/* Multipliers for boxes in which what is asked decides durations. */
#ifndef DMOC_ENDS_H
#define DMOC_ENDS_H

#include "box.h"
#include "convex.h"

/* Durations at which the dual is to be large. */
typedef struct {
    int n, count;               /* durations, ends */
    double t[MOST_POINTS - 1][MOST_PHASES];
} Ends;

/* The two ends of a range around durations t in the direction of a slope. */
void ends_begin(const Engine *engine, const double *t, const Range *range, const double *slope, Ends *ends);

/* Add the end where something of this slope is least; 1 where it is one of them, or there is no room. */
int ends_add(const double *t, const Range *range, const double *slope, Ends *ends);

/* Multipliers for which the dual is large at all ends of a box with the centre t, where it has none
 * that are the best, and the steps for them; conditions that are violated are priced. 1 where they
 * cannot be said. */
int ends_maximise(Engine *engine, const double *low, const double *high, const double *t, double enough,
                  const Steps **steps, const Ends *ends);

#endif
