/* Numbers into the program, and those that do not fit. */
#include "dmoc_inside.h"

/* Beyond them squares overflow. */
static const double LONGEST_TIME = 1e60, LARGEST = 1e100;

int dmoc_solver_numbers(const dmoc_carried *c) { return c->numbers; }

int dmoc_solver_find(const dmoc_carried *c, const char *name)
{
    for (int i = 0; i < c->numbers; ++i)
        if (!strcmp(c->number[i].name, name))
            return i;
    return -1;
}

static int is_number(const dmoc_carried *c, int number) { return number >= 0 && number < c->numbers; }

const char *dmoc_solver_number(const dmoc_carried *c, int number)
{
    return is_number(c, number) ? c->number[number].name : NULL;
}

double dmoc_solver_get(const dmoc_solver *s, int number)
{
    return is_number(s->c, number) ? s->numbers[number] : NAN;
}

void dmoc_solver_set(dmoc_solver *s, int number, double value)
{
    if (is_number(s->c, number))
        s->numbers[number] = value;
    else
        s->unnamed = 1;
}

int dmoc_solver_wrong(const dmoc_solver *s, const char **expected)
{
    if (expected)
        *expected = s->expected;
    return s->wrong;
}

static int refuse(dmoc_solver *s, int number, const char *expected)
{
    s->wrong = number, s->expected = expected;
    return 0;
}

static int changed(const dmoc_solver *s, int number)
{
    return number >= 0 && s->numbers[number] != s->c->number[number].value;
}

/* Momenta of a state that is fixed, and whether its rates are those of what is held there. */
static int set_state(dmoc_solver *s, const dmoc_state *state, int phase)
{
    const dmoc_places *p = &s->c->places;
    double *q = s->work, *v = q + p->nq, *momentum = v + p->nq, *rate = momentum + p->nq;
    int number = -1, moved = 0;
    for (int i = 0; i < 2*p->nq; ++i) {
        const int k = state->number[i];
        q[i] = k < 0 ? state->value[i] : s->numbers[k];
        moved |= changed(s, k);
        if (changed(s, k) && (i >= p->nq || number < 0))
            number = k;
    }
    for (int i = 2*p->nq; number < 0 && i--;)
        number = state->number[i];
    const ptrdiff_t first = carried_first_parameter(s, phase);
    for (int i = 0; i < p->parameters; ++i)
        moved |= s->pool[first + i] != s->c->pool[first + i];
    if (!moved)
        return 1;
    const double time = 0, *in[DMOC_MOST] = {q, v, &time, s->pool + first};
    carried_call(p->momentum, in, momentum, NULL);
    for (int i = 0; i < p->nq; ++i) {
        const int unknown = state->momentum[i];
        s->array[DMOC_LOWER][unknown] = s->array[DMOC_UPPER][unknown] =
            momentum[i]/s->program.sizes[unknown];
    }
    if (p->gap_rate) {
        carried_call(p->gap_rate, in, rate, NULL);
        for (int j = 0; j < p->nc; ++j)
            if (p->held[phase*p->nc + j] == 2 && !(fabs(rate[j]) <= CARRIED_KEPT*p->rate[j]))
                return refuse(s, number, "velocities that keep what is closed there closed");
    }
    if (p->joint_rate) {
        carried_call(p->joint_rate, in, rate, NULL);
        for (int j = 0; j < p->nj; ++j)
            if (!(fabs(rate[j]) <= CARRIED_KEPT*p->joint_rate_size[j]))
                return refuse(s, number, "velocities that keep the constraints of the model");
    }
    return 1;
}

static int within(double size, double most) { return 1/most <= size && size <= most; }

/* Whether a number is one, between those that it must lie between, and what it may be. */
static int fits(dmoc_solver *s, int i)
{
    const dmoc_number *number = &s->c->number[i];
    if (!isfinite(s->numbers[i]))
        return refuse(s, i, "a finite number");
    if (number->least >= 0 && s->numbers[i] < s->numbers[number->least])
        return refuse(s, i, "no less than its lower bound");
    if (number->most >= 0 && s->numbers[i] > s->numbers[number->most])
        return refuse(s, i, "no more than its upper bound");
    const double value = s->numbers[i], size = fabs(value);
    const int kind = number->kind;
    if (kind == DMOC_SHARE && !(value > 0 && value <= 1))
        return refuse(s, i, "a coefficient above 0, at most 1");
    if ((kind == DMOC_TIME || (kind == DMOC_EARLIEST_TIME && value != 0)) &&
        !(value > 0 && within(size, LONGEST_TIME)))
        return refuse(s, i, "a positive time from 1e-60 to 1e60 s");
    if (kind == DMOC_PARAMETER && value != 0 && !within(size, LARGEST))
        return refuse(s, i, "0 or a magnitude from 1e-100 to 1e100");
    if (kind == DMOC_STATE && size > LARGEST)
        return refuse(s, i, "a magnitude of at most 1e100");
    return 1;
}

/* Whether the mass of the first position, with these parameters, is positive definite. */
static int has_mass(dmoc_solver *s, const double *parameters)
{
    double *q = s->work + s->c->places.parameters;
    for (int i = 0; i < s->c->places.nq; ++i) {
        const int at = s->c->places.q + i;
        q[i] = fmin(fmax(s->x[at], s->array[DMOC_LOWER][at]), s->array[DMOC_UPPER][at])*
               s->program.sizes[at];
    }
    return carried_mass_at(s, q, 0, parameters);
}

static int has_friction(dmoc_solver *s, const double *parameters)
{
    const dmoc_together *t = &s->c->together;
    double *kinetic = s->work, *resting = kinetic + t->tangents;
    const double *in[DMOC_MOST] = {parameters};
    carried_call(t->friction, in, kinetic, resting);
    for (int k = 0; k < t->tangents; ++k)
        if ((t->kinds[k] && !(kinetic[k] >= 0)) ||
            (t->kinds[k] == 2 && !(kinetic[k] <= resting[k])))
            return 0;
    return 1;
}

/* Whether hits return no more along their tangents than they take. */
static int has_returns(dmoc_solver *s, const double *parameters)
{
    const dmoc_together *t = &s->c->together;
    const double *in[DMOC_MOST] = {parameters};
    carried_call(t->tangential, in, s->work, NULL);
    for (int k = 0; k < t->tangents; ++k)
        if (!(fabs(s->work[k]) <= 1))
            return 0;
    return 1;
}

/* A parameter into the pool, of all phases that have its value. */
static void put_parameter(dmoc_solver *s, int i)
{
    const dmoc_number *number = &s->c->number[i];
    for (int k = 0; number->pool >= 0 && k < number->phases; ++k)
        s->pool[number->pool + k*s->c->places.parameters] = s->numbers[i];
}

typedef int condition(dmoc_solver *s, const double *parameters);

/* Whether a condition holds of the parameters of some phases. */
static int all_hold(dmoc_solver *s, condition *fulfilled, int phases)
{
    for (int i = 0; i < phases; ++i)
        if (!fulfilled(s, s->pool + carried_first_parameter(s, i)))
            return 0;
    return 1;
}

/* Whether a condition holds of all parameters together, of the first phase or of all. Where it does
 * not, the first one is refused that spoils it when they are set one after the other. */
static int hold_together(dmoc_solver *s, condition *fulfilled, int first_alone,
                         const char *expected)
{
    const dmoc_carried *c = s->c;
    const int sets = c->places.by_phase ? c->phases : 1, phases = first_alone ? 1 : sets;
    const ptrdiff_t first = carried_first_parameter(s, 0);
    int last = -1;
    if (all_hold(s, fulfilled, phases))
        return 1;
    carried_copy(s->pool + first, c->pool + first, sets*c->places.parameters);
    for (int i = 0; i < c->numbers; ++i) {
        if (c->number[i].pool < 0 || !changed(s, i))
            continue;
        put_parameter(s, i);
        last = i;
        if (!all_hold(s, fulfilled, phases))
            break;
    }
    return last < 0 || refuse(s, last, expected);
}

/* Whether limits and tolerances are such that an end says something. */
int carried_limited(dmoc_solver *s, const dmoc_limits *limits)
{
    const int tolerances = limits->optimality > 0 && limits->optimality < INFINITY &&
                           limits->violation > 0 && limits->violation < INFINITY;
    return (tolerances && limits->iterations >= 0 && !isnan(limits->seconds)) ||
           refuse(s, -1, "positive tolerances, 0 iterations or more, and seconds that are a number");
}

int carried_apply(dmoc_solver *s)
{
    const dmoc_carried *c = s->c;
    const double *base[DMOC_ARRAYS] = {
        c->program.lower, c->program.upper, c->program.values.constant,
        c->program.values.coefficient, c->program.slopes.constant, c->factor,
    };
    const ptrdiff_t count[DMOC_ARRAYS] = {
        c->program.n, c->program.n, c->program.m + 1, c->coefficients, c->program.slopes.targets,
        c->factors,
    };
    const int unnamed = s->unnamed;
    int last = -1;
    s->wrong = -1, s->expected = NULL, s->unnamed = 0;
    for (int a = 0; a < DMOC_ARRAYS; ++a)
        carried_copy(s->array[a], base[a], count[a]);
    carried_copy(s->pool, c->pool, c->pool_size);
    if (unnamed)
        return refuse(s, -1, "a number that the problem has");
    for (int i = 0; i < c->numbers; ++i) {
        const dmoc_number *number = &c->number[i];
        if (!fits(s, i))
            return 0;
        if (!changed(s, i))
            continue;
        last = i;
        put_parameter(s, i);
        for (int k = number->first; k < number->first + number->changes; ++k)
            s->array[c->change[k].array][c->change[k].entry] +=
                c->change[k].slope*(s->numbers[i] - number->value);
    }
    if (last < 0)
        return 1;
    if (c->together.mass && !hold_together(s, has_mass, 1, "a positive definite mass matrix"))
        return 0;
    if (c->together.friction &&
        !hold_together(s, has_friction, 0, "friction of 0 or more, static no less than kinetic"))
        return 0;
    if (c->together.tangential &&
        !hold_together(s, has_returns, 0, "tangential restitution from -1 to 1"))
        return 0;
    for (int end = 0; end < 2; ++end)
        if (c->state[end].known && !set_state(s, &c->state[end], end ? c->phases - 1 : 0))
            return 0;
    for (ptrdiff_t i = 0; i < c->program.n; ++i) {
        const double lower = s->program.lower[i], upper = s->program.upper[i];
        if (c->kkt.place[i] < 0 ? lower != upper : !(lower < upper))
            return refuse(s, last, "bounds with room between them, and fixed values that agree");
    }
    return 1;
}
