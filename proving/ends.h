/* Multipliers for boxes in which what is asked decides durations. */
#ifndef DMOC_ENDS_H
#define DMOC_ENDS_H

#include "box.h"
#include "convex.h"

/* Multipliers for which the dual is large at both ends of a box, in the direction of its ``slope`` at
 * the centre t, where it has none that are the best, and the steps for them; conditions that are
 * violated are priced. 1 where they cannot be said. */
int ends_maximise(Engine *engine, const double *low, const double *high, const double *t,
                  const Range *range, const double *slope, double enough, const Steps **steps);

#endif
