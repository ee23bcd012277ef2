/* What a motion is, from the unknowns: times, momenta, velocities and forces at the nodes of the
 * phases, as dmoc.program.extraction has them. */
#include "dmoc_inside.h"

/* Nodes of a phase whose forces are continued to its ends, at least one more; Newton steps to a
 * place that is held, from an error of interpolation. */
enum { FEWEST = 4, TURNS = 4 };
/* A state that has entered a surface is put so far in front of it, in sizes of its gap. */
static const double IN_FRONT = 1e-6;

static size_t functions_of(const dmoc_carried *c)
{
    size_t count = 0;
    for (int i = 0; i < DMOC_KINDS; ++i)
        count += (size_t)c->motion.functions[i].count;
    return count;
}

/* Slopes that a state is moved along: those of functions, and of surfaces that it has entered. */
static size_t slopes_of(const dmoc_carried *c)
{
    return functions_of(c) + (size_t)c->places.nc;
}

static size_t rows_of(const dmoc_carried *c) { return (size_t)(carried_nodes(c) - 1 + c->phases); }

size_t carried_results_size(const dmoc_carried *c)
{
    return rows_of(c)*(2*(size_t)c->places.nq + functions_of(c)) + 1;
}

/* What node_of has, and what the judge, numbers and laws work with. */
size_t carried_work_size(const dmoc_carried *c)
{
    const size_t n = (size_t)c->places.nq, k = slopes_of(c);
    const size_t free = (size_t)c->places.parameters;
    size_t entries = (size_t)(c->places.crossing.count + c->places.crossing.entries);
    for (int i = 0; i < DMOC_KINDS; ++i)
        entries += (size_t)c->motion.functions[i].entries;
    return free + n + (size_t)c->motion.inputs + 2*n*n + 3*n + entries + 3*k*n + k*k + 3*k +
           (size_t)(3*c->places.nc + c->places.nj + 8*c->places.nt);
}

/* B := (A^-1 B')' for the rows of B[rows*n], by elimination in A[n*n]; not a number where A is
 * singular. */
static void solve(double *A, int n, double *B, int rows)
{
    for (int k = 0; k < n; ++k) {
        int most = k;
        for (int i = k + 1; i < n; ++i)
            most = fabs(A[i*n + k]) > fabs(A[most*n + k]) ? i : most;
        for (int j = k; j < n; ++j) {
            const double moved = A[k*n + j];
            A[k*n + j] = A[most*n + j], A[most*n + j] = moved;
        }
        for (int r = 0; r < rows; ++r) {
            const double moved = B[r*n + k];
            B[r*n + k] = B[r*n + most], B[r*n + most] = moved;
        }
        for (int i = k + 1; i < n; ++i) {
            const double factor = A[i*n + k]/A[k*n + k];
            for (int j = k + 1; j < n; ++j)
                A[i*n + j] -= factor*A[k*n + j];
            for (int r = 0; r < rows; ++r)
                B[r*n + i] -= factor*B[r*n + k];
        }
    }
    for (int r = 0; r < rows; ++r)
        for (int k = n - 1; k >= 0; --k) {
            for (int j = k + 1; j < n; ++j)
                B[r*n + k] -= A[k*n + j]*B[r*n + j];
            B[r*n + k] /= A[k*n + k];
        }
}

/* A node: where and when it is, and room for what happens there. */
typedef struct {
    const dmoc_carried *c;
    const double *q, *t, *parameters, *zeros;
    double *mass, *copy, *rest, *column, *stored, *slopes, *rates, *push, *response, *product;
    double *multiplier, *spare;
} node_of;

static node_of node_in(const dmoc_solver *s, int phase)
{
    const dmoc_carried *c = s->c;
    const size_t n = (size_t)c->places.nq, k = slopes_of(c);
    node_of at;
    double *free = s->work;
    at.c = c, at.q = at.t = NULL;
    carried_parameters(s, phase, free);
    at.parameters = free, free += c->places.parameters;
    memset(free, 0, sizeof(double)*(n + (size_t)c->motion.inputs));
    at.zeros = free, free += n + (size_t)c->motion.inputs;
    at.mass = free, free += n*n;
    at.copy = free, free += n*n;
    at.rest = free, free += n;
    at.column = free, free += n;
    at.spare = free, free += n;
    at.slopes = free, free += k*n;
    at.push = free, free += k*n;
    at.response = free, free += k*n;
    at.product = free, free += k*k;
    at.rates = free, free += k;
    at.multiplier = free, free += 2*k;
    at.stored = free;
    return at;
}

/* The mass, and the momentum at rest. */
static void weigh(node_of *at)
{
    const double *in[DMOC_MOST] = {at->q, at->zeros, at->zeros, at->t, at->parameters};
    const double *still[DMOC_MOST] = {at->q, at->zeros, at->t, at->parameters};
    carried_call(at->c->motion.dynamics, in, at->mass, at->spare);
    carried_call(at->c->places.momentum, still, at->rest, NULL);
}

static void velocity(const node_of *at, const double *p, double *v)
{
    const int n = at->c->places.nq;
    carried_copy(at->copy, at->mass, n*n);
    for (int i = 0; i < n; ++i)
        v[i] = p[i] - at->rest[i];
    solve(at->copy, n, v, 1);
}

/* Slopes by q of the functions of a kind. */
static void slope(const node_of *at, int kind)
{
    const dmoc_functions *f = &at->c->motion.functions[kind];
    const int n = at->c->places.nq;
    const double *in[DMOC_MOST] = {at->q, at->t, at->parameters};
    carried_call(f->slopes, in, at->stored, NULL);
    memset(at->slopes, 0, sizeof(double)*(size_t)(f->count*n));
    for (int e = 0; e < f->entries; ++e)
        if (f->column[e] < n)
            at->slopes[f->row[e]*n + f->column[e]] = at->stored[e];
}

/* What the impulses of a phase change of the momentum p at its node k of steps + 1; the slopes and
 * rates, at the velocity v, of what they hold go to the end of those that there are. */
static void push(const dmoc_solver *s, const node_of *at, int phase, int k, double *p)
{
    const dmoc_motion *m = &s->c->motion;
    const int n = s->c->places.nq, steps = s->c->steps[phase], own = m->degree > 1;
    const double factor = !k ? -1 : own || k == steps ? 1 : 0.5;
    const int station = own && k ? k*(m->degree + 1) - 1 : k;
    for (const dmoc_reaction *r = m->reaction; r < m->reaction + m->reactions; ++r) {
        if (r->phase != phase)
            continue;
        slope(at, r->kind);
        for (int j = 0; j < r->columns; ++j) {
            const double impulse = s->physical[r->impulse[station*r->columns + j]];
            for (int i = 0; i < n; ++i)
                p[i] += factor*r->sign*impulse*at->slopes[r->column[j]*n + i];
        }
    }
}

/* Slopes of what is held in a phase, with rates at the velocity v or, without one, with values of
 * what is held in place; how many. With back also of what slides against its direction. */
static int held(const node_of *at, int phase, const double *v, int back)
{
    const dmoc_motion *m = &at->c->motion;
    const dmoc_places *places = &at->c->places;
    const int n = places->nq;
    int count = 0;
    for (const dmoc_reaction *r = m->reaction; r < m->reaction + m->reactions; ++r) {
        if (r->phase != phase || (!v && r->kind == DMOC_TANGENTIAL))
            continue;
        const double *there[DMOC_MOST] = {at->q, at->t, at->parameters};
        const double *moving[DMOC_MOST] = {at->q, v, at->t, at->parameters};
        slope(at, r->kind);
        carried_call(v ? m->functions[r->kind].rates
                       : r->kind == DMOC_NORMAL ? places->surface : places->joint,
                     v ? moving : there, at->rates, NULL);
        const int *slides = back && r->kind == DMOC_TANGENTIAL ? places->slides + phase*places->nt
                                                               : NULL;
        for (int j = 0; j < r->columns; ++j) {
            const int column = r->column[j];
            if (r->holds[j] || (slides && slides[column]*at->rates[column] < 0)) {
                carried_copy(at->push + count*n, at->slopes + column*n, n);
                at->multiplier[count++] = at->rates[column];
            }
        }
    }
    return count;
}

/* The same of the open surfaces that a position has entered in the first phase, where they are, to
 * in front of them, behind so many others: the slope is the rate of the gap at unit velocities. */
static int entered(const node_of *at, int count)
{
    const dmoc_places *places = &at->c->places;
    const int n = places->nq;
    const double *there[DMOC_MOST] = {at->q, at->t, at->parameters};
    const double *moving[DMOC_MOST] = {at->q, at->column, at->t, at->parameters};
    for (int j = 0; j < places->nc; ++j) {
        if (places->held[j] != 1)
            continue;
        if (places->within)
            carried_call(places->within, there, at->rates, NULL);
        if (places->within && !(at->rates[j] > 0))
            continue;
        carried_call(places->surface, there, at->rates, NULL);
        const double beyond = at->rates[j] + IN_FRONT*places->gap[j];
        if (!(beyond > 0))
            continue;
        at->multiplier[count] = beyond;
        for (int i = 0; i < n; ++i) {
            memset(at->column, 0, sizeof(double)*(size_t)n);
            at->column[i] = 1;
            carried_call(places->gap_rate, moving, at->rates, NULL);
            at->push[count*n + i] = at->rates[j];
        }
        ++count;
    }
    return count;
}

/* Changes of velocities or positions that take some rates or values away, measured by the masses:
 * each slope has its multiplier in the change of the momentum, and its response. */
static int respond(const node_of *at, int count)
{
    const int n = at->c->places.nq;
    carried_copy(at->response, at->push, count*n);
    carried_copy(at->copy, at->mass, n*n);
    solve(at->copy, n, at->response, count);
    for (int a = 0; a < count; ++a)
        for (int b = 0; b < count; ++b) {
            double sum = 0;
            for (int i = 0; i < n; ++i)
                sum += at->push[a*n + i]*at->response[b*n + i];
            at->product[a*count + b] = sum;
        }
    solve(at->product, count, at->multiplier, 1);
    for (int a = 0; a < count; ++a)
        if (!isfinite(at->multiplier[a]))
            return 0;
    return count;
}

/* The momentum p moved the shortest way to where what is held, and with back what slides against
 * its direction, has no rates. */
static void hold(const node_of *at, int phase, double *p, int back)
{
    const int n = at->c->places.nq;
    velocity(at, p, at->column);
    const int count = respond(at, held(at, phase, at->column, back));
    for (int a = 0; a < count; ++a)
        for (int i = 0; i < n; ++i)
            p[i] -= at->multiplier[a]*at->push[a*n + i];
}

void carried_keep(const dmoc_solver *s, double *q, double *v)
{
    const int n = s->c->places.nq;
    const double time = 0, *reach = s->c->places.reach;
    node_of at = node_in(s, 0);
    at.q = q, at.t = &time;
    for (int turn = 0; turn < TURNS; ++turn) {
        memset(at.mass, 0, sizeof(double)*(size_t)(n*n));
        for (int i = 0; i < n; ++i)
            at.mass[i*n + i] = 1/(reach[i]*reach[i]);
        const int count = respond(&at, entered(&at, held(&at, 0, NULL, 0)));
        for (int a = 0; a < count; ++a)
            for (int i = 0; i < n; ++i)
                q[i] -= at.multiplier[a]*at.response[a*n + i];
    }
    const double *in[DMOC_MOST] = {q, v, &time, at.parameters};
    weigh(&at);
    carried_call(s->c->places.momentum, in, at.spare, NULL);
    hold(&at, 0, at.spare, 1);
    velocity(&at, at.spare, v);
}

/* Forces of a reaction at the nodes of its phase, from impulses by the time that they stand for:
 * where steps share them, those of the ends are continued; else the mean of both sides. */
static void force(const dmoc_solver *s, const dmoc_reaction *r, int column, double *to, int apart)
{
    const dmoc_motion *m = &s->c->motion;
    const int steps = s->c->steps[r->phase], d = m->degree, each = d + 1;
    const double h = s->physical[r->phase];
    for (int k = 0; k <= steps; ++k) {
        const double *x = s->physical;
        const int *impulse = r->impulse + column;
        double value;
        if (d == 1) {
            value = x[impulse[k*r->columns]]/(h*(k && k < steps ? 1 : 0.5));
        } else {
            const double after = k < steps ? x[impulse[k*each*r->columns]]/(h*m->share[0]) : 0;
            const double before = k ? x[impulse[(k*each - 1)*r->columns]]/(h*m->share[d]) : 0;
            value = (after + before)/(k && k < steps ? 2 : 1);
        }
        to[k*apart] = value;
    }
    if (d == 1 && steps + 1 > FEWEST) {
        to[0] = 2*to[apart] - to[2*apart];
        to[steps*apart] = 2*to[(steps - 1)*apart] - to[(steps - 2)*apart];
    }
}

void carried_parameters(const dmoc_solver *s, int phase, double *parameters)
{
    const dmoc_places *p = &s->c->places;
    const double *own = s->pool + carried_first_parameter(s, phase);
    for (int i = 0; i < p->parameters; ++i)
        parameters[i] = p->chosen[i] < 0 ? own[i] : s->physical[p->chosen[i]];
}

static void momenta(dmoc_solver *s, double *p, double *v)
{
    const dmoc_carried *c = s->c;
    const int n = c->places.nq, slides = c->motion.functions[DMOC_TANGENTIAL].count;
    s->strays = 0;
    for (int i = 0, first = 0, row = 0; i < c->phases; first += c->steps[i++]) {
        node_of at = node_in(s, i);
        for (int k = 0; k <= c->steps[i]; ++k, ++row) {
            at.q = s->physical + c->places.q + (first + k)*n, at.t = s->times + first + k;
            weigh(&at);
            if (c->steps[i])
                push(s, &at, i, k, p + row*n);
            else
                carried_copy(p + row*n, s->physical + c->motion.p_end, n);
            velocity(&at, p + row*n, at.column);
            if (slides && (!k || k == c->steps[i])) {
                const double *in[DMOC_MOST] = {at.q, at.column, at.t, at.parameters};
                slope(&at, DMOC_TANGENTIAL);
                s->strays |= carried_strays(s, i, in, at.slopes, at.stored);
            }
            if (c->steps[i])
                hold(&at, i, p + row*n, 0);
            velocity(&at, p + row*n, v + row*n);
        }
    }
}

void carried_read_out(dmoc_solver *s)
{
    const dmoc_carried *c = s->c;
    const dmoc_motion *m = &c->motion;
    const size_t rows = rows_of(c);
    double t = 0, *at = s->results + 2*rows*(size_t)c->places.nq;
    for (ptrdiff_t i = 0; i < s->program.n; ++i)
        s->physical[i] = s->x[i]*s->program.sizes[i];
    for (int i = 0, node = 0; i < c->phases; ++i)
        for (int k = 0; k < c->steps[i]; ++k) {
            s->times[node++] = t;
            t += s->physical[i];
            s->times[node] = t;
        }
    memset(s->results, 0, sizeof(double)*carried_results_size(c));
    dmoc_put(&s->program, s->x);
    dmoc_assemble(&s->momenta, s->pool, s->results);
    momenta(s, s->results, s->results + rows*(size_t)c->places.nq);
    for (int kind = 0; kind < DMOC_KINDS; ++kind) {
        const int count = m->functions[kind].count;
        for (const dmoc_reaction *r = m->reaction; r < m->reaction + m->reactions; ++r) {
            int first = r->phase;
            for (int i = 0; i < r->phase; ++i)
                first += c->steps[i];
            for (int j = 0; r->kind == kind && j < r->columns; ++j)
                force(s, r, j, at + first*count + r->column[j], count);
        }
        at += rows*(size_t)count;
    }
}

/* Tables ----------------------------------------------------------------------------------------*/

int dmoc_solver_size(const dmoc_carried *c) { return (int)c->program.n; }

const double *dmoc_solver_unknowns(const dmoc_solver *s) { return s->physical; }

int dmoc_solver_tables(const dmoc_carried *c) { return c->tables; }

const char *dmoc_solver_table_name(const dmoc_carried *c, int table)
{
    return table >= 0 && table < c->tables ? c->table[table].name : NULL;
}

const double *dmoc_solver_table(const dmoc_solver *s, int table, int *rows, int *columns)
{
    if (table < 0 || table >= s->c->tables)
        return NULL;
    const dmoc_table_of *of = &s->c->table[table];
    if (rows)
        *rows = of->rows;
    if (columns)
        *columns = of->columns;
    return (of->derived ? s->results : s->physical) + of->first;
}

const double *dmoc_solver_times(const dmoc_solver *s, int *count)
{
    if (count)
        *count = carried_nodes(s->c);
    return s->times;
}
