/* The multipliers at the durations of the centre of a box, in numbers without intervals: any are
 * good for a bound, the best ones make it good. */
#ifndef DMOC_CENTRE_H
#define DMOC_CENTRE_H

#include "linear_program.h"

/* How often conditions that a motion violates are priced in one box. */
#define MOST_ROUNDS 3

/* The centre of a box and ends of it, at most. */
#define MOST_POINTS (MOST_PHASES + 3)

/* The dual at given durations. */
typedef struct {
    const double *t;            /* durations */
    const Steps *const *steps;  /* over ranges around them */
    int count;                  /* inputs of all steps */
    double constant[MOST_MULTIPLIERS + 1];
    int quadratic;              /* whether nothing has bounds: the dual is constant.(m, 1) - m.curved.m/2,
                                   and rows and inputs are unknown */
    double curved[MOST_MULTIPLIERS * MOST_MULTIPLIERS];
    double *costates;           /* of each phase (d, multipliers + 1), (phases, MOST_COSTATE, MOST_MULTIPLIERS + 1) */
    double *rows;               /* what the multipliers make of each input */
    double *inputs;             /* of all steps, and shares of the spreads of the start */
    double *moved, *rate;       /* of all phases: shifts at nodes (nodes, given), and their rates */
} Point;

/* Where the shifts of a phase begin in these. */
static inline size_t moved_before(const Problem *p, int phase)
{
    return phase ? moved_before(p, phase - 1) + moved_in_phase(p->phase + phase - 1) : 0;
}

#define COSTATES(point, i) ((point)->costates + (size_t)(i) * MOST_COSTATE * (MOST_MULTIPLIERS + 1))

typedef struct {
    int multipliers;            /* goal (zero, most), events (zero, most), priced */
    int first_event[MOST_PHASES];
    int first_priced;
    const Priced *priced;
    unsigned char may_be_negative[MOST_MULTIPLIERS];
    double m[MOST_MULTIPLIERS];
    double slope[MOST_PHASES][MOST_MULTIPLIERS]; /* by the durations */
    double value;
    int converged;
    int grows;                  /* whether nothing bent the dual on the way */
    Point at;
    Choice *choices;
} Centre;

/* Number the multipliers where so many conditions are priced; 1 where there are too many. */
int centre_number(const Problem *p, int count, const Priced *priced, Centre *centre);

/* What the multipliers make of the costates and inputs at durations t. */
void point_begin(const Problem *p, const Centre *centre, const double *t, const Steps *const *steps,
                 Point *point);

/* The dual at multipliers m, its gradient and minus its second derivatives where they are asked
 * for. */
double point_dual(const Problem *p, const Centre *centre, const Point *point, const double *m,
                  double *gradient, double *H);

/* The inputs at which the dual is taken. */
void point_inputs(const Problem *p, const Centre *centre, const Point *point, const double *m);

/* Maximise the least of the duals at some points, smoothed by ``heat``, from the multipliers that are
 * there; ``enough`` is a value beyond which nobody asks. */
void centre_maximise(const Problem *p, int points, const Point *const *at, double heat, double enough,
                     Centre *centre);

/* What the inputs of the centre do at its multipliers. */
void centre_choose(const Problem *p, Centre *centre);

/* How the multipliers follow the durations. */
void centre_slopes(const Problem *p, const Steps *const *steps, const Value *const *values, Centre *centre);

/* The condition along a phase that the inputs of the centre violate most; 0 where there is none. */
int centre_violated(const Problem *p, const Steps *const *steps, const Centre *centre, int count,
                    const Priced *priced, Priced *worst);

#endif
