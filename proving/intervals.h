/* Interval arithmetic with outward rounding.
 *
 * An operation on intervals contains what it makes of any numbers in them.  Each bound is moved
 * outward by |x| 2^-52 + 2^-1022, which is at least a unit in its last place: that is more than
 * rounding takes away, in whichever direction the processor rounds.  Compile with
 * -ffp-contract=off and without -ffast-math.  Where a bound would be no number (overflow, division
 * by an interval with 0, the root of a negative number), the result is the whole line.
 */
#ifndef DMOC_INTERVALS_H
#define DMOC_INTERVALS_H

#include <float.h>
#include <math.h>

typedef struct {
    double lo, hi;
} interval;

static inline interval interval_of(double x) { return (interval){x, x}; }

static inline double interval_slack(double x) { return fabs(x) * DBL_EPSILON + DBL_MIN; }

/* Bounds as they were computed, moved outward. */
static inline interval interval_outward(double lo, double hi)
{
    lo -= interval_slack(lo);
    hi += interval_slack(hi);
    return lo <= hi ? (interval){lo, hi} : (interval){-INFINITY, INFINITY};
}

static inline interval interval_neg(interval a) { return (interval){-a.hi, -a.lo}; }

static inline interval interval_add(interval a, interval b)
{
    return interval_outward(a.lo + b.lo, a.hi + b.hi);
}

static inline interval interval_sub(interval a, interval b)
{
    return interval_outward(a.lo - b.hi, a.hi - b.lo);
}

/* The least and the largest of four numbers, moved outward. The sum is no number where one of them is
 * none, which comparisons would pass over, or where both infinities are among them. */
static inline interval interval_among(double p, double q, double r, double s)
{
    const double sum = p + q + r + s;
    if (sum != sum)
        return (interval){-INFINITY, INFINITY};
    const double a = p < q ? p : q, b = r < s ? r : s;
    const double c = p > q ? p : q, d = r > s ? r : s;
    return interval_outward(a < b ? a : b, c > d ? c : d);
}

static inline interval interval_mul(interval a, interval b)
{
    return interval_among(a.lo * b.lo, a.lo * b.hi, a.hi * b.lo, a.hi * b.hi);
}

static inline interval interval_div(interval a, interval b)
{
    if (b.lo <= 0 && b.hi >= 0)
        return (interval){-INFINITY, INFINITY};
    return interval_among(a.lo / b.lo, a.lo / b.hi, a.hi / b.lo, a.hi / b.hi);
}

/* The square, which is never negative: tighter than a product where the signs differ. */
static inline interval interval_sqr(interval a)
{
    const double p = a.lo * a.lo, q = a.hi * a.hi, most = p > q ? p : q, least = p > q ? q : p;
    const interval square = interval_outward(a.lo <= 0 && a.hi >= 0 ? 0 : least, most);
    return square.lo < 0 ? (interval){0, square.hi} : square;
}

static inline interval interval_sqrt(interval a)
{
    const interval root = interval_outward(sqrt(a.lo), sqrt(a.hi));
    return root.lo < 0 && a.lo >= 0 ? (interval){0, root.hi} : root;
}

#endif
