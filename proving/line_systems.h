/* Linear systems of functions of one duration. */
#ifndef DMOC_LINE_SYSTEMS_H
#define DMOC_LINE_SYSTEMS_H

#include "taylor.h"

#define MOST_NODES 24 /* unknowns of a step */

/* Solve A X = B, shapes (n, n) and (n, m), for matrices of lines; A and B are used up. 1 where that
 * cannot be done. */
int solve_lines(int n, int m, line *A, line *B);

#endif
