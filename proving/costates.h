/* Costates of the phases as functions of the multipliers. */
#ifndef DMOC_COSTATES_H
#define DMOC_COSTATES_H

#include "centre.h"

/* Columns of these functions: the multipliers, and 1. */
#define WIDTH (MOST_MULTIPLIERS + 1)
/* Curvature of costs that have none while multipliers are sought, relative to the cost; that of where
 * a start lies in its range, which nothing but multipliers that are zero keeps inside. */
#define SMOOTHING 1e-3
#define START_SMOOTHING(problem) (1e-6 * (problem)->scale)

/* The costates of phase i as functions of the multipliers and 1, from those of the phase after it,
 * and by one duration where ``by`` is not negative. */
void costates_of(const Problem *p, const Steps *const *steps, const Centre *c, int by, int i,
                        const double *later, const double *later_slope, double *L);

/* What the multipliers make of the spreads of the start, rows (spreads, multipliers + 1) at a stride
 * of WIDTH, without ties: those of costates L of the first phase, and what others give by its
 * duration where there are some. */
void start_rows(const Problem *p, const Centre *c, const Steps *steps, const double *L,
                const double *by_duration, double *row);

#endif
