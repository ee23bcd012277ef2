/* The dual over a box of durations, as polynomials, for prices that follow the durations. */
#ifndef DMOC_DUAL_H
#define DMOC_DUAL_H

#include "box.h"

/* A multiplier as function of the durations. */
void multiplier_model(const Centre *c, const Frame *frame, int j, model *m);

/* The dual as function of the durations of a frame, which has its centre at t, or its value alone
 * over a box where the frame has none. */
void dual_model(Engine *e, const Frame *frame, const Steps *const *all, const double *t,
                const interval *box);

#endif
