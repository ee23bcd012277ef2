/* See steps_cache.h: a table of steps by phase, range and the conditions that are priced. */
#include "steps_cache.h"

#include <stdlib.h>
#include <string.h>

#define MOST_BYTES ((size_t)256 << 20)

struct Kept {
    int phase;
    Priced priced[MOST_PRICED]; /* those of the phase */
    double low, high;
    Kept *next;
    Steps steps;
    line memory[];
};

int cache_begin(Cache *c, const Problem *problem, int workers)
{
    memset(c, 0, sizeof *c);
    c->problem = problem;
    c->room = 4096;
    c->most_bytes = MOST_BYTES / (size_t)workers;
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
    if (c->bytes < c->most_bytes)
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

/* Whether steps are those of the conditions of a phase that are priced now, under the same numbers. */
static int is_priced_alike(const Kept *k, const int *which, int count, const Priced *priced)
{
    const size_t n = (size_t)count;
    return k->steps.priced == count && !memcmp(k->steps.which, which, n * sizeof *which) &&
           !memcmp(k->priced, priced, n * sizeof *priced);
}

const Steps *cache_steps(Cache *c, int phase, double low, double high)
{
    const Problem *p = c->problem;
    const Phase *of = p->phase + phase;
    Priced priced[MOST_PRICED];
    int which[MOST_PRICED], count = 0;
    for (int i = 0; i < c->count; i++)
        if (c->priced[i].phase == phase)
            which[count] = i, priced[count++] = c->priced[i];
    Kept **slot = c->slots + slot_of(c, phase, low, high);
    for (Kept *k = *slot; k; k = k->next)
        if (k->phase == phase && k->low == low && k->high == high &&
            is_priced_alike(k, which, count, priced))
            return &k->steps;
    const int d = 2 * of->r + count + 1;
    const size_t bytes = sizeof(Kept) + steps_size(of, d) * sizeof(line);
    Kept *kept = malloc(bytes);
    if (!kept)
        return 0;
    *kept = (Kept){.phase = phase, .low = low, .high = high, .next = *slot};
    memcpy(kept->priced, priced, sizeof *priced * (size_t)count);
    steps_place(&kept->steps, of, d, kept->memory);
    double begin[MOST_STATE];
    for (int z = 0; z < 2 * of->r; z++)
        begin[z] = phase ? p->event[phase - 1].after.b[z] : p->middle[z];
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
