/* Bounds of a function over a box from its jet. */
#include "convex.h"

#include <string.h>

/* Cholesky's factor of a matrix (n, n); 1 where it is not positive definite. */
static int factored(int n, const double *A, double *L)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            double sum = A[i * n + j];
            for (int k = 0; k < j; k++)
                sum -= L[i * n + k] * L[j * n + k];
            if (i == j && !(sum > 0))
                return 1;
            L[i * n + j] = i == j ? sqrt(sum) : sum / L[j * n + j];
        }
    return 0;
}

/* How far a matrix may be from L L^T, which has no negative eigenvalue: a bound of the norm. */
static double remainder_of(int n, const double *A, const double *L)
{
    double most = 0;
    for (int i = 0; i < n; i++) {
        double row = 0;
        for (int j = 0; j < n; j++) {
            interval sum = interval_of(-A[i > j ? i * n + j : j * n + i]);
            for (int k = 0; k <= (i < j ? i : j); k++)
                sum = plus_times(sum, interval_of(L[i * n + k]), interval_of(L[j * n + k]));
            row += interval_mag(sum);
        }
        most = row > most ? row : most;
    }
    return most * (1 + 1e-12);
}

/* Least g.x + x A x/2 for x in a box whose sum lies within a range, roughly: by turns in each
 * direction at a price of the sum, which is found by halving. */
static double roughly_least(int n, const double *A, const double *g, const double *low,
                            const double *high, double least, double most, double *x)
{
    double below = -INFINITY, above = INFINITY, price = 0, reach = 0;
    for (int i = 0; i < n; i++)
        reach = fmax(reach, fabs(g[i]) + fabs(A[i * n + i]) * fmax(-low[i], high[i]));
    for (int i = 0; i < n; i++)
        x[i] = 0;
    for (int round = 0; round < 50; round++) {
        double sum = 0;
        for (int sweep = 0; sweep < 30; sweep++) {
            double moved = 0;
            for (int i = 0; i < n; i++) {
                double slope = g[i] + price, next;
                for (int j = 0; j < n; j++)
                    slope += i == j ? 0 : A[i * n + j] * x[j];
                next = A[i * n + i] > 0 ? -slope / A[i * n + i] : slope > 0 ? low[i] : high[i];
                next = next < low[i] ? low[i] : next > high[i] ? high[i] : next;
                moved = fmax(moved, fabs(next - x[i]) / (high[i] - low[i] + 1e-300));
                x[i] = next;
            }
            if (moved < 1e-9)
                break;
        }
        for (int i = 0; i < n; i++)
            sum += x[i];
        const double slack = 1e-9 * (most - least) + 1e-12 * fabs(most);
        if (sum > most + slack)
            below = price;
        else if (sum < least - slack)
            above = price;
        else if (price == 0 || (price > 0 && sum >= most - slack) || (price < 0 && sum <= least + slack))
            break;
        else if (price > 0)
            above = price;
        else
            below = price;
        if (isinf(below) && isinf(above))
            break;
        if (isinf(below))
            price = fmin(0, above) - 2 * (reach + fabs(above));
        else if (isinf(above))
            price = fmax(0, below) + 2 * (reach + fabs(below));
        else
            price = (below + above) / 2;
    }
    return price;
}

/* Least of a convex function with the value v and slopes g at x, by its tangent there: in a box,
 * with a price of the sum, which lies within a range. */
static double below_tangent(int n, interval v, const interval *g, const double *x, const double *low,
                            const double *high, double least, double most, double price)
{
    interval sum = {0, 0};
    for (int i = 0; i < n; i++) {
        const interval slope = interval_add(g[i], interval_of(price));
        const interval to_low = times(slope, interval_sub(interval_of(low[i]), interval_of(x[i])));
        const interval to_high = times(slope, interval_sub(interval_of(high[i]), interval_of(x[i])));
        v = plus(v, interval_of(fmin(to_low.lo, to_high.lo)));
        sum = plus(sum, interval_of(x[i]));
    }
    if (price != 0) {
        const interval rest = interval_sub(interval_of(price > 0 ? most : least), sum);
        v = interval_sub(v, times(interval_of(price), rest));
    }
    return v.lo;
}

/* Bound by the second derivatives over the box: what is missing to a convex function is taken off,
 * then the tangent of this at its least point is below it. */
double by_curvature(int n, const jet *box, const double *low,
                           const double *high, double least, double most, double *widths)
{
    double A[MOST_PHASES * MOST_PHASES], L[MOST_PHASES * MOST_PHASES], reach[MOST_PHASES];
    double x[MOST_PHASES], g[MOST_PHASES], size = 0, radius = 0;
    interval lost = {0, 0};
    for (int i = 0; i < n; i++)
        reach[i] = fmax(fmax(-low[i], high[i]), 1e-300);
    for (int i = 0; i < n; i++) {
        double row = 0;
        for (int j = 0; j < n; j++) {
            const interval h = box->H[i < j ? second_at(n, i, j) : second_at(n, j, i)];
            const double mid = interval_mid(h);
            A[i * n + j] = mid;
            row += fmax(h.hi - mid, mid - h.lo) * (1 + 1e-14) * reach[j];
        }
        if (!isfinite(row))
            return -INFINITY;
        widths[i] = row * reach[i];
        A[i * n + i] -= row / reach[i] * (1 + 1e-14);
        size = fmax(size, fabs(A[i * n + i]) * reach[i] * reach[i]);
        radius = fmax(radius, reach[i]);
    }
    /* Where the sum is known, its square says nothing new. */
    const double known = most - least <= 1e-12 * fabs(most) + 1e-15 ? 4 * size / (radius * radius) : 0;
    for (int i = 0; i < n * n; i++)
        A[i] += known;
    double shift = 0;
    for (int round = 0; round < 60; round++) {
        double shifted[MOST_PHASES * MOST_PHASES];
        memcpy(shifted, A, sizeof shifted);
        for (int i = 0; i < n; i++)
            shifted[i * n + i] += shift / (reach[i] * reach[i]);
        if (!factored(n, shifted, L)) {
            memcpy(A, shifted, sizeof shifted);
            break;
        }
        if (round == 59)
            return -INFINITY;
        shift = shift > 0 ? 1.5 * shift : 1e-6 * size + 1e-300;
    }
    /* shift x^2/(2 reach^2) was added to each, at most shift/2 */
    lost = plus(lost, times(interval_of(n * shift / 2), interval_of(1 + 1e-12)));
    double rest = remainder_of(n, A, L), far = 0;
    for (int i = 0; i < n; i++) /* what rounding took away when A was made */
        rest += 8 * DBL_EPSILON * (fabs(A[i * n + i]) + widths[i] / (reach[i] * reach[i]) + known);
    for (int i = 0; i < n; i++) {
        far += (high[i] - low[i]) * (high[i] - low[i]) * (1 + 1e-12);
        g[i] = interval_mid(box->g0[i]);
    }
    lost = plus(lost, times(interval_of(rest / 2), interval_of(far)));
    if (known > 0) {
        const double most_sum = fmax(fabs(least), fabs(most));
        lost = plus(lost, times(interval_of(known / 2), interval_sqr(interval_of(most_sum))));
    }
    const double price = roughly_least(n, A, g, low, high, least, most, x);
    interval v = box->v0, slope[MOST_PHASES];
    for (int i = 0; i < n; i++) {
        interval row = {0, 0};
        for (int j = 0; j < n; j++)
            row = plus_times(row, interval_of(i >= j ? A[i * n + j] : A[j * n + i]), interval_of(x[j]));
        slope[i] = plus(box->g0[i], row);
        v = plus(v, times(interval_of(x[i]), plus(box->g0[i], scaled(row, 0.5))));
    }
    v = interval_sub(v, lost);
    return below_tangent(n, v, slope, x, low, high, least, most, price);
}

/* Bound by the slopes over the box, from its centre. */
double by_slopes(int n, const jet *box, const double *low,
                        const double *high, double least, double most)
{
    double bound = -INFINITY, mean = 0;
    for (int i = 0; i < n; i++)
        mean -= interval_mid(box->g0[i]) / n;
    for (int priced = 0; priced < 2; priced++) {
        interval v = box->v0;
        const double price = priced ? mean : 0;
        for (int i = 0; i < n; i++) {
            const interval slope = interval_add(box->g[i], interval_of(price));
            const interval away = {low[i], high[i]};
            v = plus(v, interval_of(times(slope, away).lo));
        }
        if (price != 0)
            v = interval_sub(v, times(interval_of(price), interval_of(price > 0 ? most : least)));
        bound = v.lo > bound ? v.lo : bound;
    }
    return bound;
}
