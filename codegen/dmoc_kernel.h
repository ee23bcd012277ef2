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

#endif
