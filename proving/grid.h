/* Durations at which boxes begin and end: few of them serve many boxes, whose steps they share. */
#ifndef DMOC_GRID_H
#define DMOC_GRID_H

#include "linear_program.h"

/* The box that is divided. */
typedef struct {
    double low[MOST_PHASES], high[MOST_PHASES];
} Grid;

/* Where a duration of a box is divided: near its middle, in the ratio; ``low`` where nothing is left
 * to divide. */
double grid_middle(const Grid *grid, int i, double low, double high);

/* Cut off a box what the final time rules out, up to the next places of the grid. */
void grid_contract(const Grid *grid, const Problem *problem, double *low, double *high);

#endif
