/* The interior-point method with memory from the heap and the clock of the system. */
#define _POSIX_C_SOURCE 199309L

#include "interior_point.h"

#include <stdlib.h>
#include <time.h>

static double seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9*(double)t.tv_nsec;
}

/* A factorisation of kkt. */
static dmoc_ldl *factorisation(const dmoc_kkt *kkt, const dmoc_ldl *analysed)
{
    if (analysed)
        return dmoc_ldl_like(analysed);
    return dmoc_ldl_new(kkt->size, kkt->pivots, kkt->first, kkt->start, kkt->row);
}

dmoc_result dmoc_interior_heap(const dmoc_program *program, const dmoc_kkt *kkt,
                               const dmoc_ldl *analysed, const dmoc_options *options,
                               const double *size,
                               const double *stretch, double *x, double *y, double *z_lower,
                               double *z_upper)
{
    dmoc_options timed = *options;
    dmoc_result result = {DMOC_NO_MEMORY, 0, 0, 0, 0, 0, 0};
    if (!timed.clock)
        timed.clock = seconds;
    dmoc_ldl *ldl = factorisation(kkt, analysed);
    void *memory = malloc(dmoc_interior_memory(program, kkt));
    if (ldl && memory)
        result = dmoc_interior_point(program, kkt, &timed, size, stretch, x, y, z_lower, z_upper,
                                     ldl, memory);
    dmoc_ldl_free(ldl);
    free(memory);
    return result;
}

static int stopped(void *stop, int iteration, double cost, double violation, double mu,
                   int restoring)
{
    (void)iteration, (void)cost, (void)violation, (void)mu, (void)restoring;
    return __atomic_load_n((const int *)stop, __ATOMIC_RELAXED);
}

int dmoc_interior_starts(const dmoc_program *program, const dmoc_kkt *kkt,
                         const dmoc_ldl *analysed, const dmoc_options *options,
                         const double *stretch, const dmoc_starts *s)
{
    const ptrdiff_t n = program->n, m = program->m;
    const double until = seconds() + options->seconds;
    dmoc_options own = *options;
    own.clock = seconds, own.report = stopped, own.user = (void *)s->stop;
    dmoc_ldl *ldl = factorisation(kkt, analysed);
    void *memory = malloc(dmoc_interior_memory(program, kkt));
    const int enough = ldl && memory;
    while (enough && !stopped(own.user, 0, 0, 0, 0, 0) && (own.seconds = until - seconds()) > 0) {
        const int k = __atomic_fetch_add(s->turn, 1, __ATOMIC_RELAXED);
        if (k >= s->count)
            break;
        own.mu = s->mu[k];
        const dmoc_result r =
            dmoc_interior_point(program, kkt, &own, s->size + k*n, stretch, s->x + k*n,
                                s->y + k*m, s->z_lower + k*n, s->z_upper + k*n, ldl, memory);
        s->status[k] = r.status, s->iterations[k] = r.iterations;
    }
    dmoc_ldl_free(ldl);
    free(memory);
    return enough;
}
