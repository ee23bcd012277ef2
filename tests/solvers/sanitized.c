/* Runs the C sources of dmoc on a program that Python has written to a file, without Python.
 *
 *   sanitized solve FILE    the interior-point method; prints status, iterations, restorations,
 *                           cost, then x
 *   sanitized factor FILE   the factorisation of a matrix and one solution; prints the signs of the
 *                           pivots, then the solution
 *
 * A file is a sequence of arrays: the number of entries as int64, then the entries, as double or
 * int64. Every array gets memory of exactly its size, so that a sanitizer sees each access beside
 * it. TABLE is the table of the model's kernels.
 */
#include "interior_point.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

extern const dmoc_table TABLE;

static FILE *input;

static void *memory(size_t count, size_t size)
{
    void *found = malloc(count*size);
    if (!found) {
        fputs("no memory\n", stderr);
        exit(2);
    }
    return found;
}

static void take(void *target, size_t size, size_t count)
{
    if (fread(target, size, count, input) != count) {
        fputs("the file ends too early\n", stderr);
        exit(2);
    }
}

static int64_t whole(void)
{
    int64_t value;
    take(&value, sizeof value, 1);
    return value;
}

static double *numbers(void)
{
    const size_t count = (size_t)whole();
    double *found = memory(count, sizeof *found);
    take(found, sizeof *found, count);
    return found;
}

/* Positions; NULL for none. */
static ptrdiff_t *positions(void)
{
    const int64_t count = whole();
    if (!count)
        return NULL;
    ptrdiff_t *found = memory((size_t)count, sizeof *found);
    for (int64_t i = 0; i < count; ++i)
        found[i] = (ptrdiff_t)whole();
    return found;
}

static int *integers(void)
{
    const int64_t count = whole();
    int *found = memory((size_t)count, sizeof *found);
    for (int64_t i = 0; i < count; ++i)
        found[i] = (int)whole();
    return found;
}

static dmoc_element element(void)
{
    dmoc_element e = {0};
    char name[64] = {0};
    const int64_t length = whole();
    if (length >= (int64_t)sizeof name)
        exit(2);
    take(name, 1, (size_t)length);
    e.entry = dmoc_find(&TABLE, name);
    if (!e.entry) {
        fprintf(stderr, "no kernel %s\n", name);
        exit(2);
    }
    e.n = (ptrdiff_t)whole();
    for (int a = 0; a < e.entry->inputs; ++a) {
        e.base[a] = (ptrdiff_t)whole();
        e.stride[a] = (ptrdiff_t)whole();
        e.gather[a] = positions();
    }
    for (int b = 0; b < e.entry->outputs; ++b) {
        e.slot[b] = positions();
        e.factor[b] = numbers();
    }
    return e;
}

static dmoc_pass pass(void)
{
    dmoc_pass p = {0};
    p.targets = (ptrdiff_t)whole();
    p.constant = numbers();
    p.terms = (ptrdiff_t)whole();
    p.row = positions();
    p.column = positions();
    p.coefficient = numbers();
    p.elements = (ptrdiff_t)whole();
    p.element = memory((size_t)p.elements, sizeof *p.element);
    for (ptrdiff_t e = 0; e < p.elements; ++e)
        p.element[e] = element();
    p.scratch = memory((size_t)dmoc_scratch_size(&p), sizeof *p.scratch);
    return p;
}

static dmoc_program program(void)
{
    dmoc_program p = {0};
    p.n = (ptrdiff_t)whole();
    p.m = (ptrdiff_t)whole();
    p.equalities = (ptrdiff_t)whole();
    p.lower = numbers();
    p.upper = numbers();
    p.sizes = numbers();
    p.pool = numbers();
    p.values = pass();
    p.slopes = pass();
    p.curvatures = pass();
    p.row_start = integers();
    p.column = integers();
    p.hess_start = integers();
    p.hess_column = integers();
    return p;
}

static dmoc_kkt layout(void)
{
    dmoc_kkt k = {0};
    k.size = (int)whole();
    k.pivots = (int)whole();
    k.place = integers();
    k.start = integers();
    k.row = integers();
    k.first = integers();
    k.from_hess = integers();
    k.from_jac = integers();
    k.diagonal = integers();
    return k;
}

static int listen(void *user, int iteration, double cost, double violation, double mu,
                  int restoring)
{
    (void)iteration, (void)cost, (void)violation, (void)mu, (void)restoring;
    ++*(int *)user;
    return 0;
}

static dmoc_options options(int *heard)
{
    const double *real = numbers();
    const int *integer = integers();
    const int priced = integer[3];
    const double *price = numbers();
    return (dmoc_options){
        .optimality = real[0], .demanded = real[1], .violation = real[2], .least_cost = real[3],
        .infeasible = real[4], .mu = real[5], .seconds = real[6], .warm = integer[0],
        .iterations = integer[1], .least_violation = integer[2], .price = priced ? price : NULL,
        .report = listen, .user = heard,
    };
}

static void print(const double *x, ptrdiff_t n)
{
    for (ptrdiff_t i = 0; i < n; ++i)
        printf("%.17g\n", x[i]);
}

static double *two_of(const double *row, ptrdiff_t n)
{
    double *two = memory(2*(size_t)n, sizeof *two);
    for (ptrdiff_t i = 0; i < 2*n; ++i)
        two[i] = row[i % n];
    return two;
}

/* Memory that the method works in. */
static void *room(const dmoc_program *p, const dmoc_kkt *k)
{
    return memory(dmoc_interior_memory(p, k), 1);
}

/* Whether two starts at one point, without multipliers, end as a solve from there has ended. */
static int the_same_twice(const dmoc_program *p, const dmoc_kkt *k, const dmoc_options *o,
                          const double *size, const double *stretch, const double *x,
                          const double *end, dmoc_result r)
{
    double *none = memory((size_t)(p->n + p->m + 1), sizeof *none);
    for (ptrdiff_t i = 0; i < p->n + p->m; ++i)
        none[i] = 0;
    const double mu[] = {o->mu, o->mu};
    double *many = two_of(x, p->n), *sizes = two_of(size, p->n), *y = two_of(none, p->m);
    double *lower = two_of(none, p->n), *upper = two_of(none, p->n);
    const int hurried[] = {0, 0};
    int status[] = {-1, -1}, iterations[] = {0, 0}, turn = 0, stop = 0;
    const dmoc_starts starts = {
        2, sizes, mu, hurried, many, y, lower, upper, status, iterations, &turn, &stop,
    };
    dmoc_ldl *analysed = dmoc_ldl_new(k->size, k->pivots, k->first, k->start, k->row);
    int same = analysed != NULL;
    dmoc_interior_starts(p, k, o, stretch, &starts, analysed, room(p, k));
    dmoc_ldl_free(analysed);
    for (int i = 0; i < 2; ++i)
        same &= status[i] == r.status && iterations[i] == r.iterations;
    for (ptrdiff_t i = 0; i < 2*p->n; ++i)
        same &= many[i] == end[i % p->n];
    return same;
}

static int solve(void)
{
    int heard = 0;
    const dmoc_program p = program();
    const dmoc_kkt k = layout();
    const dmoc_options o = options(&heard);
    const double *size = numbers(), *stretch = numbers();
    double *x = numbers(), *y = numbers(), *z_lower = numbers(), *z_upper = numbers();
    double *before = two_of(x, p.n);
    dmoc_ldl *ldl = dmoc_ldl_new(k.size, k.pivots, k.first, k.start, k.row);
    if (!ldl)
        return 1;
    const dmoc_result r = dmoc_interior_point(&p, &k, &o, size, stretch, x, y, z_lower, z_upper,
                                              ldl, room(&p, &k));
    dmoc_ldl_free(ldl);
    double *values = memory((size_t)p.m + 1, sizeof *values);
    dmoc_put(&p, x);
    dmoc_assemble(&p.values, p.pool, values);
    printf("%d\n%d\n%d\n", r.status, r.iterations, r.restorations);
    print(values, 1);
    print(x, p.n);
    const int cold = !o.warm && !o.least_violation;
    if (cold && !the_same_twice(&p, &k, &o, size, stretch, before, x, r))
        return 1;
    return heard == r.iterations ? 0 : 1;
}

static int factor(void)
{
    const int n = (int)whole(), pivots = (int)whole();
    const int *first = integers(), *start = integers(), *row = integers();
    const double *values = numbers();
    double *x = numbers();
    dmoc_ldl *f = dmoc_ldl_new(n, pivots, first, start, row);
    if (!f)
        return 1;
    dmoc_ldl_factor(f, values, 1e-20);
    dmoc_ldl_solve(f, x);
    printf("%d\n%d\n%d\n", f->positive, f->negative, f->zero);
    print(x, n);
    dmoc_ldl_free(f);
    return 0;
}

int main(int count, char **words)
{
    input = count == 3 ? fopen(words[2], "rb") : NULL;
    if (!input)
        return 2;
    return words[1][0] == 's' ? solve() : factor();
}
