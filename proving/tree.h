/* Branch and bound over boxes of durations, in batches that several threads share: what comes of it
 * is the same for any number of them. */
#ifndef DMOC_TREE_H
#define DMOC_TREE_H

#include <stdatomic.h>

#include "box.h"
#include "grid.h"

#define MOST_THREADS 64

enum { PROVED, GOING_ON, NO_MEMORY };

/* What a box tells beside its bound: a motion that costs less, conditions that are priced from now
 * on. */
typedef struct {
    double best, at[MOST_PHASES];
    int added;
    Priced priced[MOST_PRICED];
} Told;

typedef struct {
    const Problem *problem;
    Grid grid;
    int workers;
    Engine *engines;            /* (workers,) */
    double best, at[MOST_PHASES]; /* the least cost that was met, and its durations */
    long boxes;                 /* that were looked at */
    int fixed, count_priced;    /* multipliers of goal and events; conditions that are priced */
    Priced priced[MOST_PRICED];
    double limit;               /* motions that cost as much or more are of no interest */
    double gap, least_gap;      /* relative to the least cost that was met, and at least */
    double shed;                /* least bound of the boxes that were left */
    size_t count, room, width;  /* boxes that wait, and numbers of each */
    double *waiting;            /* (room, width): bound, low, high, multipliers, the duration
                                   to divide by; a heap */
    size_t left, keep;          /* boxes that were left, of which so many are kept */
    double *leaves;             /* (keep, 1 + 2 phases): bound, low, high */
    size_t taken;               /* boxes of this batch */
    double *batch;              /* (boxes, width) */
    Told *told;                 /* (boxes,) */
    atomic_size_t next;         /* the box of the batch that nobody has looked at yet */
} Tree;

int tree_begin(Tree *tree, const Problem *problem, int workers, double best, double limit,
               double gap, double least_gap, size_t keep);
void tree_end(Tree *tree);

/* Add a box that waits; 1 where there is no memory. */
int tree_push(Tree *tree, const double *box);

/* Divide boxes until the least bound is near enough to the least cost, or so many were looked at. */
int tree_run(Tree *tree, long boxes);

/* A number that no motion costs less than. */
double tree_bound(const Tree *tree);

/* Whether a box of interest was left because it cannot be divided. */
int tree_has_missed(const Tree *tree);

/* Whether boxes lack prices of conditions along the phases for which there is no room. */
int tree_is_stuck(const Tree *tree);

#endif
