/* The numbers: factorisation block by block, and solution. */
#include "ldl_dense.h"

#include <string.h>

/* Panels are worked on four entries at a time. Where the system can choose between versions of a
 * function when a program is loaded, there is one for processors with longer vectors; both round
 * alike. */
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__gnu_linux__) && \
    !defined(__SANITIZE_ADDRESS__)
#define VERSIONS __attribute__((target_clones("avx2", "default")))
#define INLINE inline __attribute__((always_inline))
#else
#define VERSIONS
#define INLINE inline
#endif

enum { FOUR = 4 };
typedef double four __attribute__((vector_size(FOUR*sizeof(double)), aligned(sizeof(double))));

/* Column c of a panel less what the columns before `done` contribute, from the row `begin` on:
 * into y. */
static INLINE void finish_column(const double *A, const double *Y, int height, int c, int done,
                                 int begin, double *y)
{
    for (int i = begin; i < height; i += FOUR) {
        four sum = *(const four *)(A + c*height + i);
        for (int e = 0; e < done; ++e)
            sum -= *(const four *)(A + e*height + i)*Y[e*height + c];
        *(four *)(y + i) = sum;
    }
}

/* Pivots of a block: columns of L into its panel, these times D into Y. Above its pivots a column
 * of L is zero. */
static INLINE void factor_panel(dmoc_ldl *f, int b, double *A, double *Y, double tiny)
{
    const int from = f->first[f->block[b]], height = f->height[b];
    for (int p = f->block[b]; p < f->block[b + 1]; ++p) {
        const int c = f->first[p] - from, width = f->first[p + 1] - f->first[p];
        const int begin = c/FOUR*FOUR;
        double *a = A + c*height, *y = Y + c*height, *D = f->D + 3*p;
        if (width == 1) {
            finish_column(A, Y, height, c, c, begin, y);
            ldl_invert_pivot(f, D, 1, y[c], 0, 0, tiny);
            for (int i = begin; i < height; i += FOUR)
                *(four *)(a + i) = *(four *)(y + i)*D[0];
        } else {
            double *z = y + height, *d = a + height;
            finish_column(A, Y, height, c, c, begin, y);
            finish_column(A, Y, height, c + 1, c, begin, z);
            ldl_invert_pivot(f, D, 2, y[c], y[c + 1], z[c + 1], tiny);
            for (int i = begin; i < height; i += FOUR) {
                const four u = *(four *)(y + i), v = *(four *)(z + i);
                *(four *)(a + i) = D[0]*u + D[1]*v;
                *(four *)(d + i) = D[1]*u + D[2]*v;
            }
            d[c] = a[c + 1] = d[c + 1] = 0;
            for (int i = begin; i < c; ++i)
                d[i] = 0;
        }
        for (int i = begin; i <= c; ++i)
            a[i] = 0;
    }
}

/* U = L Y' of four rows and four columns, by columns of u. */
static INLINE void multiply_tile(const double *L, const double *Y, int width, int height,
                                 double *u, int apart)
{
    four a = {0}, b = {0}, c = {0}, d = {0};
    for (int e = 0; e < width; ++e, L += height, Y += height) {
        const four l = *(const four *)L;
        a += l*Y[0];
        b += l*Y[1];
        c += l*Y[2];
        d += l*Y[3];
    }
    *(four *)u = a;
    *(four *)(u + apart) = b;
    *(four *)(u + 2*apart) = c;
    *(four *)(u + 3*apart) = d;
}

/* Subtract L Y' of the rows of a block from the panels of those that its rows belong to. */
static INLINE void subtract_block(dmoc_ldl *f, int b, const double *A, const double *Y)
{
    const int width = f->first[f->block[b + 1]] - f->first[f->block[b]], height = f->height[b];
    const int rows = f->row_start[b + 1] - f->row_start[b], apart = height + FOUR;
    const dmoc_part *part = f->part + f->part_start[b], *end = f->part + f->part_start[b + 1];
    double *U = f->product;
    for (int j = 0; j < rows; ++j) {
        if (j % FOUR == 0)
            for (int i = j; i < rows; i += FOUR)
                multiply_tile(A + width + i, Y + width + j, width, height, U + i, apart);
        if (part + 1 < end && part[1].from == j)
            ++part;
        const int *target = f->target + part->at - part->from;
        const double *u = U + j % FOUR*apart;
        double *to = f->panel + f->panel_start[part->owner] + target[j]*f->height[part->owner];
        for (int i = j; i < rows; ++i)
            to[target[i]] -= u[i];
    }
}

/* The same for a block of one unknown with few rows. */
static INLINE void factor_single(dmoc_ldl *f, int b, double *a, double tiny)
{
    const int rows = f->row_start[b + 1] - f->row_start[b], p = f->block[b];
    const dmoc_part *part = f->part + f->part_start[b], *end = f->part + f->part_start[b + 1];
    double *D = f->D + 3*p, y[FOUR];
    ldl_invert_pivot(f, D, 1, a[0], 0, 0, tiny);
    a[0] = 0;
    for (int i = 0; i < rows; ++i) {
        y[i] = a[1 + i];
        a[1 + i] *= D[0];
    }
    for (int j = 0; j < rows; ++j) {
        if (part + 1 < end && part[1].from == j)
            ++part;
        const int *target = f->target + part->at - part->from;
        double *to = f->panel + f->panel_start[part->owner] + target[j]*f->height[part->owner];
        for (int i = j; i < rows; ++i)
            to[target[i]] -= a[1 + i]*y[j];
    }
}

static int is_single(const dmoc_ldl *f, int b)
{
    const int p = f->block[b];
    return f->first[f->block[b + 1]] - f->first[p] == 1 &&
           f->row_start[b + 1] - f->row_start[b] < FOUR;
}

VERSIONS void dmoc_ldl_factor(dmoc_ldl *f, const double *values, double tiny)
{
    const int dense = f->n - f->chain;
    f->positive = f->negative = f->zero = 0;
    memset(f->panel, 0, sizeof(double)*(size_t)f->panel_start[f->blocks + 1]);
    for (int e = 0; e < f->entries; ++e)
        f->panel[f->place[e]] = values[e];
    for (int b = 0; b < f->blocks; ++b) {
        double *A = f->panel + f->panel_start[b];
        if (is_single(f, b)) {
            factor_single(f, b, A, tiny);
        } else {
            factor_panel(f, b, A, f->work, tiny);
            subtract_block(f, b, A, f->work);
        }
    }
    double *A = f->panel + f->panel_start[f->blocks];
    for (int j = 0; j < dense; ++j)
        for (int i = j + 1; i < dense; ++i)
            A[i*dense + j] = A[j*dense + i];
    ldl_factor_dense(f, A, dense, tiny);
}

/* x := L^-1 x of one block and its rows. */
static INLINE void solve_forward(const dmoc_ldl *f, int b, double *x)
{
    const int from = f->first[f->block[b]], width = f->first[f->block[b + 1]] - from;
    const int height = f->height[b], rows = f->row_start[b + 1] - f->row_start[b];
    const double *A = f->panel + f->panel_start[b];
    const int *row = f->row + f->row_start[b];
    double *own = x + from;
    if (width == 1 && rows < FOUR) {
        for (int i = 0; i < rows; ++i)
            x[row[i]] -= A[1 + i]*own[0];
        return;
    }
    for (int c = 0; c < width; ++c)
        for (int i = c + 1; i < width; ++i)
            own[i] -= A[c*height + i]*own[c];
    for (int i = 0; i < rows; i += FOUR) {
        four sum = {0};
        for (int c = 0; c < width; ++c)
            sum += *(const four *)(A + c*height + width + i)*own[c];
        const int count = rows - i < FOUR ? rows - i : FOUR;
        for (int k = 0; k < count; ++k)
            x[row[i + k]] -= sum[k];
    }
}

/* x := L'^-1 D^-1 x of one block. */
static INLINE void solve_backward(const dmoc_ldl *f, int b, double *x)
{
    const int from = f->first[f->block[b]], width = f->first[f->block[b + 1]] - from;
    const int height = f->height[b], rows = f->row_start[b + 1] - f->row_start[b];
    const double *A = f->panel + f->panel_start[b];
    const int *row = f->row + f->row_start[b];
    double *own = x + from, *known = f->work;
    if (width == 1 && rows < FOUR) {
        own[0] *= f->D[3*f->block[b]];
        for (int i = 0; i < rows; ++i)
            own[0] -= A[1 + i]*x[row[i]];
        return;
    }
    for (int p = f->block[b]; p < f->block[b + 1]; ++p) {
        const double *D = f->D + 3*p;
        double *at = x + f->first[p];
        if (f->first[p + 1] - f->first[p] == 1) {
            at[0] *= D[0];
        } else {
            const double u = at[0], v = at[1];
            at[0] = D[0]*u + D[1]*v;
            at[1] = D[1]*u + D[2]*v;
        }
    }
    for (int i = 0; i < rows; ++i)
        known[i] = x[row[i]];
    for (int i = rows; i % FOUR; ++i)
        known[i] = 0;
    for (int c = width - 1; c >= 0; --c) {
        four sum = {0};
        for (int i = 0; i < rows; i += FOUR)
            sum += *(const four *)(A + c*height + width + i)**(const four *)(known + i);
        double total = (sum[0] + sum[1]) + (sum[2] + sum[3]);
        for (int i = c + 1; i < width; ++i)
            total += A[c*height + i]*own[i];
        own[c] -= total;
    }
}

VERSIONS void dmoc_ldl_solve(const dmoc_ldl *f, double *x)
{
    for (int b = 0; b < f->blocks; ++b)
        solve_forward(f, b, x);
    ldl_solve_dense(f->panel + f->panel_start[f->blocks], f->exchange, f->n - f->chain,
                    x + f->chain);
    for (int b = f->blocks - 1; b >= 0; --b)
        solve_backward(f, b, x);
}
