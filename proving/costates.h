/* Costates of the phases as functions of the multipliers. */
#ifndef DMOC_COSTATES_H
#define DMOC_COSTATES_H

#include "centre.h"

/* Columns of these functions: the multipliers, and 1. */
#define WIDTH (MOST_MULTIPLIERS + 1)

/* The costates of phase i as functions of the multipliers and 1, from those of the phase after it,
 * and by one duration where ``by`` is not negative. */
void costates_of(const Problem *p, const Steps *const *steps, const Centre *c, int by, int i,
                        const double *later, const double *later_slope, double *L);

#endif
