/* Reads m, n, a cut and m*n values of matrices, until there are none; prints for each of them the
 * pseudo-inverse, the smallest singular value and, where m > n, the complement of its columns. All
 * arrays have exactly their sizes, for the sanitizers. */
#include "least_squares.h"

#include <stdio.h>
#include <stdlib.h>

static double *numbers(ptrdiff_t n)
{
    return malloc((size_t)n*sizeof(double));
}

static void print(ptrdiff_t n, double *values)
{
    for (ptrdiff_t i = 0; i < n; ++i)
        printf("%.17g\n", values[i]);
    free(values);
}

int main(void)
{
    int m, n;
    double cut;
    while (scanf("%d %d %lf", &m, &n, &cut) == 3) {
        double *A = numbers(m*n), *inverse = numbers(n*m), *smallest = numbers(1);
        double *work = numbers(dmoc_work_size(m, n));
        for (int i = 0; i < m*n; ++i)
            if (scanf("%lf", &A[i]) != 1)
                return 1;
        dmoc_pseudo_inverse(m, n, A, cut, inverse, work);
        *smallest = dmoc_smallest_singular(m, n, A, work);
        print(n*m, inverse);
        print(1, smallest);
        if (m > n) {
            double *rows = numbers((m - n)*m);
            dmoc_complement(m, n, A, rows, work);
            print((m - n)*m, rows);
        }
        free(A);
        free(work);
    }
    return 0;
}
