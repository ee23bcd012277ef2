/* Functions of intervals beside those of intervals.h, each with its first three derivatives.
 *
 * Functions of the C library are not rounded correctly. Those of today's libraries miss the exact
 * value by one unit in the last place or two; here it is taken to be four at most, as in balls.py,
 * relative to the result, or absolute for sine and cosine, whose arguments are reduced.
 */
#ifndef DMOC_INTERVAL_FUNCTIONS_H
#define DMOC_INTERVAL_FUNCTIONS_H

#include "taylor.h"

#define OF_LIBRARY 0x1p-49
/* Sine and cosine of larger numbers are anything from -1 to 1. */
#define FAR 1e6
/* How near an interval comes to where a wave has its ends, in half periods, that counts as having one
 * in it: more than rounding takes away below FAR. */
#define NEAR_END 1e-9
/* How far outward a zero may have been moved; a power has no values below zero. */
#define MOVED_OUTWARD 1e-300

/* Bounds as the library computed them, moved outward. */
static inline interval interval_of_library(double lo, double hi)
{
    return interval_outward(lo - fabs(lo) * OF_LIBRARY, hi + fabs(hi) * OF_LIBRARY);
}

static inline interval interval_exp(interval a)
{
    const interval e = interval_of_library(exp(a.lo), exp(a.hi));
    return e.lo < 0 && e.hi < INFINITY ? (interval){0, e.hi} : e;
}

static inline interval interval_log(interval a) { return interval_of_library(log(a.lo), log(a.hi)); }

/* a^p for a >= 0: it grows with a where p > 0 and falls where p < 0, and is between its values at the
 * ends of p. */
static inline interval interval_pow(interval a, interval p)
{
    if (a.lo < 0 && a.lo > -MOVED_OUTWARD)
        a.lo = 0;
    if (!(a.lo >= 0))
        return (interval){-INFINITY, INFINITY};
    const double at[] = {pow(a.lo, p.lo), pow(a.lo, p.hi), pow(a.hi, p.lo), pow(a.hi, p.hi)};
    const double least = fmin(fmin(at[0], at[1]), fmin(at[2], at[3]));
    const double most = fmax(fmax(at[0], at[1]), fmax(at[2], at[3]));
    if (!(most < INFINITY))
        return (interval){-INFINITY, INFINITY};
    const interval power = interval_of_library(least, most);
    return power.lo < 0 ? (interval){0, power.hi} : power;
}

static inline interval interval_atan(interval a) { return interval_of_library(atan(a.lo), atan(a.hi)); }

/* Whether k + place, in half periods of pi, lies between two numbers for some k that is even, or
 * odd. */
static inline int has_end(interval a, double place, int odd)
{
    const double pi = 3.14159265358979323846, shift = place + odd;
    const double from = (a.lo / pi - shift) / 2, to = (a.hi / pi - shift) / 2;
    return ceil(from - NEAR_END) <= floor(to + NEAR_END);
}

/* A wave that is 1 where its argument is ``place`` half periods, -1 a half period later; its values at
 * both ends are given. */
static inline interval interval_wave(interval a, double place, double at_lo, double at_hi)
{
    if (!(a.lo > -FAR && a.hi < FAR))
        return (interval){-1, 1};
    const double least = fmin(at_lo, at_hi) - OF_LIBRARY, most = fmax(at_lo, at_hi) + OF_LIBRARY;
    return (interval){has_end(a, place, 1) || least < -1 ? -1 : least,
                      has_end(a, place, 0) || most > 1 ? 1 : most};
}

static inline interval interval_sin(interval a) { return interval_wave(a, 0.5, sin(a.lo), sin(a.hi)); }
static inline interval interval_cos(interval a) { return interval_wave(a, 0, cos(a.lo), cos(a.hi)); }

/* Derivatives of a function from order 0 to 3 over an interval. */
typedef struct {
    interval order[4];
} derivatives;

static inline derivatives of_sin(interval a)
{
    const interval s = interval_sin(a), c = interval_cos(a);
    return (derivatives){{s, c, interval_neg(s), interval_neg(c)}};
}

static inline derivatives of_cos(interval a)
{
    const interval s = interval_sin(a), c = interval_cos(a);
    return (derivatives){{c, interval_neg(s), interval_neg(c), s}};
}

static inline derivatives of_exp(interval a)
{
    const interval e = interval_exp(a);
    return (derivatives){{e, e, e, e}};
}

/* log a, 1/a, -1/a^2, 2/a^3 */
static inline derivatives of_log(interval a)
{
    const interval one = {1, 1}, x = interval_div(one, a), x2 = interval_sqr(x);
    return (derivatives){{interval_log(a), x, interval_neg(x2), scaled(times(x2, x), 2)}};
}

/* root r of a, 1/(2 r), -1/(4 r^3), 3/(8 r^5) */
static inline derivatives of_sqrt(interval a)
{
    const interval r = interval_sqrt(a), x = interval_div((interval){1, 1}, r), x2 = interval_sqr(x);
    const interval x3 = times(x2, x);
    return (derivatives){{r, scaled(x, 0.5), scaled(x3, -0.25), scaled(times(x3, x2), 0.375)}};
}

/* a^p with a constant p, p a^(p - 1), p (p - 1) a^(p - 2), p (p - 1) (p - 2) a^(p - 3) */
static inline derivatives of_power(interval a, interval p)
{
    derivatives made = {{interval_pow(a, p)}};
    interval factor = {1, 1};
    for (int d = 1; d < 4; d++) {
        factor = times(factor, p);
        p = interval_sub(p, (interval){1, 1});
        made.order[d] = times(factor, interval_pow(a, p));
    }
    return made;
}

/* atan a and, with y = 1/(1 + a^2), y, -2 a y^2, (6 a^2 - 2) y^3 */
static inline derivatives of_atan(interval a)
{
    const interval one = {1, 1}, a2 = interval_sqr(a), y = interval_div(one, interval_add(one, a2));
    const interval y2 = interval_sqr(y), cubic = interval_sub(scaled(a2, 6), (interval){2, 2});
    return (derivatives){{interval_atan(a), y, scaled(times(a, y2), -2), times(cubic, times(y2, y))}};
}

/* A function of a line: its derivatives at the centre and over the range are given. */
static inline line line_function(line a, derivatives at, derivatives over)
{
    const interval *f0 = at.order, *f = over.order, d2 = interval_sqr(a.d);
    const interval dd0 = plus(times(f0[2], interval_sqr(a.d0)), times(f0[1], a.dd0));
    const interval dd = plus(times(f[2], d2), times(f[1], a.dd));
    const interval cross = scaled(times(f[2], times(a.d, a.dd)), 3);
    const interval ddd = plus(plus(times(f[3], times(d2, a.d)), cross), times(f[1], a.ddd));
    return (line){f0[0], times(f0[1], a.d0), dd0, f[0], times(f[1], a.d), dd, ddd};
}

/* a^2, which is never negative */
static inline line line_sqr(line a)
{
    line square = line_mul(a, a);
    square.v0 = interval_sqr(a.v0), square.v = interval_sqr(a.v);
    return square;
}

#endif
