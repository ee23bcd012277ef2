/* The multipliers at the durations of the centre of a box, in numbers without intervals: any are
 * good for a bound, the best ones make it good. */
#ifndef DMOC_CENTRE_H
#define DMOC_CENTRE_H

#include "linear_program.h"

typedef struct {
    int multipliers;            /* goal (zero, most), events (zero, most), priced */
    int first_event[MOST_PHASES];
    int first_priced;
    unsigned char may_be_negative[MOST_MULTIPLIERS];
    double m[MOST_MULTIPLIERS];
    double slope[MOST_PHASES][MOST_MULTIPLIERS]; /* by the durations */
    double value;
    int converged;
    double *costates;           /* of each phase (d, multipliers + 1), (phases, MOST_COSTATE, MOST_MULTIPLIERS + 1) */
    double *rows;               /* what the multipliers make of each input */
    double *inputs;             /* of all steps */
    Choice *choices;
} Centre;

#define COSTATES(centre, i) ((centre)->costates + (size_t)(i) * MOST_COSTATE * (MOST_MULTIPLIERS + 1))

/* Number the multipliers where so many conditions are priced; 1 where there are too many. */
int centre_number(const Problem *p, int count, Centre *centre);

/* Maximise the dual at durations t from the multipliers that are there; ``enough`` is a value
 * beyond which nobody asks. */
void centre_maximise(const Problem *p, const double *t, const Steps *const *steps, double enough,
                     Centre *centre);

/* How the multipliers follow the durations. */
void centre_slopes(const Problem *p, const Steps *const *steps, const Value *const *values, Centre *centre);

/* The condition along a phase that the inputs of the centre violate most; 0 where there is none. */
int centre_violated(const Problem *p, const Steps *const *steps, const Centre *centre, int count,
                    const Priced *priced, Priced *worst);

#endif
