/* See convex.h. */
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

/* The function g.x + x A x/2 of x in a box, whose sum with weights lies within a range. */
typedef struct {
    int n;
    double A[MOST_PHASES * MOST_PHASES], g[MOST_PHASES];
    double low[MOST_PHASES], high[MOST_PHASES], weight[MOST_PHASES], least, most;
} Quadratic;

/* Where it is least at a price of the sum, by turns in each direction, roughly; the sum there. */
static double least_at(const Quadratic *q, double price, double *x)
{
    const int n = q->n;
    double sum = 0;
    for (int sweep = 0; sweep < 30; sweep++) {
        double moved = 0;
        for (int i = 0; i < n; i++) {
            double slope = q->g[i] + price * q->weight[i], next;
            for (int j = 0; j < n; j++)
                slope += i == j ? 0 : q->A[i * n + j] * x[j];
            const double bent = q->A[i * n + i];
            next = bent > 0 ? -slope / bent : slope > 0 ? q->low[i] : q->high[i];
            next = next < q->low[i] ? q->low[i] : next > q->high[i] ? q->high[i] : next;
            moved = fmax(moved, fabs(next - x[i]) / (q->high[i] - q->low[i] + 1e-300));
            x[i] = next;
        }
        if (moved < 1e-9)
            break;
    }
    for (int i = 0; i < n; i++)
        sum += q->weight[i] * x[i];
    return sum;
}

/* Where it is least, roughly, and a price of the sum, which is found by halving. */
static double roughly_least(const Quadratic *q, double *x)
{
    double below = -INFINITY, above = INFINITY, price = 0, reach = 0;
    const double slack = 1e-9 * (q->most - q->least) + 1e-12 * fabs(q->most);
    for (int i = 0; i < q->n; i++) {
        const double bent = fabs(q->A[i * q->n + i]) * fmax(-q->low[i], q->high[i]);
        reach = fmax(reach, (fabs(q->g[i]) + bent) / q->weight[i]);
        x[i] = 0;
    }
    for (int round = 0; round < 50; round++) {
        const double sum = least_at(q, price, x);
        if (sum > q->most + slack)
            below = price;
        else if (sum < q->least - slack)
            above = price;
        else if (price == 0 || (price > 0 && sum >= q->most - slack) ||
                 (price < 0 && sum <= q->least + slack))
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

/* Least of a convex function with the value v and slopes g at x, by its tangent there, with a price
 * of the sum. */
static double below_tangent(const Quadratic *q, interval v, const interval *g, const double *x,
                            double price)
{
    interval sum = {0, 0};
    for (int i = 0; i < q->n; i++) {
        const interval weight = interval_of(q->weight[i]), at = interval_of(x[i]);
        const interval slope = plus_times(g[i], interval_of(price), weight);
        const interval to_low = times(slope, interval_sub(interval_of(q->low[i]), at));
        const interval to_high = times(slope, interval_sub(interval_of(q->high[i]), at));
        v = plus(v, interval_of(fmin(to_low.lo, to_high.lo)));
        sum = plus_times(sum, weight, at);
    }
    if (price != 0) {
        const interval rest = interval_sub(interval_of(price > 0 ? q->most : q->least), sum);
        v = interval_sub(v, times(interval_of(price), rest));
    }
    return v.lo;
}

/* What second and third derivatives make of a polynomial: x A x/2 for x in a box, where A is what is
 * certain of a matrix: its middle less the sums of its radii in each row. */
static void take_certain(const Frame *f, const model *of, Quadratic *q, double *widths)
{
    const int n = f->n;
    double radius[MOST_PHASES][MOST_PHASES] = {{0}};
    for (int i = 0; i < n; i++)
        for (int j = i; j < n; j++) {
            const int second = f->by[i][1 + j];
            double mid = (i == j ? 2 : 1) * of->c[second], far = 0;
            for (int k = 0; k < n; k++) {
                /* the third derivative; a third of it counts in the remainder of a value */
                const int alike = (i == j) + (i == k) + (j == k);
                const double bent = (alike == 3 ? 6 : alike ? 2 : 1) * of->c[f->by[k][second]] / 3;
                mid += bent * (q->low[k] + q->high[k]) / 2;
                far += fabs(bent) * (q->high[k] - q->low[k]) / 2;
            }
            q->A[i * n + j] = q->A[j * n + i] = mid;
            radius[i][j] = radius[j][i] = far;
        }
    for (int i = 0; i < n; i++) {
        double row = 0;
        for (int j = 0; j < n; j++)
            row += radius[i][j];
        widths[i] = row;
        q->A[i * n + i] -= row;
    }
}

double by_curvature(const Frame *f, const model *of, const Range *range, double *widths)
{
    const int n = f->n;
    double L[MOST_PHASES * MOST_PHASES], x[MOST_PHASES], size = 0, longest = 0, shift = 0;
    Quadratic q = {.n = n, .least = range->least, .most = range->most};
    if (!(of->rest < INFINITY))
        return -INFINITY;
    for (int i = 0; i < n; i++) {
        q.weight[i] = f->most[i];
        q.low[i] = fmax(-1, range->below[i] / f->most[i] * (1 + 4 * DBL_EPSILON));
        q.high[i] = fmin(1, range->above[i] / f->most[i] * (1 + 4 * DBL_EPSILON));
        q.g[i] = of->c[1 + i];
        longest = fmax(longest, f->most[i]);
    }
    take_certain(f, of, &q, widths);
    for (int i = 0; i < n; i++)
        size = fmax(size, fabs(q.A[i * n + i]));
    /* Where the sum is known, its square says nothing new. */
    const double apart = range->most - range->least;
    const double known = apart <= 1e-12 * fabs(range->most) + 1e-15 ? 4 * size : 0;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
            q.A[i * n + j] += known * (f->most[i] / longest) * (f->most[j] / longest);
    for (int round = 0;; round++) {
        double shifted[MOST_PHASES * MOST_PHASES];
        memcpy(shifted, q.A, sizeof shifted);
        for (int i = 0; i < n; i++)
            shifted[i * n + i] += shift;
        if (!factored(n, shifted, L)) {
            memcpy(q.A, shifted, sizeof shifted);
            break;
        }
        if (round == 59)
            return -INFINITY;
        shift = shift > 0 ? 1.5 * shift : 1e-6 * size + 1e-300;
    }
    /* shift x^2/2 was added for each, at most shift/2. Squares of distances of points are at most 4 in
     * each direction, and rounding took from A what it may have taken from the sums that it is. */
    const double taken = 512 * DBL_EPSILON * (known + shift + of->size[2] + of->size[3]);
    const double beside = remainder_of(n, q.A, L) + n * taken;
    interval lost = interval_of(upward(n * shift / 2 + 2 * n * beside + of->rest));
    if (known > 0) {
        const double most_sum = fmax(fabs(range->least), fabs(range->most));
        const interval ratio = interval_div(interval_of(most_sum), interval_of(longest));
        lost = plus(lost, times(interval_of(known / 2), interval_sqr(ratio)));
    }
    const double price = roughly_least(&q, x);
    interval v = interval_of(of->c[0]), slope[MOST_PHASES];
    for (int i = 0; i < n; i++) {
        interval row = {0, 0};
        for (int j = 0; j < n; j++)
            row = plus_times(row, interval_of(i >= j ? q.A[i * n + j] : q.A[j * n + i]), interval_of(x[j]));
        slope[i] = plus(interval_of(q.g[i]), row);
        v = plus(v, times(interval_of(x[i]), plus(interval_of(q.g[i]), scaled(row, 0.5))));
    }
    return below_tangent(&q, interval_sub(v, lost), slope, x, price);
}
