/* Sums of slopes: what an integration does beside its kernels.
 *
 * They are made four numbers at a time: they read and write up to three numbers beyond the last.
 * Where the system can choose between versions of a function when a program is loaded, there is one
 * for processors with longer vectors; both round alike. */
#ifndef DMOC_SUMS_H
#define DMOC_SUMS_H

#include <stddef.h>

#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__gnu_linux__) && \
    !defined(__SANITIZE_ADDRESS__)
#define VERSIONS __attribute__((target_clones("avx2", "default")))
#else
#define VERSIONS
#endif

enum { FOUR = 4 };
typedef double four __attribute__((vector_size(FOUR*sizeof(double)), aligned(sizeof(double))));

/* out[c] = sum_e factor[e] slopes[which[e]*stride + c], for c < count. */
VERSIONS static void sum_of(double *restrict out, const double *restrict slopes, ptrdiff_t count,
                            ptrdiff_t stride, ptrdiff_t terms, const ptrdiff_t *restrict which,
                            const double *restrict factor)
{
    for (ptrdiff_t c = 0; c < count; c += FOUR) {
        four sum = {0};
        for (ptrdiff_t e = 0; e < terms; ++e)
            sum += factor[e]*(*(const four *)(slopes + which[e]*stride + c));
        *(four *)(out + c) = sum;
    }
}

#endif
