/* The analysis: which pivots form a block, which rows a block has, where each number belongs. */
#include "ldl.h"

#include <stdlib.h>
#include <string.h>

enum { FOUR = 4, MOST_WIDE = 32 };

/* A list that grows. */
typedef struct {
    int *at;
    int count, room;
} list;

static int append(list *l, int value)
{
    if (l->count == l->room) {
        const int room = 2*l->room + 64;
        int *more = realloc(l->at, sizeof(int)*(size_t)room);
        if (!more)
            return 0;
        l->at = more, l->room = room;
    }
    l->at[l->count++] = value;
    return 1;
}

typedef struct {
    dmoc_ldl *f;
    const int *start, *row; /* pattern of K */
    int *owner;             /* [n] pivot of each unknown, then block; of the final group the number
                               of pivots, then of blocks */
    int *below_start, *below, *entry; /* K by rows of its upper triangle: column and entry */
    int *child, *sibling;   /* [pivots] finished blocks by the pivot of their first row, -1 ends */
    int *block_mark, *pivot_mark; /* [n] the last block or pivot that the unknown is a row of */
    int *first, *block, *row_start, *part_start, *height, *panel_start, *place; /* those of f */
    list rows;              /* of finished blocks */
    list current, next;     /* rows of the block that grows, and of the next pivot alone */
    list parts, target;
} analysis;

static void transpose(analysis *s)
{
    const int n = s->f->n;
    memset(s->below_start, 0, sizeof(int)*((size_t)n + 2));
    for (int e = 0; e < s->start[n]; ++e)
        ++s->below_start[s->row[e] + 2];
    for (int i = 0; i < n; ++i)
        s->below_start[i + 2] += s->below_start[i + 1];
    for (int j = 0; j < n; ++j)
        for (int e = s->start[j]; e < s->start[j + 1]; ++e) {
            const int at = s->below_start[s->row[e] + 1]++;
            s->below[at] = j, s->entry[at] = e;
        }
}

/* Add an unknown to the rows of pivot p alone, once. */
static int add_row(analysis *s, int p, int i)
{
    if (i < s->f->first[p + 1] || s->pivot_mark[i] == p)
        return 1;
    s->pivot_mark[i] = p;
    return append(&s->next, i);
}

/* Rows of pivot p that come from K and from finished blocks. */
static int rows_of_pivot(analysis *s, int p)
{
    const int *first = s->f->first;
    int ok = 1;
    s->next.count = 0;
    for (int e = s->below_start[first[p]]; ok && e < s->below_start[first[p + 1]]; ++e)
        ok = add_row(s, p, s->below[e]);
    for (int b = s->child[p]; ok && b >= 0; b = s->sibling[b])
        for (int e = s->f->row_start[b]; ok && e < s->f->row_start[b + 1]; ++e)
            ok = add_row(s, p, s->rows.at[e]);
    return ok;
}

/* What a block costs, in units of about one multiplication. */
static double price(int width, int rows)
{
    const double w = width, r = rows;
    if (width == 1 && rows < FOUR)
        return 10*r;
    return 50 + 20*w + w*(r*r + r*w + w*w/3)/4 + 0.75*r*r;
}

static int ascending(const void *a, const void *b) { return *(const int *)a - *(const int *)b; }

/* End the block that grows before pivot p. */
static int close_block(analysis *s, int p)
{
    list *l = &s->current;
    const int b = s->f->blocks++;
    if (l->count > FOUR*FOUR) {
        qsort(l->at, (size_t)l->count, sizeof *l->at, ascending);
    } else {
        for (int i = 1; i < l->count; ++i) {
            const int value = l->at[i];
            int j = i;
            for (; j > 0 && l->at[j - 1] > value; --j)
                l->at[j] = l->at[j - 1];
            l->at[j] = value;
        }
    }
    for (int i = 0; i < l->count; ++i)
        if (!append(&s->rows, l->at[i]))
            return 0;
    s->row_start[b + 1] = s->rows.count;
    s->block[b + 1] = p;
    const int parent = l->count ? s->owner[l->at[0]] : s->f->pivots;
    if (parent < s->f->pivots) {
        s->sibling[b] = s->child[parent];
        s->child[parent] = b;
    }
    return 1;
}

/* Let the rows of the block that grows be those behind pivot p, if it keeps any, and those of p
 * alone. */
static int merge_rows(analysis *s, int p, int keep)
{
    list *l = &s->current;
    const int b = s->f->blocks, count = keep ? l->count : 0;
    int ok = 1;
    l->count = 0;
    for (int i = 0; i < count; ++i)
        if (l->at[i] >= s->f->first[p + 1]) {
            s->block_mark[l->at[i]] = b;
            l->at[l->count++] = l->at[i];
        }
    for (int i = 0; ok && i < s->next.count; ++i)
        if (s->block_mark[s->next.at[i]] != b) {
            s->block_mark[s->next.at[i]] = b;
            ok = append(l, s->next.at[i]);
        }
    return ok;
}

/* Take pivot p into the block that grows, or begin a new one with it. */
static int take_pivot(analysis *s, int p)
{
    const int *first = s->f->first;
    const list *l = &s->current;
    if (!rows_of_pivot(s, p))
        return 0;
    const int begin = first[s->f->block[s->f->blocks]];
    const int width = first[p + 1] - first[p], wide = first[p] - begin;
    int together = s->next.count, child = 0; /* rows of both; whether the block has p as a row */
    for (int i = 0; i < l->count; ++i)
        if (l->at[i] < first[p + 1])
            child = 1;
        else
            together += s->pivot_mark[l->at[i]] != p;
    const double apart = price(wide, l->count) + price(width, child ? together : s->next.count);
    const int joins = wide + width <= MOST_WIDE && price(wide + width, together) <= apart;
    if (wide > 0 && !joins && !close_block(s, p))
        return 0;
    return merge_rows(s, p, joins || child);
}

/* Parts of the rows of block b, and where they are in the panels of their owners. */
static int split_rows(analysis *s, int b)
{
    const dmoc_ldl *f = s->f;
    const int begin = s->f->row_start[b], end = s->f->row_start[b + 1], *row = s->rows.at;
    int ok = 1;
    for (int i = begin; ok && i < end;) {
        const int owner = s->owner[row[i]];
        ok = append(&s->parts, owner) && append(&s->parts, i - begin) &&
             append(&s->parts, s->target.count);
        if (owner == f->blocks) {
            for (; ok && i < end; ++i)
                ok = append(&s->target, row[i] - f->chain);
            break;
        }
        const int from = f->first[s->f->block[owner]], last = f->first[s->f->block[owner + 1]];
        int at = s->f->row_start[owner], k = i;
        for (; ok && k < end && row[k] < last; ++k)
            ok = append(&s->target, row[k] - from);
        const int next = k;
        for (; ok && k < end; ++k) {
            while (row[at] != row[k]) /* the owner has all of them */
                ++at;
            ok = append(&s->target, last - from + at - s->f->row_start[owner]);
        }
        i = next;
    }
    return ok;
}

/* Sizes of the panels, and positions of K in them. */
static void lay_out(analysis *s)
{
    dmoc_ldl *f = s->f;
    int *position = s->pivot_mark;
    const int dense = f->n - f->chain;
    s->panel_start[0] = 0;
    for (int b = 0; b <= f->blocks; ++b) {
        const int from = b < f->blocks ? f->first[s->f->block[b]] : f->chain;
        const int last = b < f->blocks ? f->first[s->f->block[b + 1]] : f->n;
        const int rows = b < f->blocks ? s->f->row_start[b + 1] - s->f->row_start[b] : 0;
        const int height = b < f->blocks ? (last - from + rows + FOUR - 1)/FOUR*FOUR : dense;
        s->height[b] = height;
        s->panel_start[b + 1] = f->panel_start[b] + height*(last - from);
        for (int i = 0; i < rows; ++i)
            position[s->rows.at[s->f->row_start[b] + i]] = last - from + i;
        for (int i = from; i < last; ++i)
            for (int e = s->below_start[i]; e < s->below_start[i + 1]; ++e) {
                const int j = s->below[e];
                s->place[s->entry[e]] =
                    f->panel_start[b] + (i - from)*height + (j < last ? j - from : position[j]);
            }
    }
}

static void own(analysis *s, int groups, const int *group)
{
    const dmoc_ldl *f = s->f;
    for (int g = 0; g < groups; ++g)
        for (int i = f->first[group ? group[g] : g]; i < f->first[group ? group[g + 1] : g + 1]; ++i)
            s->owner[i] = g;
    for (int i = f->chain; i < f->n; ++i)
        s->owner[i] = groups;
}

static int analyse(analysis *s)
{
    const dmoc_ldl *f = s->f;
    for (int p = 0; p < f->pivots; ++p)
        s->child[p] = -1;
    for (int i = 0; i < f->n; ++i)
        s->block_mark[i] = s->pivot_mark[i] = -1;
    own(s, f->pivots, NULL);
    transpose(s);
    for (int p = 0; p < f->pivots; ++p)
        if (!take_pivot(s, p))
            return 0;
    if (f->pivots && !close_block(s, f->pivots))
        return 0;
    own(s, f->blocks, f->block);
    for (int b = 0; b < f->blocks; ++b) {
        s->part_start[b] = s->parts.count/3;
        if (!split_rows(s, b))
            return 0;
    }
    s->part_start[f->blocks] = s->parts.count/3;
    lay_out(s);
    return 1;
}

/* Memory for numbers. */
static int make_room(dmoc_ldl *f)
{
    f->panel = calloc((size_t)f->panel_size, sizeof(double));
    f->work = calloc((size_t)f->work_size, sizeof(double));
    f->D = malloc(sizeof(double)*3*((size_t)f->pivots + 2));
    f->exchange = calloc((size_t)(f->n - f->chain) + 1, sizeof(int));
    f->product = f->work ? f->work + f->product_at : NULL;
    return f->panel && f->work && f->D && f->exchange;
}

/* Take over what has been found. */
static int finish(analysis *s)
{
    dmoc_ldl *f = s->f;
    int tallest = 0, widest = 1;
    for (int b = 0; b < f->blocks; ++b) {
        const int width = f->first[s->f->block[b + 1]] - f->first[s->f->block[b]];
        tallest = f->height[b] > tallest ? f->height[b] : tallest;
        widest = width > widest ? width : widest;
    }
    const size_t columns = (size_t)(tallest + FOUR)*(size_t)widest;
    f->panel_size = f->panel_start[f->blocks + 1] + FOUR;
    f->product_at = (int)columns, f->work_size = (int)columns + (tallest + FOUR)*FOUR;
    dmoc_part *part = malloc(sizeof(int)*((size_t)s->parts.count + 3));
    f->part = part;
    if (!part || !make_room(f))
        return 0;
    if (s->parts.count)
        memcpy(part, s->parts.at, sizeof(int)*(size_t)s->parts.count);
    f->row = s->rows.at, f->target = s->target.at;
    s->rows.at = s->target.at = NULL;
    return 1;
}

dmoc_ldl *dmoc_ldl_new(int n, int pivots, const int *first, const int *start, const int *row)
{
    dmoc_ldl *f = calloc(1, sizeof *f);
    if (!f)
        return NULL;
    f->n = n, f->entries = start[n], f->pivots = pivots, f->chain = first[pivots];
    const size_t many = (size_t)pivots + 2, unknowns = (size_t)n + 2;
    const size_t entries = (size_t)f->entries + 1;
    analysis s = {.f = f, .start = start, .row = row};
    struct {
        int **at;
        size_t count;
    } const lasting[] = {
        {&s.first, many}, {&s.block, many}, {&s.row_start, many}, {&s.part_start, many},
        {&s.height, many}, {&s.panel_start, many + 1}, {&s.place, entries},
    }, passing[] = {
        {&s.owner, unknowns}, {&s.below_start, unknowns}, {&s.below, entries}, {&s.entry, entries},
        {&s.child, many}, {&s.sibling, many}, {&s.block_mark, unknowns}, {&s.pivot_mark, unknowns},
    };
    size_t total = 0;
    for (size_t i = 0; i < sizeof passing/sizeof *passing; ++i)
        total += passing[i].count;
    int *memory = malloc(sizeof(int)*total), *next = memory, ok = memory != NULL;
    for (size_t i = 0; ok && i < sizeof passing/sizeof *passing; ++i) {
        *passing[i].at = next;
        next += passing[i].count;
    }
    for (size_t i = 0; ok && i < sizeof lasting/sizeof *lasting; ++i)
        ok = (*lasting[i].at = calloc(lasting[i].count, sizeof(int))) != NULL;
    f->first = s.first, f->block = s.block, f->row_start = s.row_start;
    f->part_start = s.part_start, f->height = s.height, f->panel_start = s.panel_start;
    f->place = s.place;
    if (ok) {
        memcpy(s.first, first, sizeof(int)*((size_t)pivots + 1));
        ok = analyse(&s) && finish(&s);
    }
    free(memory), free(s.rows.at), free(s.current.at), free(s.next.at);
    free(s.parts.at), free(s.target.at);
    if (!ok) {
        dmoc_ldl_free(f);
        return NULL;
    }
    return f;
}

dmoc_ldl *dmoc_ldl_like(const dmoc_ldl *analysed)
{
    dmoc_ldl *f = malloc(sizeof *f);
    if (!f)
        return NULL;
    *f = *analysed;
    f->shares = 1;
    if (!make_room(f)) {
        dmoc_ldl_free(f);
        return NULL;
    }
    return f;
}

void dmoc_ldl_free(dmoc_ldl *f)
{
    if (!f)
        return;
    if (!f->shares) {
        free((void *)f->first), free((void *)f->block), free((void *)f->row_start);
        free((void *)f->row), free((void *)f->part_start), free((void *)f->part);
        free((void *)f->target), free((void *)f->height), free((void *)f->panel_start);
        free((void *)f->place);
    }
    free(f->panel), free(f->D), free(f->exchange), free(f->work);
    free(f);
}
