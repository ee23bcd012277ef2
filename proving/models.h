/* Functions of all durations over a box: polynomials of the third degree with a remainder.
 *
 * Durations are their distances from the centre in units of what these are at most, numbers x from
 * -1 to 1.  A model of a function says that it differs from a polynomial by ``rest`` at most,
 * wherever it is in the box.  Coefficients are plain numbers: what rounding takes from them is a
 * part of the rest, as are terms of higher degrees.  A function that is no number anywhere has a
 * rest that is infinite or none.
 */
#ifndef DMOC_MODELS_H
#define DMOC_MODELS_H

#include <string.h>

#include "linear_program.h"

#define MOST_SECONDS (MOST_PHASES * (MOST_PHASES + 1) / 2)
#define MOST_TERMS ((MOST_PHASES + 1) * (MOST_PHASES + 2) * (MOST_PHASES + 3) / 6)

/* The terms of polynomials in n durations: those of the degree d from number first[d] on. */
typedef struct {
    int n, terms, first[DEGREE + 2];
    double most[MOST_PHASES];   /* distances from the centre at most */
    /* number of a term of degree 0, 1 or 2 times x_i */
    unsigned short by[MOST_PHASES][1 + MOST_PHASES + MOST_SECONDS];
} Frame;

typedef struct {
    double c[MOST_TERMS];
    double rest;
    double size[DEGREE + 1];    /* sums of |coefficients| of each degree, at most */
} model;

static inline void frame_begin(int n, Frame *f)
{
    int at = 0, number[MOST_PHASES][MOST_PHASES];
    f->n = n;
    f->first[0] = 0, f->first[1] = 1, f->first[2] = 1 + n, f->first[3] = 1 + n + n * (n + 1) / 2;
    for (int i = 0; i < n; i++)
        for (int j = i; j < n; j++)
            number[i][j] = number[j][i] = f->first[2] + at++;
    for (int i = 0; i < n; i++) {
        f->by[i][0] = (unsigned short)(1 + i);
        for (int j = 0; j < n; j++)
            f->by[i][1 + j] = (unsigned short)number[i][j];
    }
    at = f->first[3];
    for (int i = 0; i < n; i++)
        for (int j = i; j < n; j++)
            for (int k = j; k < n; k++, at++) {
                f->by[i][number[j][k]] = (unsigned short)at;
                f->by[j][number[i][k]] = (unsigned short)at;
                f->by[k][number[i][j]] = (unsigned short)at;
            }
    f->first[4] = f->terms = at;
}

static inline double model_size(const model *a)
{
    return a->size[0] + a->size[1] + a->size[2] + a->size[3];
}

static inline void model_zero(const Frame *f, model *a)
{
    memset(a->c, 0, sizeof(double) * (size_t)f->terms);
    memset(a->size, 0, sizeof a->size);
    a->rest = 0;
}

static inline void model_constant(const Frame *f, interval x, model *a)
{
    model_zero(f, a);
    a->c[0] = interval_mid(x);
    a->size[0] = fabs(a->c[0]);
    a->rest = upward(fmax(x.hi - a->c[0], a->c[0] - x.lo));
}

/* Sums of coefficients as they are, which may be less than those of their parts. */
static inline void model_settle(const Frame *f, model *a)
{
    for (int d = 0; d <= DEGREE; d++) {
        double sum = 0;
        for (int k = f->first[d]; k < f->first[d + 1]; k++)
            sum += fabs(a->c[k]);
        a->size[d] = upward(sum);
    }
}

/* What rounding takes when something of a size is added. */
static inline void model_round(double size, model *a)
{
    a->rest = upward(a->rest + ROUNDING * (model_size(a) + size));
}

/* a += s b */
static inline void model_add_scaled(const Frame *f, double s, const model *b, model *a)
{
    const double share = fabs(s);
    if (s == 0)
        return;
    for (int k = 0; k < f->terms; k++)
        a->c[k] += s * b->c[k];
    a->rest += share * b->rest;
    model_round(share * model_size(b), a);
    for (int d = 0; d <= DEGREE; d++)
        a->size[d] = upward(a->size[d] + share * b->size[d]);
}

/* a += s b c */
static inline void model_add_mul(const Frame *f, double s, const model *b, const model *c, model *a)
{
    const int n = f->n, second = f->first[2], third = f->first[3];
    const double *B = b->size, *C = c->size, share = fabs(s);
    const double b_0 = s * b->c[0], c_0 = s * c->c[0];
    double *to = a->c;
    to[0] += b_0 * c->c[0];
    for (int k = 1; k < f->terms; k++)
        to[k] += b_0 * c->c[k] + b->c[k] * c_0;
    for (int i = 0; i < n; i++) {
        const unsigned short *by = f->by[i];
        const double b_i = s * b->c[1 + i], c_i = s * c->c[1 + i];
        for (int k = 1; k < second; k++)
            to[by[k]] += b_i * c->c[k];
        for (int k = second; k < third; k++)
            to[by[k]] += b_i * c->c[k] + c_i * b->c[k];
    }
    const double beyond = B[1] * C[3] + B[2] * (C[2] + C[3]) + B[3] * (C[1] + C[2] + C[3]);
    const double size = model_size(b) * model_size(c);
    a->rest += share * (beyond + model_size(b) * c->rest + b->rest * (model_size(c) + c->rest));
    a->rest += DBL_MIN * (model_size(b) + model_size(c)); /* what underflows before it is multiplied */
    model_round(share * size, a);
    a->size[0] = upward(a->size[0] + share * B[0] * C[0]);
    a->size[1] = upward(a->size[1] + share * (B[0] * C[1] + B[1] * C[0]));
    a->size[2] = upward(a->size[2] + share * (B[0] * C[2] + B[1] * C[1] + B[2] * C[0]));
    a->size[3] = upward(a->size[3] + share * (B[0] * C[3] + B[1] * C[2] + B[2] * C[1] + B[3] * C[0]));
}

/* a += s g b, where g is a function of duration i alone. */
static inline void model_add_curve(const Frame *f, double s, int i, const curve *g, const model *b,
                                   model *a)
{
    const unsigned short *by = f->by[i];
    const int third = f->n ? f->first[3] : 0, second = f->n ? f->first[2] : 0;
    const double c[] = {s * g->c[0], s * g->c[1], s * g->c[2], s * g->c[3]};
    const double G[] = {fabs(c[0]), fabs(c[1]), fabs(c[2]), fabs(c[3])}, *B = b->size;
    const double whole = G[0] + G[1] + G[2] + G[3], share = fabs(s) * g->rest;
    double *to = a->c;
    a->rest += DBL_MIN * model_size(b); /* what underflows before it is multiplied */
    if (whole == 0 && share == 0)
        return;
    for (int k = 0; k < f->terms; k++)
        to[k] += c[0] * b->c[k];
    for (int k = 0; k < third && c[1] != 0; k++)
        to[by[k]] += c[1] * b->c[k];
    for (int k = 0; k < second && c[2] != 0; k++)
        to[by[by[k]]] += c[2] * b->c[k];
    if (second)
        to[by[by[by[0]]]] += c[3] * b->c[0];
    const double size = model_size(b);
    const double beyond = G[1] * B[3] + G[2] * (B[2] + B[3]) + G[3] * (B[1] + B[2] + B[3]);
    a->rest += beyond + whole * b->rest + share * (size + b->rest);
    model_round(whole * size, a);
    a->size[0] = upward(a->size[0] + G[0] * B[0]);
    a->size[1] = upward(a->size[1] + G[0] * B[1] + G[1] * B[0]);
    a->size[2] = upward(a->size[2] + G[0] * B[2] + G[1] * B[1] + G[2] * B[0]);
    a->size[3] = upward(a->size[3] + G[0] * B[3] + G[1] * B[2] + G[2] * B[1] + G[3] * B[0]);
}

/* A function of duration i alone as one of all. */
static inline void model_of_curve(const Frame *f, int i, const curve *g, model *a)
{
    const unsigned short *by = f->by[i];
    model_zero(f, a);
    a->c[0] = g->c[0];
    if (f->n)
        a->c[by[0]] = g->c[1], a->c[by[by[0]]] = g->c[2], a->c[by[by[by[0]]]] = g->c[3];
    for (int d = 0; d <= DEGREE; d++)
        a->size[d] = fabs(g->c[d]);
    a->rest = g->rest;
}

/* All that a function may be. */
static inline interval model_range(const model *a)
{
    const double far = upward(a->size[1] + a->size[2] + a->size[3] + a->rest);
    if (!(far < INFINITY))
        return (interval){-INFINITY, INFINITY};
    return interval_outward(a->c[0] - far, a->c[0] + far);
}

#endif
