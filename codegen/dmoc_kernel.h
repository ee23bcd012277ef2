/* Kernels: C functions of a few small vectors, and the table of those of one model.
 *
 * A kernel evaluates n rows: in[a] + i*stride[a] is row i of input a (a stride of 0 repeats one
 * row), and row i of output b starts at out[b] + i*(its number of values). Outputs do not overlap
 * inputs. No kernel allocates or keeps state.
 *
 * The sources of a model, kernels.c, end in its table, <model>_kernels. Python hands it on in a
 * capsule named DMOC_TABLE.
 */
#ifndef DMOC_KERNEL_H
#define DMOC_KERNEL_H

#include <stddef.h>
#include <string.h>

#define DMOC_TABLE "dmoc_table"

enum { DMOC_MOST = 16 }; /* inputs, and outputs, of a kernel */

typedef void dmoc_kernel(ptrdiff_t n, const double *const in[], const ptrdiff_t stride[],
                         double *const out[]);

typedef struct {
    const char *name;
    ptrdiff_t size; /* values of one row; of a matrix, its stored entries */
} dmoc_array;

typedef struct {
    const char *name;
    dmoc_kernel *kernel;
    int inputs, outputs;
    const dmoc_array *array; /* [inputs + outputs] the inputs, then the outputs */
} dmoc_entry;

typedef struct {
    const char *model;
    const char *code; /* the digest of the sources, which their manifest holds too */
    int entries;
    const dmoc_entry *entry; /* [entries] */
} dmoc_table;

/* The kernel of this name, or NULL. */
static inline const dmoc_entry *dmoc_find(const dmoc_table *table, const char *name)
{
    for (int i = 0; i < table->entries; ++i)
        if (!strcmp(table->entry[i].name, name))
            return &table->entry[i];
    return NULL;
}

#ifdef DMOC_NAME /* the sources of a model, which name its kernels so */

/* Of a kernel they have a function of one row, whose arguments are the inputs and outputs that it
 * needs, and KERNEL with their places: rows of the inputs, and outputs with their sizes. */
#ifdef __cplusplus
#define DMOC_ALONE __restrict
#else
#define DMOC_ALONE restrict
#endif
#define IN const double *DMOC_ALONE
#define OUT double *DMOC_ALONE
#define ROW(a) in[a] + row*stride[a]
#define INTO(b, size) out[b] + row*size
#define KERNEL(kernel, ...) \
    void DMOC_NAME(kernel)(ptrdiff_t rows, const double *const in[], const ptrdiff_t stride[], \
                           double *const out[]) \
    { \
        (void)in, (void)stride; \
        for (ptrdiff_t row = 0; row < rows; ++row) \
            kernel(__VA_ARGS__); \
    }
/* A kernel without results. */
#define EMPTY(kernel) \
    void DMOC_NAME(kernel)(ptrdiff_t rows, const double *const in[], const ptrdiff_t stride[], \
                           double *const out[]) \
    { \
        (void)rows, (void)in, (void)stride, (void)out; \
    }
/* All its arrays, and its entry in the table. */
#define ARRAYS(kernel, ...) static const dmoc_array kernel##_arrays[] = {__VA_ARGS__};
#define ENTRY(kernel, inputs, outputs) {#kernel, DMOC_NAME(kernel), inputs, outputs, kernel##_arrays}

#endif

#endif
