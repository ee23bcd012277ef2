/* See steps_cache.h: a table of steps by phase, range and number of priced conditions. */
#include "steps_cache.h"

#include <stdlib.h>
#include <string.h>

#define MOST_BYTES ((size_t)256 << 20)

struct Kept {
    int phase, priced;
    double low, high;
    Kept *next;
    Steps steps;
    line memory[];
};

int cache_begin(Cache *c, const Problem *problem)
{
    memset(c, 0, sizeof *c);
    c->problem = problem;
    c->room = 4096;
    c->slots = calloc(c->room, sizeof *c->slots);
    return !c->slots;
}

static void forget(Cache *c)
{
    for (size_t i = 0; i < c->room && c->slots; i++)
        for (Kept *kept = c->slots[i], *next; kept; kept = next) {
            next = kept->next;
            free(kept);
        }
}

void cache_end(Cache *c)
{
    forget(c);
    free(c->slots);
    c->slots = 0;
}

void cache_trim(Cache *c)
{
    if (c->bytes < MOST_BYTES)
        return;
    forget(c);
    memset(c->slots, 0, c->room * sizeof *c->slots);
    c->bytes = 0;
}

static size_t slot_of(const Cache *c, int phase, double low, double high)
{
    unsigned long long a, b;
    memcpy(&a, &low, sizeof a);
    memcpy(&b, &high, sizeof b);
    unsigned long long hash = (a ^ (b << 7 | b >> 57)) * 0x9e3779b97f4a7c15ull + (unsigned)phase;
    hash ^= hash >> 29;
    return (hash * 0xbf58476d1ce4e5b9ull >> 32) % c->room;
}

const Steps *cache_steps(Cache *c, int phase, double low, double high)
{
    const Problem *p = c->problem;
    const Phase *of = p->phase + phase;
    int priced = 0;
    for (int i = 0; i < c->count; i++)
        priced += c->priced[i].phase == phase;
    Kept **slot = c->slots + slot_of(c, phase, low, high);
    for (Kept *k = *slot; k; k = k->next)
        if (k->phase == phase && k->low == low && k->high == high && k->priced == priced)
            return &k->steps;
    const int d = 2 * of->r + priced + 1;
    const size_t bytes = sizeof(Kept) + steps_size(of, d) * sizeof(line);
    Kept *kept = malloc(bytes);
    if (!kept)
        return 0;
    *kept = (Kept){.phase = phase, .priced = priced, .low = low, .high = high, .next = *slot};
    steps_place(&kept->steps, of, d, kept->memory);
    double begin[MOST_STATE];
    for (int z = 0; z < 2 * of->r; z++)
        begin[z] = phase ? p->event[phase - 1].after.b[z]
                         : p->start_low[z] + (p->start_high[z] - p->start_low[z]) / 2;
    const double centre = low + (high - low) / 2;
    if (phase_steps(of, phase, centre, (interval){low, high}, c->count, c->priced, begin,
                    &kept->steps)) {
        free(kept);
        return 0;
    }
    *slot = kept;
    c->bytes += bytes;
    return &kept->steps;
}
