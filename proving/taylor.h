/* Values with their first, second and third derivatives, as intervals.
 *
 * A line is a function of one duration over an interval of it; a jet is a function of all of them,
 * whose second derivatives are stored by rows of the upper triangle, the third ones by those i <= j
 * <= k; one of no durations is a value alone.
 */
#ifndef DMOC_TAYLOR_H
#define DMOC_TAYLOR_H

#include "intervals.h"

#define MOST_PHASES 10
#define MOST_SECONDS (MOST_PHASES * (MOST_PHASES + 1) / 2)
#define MOST_THIRDS (MOST_SECONDS * (MOST_PHASES + 2) / 3)

static inline int interval_is_zero(interval a) { return a.lo == 0 && a.hi == 0; }
static inline double interval_mid(interval a) { return a.lo + (a.hi - a.lo) / 2; }
static inline double interval_mag(interval a)
{
    const double lo = fabs(a.lo), hi = fabs(a.hi);
    return lo > hi ? lo : hi;
}

/* The product; none of both is moved outward where the other is zero. */
static inline interval times(interval a, interval b)
{
    if (interval_is_zero(a) || interval_is_zero(b))
        return (interval){0, 0};
    return interval_mul(a, b);
}

static inline interval plus(interval a, interval b)
{
    if (interval_is_zero(a))
        return b;
    return interval_is_zero(b) ? a : interval_add(a, b);
}

static inline interval scaled(interval a, double s)
{
    return s == 1 ? a : times(a, interval_of(s));
}

/* a + b c */
static inline interval plus_times(interval a, interval b, interval c)
{
    return plus(a, times(b, c));
}

/* What two intervals that hold the same number have in common. */
static inline interval both(interval a, interval b)
{
    return (interval){a.lo > b.lo ? a.lo : b.lo, a.hi < b.hi ? a.hi : b.hi};
}

/* Functions of one duration ----------------------------------------------------------------- */

typedef struct {
    interval v0, d0, dd0;    /* at the centre */
    interval v, d, dd, ddd;  /* over the range */
} line;

static inline line line_of(double x)
{
    const interval none = {0, 0}, value = interval_of(x);
    return (line){value, none, none, value, none, none, none};
}

static inline line line_constant(interval x)
{
    const interval none = {0, 0};
    return (line){x, none, none, x, none, none, none};
}

static inline int line_is_constant(line a)
{
    return interval_is_zero(a.d) && interval_is_zero(a.dd) && interval_is_zero(a.ddd);
}

static inline int line_is_zero(line a) { return interval_is_zero(a.v) && line_is_constant(a); }

static inline line line_add(line a, line b)
{
    return (line){plus(a.v0, b.v0), plus(a.d0, b.d0), plus(a.dd0, b.dd0), plus(a.v, b.v),
                  plus(a.d, b.d),   plus(a.dd, b.dd), plus(a.ddd, b.ddd)};
}

static inline line line_scaled(line a, double s)
{
    return (line){scaled(a.v0, s), scaled(a.d0, s), scaled(a.dd0, s), scaled(a.v, s),
                  scaled(a.d, s),  scaled(a.dd, s), scaled(a.ddd, s)};
}

/* The second derivative of a product, from values and derivatives of its factors. */
static inline interval product_second(interval a, interval a1, interval a2, interval b, interval b1,
                                      interval b2)
{
    return plus(plus(times(a2, b), times(a, b2)), scaled(times(a1, b1), 2));
}

static inline line line_mul(line a, line b)
{
    if (line_is_zero(a) || line_is_zero(b))
        return line_of(0);
    const interval cross = plus(times(a.dd, b.d), times(a.d, b.dd));
    return (line){times(a.v0, b.v0),
                  plus(times(a.d0, b.v0), times(a.v0, b.d0)),
                  product_second(a.v0, a.d0, a.dd0, b.v0, b.d0, b.dd0),
                  times(a.v, b.v),
                  plus(times(a.d, b.v), times(a.v, b.d)),
                  product_second(a.v, a.d, a.dd, b.v, b.d, b.dd),
                  plus(plus(times(a.ddd, b.v), times(a.v, b.ddd)), scaled(cross, 3))};
}

static inline line line_add_mul(line a, line b, line c) { return line_add(a, line_mul(b, c)); }

/* 1/a for a that is not zero, with its derivatives -a1/a^2, 2 a1^2/a^3 - a2/a^2 and
 * 6 a1 a2/a^3 - 6 a1^3/a^4 - a3/a^2. */
static inline line line_inverse(line a)
{
    const interval one = {1, 1}, x = interval_div(one, a.v0), v = interval_div(one, a.v);
    const interval x2 = interval_sqr(x), v2 = interval_sqr(v), v3 = times(v2, v);
    const interval dd0 = plus(scaled(times(interval_sqr(a.d0), times(x2, x)), 2),
                              interval_neg(times(a.dd0, x2)));
    const interval dd = plus(scaled(times(interval_sqr(a.d), v3), 2), interval_neg(times(a.dd, v2)));
    const interval cube = scaled(times(times(interval_sqr(a.d), a.d), interval_sqr(v2)), -6);
    const interval ddd = plus(plus(scaled(times(times(a.d, a.dd), v3), 6), cube),
                              interval_neg(times(a.ddd, v2)));
    return (line){x, interval_neg(times(a.d0, x2)), dd0, v, interval_neg(times(a.d, v2)), dd, ddd};
}

/* Values and derivatives from those at the centre, which cancel where long sums do: at distances
 * ``away`` from it. */
static inline line line_centred(line a, interval away)
{
    if (line_is_constant(a))
        return a;
    const interval square = scaled(interval_sqr(away), 0.5);
    const interval cube = interval_div(times(square, away), (interval){3, 3});
    a.dd = both(a.dd, plus(a.dd0, times(a.ddd, away)));
    a.d = both(a.d, plus(plus(a.d0, times(a.dd0, away)), times(a.ddd, square)));
    a.v = both(a.v, plus(plus(a.v0, times(a.d0, away)),
                         plus(times(a.dd0, square), times(a.ddd, cube))));
    return a;
}

/* Functions of all durations ---------------------------------------------------------------- */

typedef struct {
    interval v0, g0[MOST_PHASES], H0[MOST_SECONDS]; /* at the centre */
    interval v, g[MOST_PHASES], H[MOST_SECONDS], T[MOST_THIRDS]; /* over the box */
} jet;

/* Place of the second derivative by two of n durations. */
static inline int second_at(int n, int i, int j)
{
    return i <= j ? i * n - i * (i - 1) / 2 + j - i : j * n - j * (j - 1) / 2 + i - j;
}

static inline void jet_zero(int n, jet *a)
{
    const interval none = {0, 0};
    a->v = a->v0 = none;
    for (int i = 0; i < n; i++)
        a->g[i] = a->g0[i] = none;
    for (int i = 0; i < n * (n + 1) / 2; i++)
        a->H[i] = a->H0[i] = none;
    for (int i = 0; i < n * (n + 1) * (n + 2) / 6; i++)
        a->T[i] = none;
}

/* a += s b */
static inline void jet_add_scaled(int n, jet *a, double s, const jet *b)
{
    if (s == 0)
        return;
    a->v0 = plus(a->v0, scaled(b->v0, s));
    a->v = plus(a->v, scaled(b->v, s));
    for (int i = 0; i < n; i++) {
        a->g0[i] = plus(a->g0[i], scaled(b->g0[i], s));
        a->g[i] = plus(a->g[i], scaled(b->g[i], s));
    }
    for (int i = 0; i < n * (n + 1) / 2; i++) {
        a->H0[i] = plus(a->H0[i], scaled(b->H0[i], s));
        a->H[i] = plus(a->H[i], scaled(b->H[i], s));
    }
    for (int i = 0; i < n * (n + 1) * (n + 2) / 6; i++)
        a->T[i] = plus(a->T[i], scaled(b->T[i], s));
}

/* a += b c */
static inline void jet_add_mul(int n, jet *a, const jet *b, const jet *c)
{
    a->v0 = plus_times(a->v0, b->v0, c->v0);
    a->v = plus_times(a->v, b->v, c->v);
    for (int i = 0; i < n; i++) {
        a->g0[i] = plus(a->g0[i], plus(times(b->g0[i], c->v0), times(b->v0, c->g0[i])));
        a->g[i] = plus(a->g[i], plus(times(b->g[i], c->v), times(b->v, c->g[i])));
    }
    for (int i = 0, at = 0, third = 0; i < n; i++)
        for (int j = i; j < n; j++, at++) {
            const interval bent0 = plus(times(b->H0[at], c->v0), times(b->v0, c->H0[at]));
            const interval cross0 = plus(times(b->g0[i], c->g0[j]), times(b->g0[j], c->g0[i]));
            a->H0[at] = plus(a->H0[at], plus(bent0, cross0));
            const interval bent = plus(times(b->H[at], c->v), times(b->v, c->H[at]));
            const interval cross = plus(times(b->g[i], c->g[j]), times(b->g[j], c->g[i]));
            a->H[at] = plus(a->H[at], plus(bent, cross));
            for (int k = j; k < n; k++, third++) {
                const int ik = second_at(n, i, k), jk = second_at(n, j, k);
                interval sum = plus(times(b->T[third], c->v), times(b->v, c->T[third]));
                sum = plus(sum, plus(times(b->g[i], c->H[jk]), times(b->H[jk], c->g[i])));
                sum = plus(sum, plus(times(b->g[j], c->H[ik]), times(b->H[ik], c->g[j])));
                sum = plus(sum, plus(times(b->g[k], c->H[at]), times(b->H[at], c->g[k])));
                a->T[third] = plus(a->T[third], sum);
            }
        }
}

/* a += f b, where f is a function of duration k alone. */
static inline void jet_add_line(int n, int k, jet *a, line f, const jet *b)
{
    if (line_is_zero(f))
        return;
    a->v0 = plus_times(a->v0, f.v0, b->v0);
    a->v = plus_times(a->v, f.v, b->v);
    for (int i = 0, at = 0, third = 0; i < n; i++) {
        a->g0[i] = plus_times(a->g0[i], f.v0, b->g0[i]);
        a->g[i] = plus_times(a->g[i], f.v, b->g[i]);
        if (i == k) {
            a->g0[i] = plus_times(a->g0[i], f.d0, b->v0);
            a->g[i] = plus_times(a->g[i], f.d, b->v);
        }
        for (int j = i; j < n; j++, at++) {
            const int by_i = i == k, by_j = j == k;
            a->H0[at] = plus_times(a->H0[at], f.v0, b->H0[at]);
            a->H[at] = plus_times(a->H[at], f.v, b->H[at]);
            if (by_i) {
                a->H0[at] = plus_times(a->H0[at], f.d0, b->g0[j]);
                a->H[at] = plus_times(a->H[at], f.d, b->g[j]);
            }
            if (by_j) {
                a->H0[at] = plus_times(a->H0[at], f.d0, b->g0[i]);
                a->H[at] = plus_times(a->H[at], f.d, b->g[i]);
            }
            if (by_i && by_j) {
                a->H0[at] = plus_times(a->H0[at], f.dd0, b->v0);
                a->H[at] = plus_times(a->H[at], f.dd, b->v);
            }
            for (int l = j; l < n; l++, third++) {
                const int by_l = l == k;
                interval sum = times(f.v, b->T[third]);
                if (by_i)
                    sum = plus_times(sum, f.d, b->H[second_at(n, j, l)]);
                if (by_j)
                    sum = plus_times(sum, f.d, b->H[second_at(n, i, l)]);
                if (by_l)
                    sum = plus_times(sum, f.d, b->H[at]);
                if (by_i && by_j)
                    sum = plus_times(sum, f.dd, b->g[l]);
                if (by_i && by_l)
                    sum = plus_times(sum, f.dd, b->g[j]);
                if (by_j && by_l)
                    sum = plus_times(sum, f.dd, b->g[i]);
                if (by_i && by_j && by_l)
                    sum = plus_times(sum, f.ddd, b->v);
                a->T[third] = plus(a->T[third], sum);
            }
        }
    }
}

/* Values and derivatives from those at the centre, as of a line. */
static inline void jet_centred(int n, jet *a, const interval *away)
{
    if (!n)
        return;
    const interval none = {0, 0};
    interval bent[MOST_SECONDS]; /* sums over k of T_ijk away_k */
    for (int i = 0; i < n * (n + 1) / 2; i++)
        bent[i] = none;
    for (int i = 0, third = 0; i < n; i++)
        for (int j = i; j < n; j++)
            for (int k = j; k < n; k++, third++) {
                const interval T = a->T[third];
                const int ij = second_at(n, i, j), ik = second_at(n, i, k), jk = second_at(n, j, k);
                bent[ij] = plus_times(bent[ij], T, away[k]);
                if (k != j)
                    bent[ik] = plus_times(bent[ik], T, away[j]);
                if (j != i)
                    bent[jk] = plus_times(bent[jk], T, away[i]);
            }
    interval v = a->v0, second = none, third = none;
    for (int i = 0; i < n; i++) {
        interval slope = none, turn = none;
        for (int j = 0; j < n; j++) {
            const int at = second_at(n, i, j);
            slope = plus_times(slope, a->H0[at], away[j]);
            turn = plus_times(turn, bent[at], away[j]);
        }
        a->g[i] = both(a->g[i], plus(a->g0[i], plus(slope, scaled(turn, 0.5))));
        v = plus_times(v, a->g0[i], away[i]);
        second = plus_times(second, slope, away[i]);
        third = plus_times(third, turn, away[i]);
    }
    for (int i = 0; i < n * (n + 1) / 2; i++)
        a->H[i] = both(a->H[i], plus(a->H0[i], bent[i]));
    third = interval_div(third, interval_of(6));
    a->v = both(a->v, plus(v, plus(scaled(second, 0.5), third)));
}

#endif
