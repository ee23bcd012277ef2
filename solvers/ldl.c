#include "ldl.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int block_rows(const dmoc_ldl *f) { return f->pivots + f->n - f->chain; }

/* First unknown and width of a block row: a pivot, or one unknown of the final group. */
static int row_first(const dmoc_ldl *f, int k)
{
    return k < f->pivots ? f->first[k] : f->chain + k - f->pivots;
}
static int row_width(const dmoc_ldl *f, int k)
{
    return k < f->pivots ? f->first[k + 1] - f->first[k] : 1;
}

static int compare(const void *a, const void *b) { return *(const int *)a - *(const int *)b; }

/* Collect the pivots in block row k of L: those that reach k in the elimination tree from an
 * entry of K. Returns their number. */
static int row_pattern(const dmoc_ldl *f, int k, const int *pivot_of, int *parent, int *mark,
                       int *found)
{
    int count = 0;
    const int first = row_first(f, k), last = first + row_width(f, k);
    mark[k] = k;
    for (int c = first; c < last; ++c)
        for (int p = f->start[c]; p < f->start[c + 1]; ++p) {
            if (f->row[p] >= f->chain)
                continue;
            for (int j = pivot_of[f->row[p]]; j >= 0 && j < k && mark[j] != k; j = parent[j]) {
                if (parent[j] < 0 || parent[j] > k)
                    parent[j] = k < f->pivots ? k : -1;
                mark[j] = k;
                found[count++] = j;
            }
        }
    qsort(found, (size_t)count, sizeof *found, compare);
    return count;
}

static int analyse(dmoc_ldl *f)
{
    const int rows = block_rows(f);
    const size_t size = sizeof(int)*(size_t)(rows + 1);
    int *pivot_of = malloc(sizeof(int)*(size_t)(f->n + 1)), *parent = malloc(size);
    int *mark = malloc(size), *found = malloc(size);
    int room = 16*rows + 16, ok = pivot_of && parent && mark && found;
    f->pattern = malloc(sizeof(int)*(size_t)room);
    ok = ok && f->pattern;
    for (int k = 0; ok && k < f->pivots; ++k)
        for (int c = f->first[k]; c < f->first[k + 1]; ++c)
            pivot_of[c] = k;
    for (int k = 0; ok && k < rows; ++k)
        parent[k] = mark[k] = -1;
    for (int k = 0; ok && k < rows; ++k) {
        const int count = row_pattern(f, k, pivot_of, parent, mark, found);
        const int used = f->pattern_start[k];
        if (used + count > room) {
            room = 2*(used + count);
            int *more = realloc(f->pattern, sizeof(int)*(size_t)room);
            ok = more != NULL;
            if (ok)
                f->pattern = more;
        }
        if (ok) {
            memcpy(f->pattern + used, found, sizeof(int)*(size_t)count);
            f->pattern_start[k + 1] = used + count;
            for (int i = 0; i < count; ++i)
                f->filled[found[i]] += row_width(f, k);
        }
    }
    free(pivot_of), free(parent), free(mark), free(found);
    return ok;
}

dmoc_ldl *dmoc_ldl_new(int n, int pivots, const int *first, const int *start, const int *row)
{
    dmoc_ldl *f = calloc(1, sizeof *f);
    if (!f)
        return NULL;
    f->n = n, f->pivots = pivots, f->chain = first[pivots], f->start = start, f->row = row;
    const size_t dense = (size_t)(n - f->chain), many = (size_t)pivots + 1;
    f->first = malloc(sizeof(int)*many);
    f->pattern_start = calloc(many + dense, sizeof(int));
    f->column_start = malloc(sizeof(int)*many);
    f->filled = calloc(many, sizeof(int));
    f->D = malloc(sizeof(double)*3*many);
    f->dense = malloc(sizeof(double)*(dense*dense + 1));
    f->exchange = malloc(sizeof(int)*(dense + 1));
    f->work = calloc(2*(size_t)n + 2, sizeof(double));
    int ok = f->first && f->pattern_start && f->column_start && f->filled;
    ok = ok && f->D && f->dense && f->exchange && f->work;
    if (ok)
        memcpy(f->first, first, sizeof(int)*many);
    ok = ok && analyse(f);
    if (ok) {
        f->column_start[0] = 0;
        for (int j = 0; j < pivots; ++j)
            f->column_start[j + 1] = f->column_start[j] + f->filled[j];
        f->column_row = malloc(sizeof(int)*((size_t)f->column_start[pivots] + 1));
        f->L = malloc(sizeof(double)*2*((size_t)f->column_start[pivots] + 1));
        ok = f->column_row && f->L;
    }
    if (!ok) {
        dmoc_ldl_free(f);
        return NULL;
    }
    return f;
}

void dmoc_ldl_free(dmoc_ldl *f)
{
    if (!f)
        return;
    free(f->first), free(f->pattern_start), free(f->pattern), free(f->filled);
    free(f->column_start), free(f->column_row);
    free(f->L), free(f->D), free(f->dense), free(f->exchange), free(f->work);
    free(f);
}

static void count_sign(dmoc_ldl *f, double d) { *(d > 0 ? &f->positive : &f->negative) += 1; }

/* Invert a pivot of one (b = 0) or two unknowns into D and count the signs of its eigenvalues. */
static void invert_pivot(dmoc_ldl *f, double *D, int width, double a, double b, double c,
                         double tiny)
{
    if (width == 1) {
        if (!(fabs(a) > tiny)) {
            f->zero += 1;
            a = a < 0 ? -tiny : tiny;
        }
        count_sign(f, a);
        D[0] = 1/a, D[1] = D[2] = 0;
        return;
    }
    double det = a*c - b*b;
    const double size = fmax(fabs(a*c), b*b);
    if (!(fabs(det) > 1e-14*size && fabs(det) > tiny*tiny)) {
        f->zero += 1;
        det = -fmax(1e-14*size, tiny*tiny);
    }
    if (det < 0) {
        f->positive += 1, f->negative += 1;
    } else {
        count_sign(f, a), count_sign(f, a);
    }
    D[0] = c/det, D[1] = -b/det, D[2] = a/det;
}

/* y -= L_j y_j for the rows of block column j that are filled, for a right-hand side of the given
 * width; called with constant widths. */
static inline void update(const int *rows, const double *L, int count, int wide, int width,
                          const double yj[4], double *y)
{
    for (int p = 0; p < count; ++p) {
        double *to = y + 2*rows[p];
        for (int c = 0; c < width; ++c)
            to[c] -= wide == 2 ? L[2*p]*yj[c] + L[2*p + 1]*yj[2 + c] : L[2*p]*yj[c];
    }
}

/* Row k of L: y = L^-1 K(:, k), L_kj = y_j D_j^-1, and pivot (or row of the final group) left in
 * y and S. */
static void eliminate_row(dmoc_ldl *f, const double *values, int k, double S[3])
{
    const int first = row_first(f, k), width = row_width(f, k);
    double *y = f->work;
    S[0] = S[1] = S[2] = 0;
    for (int c = 0; c < width; ++c)
        for (int p = f->start[first + c]; p < f->start[first + c + 1]; ++p) {
            const int i = f->row[p];
            if (i < first || k >= f->pivots)
                y[2*i + c] = values[p];
            else
                S[c + (i - first)] = values[p];
        }
    for (int p = f->pattern_start[k]; p < f->pattern_start[k + 1]; ++p) {
        const int j = f->pattern[p], from = f->first[j], wide = f->first[j + 1] - from;
        const int begin = f->column_start[j], count = f->filled[j];
        const int *rows = f->column_row + begin;
        double *L = f->L + 2*begin, yj[4] = {0, 0, 0, 0};
        const double *D = f->D + 3*j;
        for (int b = 0; b < wide; ++b)
            for (int c = 0; c < width; ++c) {
                yj[2*b + c] = y[2*(from + b) + c];
                y[2*(from + b) + c] = 0;
            }
        if (wide == 2) {
            if (width == 2)
                update(rows, L, count, 2, 2, yj, y);
            else
                update(rows, L, count, 2, 1, yj, y);
        } else {
            if (width == 2)
                update(rows, L, count, 1, 2, yj, y);
            else
                update(rows, L, count, 1, 1, yj, y);
        }
        double l[4];
        for (int c = 0; c < width; ++c) {
            double *entry = L + 2*(count + c);
            l[2*c] = entry[0] = D[0]*yj[c] + D[1]*yj[2 + c];
            l[2*c + 1] = entry[1] = D[1]*yj[c] + D[2]*yj[2 + c];
            f->column_row[begin + count + c] = first + c;
        }
        f->filled[j] = count + width;
        if (k >= f->pivots) {
            y[2*first] -= l[0]*yj[0] + l[1]*yj[2];
        } else {
            S[0] -= l[0]*yj[0] + l[1]*yj[2];
            if (width == 2) {
                S[1] -= l[2]*yj[0] + l[3]*yj[2];
                S[2] -= l[2]*yj[1] + l[3]*yj[3];
            }
        }
    }
}

/* Exchange rows and columns i and j of a symmetric matrix stored in full; finished columns of L
 * follow. */
static void swap(double *A, int n, int i, int j)
{
    for (int c = 0; c < n; ++c) {
        const double t = A[i*n + c];
        A[i*n + c] = A[j*n + c], A[j*n + c] = t;
    }
    for (int r = 0; r < n; ++r) {
        const double t = A[r*n + i];
        A[r*n + i] = A[r*n + j], A[r*n + j] = t;
    }
}

/* Bunch and Parlett's factorisation with complete pivoting: L below the diagonal, the inverse
 * pivots on it and beside it. */
static void factor_dense(dmoc_ldl *f, double tiny)
{
    const int n = f->n - f->chain;
    const double ratio = 0.6403882032022076; /* (1 + sqrt(17))/8 bounds the growth */
    double *A = f->dense;
    for (int k = 0; k < n;) {
        int d = k, r = k, s = k;
        for (int i = k; i < n; ++i)
            for (int j = k; j <= i; ++j) {
                if (i == j && fabs(A[i*n + i]) > fabs(A[d*n + d]))
                    d = i;
                if (i != j && (r == s || fabs(A[i*n + j]) > fabs(A[r*n + s])))
                    r = i, s = j;
            }
        const int width = r == s || fabs(A[d*n + d]) >= ratio*fabs(A[r*n + s]) ? 1 : 2;
        double D[3];
        if (width == 1) {
            swap(A, n, k, d);
            f->exchange[k] = d;
            invert_pivot(f, D, 1, A[k*n + k], 0, 0, tiny);
        } else {
            swap(A, n, k, s);
            swap(A, n, k + 1, r);
            f->exchange[k] = ~s;
            f->exchange[k + 1] = r;
            invert_pivot(f, D, 2, A[k*n + k], A[(k + 1)*n + k], A[(k + 1)*n + k + 1], tiny);
        }
        for (int i = k + width; i < n; ++i) {
            const double a = A[i*n + k], b = width == 2 ? A[i*n + k + 1] : 0;
            const double la = D[0]*a + D[1]*b, lb = D[1]*a + D[2]*b;
            for (int j = k + width; j < n; ++j)
                A[i*n + j] -= la*A[k*n + j] + (width == 2 ? lb*A[(k + 1)*n + j] : 0);
        }
        for (int i = k + width; i < n; ++i) {
            const double a = A[i*n + k], b = width == 2 ? A[i*n + k + 1] : 0;
            A[i*n + k] = D[0]*a + D[1]*b;
            if (width == 2)
                A[i*n + k + 1] = D[1]*a + D[2]*b;
        }
        A[k*n + k] = D[0];
        if (width == 2)
            A[(k + 1)*n + k] = D[1], A[(k + 1)*n + k + 1] = D[2];
        k += width;
    }
}

void dmoc_ldl_factor(dmoc_ldl *f, const double *values, double tiny)
{
    const int dense = f->n - f->chain;
    double S[3];
    f->positive = f->negative = f->zero = 0;
    memset(f->filled, 0, sizeof(int)*(size_t)f->pivots);
    for (int k = 0; k < f->pivots; ++k) {
        eliminate_row(f, values, k, S);
        invert_pivot(f, f->D + 3*k, row_width(f, k), S[0], S[1], S[2], tiny);
    }
    for (int i = 0; i < dense; ++i) {
        eliminate_row(f, values, f->pivots + i, S);
        for (int j = 0; j <= i; ++j) {
            double *y = f->work + 2*(f->chain + j);
            f->dense[i*dense + j] = f->dense[j*dense + i] = *y;
            *y = 0;
        }
    }
    factor_dense(f, tiny);
}

/* Exchange unknowns k and its partner. */
static void exchange(const dmoc_ldl *f, double *x, int k)
{
    const int other = f->exchange[k] < 0 ? ~f->exchange[k] : f->exchange[k];
    const double t = x[k];
    x[k] = x[other], x[other] = t;
}

static void solve_dense(const dmoc_ldl *f, double *x)
{
    const int n = f->n - f->chain;
    const double *A = f->dense;
    for (int k = 0; k < n; ++k)
        exchange(f, x, k);
    for (int k = 0; k < n;) {
        const int width = f->exchange[k] < 0 ? 2 : 1;
        for (int i = k + width; i < n; ++i)
            x[i] -= A[i*n + k]*x[k] + (width == 2 ? A[i*n + k + 1]*x[k + 1] : 0);
        const double a = x[k];
        x[k] *= A[k*n + k];
        if (width == 2) {
            x[k] += A[(k + 1)*n + k]*x[k + 1];
            x[k + 1] = A[(k + 1)*n + k]*a + A[(k + 1)*n + k + 1]*x[k + 1];
        }
        k += width;
    }
    for (int k = n - 1; k >= 0; --k) {
        /* The second unknown of a pivot of two has no entry beside it. */
        const int last = k > 0 && f->exchange[k - 1] < 0 ? 1 : 0;
        for (int i = k + (last || f->exchange[k] >= 0 ? 1 : 2); i < n; ++i)
            x[k] -= A[i*n + k]*x[i];
    }
    for (int k = n - 1; k >= 0; --k)
        exchange(f, x, k);
}

void dmoc_ldl_solve(const dmoc_ldl *f, double *x)
{
    for (int j = 0; j < f->pivots; ++j) {
        const int from = f->first[j], wide = f->first[j + 1] - from, end = f->column_start[j + 1];
        const double a = x[from], b = wide == 2 ? x[from + 1] : 0;
        for (int p = f->column_start[j]; p < end; ++p)
            x[f->column_row[p]] -= f->L[2*p]*a + f->L[2*p + 1]*b;
    }
    solve_dense(f, x + f->chain);
    for (int j = f->pivots - 1; j >= 0; --j) {
        const int from = f->first[j], wide = f->first[j + 1] - from, end = f->column_start[j + 1];
        const double *D = f->D + 3*j;
        double a = x[from], b = wide == 2 ? x[from + 1] : 0;
        const double u = D[0]*a + D[1]*b, v = D[1]*a + D[2]*b;
        a = u, b = v;
        for (int p = f->column_start[j]; p < end; ++p) {
            a -= f->L[2*p]*x[f->column_row[p]];
            b -= f->L[2*p + 1]*x[f->column_row[p]];
        }
        x[from] = a;
        if (wide == 2)
            x[from + 1] = b;
    }
}
