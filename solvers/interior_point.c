/* The iteration, WB algorithm A; parts of the memory, and entry. */
#include "interior_solver.h"

#include <math.h>
#include <string.h>

#ifdef __SANITIZE_ADDRESS__
#include <sanitizer/asan_interface.h>
#else
#define ASAN_POISON_MEMORY_REGION(at, size) ((void)(at), (void)(size))
#define ASAN_UNPOISON_MEMORY_REGION(at, size) ((void)(at), (void)(size))
#endif

/* Barrier parameter, WB (7), (8). */
static const double KAPPA_EPS = 10, KAPPA_MU = 0.2, THETA_MU = 1.5, TAU_MIN = 0.99;
enum { MOST_PATIENCE = 3 };

double ip_seconds(const solver *s) { return s->options->clock ? s->options->clock() : 0; }

int ip_late(const solver *s) { return ip_seconds(s) - s->begin > s->options->seconds; }

void ip_set_barrier(solver *s, double mu)
{
    s->mu = mu;
    s->tau = max(TAU_MIN, 1 - mu);
}

/* One iteration from an evaluated point; returns -1 to go on, else a status. */
int ip_iterate(solver *s)
{
    ip_evaluate_slopes(s);
    ip_evaluate_dual(s);
    ip_measure(s);
    const int good = ip_converged(s);
    s->patience = good ? s->patience + 1 : 0;
    if (good == 2 || s->patience > MOST_PATIENCE)
        return DMOC_SOLVED;
    const double size = s->elastic ? 1 : s->fs*min(ip_cost_size(s), 1);
    const double least_mu = s->options->optimality/(KAPPA_EPS + 1)*size;
    /* A step below rounding errors ends the barrier problem too: only its multipliers could still
     * gain, WB 3.9. */
    while (s->mu > least_mu && (ip_barrier_error(s, s->mu) <= KAPPA_EPS*s->mu || s->tiny > 0)) {
        s->tiny = 0;
        ip_set_barrier(s, max(least_mu, min(KAPPA_MU*s->mu, pow(s->mu, THETA_MU))));
        if (s->elastic) { /* the objective changes with mu */
            s->zeta = sqrt(s->mu);
            ip_evaluate(s, &s->now);
            ip_evaluate_slopes(s);
            ip_evaluate_dual(s);
            ip_measure(s);
        } else {
            s->now.phi = s->now.f + s->mu*s->now.logs;
        }
        ip_filter_reset(&s->front, s->now.theta);
    }
    if (s->result.iterations >= s->options->iterations)
        return DMOC_ITERATION_LIMIT;
    if (ip_late(s))
        return DMOC_TIME_LIMIT;
    ip_evaluate_curvatures(s);
    if (!ip_direction(s))
        return ip_late(s) ? DMOC_TIME_LIMIT : DMOC_STALLED;
    const int stepped = ip_line_search(s);
    if (stepped < 0)
        return DMOC_STALLED;
    if (!stepped) {
        ip_evaluate(s, &s->now);
        if (s->elastic)
            return DMOC_STALLED;
        return ip_restore(s); /* counts its own iterations */
    }
    ip_keep_multipliers(s);
    s->result.iterations += 1;
    const dmoc_options *o = s->options;
    const int stop = o->report && o->report(o->user, s->result.iterations, s->values[0],
                                            ip_violation(s), s->mu, s->elastic);
    return stop ? DMOC_INTERRUPTED : -1;
}

/* Doubles that hold a solver, with which the memory begins. */
enum { OWN = (sizeof(solver) + sizeof(double) - 1)/sizeof(double) };

/* Share the memory out among the parts; returns how many doubles they take. */
static size_t share_out(solver *s, double *memory)
{
    const size_t n = (size_t)s->n, m = (size_t)s->m, most = (size_t)s->most;
    const size_t hess = (size_t)s->program->hess_start[n], jac = (size_t)s->program->row_start[m];
    const size_t entries = (size_t)s->kkt->start[s->kkt->size];
    struct {
        double **at;
        size_t count;
    } parts[] = {
        {&s->lo, most}, {&s->up, most}, {&s->open, most}, {&s->below, most},
        {&s->above, most}, {&s->values, m + 1}, {&s->slopes, n + jac},
        {&s->hess, hess}, {&s->K, entries}, {&s->fs_rows, m},
        {&s->now.v, most}, {&s->now.y, m}, {&s->now.zl, most}, {&s->now.zu, most},
        {&s->now.residual, m}, {&s->trial.v, most}, {&s->trial.residual, m},
        {&s->gradient, most}, {&s->dual, most}, {&s->sigma, most}, {&s->pull, most},
        {&s->dv, most}, {&s->dy, m}, {&s->dzl, most}, {&s->dzu, most},
        {&s->soc_dv, most}, {&s->soc_dy, m}, {&s->soc_residual, m},
        {&s->right, n + m}, {&s->solution, n + m}, {&s->rest, n + m}, {&s->change, n + m},
        {&s->reference, n}, {&s->weight, n}, {&s->rho, m},
    };
    size_t total = 0;
    for (size_t i = 0; i < sizeof parts/sizeof *parts; ++i) {
        if (memory) {
            *parts[i].at = memory + total;
            memset(memory + total, 0, sizeof(double)*parts[i].count);
            ASAN_POISON_MEMORY_REGION(memory + total + parts[i].count, sizeof *memory);
        }
        total += parts[i].count + 1; /* one between the parts */
    }
    return total;
}

static void begin(solver *s, const dmoc_program *program, const dmoc_kkt *kkt)
{
    memset(s, 0, sizeof *s);
    s->program = program, s->kkt = kkt;
    s->n = (int)program->n, s->m = (int)program->m, s->eq = (int)program->equalities;
    s->slacks = s->m - s->eq;
    s->most = s->n + s->slacks + 2*s->m;
}

size_t dmoc_interior_memory(const dmoc_program *program, const dmoc_kkt *kkt)
{
    solver s;
    begin(&s, program, kkt);
    return sizeof(double)*(OWN + share_out(&s, NULL));
}

static int minimise(solver *s)
{
    int status = -1;
    while (status < 0)
        status = ip_iterate(s);
    return status;
}

static int least_violation(solver *s)
{
    ip_begin_restoration(s);
    const int status = minimise(s);
    ip_evaluate_values(s, s->now.v);
    const int ended = status == DMOC_SOLVED || status == DMOC_STALLED;
    if (ended && ip_violation(s) <= s->options->infeasible)
        return DMOC_SOLVED;
    return status == DMOC_SOLVED ? DMOC_INFEASIBLE : status;
}

dmoc_result dmoc_interior_point(const dmoc_program *program, const dmoc_kkt *kkt,
                                const dmoc_options *options, const double *size,
                                const double *stretch, double *x, double *y, double *z_lower,
                                double *z_upper, dmoc_ldl *ldl, void *memory)
{
    solver *s = (solver *)memory;
    double *parts = (double *)memory + OWN;
    begin(s, program, kkt);
    s->options = options, s->size = size, s->stretch = stretch, s->ldl = ldl;
    s->begin = ip_seconds(s);
    const size_t count = share_out(s, parts);
    ip_start(s, x, y, z_lower, z_upper);
    s->result.status = options->least_violation ? least_violation(s) : minimise(s);
    memcpy(x, s->now.v, sizeof(double)*(size_t)s->n);
    /* Multipliers of the objective, or of the least violation: in the units of the problem. */
    const int missed = options->least_violation || s->result.status == DMOC_INFEASIBLE;
    const double factor = missed ? RHO : s->fs;
    for (int r = 0; r < s->m; ++r)
        y[r] = s->now.y[r]*s->fs_rows[r]/factor;
    for (int i = 0; i < s->n; ++i) {
        z_lower[i] = s->now.zl[i]/factor;
        z_upper[i] = s->now.zu[i]/factor;
    }
    s->result.seconds = ip_seconds(s) - s->begin;
    ASAN_UNPOISON_MEMORY_REGION(parts, sizeof *parts*count);
    return s->result;
}
