/* A problem as constants: what dmoc_solver.c reads, and dmoc writes on the day of export. */
#ifndef DMOC_CARRIED_H
#define DMOC_CARRIED_H

#include "dmoc_solver.h"
#include "interior_point.h"

/* What a number moves beside the pool: an entry of one of these arrays, by slope for each unit. */
enum { DMOC_LOWER, DMOC_UPPER, DMOC_CONSTANT, DMOC_COEFFICIENT, DMOC_SLOPE, DMOC_FACTOR,
       DMOC_ARRAYS };

typedef struct {
    int array, entry;
    double slope;
} dmoc_change;

/* What a number may be: any bound, a coefficient above 0 and at most 1, a time, one that may be 0, a
 * position or velocity, a parameter. */
enum { DMOC_BOUND, DMOC_SHARE, DMOC_TIME, DMOC_EARLIEST_TIME, DMOC_STATE, DMOC_PARAMETER };

/* pool: where the value of a parameter is in the pool, -1 for none; phases: in so many phases, each
 * with parameters of its own. least, most: the numbers that it must lie between, -1 for none. */
typedef struct {
    const char *name;
    double value; /* of the day of export */
    int pool, phases, first, changes, least, most, kind;
} dmoc_number;

/* A result of an element of a pass (0 values, 1 slopes, 2 curvatures) whose factors numbers move:
 * they begin at DMOC_FACTOR[at]. */
typedef struct {
    int pass, element, output, at;
} dmoc_moved;

typedef struct {
    const char *name;
    int first, rows, columns;
    int derived; /* found from the unknowns (dmoc_motion.c), not one of them */
} dmoc_table_of;

/* A state at one end whose position and velocity are fixed: its momenta follow. known: whether
 * there is one. number[2*nq]: the numbers of q and v, -1 for those that have none, which have the
 * values value[2*nq]; momentum[nq]: the unknowns. */
typedef struct {
    int known;
    const int *number, *momentum;
    const double *value;
} dmoc_state;

/* Functions of one kind: gaps, tangential positions, constraints, which push along a motion, or
 * switches. slopes: the kernel of their derivatives by (q, t), of switches by (q, v, t), of which
 * entry e is that of function row[e] by column[e]; NULL where the model has none. rates: the kernel
 * of their rates; of switches that of their values. */
typedef struct {
    const dmoc_entry *slopes, *rates;
    int count, entries;
    const int *row, *column;
} dmoc_functions;

/* What tells that an event has happened: the gap of a surface or, to either side, of a grip; a
 * switch; how far a contact is past an end of its surface. */
enum { DMOC_OF_GAP, DMOC_OF_GRIP, DMOC_OF_SWITCH, DMOC_OF_END };

/* What positions and velocities keep: kernels, NULL for none, and sizes of their results. */
typedef struct {
    const dmoc_entry *momentum, *surface, *gap_rate, *joint, *joint_rate, *tangent;
    const dmoc_entry *barrier; /* of open surfaces: the same, or one that counts within their ends */
    const dmoc_entry *within, *within_rate; /* of the ends of surfaces, NULL where none has some */
    dmoc_functions crossing; /* switches */
    int nq, nc, nj, nt, parameters;
    int by_phase;      /* whether each phase has parameters of its own */
    const int *chosen; /* [parameters] the unknowns that they are, or -1 */
    const double *gap, *rate, *joint_size, *joint_rate_size, *tangent_size, *slide_size;
    const double *reach; /* [nq] how far coordinates may move */
    const int *held; /* [phases*nc] 0 for what holds nothing back, 1 open, 2 closed */
    const int *stuck; /* [phases*nt] whether a tangent sticks */
    const int *slides; /* [phases*nt] the direction in which it slides, 0 for none */
    int q, t;        /* the first unknowns of these tables; t is -1 for none */
} dmoc_places;

/* What pushes along a phase: impulses of some functions of a kind at its stations, which change
 * momenta by sign*impulse*slope. */
typedef struct {
    int phase, kind, columns;
    double sign;
    const int *column; /* [columns] the functions */
    const int *holds;  /* [columns] whether rates vanish, and not because others do */
    const int *impulse; /* [stations*columns] unknowns */
} dmoc_reaction;

enum { DMOC_NORMAL, DMOC_TANGENTIAL, DMOC_REACTION, DMOC_KINDS };

/* What is found from the unknowns: tables one after the other of momenta and velocities
 * [nodes of the phases*nq] and of forces [nodes of the phases*functions of the kind]. momenta: the
 * pass that adds momenta of steps to the first of them. input[2][steps*inputs]: the unknowns that
 * are the inputs at both ends of the steps. share: the part of a step that stations
 * stand for, [degree + 1] where steps have stations of their own (degree > 1). */
typedef struct {
    dmoc_pass momenta;
    const dmoc_entry *dynamics;
    dmoc_functions functions[DMOC_KINDS];
    int inputs, reactions, degree, p_end;
    const dmoc_reaction *reaction;
    const double *share;
    const int *input[2];
} dmoc_motion;

/* Values at places of the first phase, from 0 to 1 in order. */
typedef struct {
    int count, kind, coordinate; /* coordinate: which of a node */
    const int *index;
    const double *at;
} dmoc_track;

/* A coordinate, which follows the polynomials of steps; a value, which is linear between its
 * places; an amount that is in proportion to the step. */
enum { DMOC_COORDINATE, DMOC_VALUE, DMOC_AMOUNT };

/* The rest of a motion, and other courses of it. possible: there is one on the same phases.
 * time[times]: numbers from which the time that has passed is taken.
 * course[degree + 3][degree + 3]: coefficients of the powers of the place in a step, of the
 * polynomials of nodes and of the slopes at both ends. inside[degree - 1]: places of the nodes
 * inside a step, whose coordinates begin at the unknown q_inside. */
typedef struct {
    int possible, times, unknowns, rows, q_inside;
    const int *time;
    const dmoc_track *unknown, *row;
    const double *course, *inside;
} dmoc_rest;

/* What parameters must be together. mass: whether that of the first position is positive definite;
 * friction: the kernel of coefficients, NULL for none; kinds[k]: 0 for those that vary, 2 for pairs
 * of static and kinetic ones, else 1; tangential: the kernel of tangential restitution. */
typedef struct {
    int mass, tangents;
    const dmoc_entry *friction;
    const int *kinds;
    const dmoc_entry *tangential;
} dmoc_together;

/* Laws with coefficients that depend on the motion: kernels of restitution, of kinetic and of static
 * friction, and of the sliding velocities, NULL for none. hit[phases]: the surface that is hit at
 * the end of a phase by a law, -1 for none. Of each tangent [phases*nt], rubs: along a phase, 0 for
 * none of these laws, 2 for a pair of static and kinetic friction, else 1; struck: whether kinetic
 * friction acts in the impact at the end of a phase by one of them. */
typedef struct {
    const dmoc_entry *restitution, *kinetic, *resting, *slide_rate;
    const int *hit, *rubs, *struck;
} dmoc_laws;

struct dmoc_carried {
    const char *name;
    dmoc_program program; /* without what is written: pool and scratch are NULL */
    dmoc_kkt kkt;
    dmoc_ldl ldl;         /* the analysis alone */
    const double *pool;
    int pool_size, coefficients, factors, results;
    const double *factor;
    const dmoc_moved *moved;
    int numbers, tables, phases;
    const dmoc_number *number;
    const dmoc_change *change;
    const dmoc_table_of *table;
    dmoc_state state[2];
    dmoc_places places;
    dmoc_motion motion;
    dmoc_rest rest;
    dmoc_together together;
    dmoc_laws laws;
    const int *steps;     /* [phases] of the phases; their sizes are the first unknowns */
    double cost;          /* size of the cost */
    /* The answer of the day of export, scaled, and the first motion before it. */
    const double *x, *y, *z, *first;
};

#endif
