/* Where a solve starts, solves from several starts, the rest of a motion. */
#include "dmoc_inside.h"

/* The largest violation of what is a motion at all, relative to sizes. */
static const double MOTION = 1e-4;

void dmoc_solver_from_answer(dmoc_solver *s)
{
    carried_copy(s->x, s->c->x, s->program.n);
    carried_copy(s->y, s->c->y, s->program.m);
    carried_copy(s->z, s->c->z, s->program.n);
    s->warm = 1;
}

void dmoc_solver_from_first_motion(dmoc_solver *s)
{
    carried_copy(s->x, s->c->first, s->program.n);
    s->warm = 0;
}

void dmoc_solver_from(dmoc_solver *s, const double *unknowns)
{
    for (ptrdiff_t i = 0; i < s->program.n; ++i)
        s->x[i] = unknowns[i]/s->program.sizes[i];
    s->warm = 0;
}

/* Several starts --------------------------------------------------------------------------------*/

/* A number from -1 to 1 by the generator splitmix64 (G. L. Steele, D. Lea, C. H. Flood: Fast
 * splittable pseudorandom number generators. OOPSLA 2014), in arithmetic that is exact. */
static double uniform(unsigned long long *state)
{
    const unsigned long long mask = 0xffffffffffffffffULL;
    *state = (*state + 0x9e3779b97f4a7c15ULL) & mask;
    unsigned long long z = *state;
    z = ((z ^ (z >> 30))*0xbf58476d1ce4e5b9ULL) & mask;
    z = ((z ^ (z >> 27))*0x94d049bb133111ebULL) & mask;
    return (double)((z ^ (z >> 31)) >> 11)*(2.0/9007199254740992.0) - 1;
}

/* The scaled place of a coordinate t of the way along the motion: a cubic that vanishes at both
 * ends of it, times a factor of less than one in each term. */
static double course(const double *factor, double t)
{
    const double w = 2*t - 1;
    return 4*t*(1 - t)*(factor[0] + factor[1]*w + factor[2]*w*w);
}

/* Start number k of a seed: the first motion or the answer of the day of export, in turn, its
 * coordinates moved along a smooth course by their sizes, its step sizes multiplied by factors
 * between 1/2 and 3/2. */
static void from_random(dmoc_solver *s, unsigned long long seed, int k)
{
    const dmoc_carried *c = s->c;
    const int total = carried_nodes(c) - 1, nq = c->places.nq, inside = c->motion.degree - 1;
    unsigned long long state = seed*0xd1342543de82ef95ULL + (unsigned long long)k;
    carried_copy(s->x, k % 2 ? c->x : c->first, s->program.n);
    for (int i = 0; i < carried_stepped(c); ++i)
        s->x[i] *= 1 + 0.5*uniform(&state);
    for (int i = 0; i < nq; ++i) {
        double factor[3];
        for (int j = 0; j < 3; ++j)
            factor[j] = uniform(&state);
        for (int node = 0; node <= total; ++node)
            s->x[c->places.q + node*nq + i] += course(factor, (double)node/total);
        for (int j = 0; j < total*inside; ++j) {
            const double at = (j/inside + c->rest.inside[j % inside])/total;
            s->x[c->rest.q_inside + j*nq + i] += course(factor, at);
        }
    }
    s->warm = 0;
}

static void keep(double *to, const dmoc_solver *s)
{
    carried_copy(to, s->x, s->program.n);
    carried_copy(to + s->program.n, s->z, s->program.n);
    carried_copy(to + 2*s->program.n, s->y, s->program.m);
}

static void take_back(dmoc_solver *s, const double *from)
{
    carried_copy(s->x, from, s->program.n);
    carried_copy(s->z, from + s->program.n, s->program.n);
    carried_copy(s->y, from + 2*s->program.n, s->program.m);
}

/* Whether an end is better: a solution of less cost; where there is none, less violation. */
static int better(int status, const dmoc_end *end, int best, const dmoc_end *than)
{
    if ((status == DMOC_SOLVED) != (best == DMOC_SOLVED))
        return status == DMOC_SOLVED;
    return status == DMOC_SOLVED ? end->cost < than->cost : end->violation < than->violation;
}

int dmoc_solver_explore(dmoc_solver *s, int starts, unsigned long long seed,
                        const dmoc_limits *given)
{
    dmoc_limits limits = given ? *given : dmoc_solver_limits();
    const double begin = limits.clock ? limits.clock() : 0, seconds = limits.seconds;
    int best = -1, iterations = 0, restorations = 0, tried = 0;
    long factorisations = 0;
    dmoc_end end;
    memset(&end, 0, sizeof end);
    for (int k = 0; k < starts || !k; ++k) {
        if (k == 1)
            dmoc_solver_from_first_motion(s);
        else if (k)
            from_random(s, seed, k);
        const int status = dmoc_solver_solve(s, &limits);
        if (status == DMOC_BAD_NUMBER)
            return status;
        iterations += s->end.iterations, restorations += s->end.restorations;
        factorisations += s->end.factorisations, ++tried;
        if (best < 0 || better(status, &s->end, best, &end)) {
            keep(s->best, s);
            best = status, end = s->end;
        }
        limits.seconds = limits.clock ? seconds - (limits.clock() - begin) : seconds;
        if (status == DMOC_INTERRUPTED || !(limits.seconds > 0))
            break;
    }
    take_back(s, s->best);
    s->warm = best == DMOC_SOLVED, s->end = end;
    s->end.iterations = iterations, s->end.restorations = restorations;
    s->end.factorisations = factorisations, s->end.starts = tried;
    carried_read_out(s);
    return best;
}

/* The rest of a motion --------------------------------------------------------------------------*/

/* Coordinates q and, if they are asked for, velocities v at a place from 0 to 1 of the first
 * phase: the polynomial of the step through its nodes with the velocities of both ends. */
static void state_at(const dmoc_solver *s, double place, double *q, double *v)
{
    const dmoc_carried *c = s->c;
    const int steps = c->steps[0], n = c->places.nq, d = c->motion.degree, terms = d + 3;
    const int step = (int)fmin(floor(place*steps), steps - 1);
    const double at = place*steps - step, h = s->physical[0];
    const double *left = s->physical + c->places.q + step*n;
    const double *inside = s->physical + c->rest.q_inside + step*(d - 1)*n;
    const double *rates = s->results + ((carried_nodes(c) - 1 + c->phases) + step)*n;
    for (int i = 0; i < n; ++i) {
        q[i] = 0;
        if (v)
            v[i] = 0;
        for (int a = 0; a < terms; ++a) {
            const double data = a < 2 ? left[a*n + i] : a <= d ? inside[(a - 2)*n + i]
                                                              : h*rates[(a - d - 1)*n + i];
            double value = 0, slope = 0;
            for (int power = terms - 1; power >= 0; --power) {
                slope = slope*at + value;
                value = value*at + c->rest.course[power*terms + a];
            }
            q[i] += data*value;
            if (v)
                v[i] += data*slope/h;
        }
    }
}

/* Values of a track at a later place of what they were. */
static void move(const dmoc_track *track, double gone, double factor, double *values)
{
    for (int k = 0, j = 0; k < track->count; ++k) {
        const double place = gone + (1 - gone)*track->at[k];
        while (j + 2 < track->count && track->at[j + 1] <= place)
            ++j;
        const int a = track->index[j], b = track->index[j + 1 < track->count ? j + 1 : j];
        const double apart = b != a ? track->at[j + 1] - track->at[j] : 0;
        const double part = apart > 0 ? fmin((place - track->at[j])/apart, 1) : 1;
        const double left = values[a], right = values[b];
        values[track->index[k]] = factor*(left + part*(right - left));
    }
}

int dmoc_solver_shift(dmoc_solver *s, double elapsed)
{
    const dmoc_carried *c = s->c;
    const dmoc_rest *rest = &c->rest;
    const dmoc_state *start = &c->state[0];
    const int n = c->places.nq;
    const double end = s->times[c->steps[0]], gone = elapsed/end;
    double *q = (double *)s->memory, *v = q + n;
    if (!rest->possible || !(elapsed >= 0 && elapsed < end) || !(s->end.violation <= MOTION))
        return DMOC_NO_REST;
    if (gone == 0)
        return DMOC_SOLVED;
    state_at(s, gone, q, v);
    carried_keep(s, q, v);
    for (int i = 0; i < 2*n; ++i)
        if (!isfinite(q[i])) /* with parameters that the last solve has refused */
            return DMOC_NO_REST;
    for (int i = 0; i < 2*n; ++i)
        s->numbers[start->number[i]] = q[i];
    for (int i = 0; i < rest->times; ++i) {
        const int number = rest->time[i];
        s->numbers[number] = fmax(s->numbers[number] - elapsed, 0);
    }
    for (const dmoc_track *t = rest->unknown; t < rest->unknown + rest->unknowns; ++t) {
        if (t->kind != DMOC_COORDINATE)
            move(t, gone, t->kind == DMOC_AMOUNT ? 1 - gone : 1, s->x);
        move(t, gone, 1 - gone, s->z);
        for (int k = 0; k < t->count && t->kind == DMOC_COORDINATE; ++k) {
            const int at = t->index[k];
            state_at(s, gone + (1 - gone)*t->at[k], q, NULL);
            s->x[at] = q[t->coordinate]/s->program.sizes[at];
        }
    }
    for (const dmoc_track *t = rest->row; t < rest->row + rest->rows; ++t)
        move(t, gone, t->kind == DMOC_AMOUNT ? 1 - gone : 1, s->y);
    s->x[0] *= 1 - gone;
    carried_read_out(s);
    return DMOC_SOLVED;
}
