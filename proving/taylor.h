/* Functions of one duration over an interval of it: values with their first, second and third
 * derivatives, as intervals. */
#ifndef DMOC_TAYLOR_H
#define DMOC_TAYLOR_H

#include "intervals.h"

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

/* The same function as a polynomial that differs from it by a rest at most, of distances from the
 * centre in units of what these are at most, from -1 to 1. */
#define DEGREE 3
typedef struct {
    double c[DEGREE + 1], rest;
} curve;

/* What polynomials lose to rounding: a coefficient of a product has at most 16 roundings of half an
 * epsilon; sums of numbers that are not negative have fewer than 512. */
#define ROUNDING (16 * DBL_EPSILON)
static inline double upward(double x) { return x * (1 + 512 * DBL_EPSILON) + DBL_MIN; }

static inline double interval_radius(interval a, double mid) { return fmax(a.hi - mid, mid - a.lo); }

/* All values of a line. */
static inline curve curve_over(line a)
{
    const double mid = interval_mid(a.v);
    return (curve){{mid, 0, 0, 0}, upward(interval_radius(a.v, mid))};
}

/* A line at distances of at most ``most``: its derivatives at the centre up to the order that leaves
 * the least rest, and the next one over the range. */
static inline curve curve_of(line a, double most)
{
    const interval at[DEGREE] = {a.v0, a.d0, a.dd0}, over[DEGREE + 1] = {a.v, a.d, a.dd, a.ddd};
    const double power[DEGREE + 1] = {1, most, most * most / 2, most * most * most / 6};
    curve made = {{0}, INFINITY};
    double certain = 0, size = 0;
    for (int d = 0, last = 0; d <= DEGREE; d++) {
        const double mid = interval_mid(over[d]);
        const double rest = certain + interval_radius(over[d], mid) * power[d];
        if (rest < made.rest) {
            for (; last < d; last++)
                made.c[last] = interval_mid(at[last]) * power[last];
            made.c[d] = mid * power[d];
            made.rest = rest;
        }
        if (d < DEGREE)
            certain += interval_radius(at[d], interval_mid(at[d])) * power[d];
    }
    for (int d = 0; d <= DEGREE; d++)
        size += fabs(made.c[d]);
    made.rest = upward(made.rest + ROUNDING * size);
    return made;
}

#endif
