/* How surfaces move: functions of the time, as operations one after another. */
#ifndef DMOC_SHIFTS_H
#define DMOC_SHIFTS_H

#include "taylor.h"

#define MOST_OPERATIONS 512
#define MOST_SHIFTS 32

/* Operations; those with two arguments first. */
enum { SUM, PRODUCT, POWER, NEGATIVE, SQUARE, INVERSE, ROOT, SINE, COSINE, EXPONENTIAL, LOGARITHM, ARCTANGENT,
       CONSTANT, TIME };

typedef struct {
    int operations, shifts;
    const int *operation;       /* (operations, 3): which, and the numbers of its arguments */
    const double *constant;     /* (operations, 2): bounds of a constant */
    const int *result;          /* (shifts,): the operation that a shift is */
} Shifts;

/* All shifts over a range of the time, whose centre is known up to rounding, (shifts,). */
void shifts_over(const Shifts *shifts, interval centre, interval range, line *values);

#endif
