#include "passes.h"

#include <string.h>

enum { CHUNK = 64 }; /* rows at a time, which stay in the first-level cache */

ptrdiff_t dmoc_scratch_size(const dmoc_pass *pass)
{
    ptrdiff_t most = 0;
    for (ptrdiff_t e = 0; e < pass->elements; ++e) {
        const dmoc_element *element = &pass->element[e];
        ptrdiff_t size = 0;
        const dmoc_entry *entry = element->entry;
        for (int a = 0; a < entry->inputs; ++a)
            size += element->gather[a] ? entry->array[a].size : 0;
        for (int b = 0; b < entry->outputs; ++b)
            size += entry->array[entry->inputs + b].size;
        most = size > most ? size : most;
    }
    return most*CHUNK;
}

static void add_element(const dmoc_element *element, const double *pool, double *scratch,
                        double *target)
{
    const dmoc_entry *entry = element->entry;
    const dmoc_array *input = entry->array, *output = input + entry->inputs;
    for (ptrdiff_t first = 0; first < element->n; first += CHUNK) {
        const ptrdiff_t rows = element->n - first < CHUNK ? element->n - first : (ptrdiff_t)CHUNK;
        const double *in[DMOC_MOST];
        double *out[DMOC_MOST];
        double *free = scratch;
        for (int a = 0; a < entry->inputs; ++a) {
            if (!element->gather[a]) {
                in[a] = pool + element->base[a] + first*element->stride[a];
                continue;
            }
            const ptrdiff_t size = input[a].size;
            const ptrdiff_t *from = element->gather[a] + first*size;
            for (ptrdiff_t i = 0; i < rows*size; ++i)
                free[i] = pool[from[i]];
            in[a] = free;
            free += rows*size;
        }
        for (int b = 0; b < entry->outputs; ++b) {
            out[b] = free;
            free += rows*output[b].size;
        }
        entry->kernel(rows, in, element->stride, out);
        for (int b = 0; b < entry->outputs; ++b) {
            if (!element->slot[b])
                continue;
            const ptrdiff_t count = output[b].size;
            const ptrdiff_t *slot = element->slot[b] + first*count;
            const double *factor = element->factor[b] + first*count;
            for (ptrdiff_t i = 0; i < rows*count; ++i)
                if (slot[i] >= 0)
                    target[slot[i]] += factor[i]*out[b][i];
        }
    }
}

void dmoc_assemble(const dmoc_pass *pass, const double *pool, double *target)
{
    memcpy(target, pass->constant, (size_t)pass->targets*sizeof *target);
    for (ptrdiff_t k = 0; k < pass->terms; ++k)
        target[pass->row[k]] += pass->coefficient[k]*pool[pass->column[k]];
    for (ptrdiff_t e = 0; e < pass->elements; ++e)
        add_element(&pass->element[e], pool, pass->scratch, target);
}

void dmoc_put(const dmoc_program *program, const double *x)
{
    for (ptrdiff_t i = 0; i < program->n; ++i)
        program->pool[i] = program->sizes[i]*x[i];
}
