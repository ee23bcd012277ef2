/* The rest of a motion from measured states, as dmoc.planning has it. */
#include "dmoc_inside.h"
#include "dmoc_planner.h"

/* As dmoc.planning has them. */
static const double FEASIBLE = 1e-4, EARLY = 0.25, NEAR = 2e-3, LATE = 0.5, BEYOND = 0.05,
                    AGAINST = 0.25;
enum { PLAN_ITERATIONS = 60 };

struct dmoc_planner {
    const dmoc_rests *rests;
    dmoc_solver *solver; /* with the plan that is followed, between plans */
    void *memory;        /* of the solver */
    size_t bytes;
    double *kept, *from, *numbers, *state;
    int rest, warm;      /* the program of the plan, whether it has multipliers */
    int phase, fresh;
    double origin, begun, measured; /* begun: when the phase began */
    dmoc_end end;
};

/* The most that a solver of the rests takes: bytes, unknowns with multipliers, numbers. */
static void most_of(const dmoc_rests *r, size_t *bytes, size_t *kept, size_t *numbers)
{
    *bytes = *kept = *numbers = 0;
    for (int i = 0; i < r->rests; ++i) {
        const dmoc_carried *c = r->rest[i].problem;
        const size_t size = dmoc_solver_memory(c), count = (size_t)c->numbers;
        const size_t all = (size_t)(2*c->program.n + c->program.m);
        *bytes = size > *bytes ? size : *bytes;
        *kept = all > *kept ? all : *kept;
        *numbers = count > *numbers ? count : *numbers;
    }
}

static size_t own_size(void)
{
    return (sizeof(dmoc_planner) + sizeof(double) - 1)/sizeof(double);
}

size_t dmoc_planner_memory(const dmoc_rests *r)
{
    size_t bytes, kept, numbers;
    most_of(r, &bytes, &kept, &numbers);
    const size_t states = 2*(size_t)r->rest[0].problem->places.nq;
    return sizeof(double)*(own_size() + 2*kept + numbers + states) + bytes;
}

static void keep_plan(dmoc_planner *p)
{
    const dmoc_solver *s = p->solver;
    carried_copy(p->kept, s->x, s->program.n);
    carried_copy(p->kept + s->program.n, s->z, s->program.n);
    carried_copy(p->kept + 2*s->program.n, s->y, s->program.m);
    p->warm = s->warm, p->end = s->end;
}

/* The solver with the plan that was kept and the numbers before another one was tried. */
static void take_plan_back(dmoc_planner *p)
{
    dmoc_solver *s = p->solver = dmoc_solver_begin(p->rests->rest[p->rest].problem, p->memory,
                                                   p->bytes);
    carried_copy(s->numbers, p->numbers, s->c->numbers);
    carried_apply(s);
    carried_copy(s->x, p->kept, s->program.n);
    carried_copy(s->z, p->kept + s->program.n, s->program.n);
    carried_copy(s->y, p->kept + 2*s->program.n, s->program.m);
    s->warm = p->warm, s->end = p->end;
    carried_read_out(s);
}

dmoc_planner *dmoc_planner_begin(const dmoc_rests *r, void *memory, size_t bytes)
{
    size_t kept, numbers;
    dmoc_planner *p = (dmoc_planner *)memory;
    if (!memory || bytes < dmoc_planner_memory(r))
        return NULL;
    memset(p, 0, sizeof *p);
    most_of(r, &p->bytes, &kept, &numbers);
    p->rests = r;
    p->kept = (double *)memory + own_size();
    p->from = p->kept + kept;
    p->numbers = p->from + kept;
    p->state = p->numbers + numbers;
    p->memory = p->state + 2*r->rest[0].problem->places.nq;
    p->solver = dmoc_solver_begin(r->rest[0].problem, p->memory, p->bytes);
    p->fresh = 1;
    keep_plan(p);
    return p;
}

/* Which phase a state is in ---------------------------------------------------------------------*/

/* The last node of a phase of the plan. */
static int last_node(const dmoc_planner *p, int phase)
{
    int node = 0;
    for (int i = p->rest; i <= phase; ++i)
        node += p->solver->c->steps[i - p->rest];
    return node;
}

/* Rates of the gap before and after the event at the end of a phase of the plan. */
static void rates_of(const dmoc_planner *p, int phase, double *before, double *after)
{
    const dmoc_solver *s = p->solver;
    const int n = s->c->places.nq, node = last_node(p, phase), row = node + phase - p->rest;
    const double *v = s->results + (carried_nodes(s->c) - 1 + s->c->phases)*n + row*n;
    const double *q = s->physical + s->c->places.q + node*n;
    double gap;
    carried_event(s, DMOC_OF_GAP, p->rests->event[phase], q, v, &gap, before);
    carried_event(s, DMOC_OF_GAP, p->rests->event[phase], q, v + n, &gap, after);
}

/* Whether a state shows that the event at the end of a phase has happened: what is hit or lands is
 * left or at rest, and is still near; a switch is not below zero, and what slips off is past its
 * end; what leaves, or rubs in another way, does so at its time. */
static int is_over(const dmoc_planner *p, int phase, double time, const double *state)
{
    const dmoc_solver *s = p->solver;
    const double end = p->origin + s->times[last_node(p, phase)];
    const double begin = phase == p->phase ? p->begun
                                           : p->origin + s->times[last_node(p, phase - 1)];
    double gap, rate, before, after;
    if (p->rests->event[phase] < 0)
        return time >= end;
    if (time - end < -EARLY*(end - begin))
        return 0;
    const int kind = p->rests->kind[phase];
    carried_event(s, kind, p->rests->event[phase], state, state + s->c->places.nq, &gap, &rate);
    if (kind == DMOC_OF_SWITCH || kind == DMOC_OF_END)
        return gap >= 0;
    rates_of(p, phase, &before, &after);
    if (kind == DMOC_OF_GRIP && before < 0)
        gap = -gap, rate = -rate, before = -before, after = -after;
    const double fast = fmax(fabs(before), fabs(after));
    return -gap <= 2*fast*(time - p->measured) && rate < (before + after)/2;
}

static int phase_of(const dmoc_planner *p, double time, const double *state)
{
    int phase = p->phase;
    while (phase < p->rests->phases - 1 && is_over(p, phase, time, state))
        ++phase;
    return phase;
}

/* A plan ----------------------------------------------------------------------------------------*/

static int starts_with(const char *name, const char *word)
{
    return !strncmp(name, word, strlen(word));
}

/* To the program of the rest from a phase on, with the numbers that were changed. */
static void change_program(dmoc_planner *p, int phase)
{
    const dmoc_carried *old = p->solver->c, *c = p->rests->rest[phase].problem;
    p->solver = dmoc_solver_begin(c, p->memory, p->bytes);
    for (int i = 0; i < old->numbers; ++i) {
        const char *name = old->number[i].name;
        const int same = dmoc_solver_find(c, name);
        if (same >= 0 && p->numbers[i] != old->number[i].value && !starts_with(name, "start.") &&
            !starts_with(name, "final_time") && !starts_with(name, "durations.") &&
            !starts_with(name, "via."))
            p->solver->numbers[same] = p->numbers[i];
    }
}

/* Start and times of the rest; whether its bounds leave any. */
static int set_rest(dmoc_planner *p, double time)
{
    dmoc_solver *s = p->solver;
    const dmoc_rest *rest = &s->c->rest;
    for (int i = 0; i < 2*s->c->places.nq; ++i)
        s->numbers[s->c->state[0].number[i]] = p->state[i];
    for (int i = 0; i < rest->times; ++i) {
        const dmoc_number *number = &s->c->number[rest->time[i]];
        const int total = starts_with(number->name, "final_time");
        const double passed = total ? time - p->rests->rest[p->phase].begin : time - p->begun;
        const double left = number->value - (p->rests->recedes ? 0 : passed);
        const size_t length = strlen(number->name);
        const int low = length > 4 && !strcmp(number->name + length - 4, ".low");
        if (!low && left <= 0)
            return 0;
        s->numbers[rest->time[i]] = fmax(left, 0);
    }
    return 1;
}

/* The last plan from a time on; where its event is late, its first phase goes on as the state moves
 * until the event. */
static int go_on(dmoc_planner *p, double time, double left, double arrival)
{
    dmoc_solver *s = p->solver;
    const int n = s->c->places.nq, steps = s->c->steps[0];
    const double end = s->times[steps], nearly = NEAR*left, gone = time - p->origin;
    if (end - gone > nearly)
        return dmoc_solver_shift(s, gone);
    const int status = dmoc_solver_shift(s, fmax(end - fmin(nearly, end/2), 0));
    const double lasts = fmin(arrival, LATE*left);
    if (status != DMOC_SOLVED)
        return status;
    s->x[0] = lasts/steps/s->program.sizes[0];
    for (const dmoc_track *t = s->c->rest.unknown; t < s->c->rest.unknown + s->c->rest.unknowns; ++t)
        for (int k = 0; k < t->count && t->kind == DMOC_COORDINATE; ++k) {
            const int i = t->coordinate, at = t->index[k];
            s->x[at] = (p->state[i] + t->at[k]*lasts*p->state[n + i])/s->program.sizes[at];
        }
    s->warm = 0;
    return DMOC_SOLVED;
}

static int is_plan(int status, const dmoc_solver *s)
{
    const int cut = status == DMOC_ITERATION_LIMIT || status == DMOC_TIME_LIMIT ||
                    status == DMOC_STALLED || status == DMOC_INTERRUPTED;
    return status == DMOC_SOLVED || (cut && s->end.violation <= FEASIBLE);
}

/* Solve with the multipliers of the last plan; without them where that leads nowhere. */
static int solve_rest(dmoc_planner *p, const dmoc_limits *given)
{
    dmoc_solver *s = p->solver;
    dmoc_limits limits = given ? *given : dmoc_solver_limits();
    if (!given)
        limits.iterations = PLAN_ITERATIONS;
    const double begin = limits.clock ? limits.clock() : 0;
    const int warm = s->warm;
    carried_copy(p->from, s->x, s->program.n);
    const int status = dmoc_solver_solve(s, &limits);
    if (limits.clock)
        limits.seconds -= limits.clock() - begin;
    if (!warm || is_plan(status, s) || status == DMOC_BAD_NUMBER || status == DMOC_INTERRUPTED ||
        !(limits.seconds > 0))
        return status;
    carried_copy(s->x, p->from, s->program.n);
    s->warm = 0;
    return dmoc_solver_solve(s, &limits);
}

/* The state within the bounds of coordinates and velocities. */
static void put_within(dmoc_planner *p)
{
    const dmoc_solver *s = p->solver;
    for (int i = 0; i < 2*s->c->places.nq; ++i) {
        const dmoc_number *number = &s->c->number[s->c->state[0].number[i]];
        if (number->least >= 0)
            p->state[i] = fmax(p->state[i], s->numbers[number->least]);
        if (number->most >= 0)
            p->state[i] = fmin(p->state[i], s->numbers[number->most]);
    }
}

/* Whether the state lies far behind a surface that is open, where it is, beside how far the
 * coordinates move. */
static int is_behind(const dmoc_planner *p)
{
    const dmoc_places *places = &p->solver->c->places;
    const int n = places->nq;
    double *along = p->from, gap, rate;
    for (int j = 0; j < places->nc; ++j) {
        double size = 0;
        for (int i = 0; i < n; ++i) {
            memset(along, 0, sizeof(double)*(size_t)n);
            along[i] = places->reach[i];
            carried_event(p->solver, DMOC_OF_GAP, j, p->state, along, &gap, &rate);
            size += fabs(rate);
        }
        if (places->held[j] != 1 || !(gap > BEYOND*size))
            continue;
        if (places->within)
            carried_event(p->solver, DMOC_OF_END, j, p->state, along, &gap, &rate);
        if (!places->within || gap < 0)
            return 1;
    }
    return 0;
}

/* Whether the state slides against the direction of its phase, faster than what is measured wrong
 * beside how fast the coordinates move. */
static int is_against(const dmoc_planner *p)
{
    const dmoc_places *places = &p->solver->c->places;
    const dmoc_entry *rate = p->solver->c->motion.functions[DMOC_TANGENTIAL].rates;
    const double time = 0;
    double *rates = p->solver->work, *parameters = rates + places->nt;
    const double *moving[DMOC_MOST] = {p->state, p->state + places->nq, &time, parameters};
    if (!rate)
        return 0;
    carried_parameters(p->solver, 0, parameters);
    carried_call(rate, moving, rates, NULL);
    for (int k = 0; k < places->nt; ++k)
        if (places->slides[k]*rates[k] < -AGAINST*places->slide_size[k])
            return 1;
    return 0;
}

static int planned(dmoc_planner *p, double time, const dmoc_limits *limits)
{
    const int n = p->solver->c->places.nq, ends = p->phase < p->rests->phases - 1;
    const int seen = ends && p->rests->event[p->phase] >= 0;
    const double left = fmax(dmoc_planner_end(p) - time, 0);
    double arrival = (double)INFINITY;
    if (p->phase >= p->rests->rests)
        return DMOC_NO_REST;
    if (p->phase != p->rest)
        change_program(p, p->phase);
    put_within(p);
    if (is_behind(p))
        return DMOC_BEHIND;
    if (is_against(p))
        return DMOC_AGAINST;
    carried_keep(p->solver, p->state, p->state + n);
    if (seen) {
        double gap, rate;
        const int kind = p->rests->kind[p->phase];
        carried_event(p->solver, kind, p->rests->event[p->phase], p->state, p->state + n, &gap,
                      &rate);
        if (kind == DMOC_OF_GRIP && gap > 0)
            gap = -gap, rate = -rate;
        arrival = rate > 0 ? fmax(-gap, 0)/rate : arrival;
        if (arrival < NEAR*left)
            return DMOC_NEARLY;
    }
    const int status = p->phase == p->rest ? go_on(p, time, left, arrival) : DMOC_SOLVED;
    if (status != DMOC_SOLVED || !set_rest(p, time))
        return DMOC_NO_REST;
    return solve_rest(p, limits);
}

int dmoc_planner_replan(dmoc_planner *p, double time, const double *state, int phase,
                        const dmoc_limits *limits)
{
    const int n = p->solver->c->places.nq;
    int good = time >= p->measured && isfinite(time) && phase < p->rests->phases &&
               (phase < 0 || phase >= p->phase);
    for (int i = 0; i < 2*n; ++i)
        good = good && isfinite(state[i]);
    if (!good)
        return DMOC_BAD_NUMBER;
    carried_copy(p->numbers, p->solver->numbers, p->solver->c->numbers);
    const int reached = phase < 0 ? phase_of(p, time, state) : phase;
    if (reached != p->phase)
        p->phase = reached, p->begun = time;
    p->measured = time;
    carried_copy(p->state, state, 2*n);
    const int status = planned(p, time, limits);
    p->fresh = is_plan(status, p->solver);
    if (p->fresh) {
        p->rest = reached, p->origin = time;
        keep_plan(p);
    } else {
        take_plan_back(p);
    }
    return status;
}

/* What is planned -------------------------------------------------------------------------------*/

void dmoc_planner_input(const dmoc_planner *p, double time, double *u)
{
    const dmoc_solver *s = p->solver;
    const int inputs = s->c->motion.inputs;
    const int *const *input = s->c->motion.input;
    int k = 0, steps = carried_nodes(s->c) - 1;
    const double t = fmin(fmax(time - p->origin, 0), s->times[steps]);
    while (k < steps - 1 && s->times[k + 1] <= t)
        ++k;
    const double share = (t - s->times[k])/(s->times[k + 1] - s->times[k]);
    for (int i = 0; i < inputs; ++i) {
        const double first = s->physical[input[0][k*inputs + i]];
        u[i] = first + share*(s->physical[input[1][k*inputs + i]] - first);
    }
}

int dmoc_planner_phase(const dmoc_planner *p) { return p->phase; }

int dmoc_planner_new(const dmoc_planner *p) { return p->fresh; }

double dmoc_planner_origin(const dmoc_planner *p) { return p->origin; }

double dmoc_planner_end(const dmoc_planner *p)
{
    return p->origin + p->solver->times[carried_nodes(p->solver->c) - 1];
}

dmoc_solver *dmoc_planner_solver(const dmoc_planner *p) { return p->solver; }

const char *dmoc_planner_sentence(int status)
{
    return status == DMOC_BEHIND
               ? "the state lies far behind a surface: check what is measured"
           : status == DMOC_AGAINST
               ? "the state slides against the direction of its phase: check what is measured"
           : status == DMOC_NEARLY ? "the next event is sooner than a phase may last"
           : status == DMOC_NO_REST ? "the motion is over, or nothing is left of its bounds"
                                    : dmoc_solver_sentence(status);
}
