/* A solver in the caller's memory: the parts of the memory, a solve. */
#include "dmoc_inside.h"

/* As dmoc.solvers and dmoc.base.tolerances have them. */
static const double COLD = 1e-4, WARM = 1e-6, LEAST = 1e-6, BARRIER_END = 1e-9, STRETCH = 1.25;
static const double OPTIMALITY = 1e-6, VIOLATION = 1e-10;
enum { ITERATIONS = 1000 };

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

static size_t scratch_size(const dmoc_carried *c)
{
    const dmoc_pass *pass[] = {&c->program.values, &c->program.slopes, &c->program.curvatures,
                               &c->motion.momenta};
    size_t most = 0;
    for (size_t i = 0; i < sizeof pass/sizeof *pass; ++i) {
        const size_t size = (size_t)dmoc_scratch_size(pass[i]);
        most = size > most ? size : most;
    }
    return most;
}

/* Elements that are copied, as numbers move factors of some of them. */
static size_t elements_of(const dmoc_carried *c)
{
    const dmoc_program *p = &c->program;
    return c->results ? (size_t)(p->values.elements + p->slopes.elements + p->curvatures.elements)
                      : 0;
}

/* The passes with elements of their own, whose factors are those that numbers move. */
static void set_elements(dmoc_solver *s)
{
    const dmoc_carried *c = s->c;
    dmoc_pass *pass[] = {&s->program.values, &s->program.slopes, &s->program.curvatures};
    dmoc_element *element = s->elements;
    for (int i = 0; c->results && i < 3; ++i) {
        memcpy(element, pass[i]->element, sizeof *element*(size_t)pass[i]->elements);
        pass[i]->element = element;
        element += pass[i]->elements;
    }
    for (const dmoc_moved *moved = c->moved; moved < c->moved + c->results; ++moved)
        pass[moved->pass]->element[moved->element].factor[moved->output] =
            s->array[DMOC_FACTOR] + moved->at;
}

/* Share the memory out; without any, count alone. */
static size_t share_out(dmoc_solver *s, const dmoc_carried *c, double *memory)
{
    const size_t n = (size_t)c->program.n, m = (size_t)c->program.m;
    const size_t count[DMOC_ARRAYS] = {
        n, n, m + 1, (size_t)c->coefficients, (size_t)c->program.slopes.targets,
        (size_t)c->factors,
    };
    memory_left left = {memory, doubles(sizeof *s)};
    for (int a = 0; a < DMOC_ARRAYS; ++a)
        s->array[a] = take(&left, count[a]);
    s->elements = (dmoc_element *)take(&left, doubles(sizeof(dmoc_element)*elements_of(c)));
    s->numbers = take(&left, (size_t)c->numbers);
    s->pool = take(&left, (size_t)c->pool_size);
    s->x = take(&left, n), s->y = take(&left, m), s->z = take(&left, n);
    s->best = take(&left, 2*n + m);
    s->size = take(&left, n), s->stretch = take(&left, n);
    s->z_lower = take(&left, n), s->z_upper = take(&left, n);
    s->values = take(&left, m + 1);
    s->slopes = take(&left, (size_t)c->program.slopes.targets);
    s->physical = take(&left, n);
    s->times = take(&left, (size_t)carried_nodes(c));
    s->results = take(&left, carried_results_size(c));
    s->work = take(&left, carried_work_size(c));
    double *scratch = take(&left, scratch_size(c));
    s->program = c->program, s->ldl = c->ldl, s->momenta = c->motion.momenta;
    s->program.values.scratch = s->program.slopes.scratch = s->program.curvatures.scratch = scratch;
    s->momenta.scratch = scratch;
    s->ldl.panel = take(&left, (size_t)c->ldl.panel_size);
    s->ldl.work = take(&left, (size_t)c->ldl.work_size);
    s->ldl.product = s->ldl.work ? s->ldl.work + c->ldl.product_at : NULL;
    s->ldl.D = take(&left, 3*((size_t)c->ldl.pivots + 2));
    const size_t group = (size_t)(c->ldl.n - c->ldl.chain + 1);
    s->ldl.exchange = (int *)take(&left, doubles(sizeof(int)*group));
    s->memory = take(&left, doubles(dmoc_interior_memory(&c->program, &c->kkt)));
    return left.count;
}

size_t dmoc_solver_memory(const dmoc_carried *problem)
{
    dmoc_solver s;
    return sizeof(double)*share_out(&s, problem, NULL);
}

dmoc_solver *dmoc_solver_begin(const dmoc_carried *c, void *memory, size_t bytes)
{
    dmoc_solver *s = (dmoc_solver *)memory;
    if (!memory || bytes < dmoc_solver_memory(c))
        return NULL;
    memset(s, 0, sizeof *s);
    share_out(s, c, (double *)memory);
    s->c = c;
    s->program.lower = s->array[DMOC_LOWER], s->program.upper = s->array[DMOC_UPPER];
    s->program.values.constant = s->array[DMOC_CONSTANT];
    s->program.values.coefficient = s->array[DMOC_COEFFICIENT];
    s->program.slopes.constant = s->array[DMOC_SLOPE];
    set_elements(s);
    s->program.pool = s->pool, s->momenta.constant = s->pool;
    memset(s->ldl.panel, 0, sizeof(double)*(size_t)c->ldl.panel_size);
    memset(s->ldl.work, 0, sizeof(double)*(size_t)c->ldl.work_size);
    for (int i = 0; i < c->numbers; ++i)
        s->numbers[i] = c->number[i].value;
    for (ptrdiff_t i = 0; i < c->program.n; ++i)
        s->stretch[i] = i < carried_stepped(c) ? STRETCH : (double)INFINITY;
    dmoc_solver_from_answer(s);
    carried_apply(s);
    carried_read_out(s);
    return s;
}

dmoc_limits dmoc_solver_limits(void)
{
    dmoc_limits limits = {ITERATIONS, 0, NULL, OPTIMALITY, VIOLATION, NULL, NULL};
    limits.seconds = (double)INFINITY;
    return limits;
}

static dmoc_options options_of(const dmoc_solver *s, const dmoc_limits *limits)
{
    dmoc_options o;
    memset(&o, 0, sizeof o);
    o.optimality = fmin(limits->optimality, BARRIER_END);
    o.demanded = fmax(limits->optimality, BARRIER_END);
    o.violation = limits->violation;
    o.least_cost = CARRIED_LEAST_COST, o.infeasible = CARRIED_INFEASIBLE;
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
    if (!carried_apply(s) || !carried_limited(s, &limits))
        return DMOC_BAD_NUMBER;
    memset(&s->end, 0, sizeof s->end);
    for (ptrdiff_t i = 0; i < n; ++i) {
        s->x[i] = fmin(fmax(s->x[i], s->program.lower[i]), s->program.upper[i]);
        s->size[i] = i < carried_stepped(s->c) ? s->x[i] : 1;
        s->z_lower[i] = s->warm ? fmax(s->z[i], 0) : 0;
        s->z_upper[i] = s->warm ? fmax(-s->z[i], 0) : 0;
    }
    if (!s->warm)
        memset(s->y, 0, sizeof(double)*(size_t)s->program.m);
    carried_evaluate(s);
    const dmoc_options o = options_of(s, &limits);
    const dmoc_result result = dmoc_interior_point(&s->program, &s->c->kkt, &o, s->size, s->stretch,
                                                   s->x, s->y, s->z_lower, s->z_upper, &s->ldl,
                                                   s->memory);
    for (ptrdiff_t i = 0; i < n; ++i)
        s->z[i] = s->z_lower[i] - s->z_upper[i];
    for (ptrdiff_t r = s->program.equalities; r < s->program.m; ++r)
        s->y[r] = fmin(s->y[r], 0);
    s->end.iterations = result.iterations, s->end.restorations = result.restorations;
    s->end.factorisations = result.factorisations, s->end.starts = 1;
    const int status = carried_judge(s, result.status, &limits);
    s->warm = status == DMOC_SOLVED;
    carried_read_out(s);
    if (status != DMOC_SOLVED)
        return status;
    return !carried_all_inside(s) ? DMOC_OUTSIDE : !carried_lawful(s) ? DMOC_UNPHYSICAL : status;
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
        "the motion penetrates a surface, leaves its hold or slides against its word: move an end",
        "a mass, friction or restitution along the motion is none: change the parameters",
        "the first event is over, nothing is left on these phases alone, or the last end is no motion",
    };
    const int known = status >= 0 && status < (int)(sizeof sentences/sizeof *sentences);
    return known ? sentences[status] : "";
}

dmoc_end dmoc_solver_end(const dmoc_solver *s) { return s->end; }

int dmoc_solver_rows(const dmoc_carried *c) { return (int)c->program.m; }

void dmoc_solver_multipliers(const dmoc_solver *s, double *y, double *z)
{
    const ptrdiff_t n = s->program.n, m = s->program.m;
    const double *inverse = s->program.sizes + n; /* of the sizes of rows, then that of the cost */
    for (ptrdiff_t r = 0; r < m; ++r)
        y[r] = s->y[r]*inverse[r]*s->c->cost;
    for (ptrdiff_t i = 0; i < n; ++i)
        z[i] = s->z[i]/s->program.sizes[i]*s->c->cost;
}
