/* proving/intervals.h over arrays: count pairs (a, b) of intervals, their results in the order
 * + - * / square root, six each. */
#include "intervals.h"

void operations(int count, const interval *a, const interval *b, interval *results);

void operations(int count, const interval *a, const interval *b, interval *results)
{
    for (int i = 0; i < count; i++) {
        *results++ = interval_add(a[i], b[i]);
        *results++ = interval_sub(a[i], b[i]);
        *results++ = interval_mul(a[i], b[i]);
        *results++ = interval_div(a[i], b[i]);
        *results++ = interval_sqr(a[i]);
        *results++ = interval_sqrt(a[i]);
    }
}
