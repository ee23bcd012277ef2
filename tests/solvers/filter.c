/* The filter of the line search: what it takes and refuses, one number a line. */
#include "interior_solver.h"

#include <stdio.h>

int main(void)
{
    filter f;
    ip_filter_reset(&f, 2);
    printf("%d\n", ip_filter_accepts(&f, 1, 1e300));
    printf("%d\n", ip_filter_accepts(&f, f.theta_max, -1));
    printf("%d\n", ip_filter_accepts(&f, 1.001*f.theta_max, -1e300));
    ip_filter_add(&f, 1, 5);
    printf("%d\n", ip_filter_accepts(&f, 1, 5));
    printf("%d\n", ip_filter_accepts(&f, 1.5, 6));
    printf("%d\n", ip_filter_accepts(&f, 0.9, 6));
    printf("%d\n", ip_filter_accepts(&f, 1.5, 4));
    return 0;
}
