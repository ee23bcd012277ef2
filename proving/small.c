/* See small.h. */
#include "small.h"

#include <math.h>
#include <string.h>

#include "linear_program.h"

/* The inverse of a positive definite matrix (n, n). */
void small_inverse(int n, const double *H, double *inverse)
{
    double A[MOST_INPUTS * MOST_INPUTS];
    memcpy(A, H, sizeof(double) * n * n);
    for (int i = 0; i < n * n; i++)
        inverse[i] = i % (n + 1) == 0;
    for (int k = 0; k < n; k++) {
        const double pivot = 1 / A[k * n + k];
        for (int j = 0; j < n; j++)
            A[k * n + j] *= pivot, inverse[k * n + j] *= pivot;
        for (int i = 0; i < n; i++) {
            const double factor = A[i * n + k];
            for (int j = 0; j < n && i != k; j++) {
                A[i * n + j] -= factor * A[k * n + j];
                inverse[i * n + j] -= factor * inverse[k * n + j];
            }
        }
    }
}

/* Least of u H u/2 + y u within bounds; the free inputs as a mask. */
unsigned least_inputs(int n, const double *H, const double *inverse, const double *y,
                             const double *lower, const double *upper, double *u)
{
    int within = 1;
    for (int i = 0; i < n; i++) {
        double sum = 0;
        for (int j = 0; j < n; j++)
            sum -= inverse[i * n + j] * y[j];
        u[i] = sum;
        within &= sum > lower[i] && sum < upper[i];
    }
    if (within)
        return (1u << n) - 1;
    for (int i = 0; i < n; i++)
        u[i] = u[i] < lower[i] ? lower[i] : u[i] > upper[i] ? upper[i] : u[i];
    for (int round = 0; round < 200 && n > 1; round++) {
        double moved = 0, size = 0;
        for (int i = 0; i < n; i++) {
            double slope = y[i];
            for (int j = 0; j < n; j++)
                slope += i == j ? 0 : H[i * n + j] * u[j];
            double next = -slope / H[i * n + i];
            next = next < lower[i] ? lower[i] : next > upper[i] ? upper[i] : next;
            const double change = fabs(next - u[i]);
            moved = change > moved ? change : moved;
            size = fabs(next) > size ? fabs(next) : size;
            u[i] = next;
        }
        if (moved <= 1e-15 * size)
            break;
    }
    unsigned mask = 0;
    for (int i = 0; i < n; i++)
        mask |= (unsigned)(u[i] > lower[i] && u[i] < upper[i]) << i;
    return mask;
}

/* Solve the symmetric positive system A x = b of the rows that are free, with a little more on its
 * diagonal where it needs it; A is used up. */
void solve_free(int n, double *A, const double *b, const unsigned char *is_free, double *x)
{
    int at[MOST_MULTIPLIERS], k = 0;
    for (int i = 0; i < n; i++) {
        x[i] = 0;
        if (is_free[i])
            at[k++] = i;
    }
    double L[MOST_MULTIPLIERS * MOST_MULTIPLIERS], z[MOST_MULTIPLIERS];
    for (int i = 0; i < k; i++)
        for (int j = 0; j <= i; j++) {
            const double diagonal = A[at[i] * n + at[i]];
            double sum = A[at[i] * n + at[j]] + (i == j ? 1e-13 * diagonal : 0);
            for (int l = 0; l < j; l++)
                sum -= L[i * k + l] * L[j * k + l];
            if (i == j)
                L[i * k + i] = sqrt(sum > 1e-12 * diagonal ? sum : 1e-12 * diagonal + 1e-300);
            else
                L[i * k + j] = sum / L[j * k + j];
        }
    for (int i = 0; i < k; i++) {
        double sum = b[at[i]];
        for (int l = 0; l < i; l++)
            sum -= L[i * k + l] * z[l];
        z[i] = sum / L[i * k + i];
    }
    for (int i = k - 1; i >= 0; i--) {
        double sum = z[i];
        for (int l = i + 1; l < k; l++)
            sum -= L[l * k + i] * x[at[l]];
        x[at[i]] = sum / L[i * k + i];
    }
}
