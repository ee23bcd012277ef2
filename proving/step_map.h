/* A step as function of what is before it. */
#ifndef DMOC_STEP_MAP_H
#define DMOC_STEP_MAP_H

#include "linear_program.h"

/* The state (y, h p) after a step of the size h, the places inside it and its rows S as functions of
 * (y, h p, u, s, 1) before, shapes (2 r, columns), (na - r, columns) and (rows, columns); 0, or 1 where its
 * equations cannot be solved. */
int step_map(const Phase *p, line h, line *map, line *inner, line *rows);

#endif
