/* Steps of phases over the ranges of durations that boxes are made of: they are halved alike in all
 * boxes, so that few ranges serve many boxes. */
#ifndef DMOC_STEPS_CACHE_H
#define DMOC_STEPS_CACHE_H

#include "linear_program.h"

typedef struct Kept Kept;

typedef struct {
    const Problem *problem;
    int count;                  /* conditions along the phases that are priced */
    Priced priced[MOST_PRICED];
    Kept **slots;               /* (room,) */
    size_t room, bytes, most_bytes;
} Cache;

/* One of so many caches; 0, or 1 where there is no memory. */
int cache_begin(Cache *cache, const Problem *problem, int workers);
void cache_end(Cache *cache);

/* The steps of a phase over a range; NULL where they cannot be had. They stay until
 * ``cache_trim``. */
const Steps *cache_steps(Cache *cache, int phase, double low, double high);

/* Forget all steps where they have become too many. */
void cache_trim(Cache *cache);

#endif
