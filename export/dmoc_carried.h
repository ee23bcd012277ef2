/* A problem as constants: what dmoc_solver.c reads, and dmoc writes on the day of export. */
#ifndef DMOC_CARRIED_H
#define DMOC_CARRIED_H

#include "dmoc_solver.h"
#include "interior_point.h"

/* What a number moves beside the pool: an entry of one of these arrays, by slope for each unit. */
enum { DMOC_LOWER, DMOC_UPPER, DMOC_CONSTANT, DMOC_COEFFICIENT, DMOC_SLOPE, DMOC_ARRAYS };

typedef struct {
    int array, entry;
    double slope;
} dmoc_change;

/* pool: where the value of a parameter is in the pool, -1 for none. least, most: the numbers that
 * it must lie between, -1 for none. */
typedef struct {
    const char *name;
    double value; /* of the day of export */
    int pool, first, changes, least, most;
} dmoc_number;

typedef struct {
    const char *name;
    int first, rows, columns; /* of the unknowns */
} dmoc_table_of;

/* A state at one end whose position and velocity are fixed: its momenta follow. known: whether
 * there is one. number[2*nq]: the numbers of q and v, -1 for those that have none, which have the
 * values value[2*nq]; momentum[nq]: the unknowns. */
typedef struct {
    int known;
    const int *number, *momentum;
    const double *value;
} dmoc_state;

/* What positions and velocities keep: kernels, NULL for none, and sizes of their results. */
typedef struct {
    const dmoc_entry *momentum, *surface, *gap_rate, *joint, *joint_rate;
    int nq, nc, nj, parameters;
    const int *chosen; /* [parameters] the unknowns that they are, or -1 */
    const double *gap, *rate, *joint_size, *joint_rate_size;
    const int *held; /* [phases*nc] 0 for what holds nothing back, 1 open, 2 closed */
    int q, t;        /* the first unknowns of these tables; t is -1 for none */
} dmoc_places;

struct dmoc_carried {
    const char *name;
    dmoc_program program; /* without what is written: pool and scratch are NULL */
    dmoc_kkt kkt;
    dmoc_ldl ldl;         /* the analysis alone */
    const double *pool;
    int pool_size, coefficients;
    int numbers, tables, phases;
    const dmoc_number *number;
    const dmoc_change *change;
    const dmoc_table_of *table;
    dmoc_state state[2];
    dmoc_places places;
    const int *steps;     /* [phases] of the phases; their sizes are the first unknowns */
    double cost;          /* size of the cost */
    /* The answer of the day of export, scaled, and the first motion before it. */
    const double *x, *y, *z, *first;
};

#endif
