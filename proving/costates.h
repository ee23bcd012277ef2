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

/* What the multipliers make of what shifts, (shifts,), add to the state after an event, a row
 * (multipliers + 1,): from costates L of the phase after it, as start_rows. */
void after_row(const Problem *p, const Centre *c, const Steps *steps, int event, const double *shift,
               const double *L, const double *by_duration, double *row);

/* What the multipliers make of shifts ``x`` at the nodes of a phase, (nodes, given), or, where they are
 * ``passing``, of their shares by how much of the phase has passed, as start_rows. */
void moved_row(const Problem *p, const Centre *c, int phase, const Steps *steps, const double *x,
               int passing, const double *L, const double *by_duration, double *row);

/* How a shift changes along a phase: by the time, and which share of the phase has passed. */
typedef struct {
    double rate, share;
} Along;

/* What shifts add to condition k of a phase at the centre. */
double shift_along(const Problem *p, const Centre *c, const Steps *const *steps, int phase, int k,
                   Along *along);

/* Shifts and their slopes at a time, (shifts,), and what they add to a row. */
void shifts_at(const Problem *p, double time, double *shift, double *rate);
static inline double shifted(const Problem *p, const Rows *rows, int row, const double *shift)
{
    double sum = 0;
    for (int j = 0; j < p->shifts.shifts; j++)
        sum += rows->shifted[row * p->shifts.shifts + j] * shift[j];
    return sum;
}

#endif
