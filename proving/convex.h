/* Bounds of a function over a box of n durations, at distances from ``low`` to ``high`` from its
 * centre whose sum lies between ``least`` and ``most``. */
#ifndef DMOC_CONVEX_H
#define DMOC_CONVEX_H

#include "taylor.h"

/* By its second derivatives; ``widths`` become what each duration costs the bound. */
double by_curvature(int n, const jet *box, const double *low,
                           const double *high, double least, double most, double *widths);

/* By its slopes. */
double by_slopes(int n, const jet *box, const double *low,
                        const double *high, double least, double most);

#endif
