/* The interior-point method from many starts, by the clock of the system. */
#define _POSIX_C_SOURCE 199309L

#include "interior_point.h"

#include <math.h>
#include <time.h>

double dmoc_clock(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9*(double)t.tv_nsec;
}

/* A start in a hurry is given up where its least violation is above SMALL and has not come down to a
 * share FALLEN in so many iterations. */
enum { PATIENCE = 8 };
static const double SMALL = 0.1, FALLEN = 0.8;

typedef struct {
    const int *stop;
    int hurried, given_up;
    double least[PATIENCE]; /* violation until each of the last iterations, one after the other */
} hearing;

static int stopped(const int *stop) { return __atomic_load_n(stop, __ATOMIC_RELAXED); }

static int heard(void *user, int iteration, double cost, double violation, double mu, int restoring)
{
    (void)cost, (void)mu, (void)restoring;
    hearing *h = user;
    double *own = &h->least[(iteration - 1) % PATIENCE], least = violation;
    if (iteration > 1)
        least = fmin(least, h->least[(iteration - 2) % PATIENCE]);
    h->given_up = h->hurried && iteration > PATIENCE && least > SMALL && least > FALLEN * *own;
    *own = least;
    return h->given_up || stopped(h->stop);
}

void dmoc_interior_starts(const dmoc_program *program, const dmoc_kkt *kkt,
                          const dmoc_options *options, const double *stretch,
                          const dmoc_starts *s, dmoc_ldl *ldl, void *memory)
{
    const ptrdiff_t n = program->n, m = program->m;
    const double until = dmoc_clock() + options->seconds;
    dmoc_options own = *options;
    hearing listener = {.stop = s->stop};
    own.clock = dmoc_clock, own.report = heard, own.user = &listener;
    while (!stopped(s->stop) && (own.seconds = until - dmoc_clock()) > 0) {
        const int k = __atomic_fetch_add(s->turn, 1, __ATOMIC_RELAXED);
        if (k >= s->count)
            break;
        own.mu = s->mu[k];
        listener.hurried = s->hurried[k], listener.given_up = 0;
        const dmoc_result r =
            dmoc_interior_point(program, kkt, &own, s->size + k*n, stretch, s->x + k*n,
                                s->y + k*m, s->z_lower + k*n, s->z_upper + k*n, ldl, memory);
        s->status[k] = listener.given_up ? DMOC_ITERATION_LIMIT : r.status;
        s->iterations[k] = r.iterations;
    }
}
