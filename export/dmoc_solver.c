/* A solver in the caller's memory: numbers into the program, the method, the judge, the motion. */
#include "dmoc_carried.h"

#include <math.h>
#include <string.h>

/* As dmoc.solvers and dmoc.base.tolerances have them. */
static const double COLD = 1e-4, WARM = 1e-6, LEAST = 1e-6, BARRIER_END = 1e-9, STRETCH = 1.25;
static const double LEAST_COST = 1e-2, SCALE_FROM = 100, INFEASIBLE = 1e-6, KEPT = 1e-6;
static const double ROUNDED_OPTIMALITY = 1e-5, ROUNDED_VIOLATION = 1e-9;
static const double OPTIMALITY = 1e-6, VIOLATION = 1e-10;
enum { ITERATIONS = 1000 };

struct dmoc_solver {
    const dmoc_carried *c;
    dmoc_program program;
    dmoc_ldl ldl;
    double *array[DMOC_ARRAYS]; /* those that numbers move */
    double *numbers, *pool;
    double *x, *y, *z;          /* scaled unknowns, multipliers of rows and of bounds */
    double *size, *stretch, *z_lower, *z_upper, *values, *slopes;
    double *physical, *times, *place;
    void *memory;               /* of the method */
    int warm, wrong;
    const char *expected;
    dmoc_end end;
};

/* Memory is shared out in doubles. */
typedef struct {
    double *at;
    size_t count;
} memory_left;

static double *take(memory_left *left, size_t count)
{
    double *part = left->at ? left->at + left->count : NULL;
    left->count += count + 1;
    return part;
}

static size_t doubles(size_t bytes) { return (bytes + sizeof(double) - 1)/sizeof(double); }

static int nodes(const dmoc_carried *c)
{
    int count = 1;
    for (int i = 0; i < c->phases; ++i)
        count += c->steps[i];
    return count;
}

static size_t scratch_size(const dmoc_carried *c)
{
    const dmoc_pass *pass[] = {&c->program.values, &c->program.slopes, &c->program.curvatures};
    size_t most = 0;
    for (int i = 0; i < 3; ++i) {
        const size_t size = (size_t)dmoc_scratch_size(pass[i]);
        most = size > most ? size : most;
    }
    return most;
}

static size_t place_size(const dmoc_places *p)
{
    return 3*(size_t)p->nq + (size_t)(p->nc + p->nj + p->parameters) + 1;
}

/* Share the memory out; without any, count alone. */
static size_t share_out(dmoc_solver *s, const dmoc_carried *c, double *memory)
{
    const size_t n = (size_t)c->program.n, m = (size_t)c->program.m;
    const size_t count[DMOC_ARRAYS] = {
        n, n, m + 1, (size_t)c->coefficients, (size_t)c->program.slopes.targets,
    };
    memory_left left = {memory, doubles(sizeof *s)};
    for (int a = 0; a < DMOC_ARRAYS; ++a)
        s->array[a] = take(&left, count[a]);
    s->numbers = take(&left, (size_t)c->numbers);
    s->pool = take(&left, (size_t)c->pool_size);
    s->x = take(&left, n), s->y = take(&left, m), s->z = take(&left, n);
    s->size = take(&left, n), s->stretch = take(&left, n);
    s->z_lower = take(&left, n), s->z_upper = take(&left, n);
    s->values = take(&left, m + 1);
    s->slopes = take(&left, (size_t)c->program.slopes.targets);
    s->physical = take(&left, n);
    s->times = take(&left, (size_t)nodes(c));
    s->place = take(&left, place_size(&c->places));
    double *scratch = take(&left, scratch_size(c));
    s->program = c->program, s->ldl = c->ldl;
    s->program.values.scratch = s->program.slopes.scratch = s->program.curvatures.scratch = scratch;
    s->ldl.panel = take(&left, (size_t)c->ldl.panel_size);
    s->ldl.work = take(&left, (size_t)c->ldl.work_size);
    s->ldl.product = s->ldl.work ? s->ldl.work + c->ldl.product_at : NULL;
    s->ldl.D = take(&left, 3*((size_t)c->ldl.pivots + 2));
    s->ldl.exchange = (int *)take(&left, doubles(sizeof(int)*(size_t)(c->ldl.n - c->ldl.chain + 1)));
    s->memory = take(&left, doubles(dmoc_interior_memory(&c->program, &c->kkt)));
    return left.count;
}

size_t dmoc_solver_memory(const dmoc_carried *problem)
{
    dmoc_solver s;
    return sizeof(double)*share_out(&s, problem, NULL);
}

/* Unknowns and times in units of the problem. */
static void read_out(dmoc_solver *s)
{
    const dmoc_carried *c = s->c;
    double t = 0;
    for (ptrdiff_t i = 0; i < s->program.n; ++i)
        s->physical[i] = s->x[i]*s->program.unit[i];
    for (int i = 0, node = 0; i < c->phases; ++i)
        for (int k = 0; k < c->steps[i]; ++k) {
            s->times[node++] = t;
            t += s->physical[i];
            s->times[node] = t;
        }
}

dmoc_solver *dmoc_solver_begin(const dmoc_carried *c, void *memory, size_t bytes)
{
    dmoc_solver *s = (dmoc_solver *)memory;
    if (!memory || bytes < dmoc_solver_memory(c))
        return NULL;
    memset(s, 0, sizeof *s);
    share_out(s, c, (double *)memory);
    s->c = c, s->wrong = -1;
    s->program.lower = s->array[DMOC_LOWER], s->program.upper = s->array[DMOC_UPPER];
    s->program.values.constant = s->array[DMOC_CONSTANT];
    s->program.values.coefficient = s->array[DMOC_COEFFICIENT];
    s->program.slopes.constant = s->array[DMOC_SLOPE];
    s->program.pool = s->pool;
    memset(s->ldl.panel, 0, sizeof(double)*(size_t)c->ldl.panel_size);
    memset(s->ldl.work, 0, sizeof(double)*(size_t)c->ldl.work_size);
    for (int i = 0; i < c->numbers; ++i)
        s->numbers[i] = c->number[i].value;
    for (ptrdiff_t i = 0; i < c->program.n; ++i)
        s->stretch[i] = i < c->phases ? STRETCH : (double)INFINITY;
    dmoc_solver_from_answer(s);
    read_out(s);
    return s;
}

/* Numbers ---------------------------------------------------------------------------------------*/

int dmoc_solver_numbers(const dmoc_carried *c) { return c->numbers; }

const char *dmoc_solver_number(const dmoc_carried *c, int number) { return c->number[number].name; }

int dmoc_solver_find(const dmoc_carried *c, const char *name)
{
    for (int i = 0; i < c->numbers; ++i)
        if (!strcmp(c->number[i].name, name))
            return i;
    return -1;
}

double dmoc_solver_get(const dmoc_solver *s, int number) { return s->numbers[number]; }

void dmoc_solver_set(dmoc_solver *s, int number, double value) { s->numbers[number] = value; }

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

static void copy(double *to, const double *from, ptrdiff_t count)
{
    if (count > 0)
        memcpy(to, from, sizeof(double)*(size_t)count);
}

static void call(const dmoc_entry *entry, const double *const in[], double *out)
{
    const ptrdiff_t stride[DMOC_MOST] = {0};
    double *results[1];
    results[0] = out;
    entry->kernel(1, in, stride, results);
}

/* Momenta of a state that is fixed, and whether its rates are those of what is held there. */
static int set_state(dmoc_solver *s, const dmoc_state *state, int phase)
{
    const dmoc_places *p = &s->c->places;
    double *q = s->place, *v = q + p->nq, *momentum = v + p->nq, *rate = momentum + p->nq;
    int number = -1, moved = 0;
    for (int i = 0; i < 2*p->nq; ++i) {
        const int k = state->number[i];
        q[i] = k < 0 ? state->value[i] : s->numbers[k];
        moved |= changed(s, k);
        number = i >= p->nq && changed(s, k) ? k : number;
    }
    const ptrdiff_t first = s->program.n + s->program.m + 2;
    for (int i = 0; i < p->parameters; ++i)
        moved |= s->pool[first + i] != s->c->pool[first + i];
    if (!moved)
        return 1;
    const double time = 0, *in[DMOC_MOST] = {q, v, &time, s->pool + first};
    call(p->momentum, in, momentum);
    for (int i = 0; i < p->nq; ++i) {
        const int unknown = state->momentum[i];
        s->array[DMOC_LOWER][unknown] = s->array[DMOC_UPPER][unknown] =
            momentum[i]/s->program.unit[unknown];
    }
    if (p->gap_rate) {
        call(p->gap_rate, in, rate);
        for (int j = 0; j < p->nc; ++j)
            if (p->held[phase*p->nc + j] == 2 && !(fabs(rate[j]) <= KEPT*p->rate[j]))
                return refuse(s, number, "velocities that keep what is closed there closed");
    }
    if (p->joint_rate) {
        call(p->joint_rate, in, rate);
        for (int j = 0; j < p->nj; ++j)
            if (!(fabs(rate[j]) <= KEPT*p->joint_rate_size[j]))
                return refuse(s, number, "velocities that keep the constraints of the model");
    }
    return 1;
}

/* Whether a number is one, and between those that it must lie between. */
static int fits(dmoc_solver *s, int i)
{
    const dmoc_number *number = &s->c->number[i];
    if (!isfinite(s->numbers[i]))
        return refuse(s, i, "a finite number");
    if (number->least >= 0 && s->numbers[i] < s->numbers[number->least])
        return refuse(s, i, "no less than its lower bound");
    if (number->most >= 0 && s->numbers[i] > s->numbers[number->most])
        return refuse(s, i, "no more than its upper bound");
    return 1;
}

/* Put the numbers into the program; 0 where one does not fit. */
static int apply(dmoc_solver *s)
{
    const dmoc_carried *c = s->c;
    const double *base[DMOC_ARRAYS] = {
        c->program.lower, c->program.upper, c->program.values.constant,
        c->program.values.coefficient, c->program.slopes.constant,
    };
    const ptrdiff_t count[DMOC_ARRAYS] = {
        c->program.n, c->program.n, c->program.m + 1, c->coefficients, c->program.slopes.targets,
    };
    int last = -1;
    s->wrong = -1, s->expected = NULL;
    for (int a = 0; a < DMOC_ARRAYS; ++a)
        copy(s->array[a], base[a], count[a]);
    copy(s->pool, c->pool, c->pool_size);
    for (int i = 0; i < c->numbers; ++i) {
        const dmoc_number *number = &c->number[i];
        if (!fits(s, i))
            return 0;
        if (!changed(s, i))
            continue;
        last = i;
        if (number->pool >= 0)
            s->pool[number->pool] = s->numbers[i];
        for (int k = number->first; k < number->first + number->changes; ++k)
            s->array[c->change[k].array][c->change[k].entry] +=
                c->change[k].slope*(s->numbers[i] - number->value);
    }
    if (last < 0)
        return 1;
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

/* Starts ----------------------------------------------------------------------------------------*/

void dmoc_solver_from_answer(dmoc_solver *s)
{
    copy(s->x, s->c->x, s->program.n);
    copy(s->y, s->c->y, s->program.m);
    copy(s->z, s->c->z, s->program.n);
    s->warm = 1;
}

void dmoc_solver_from_first_motion(dmoc_solver *s)
{
    copy(s->x, s->c->first, s->program.n);
    s->warm = 0;
}

void dmoc_solver_from(dmoc_solver *s, const double *unknowns)
{
    for (ptrdiff_t i = 0; i < s->program.n; ++i)
        s->x[i] = unknowns[i]/s->program.unit[i];
    s->warm = 0;
}

/* Solve -----------------------------------------------------------------------------------------*/

dmoc_limits dmoc_solver_limits(void)
{
    dmoc_limits limits = {ITERATIONS, 0, NULL, OPTIMALITY, VIOLATION, NULL, NULL};
    limits.seconds = (double)INFINITY;
    return limits;
}

static void evaluate(dmoc_solver *s)
{
    dmoc_put(&s->program, s->x);
    dmoc_assemble(&s->program.values, s->pool, s->values);
    dmoc_assemble(&s->program.slopes, s->pool, s->slopes);
}

static double larger(double a, double b) { return a > b || a != a ? a : b; }

/* Residuals of the optimality conditions at the point, with its multipliers or with none. */
static double optimality(const dmoc_solver *s, double *slope, int alone)
{
    const dmoc_program *p = &s->program;
    double worst = 0, sum = 0;
    const double *jac = s->slopes + p->n;
    copy(slope, s->slopes, p->n);
    for (ptrdiff_t r = 0; r < p->m; ++r) {
        const double y = alone ? 0 : r < p->equalities ? s->y[r] : fmin(s->y[r], 0);
        for (int e = p->row_start[r]; e < p->row_start[r + 1]; ++e)
            slope[p->column[e]] += jac[e]*y;
        sum += fabs(y);
        if (r >= p->equalities)
            worst = larger(fabs(y*s->values[1 + r]), worst);
    }
    for (ptrdiff_t i = 0; i < p->n; ++i) {
        if (!(p->lower[i] < p->upper[i]))
            continue;
        const double z = alone ? 0 : s->z[i];
        const double distance = z > 0 ? s->x[i] - p->lower[i] : z < 0 ? p->upper[i] - s->x[i] : 0;
        sum += fabs(z);
        worst = larger(fabs((slope[i] - z)*(i < s->c->phases ? s->x[i] : 1)), worst);
        worst = larger(fabs(z*distance), worst);
    }
    const double mean = p->n + p->m ? sum/(double)(p->n + p->m) : 0;
    worst /= fmax(SCALE_FROM, mean)/SCALE_FROM*fmax(fabs(s->values[0]), LEAST_COST);
    return isfinite(worst) ? worst : (double)INFINITY;
}

static double violation(const dmoc_solver *s)
{
    const dmoc_program *p = &s->program;
    double worst = 0;
    for (ptrdiff_t r = 0; r < p->m; ++r)
        worst = larger(r < p->equalities ? fabs(s->values[1 + r]) : -s->values[1 + r], worst);
    for (ptrdiff_t i = 0; i < p->n; ++i)
        worst = larger(fmax(p->lower[i] - s->x[i], s->x[i] - p->upper[i]), worst);
    return isfinite(worst) ? worst : (double)INFINITY;
}

/* What the residuals say of the point where the method has ended, dmoc.solvers.judge. */
static int judge(dmoc_solver *s, int word, const dmoc_limits *limits)
{
    dmoc_end *end = &s->end;
    evaluate(s);
    end->optimality = optimality(s, s->z_lower, 0);
    if (fabs(s->values[0]) <= LEAST_COST) {
        const double alone = optimality(s, s->z_lower, 1);
        if (alone < end->optimality) {
            end->optimality = alone;
            memset(s->y, 0, sizeof(double)*(size_t)s->program.m);
            memset(s->z, 0, sizeof(double)*(size_t)s->program.n);
        }
    }
    end->violation = violation(s);
    end->cost = s->c->cost*s->values[0];
    if (word == DMOC_INTERRUPTED)
        return word;
    if (end->optimality <= limits->optimality && end->violation <= limits->violation)
        return DMOC_SOLVED;
    if (word == DMOC_ITERATION_LIMIT || word == DMOC_TIME_LIMIT)
        return word;
    if (end->optimality <= ROUNDED_OPTIMALITY && end->violation <= ROUNDED_VIOLATION)
        return DMOC_SOLVED;
    const int finite = isfinite(end->optimality) && isfinite(end->violation);
    return finite && end->violation > INFEASIBLE ? DMOC_INFEASIBLE : DMOC_STALLED;
}

/* Whether nothing is penetrated and all that is closed or held is kept, at all nodes of a phase:
 * rows that fixed values have settled are not in the program. */
static int inside(const dmoc_solver *s, int phase, int first, int last)
{
    const dmoc_places *p = &s->c->places;
    double *result = s->place, *parameters = s->place + p->nc + p->nj;
    const ptrdiff_t at = s->program.n + s->program.m + 2;
    for (int i = 0; i < p->parameters; ++i)
        parameters[i] = p->chosen[i] < 0 ? s->pool[at + i] : s->physical[p->chosen[i]];
    for (int k = first; k <= last; ++k) {
        const double *in[DMOC_MOST] = {s->physical + p->q + k*p->nq, s->times + k, parameters};
        if (p->surface) {
            call(p->surface, in, result);
            for (int j = 0; j < p->nc; ++j) {
                const int held = p->held[phase*p->nc + j];
                const double g = held == 2 ? fabs(result[j]) : result[j];
                if (held && !(g <= KEPT*p->gap[j]))
                    return 0;
            }
        }
        if (p->joint) {
            call(p->joint, in, result);
            for (int j = 0; j < p->nj; ++j)
                if (!(fabs(result[j]) <= KEPT*p->joint_size[j]))
                    return 0;
        }
    }
    return 1;
}

static int all_inside(const dmoc_solver *s)
{
    for (int i = 0, node = 0; i < s->c->phases; node += s->c->steps[i++])
        if (!inside(s, i, node, node + s->c->steps[i]))
            return 0;
    return 1;
}

static dmoc_options options_of(const dmoc_solver *s, const dmoc_limits *limits)
{
    dmoc_options o;
    memset(&o, 0, sizeof o);
    o.optimality = fmin(limits->optimality, BARRIER_END);
    o.demanded = fmax(limits->optimality, BARRIER_END);
    o.violation = limits->violation, o.least_cost = LEAST_COST, o.infeasible = INFEASIBLE;
    o.mu = fmax((s->warm ? WARM : COLD)*fabs(s->values[0]), LEAST);
    o.warm = s->warm, o.iterations = limits->iterations;
    o.seconds = limits->seconds, o.clock = limits->clock;
    o.report = limits->report, o.user = limits->user;
    return o;
}

int dmoc_solver_solve(dmoc_solver *s, const dmoc_limits *given)
{
    const dmoc_limits limits = given ? *given : dmoc_solver_limits();
    const ptrdiff_t n = s->program.n;
    memset(&s->end, 0, sizeof s->end);
    if (!apply(s))
        return DMOC_BAD_NUMBER;
    for (ptrdiff_t i = 0; i < n; ++i) {
        s->x[i] = fmin(fmax(s->x[i], s->program.lower[i]), s->program.upper[i]);
        s->size[i] = i < s->c->phases ? s->x[i] : 1;
        s->z_lower[i] = s->warm ? fmax(s->z[i], 0) : 0;
        s->z_upper[i] = s->warm ? fmax(-s->z[i], 0) : 0;
    }
    if (!s->warm)
        memset(s->y, 0, sizeof(double)*(size_t)s->program.m);
    evaluate(s);
    const dmoc_options o = options_of(s, &limits);
    const dmoc_result result = dmoc_interior_point(&s->program, &s->c->kkt, &o, s->size, s->stretch,
                                                   s->x, s->y, s->z_lower, s->z_upper, &s->ldl,
                                                   s->memory);
    for (ptrdiff_t i = 0; i < n; ++i)
        s->z[i] = s->z_lower[i] - s->z_upper[i];
    for (ptrdiff_t r = s->program.equalities; r < s->program.m; ++r)
        s->y[r] = fmin(s->y[r], 0);
    s->end.iterations = result.iterations, s->end.restorations = result.restorations;
    s->end.factorisations = result.factorisations;
    const int status = judge(s, result.status, &limits);
    s->warm = status == DMOC_SOLVED;
    read_out(s);
    return status == DMOC_SOLVED && !all_inside(s) ? DMOC_OUTSIDE : status;
}

const char *dmoc_solver_sentence(int status)
{
    static const char *const sentences[] = {
        "a local minimum was found",
        "no feasible motion was found",
        "the iteration limit was reached: raise it, or start from a better guess",
        "the time limit was reached: raise it, or start from a better guess",
        "no further progress was possible before optimality: try another guess or other steps",
        "the solve was interrupted: the best iterate so far is kept",
        "there is not enough memory",
        "a number does not fit the problem: nothing was solved",
        "the motion penetrates a surface or leaves what holds it: move its start or goal",
    };
    const int known = status >= 0 && status < (int)(sizeof sentences/sizeof *sentences);
    return known ? sentences[status] : "";
}

dmoc_end dmoc_solver_end(const dmoc_solver *s) { return s->end; }

/* The motion ------------------------------------------------------------------------------------*/

int dmoc_solver_size(const dmoc_carried *c) { return (int)c->program.n; }

int dmoc_solver_rows(const dmoc_carried *c) { return (int)c->program.m; }

const double *dmoc_solver_unknowns(const dmoc_solver *s) { return s->physical; }

int dmoc_solver_tables(const dmoc_carried *c) { return c->tables; }

const char *dmoc_solver_table_name(const dmoc_carried *c, int table) { return c->table[table].name; }

const double *dmoc_solver_table(const dmoc_solver *s, int table, int *rows, int *columns)
{
    const dmoc_table_of *of = &s->c->table[table];
    if (rows)
        *rows = of->rows;
    if (columns)
        *columns = of->columns;
    return s->physical + of->first;
}

const double *dmoc_solver_times(const dmoc_solver *s, int *count)
{
    if (count)
        *count = nodes(s->c);
    return s->times;
}

void dmoc_solver_multipliers(const dmoc_solver *s, double *y, double *z)
{
    const ptrdiff_t n = s->program.n, m = s->program.m;
    const double *inverse = s->program.unit + n; /* of the sizes of rows, then that of the cost */
    for (ptrdiff_t r = 0; r < m; ++r)
        y[r] = s->y[r]*inverse[r]*s->c->cost;
    for (ptrdiff_t i = 0; i < n; ++i)
        z[i] = s->z[i]/s->program.unit[i]*s->c->cost;
}
