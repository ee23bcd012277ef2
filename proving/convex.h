/* Bounds of a function over a box from its model. */
#ifndef DMOC_CONVEX_H
#define DMOC_CONVEX_H

#include "models.h"

/* Where distances from the centre lie, from ``below`` to ``above``, and their sum. */
typedef struct {
    const double *below, *above;
    double least, most;
} Range;

/* A number that is below a function over a range, by its second derivatives; ``widths`` become what
 * each duration costs the bound. */
double by_curvature(const Frame *frame, const model *f, const Range *range, double *widths);

#endif
