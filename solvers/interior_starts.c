/* The interior-point method from many starts, by the clock of the system. */
#define _POSIX_C_SOURCE 199309L

#include "interior_point.h"

#include <time.h>

double dmoc_clock(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9*(double)t.tv_nsec;
}

static int stopped(void *stop, int iteration, double cost, double violation, double mu,
                   int restoring)
{
    (void)iteration, (void)cost, (void)violation, (void)mu, (void)restoring;
    return __atomic_load_n((const int *)stop, __ATOMIC_RELAXED);
}

void dmoc_interior_starts(const dmoc_program *program, const dmoc_kkt *kkt,
                          const dmoc_options *options, const double *stretch,
                          const dmoc_starts *s, dmoc_ldl *ldl, void *memory)
{
    const ptrdiff_t n = program->n, m = program->m;
    const double until = dmoc_clock() + options->seconds;
    dmoc_options own = *options;
    own.clock = dmoc_clock, own.report = stopped, own.user = (void *)s->stop;
    while (!stopped(own.user, 0, 0, 0, 0, 0) && (own.seconds = until - dmoc_clock()) > 0) {
        const int k = __atomic_fetch_add(s->turn, 1, __ATOMIC_RELAXED);
        if (k >= s->count)
            break;
        own.mu = s->mu[k];
        const dmoc_result r =
            dmoc_interior_point(program, kkt, &own, s->size + k*n, stretch, s->x + k*n,
                                s->y + k*m, s->z_lower + k*n, s->z_upper + k*n, ldl, memory);
        s->status[k] = r.status, s->iterations[k] = r.iterations;
    }
}
