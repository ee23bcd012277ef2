/* The dual over a box of durations: its value and derivatives for prices that follow the durations. */
#ifndef DMOC_DUAL_H
#define DMOC_DUAL_H

#include "box.h"

/* A multiplier as function of n durations, at distances ``away`` from the centre. */
void multiplier_jet(const Centre *c, int n, int j, const interval *away, jet *m);

/* The dual as function of n durations in a box, or its value alone for none, at distances ``away``
 * from its centre t. */
void dual_jet(Engine *e, int n, const Steps *const *all, const double *t, const interval *box,
                     const interval *away, jet *value);

#endif
