/* Conditions of the time alone at events and at the end, such as that of a table which a block leaves
 * when it falls faster. They rule out durations, whatever the motion is. */
#ifndef DMOC_TIMES_H
#define DMOC_TIMES_H

#include "linear_program.h"

/* Cut off a box of durations what they rule out; 0 where nothing is left of it. */
int times_contract(const Problem *problem, double *low, double *high);

#endif
