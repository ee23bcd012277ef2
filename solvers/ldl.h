/* Sparse symmetric indefinite factorisation P K P' = L D L' with pivots that are chosen before the
 * numbers are known.
 *
 * The unknowns are given in elimination order, as pivots of one or two unknowns followed by a
 * final group that is factorised densely with complete pivoting (ldl_dense.h). An optimal
 * control problem tells which unknown and which equation belong together as a pivot of two
 * (solvers/kkt_layout.py), so that K needs to be analysed once and pivots are not zero by their
 * structure.
 *
 * K is given by its upper triangle, by columns: start[n + 1], row[entries] with row <= column, in
 * elimination order. Consecutive pivots whose columns of L have nearly the same rows form a block,
 * which in an optimal control problem is about one time step. The columns of a block are kept as a
 * dense panel; a finished block is subtracted from the panels of those that its rows belong to
 * ("supernodal, right-looking", as in Davis, Rajamanickam & Sid-Lakhdar, A survey of direct methods
 * for sparse linear systems, 2016, section 9).
 */
#ifndef DMOC_LDL_H
#define DMOC_LDL_H

/* Rows of a block, from row `from` on, up to the next part: they are unknowns of the block `owner`
 * (the final group counts as one more block). target[at + i - from] is the position of row
 * i >= from in a column of the owner's panel. */
typedef struct {
    int owner, from, at;
} dmoc_part;

typedef struct {
    int n, entries;       /* unknowns; entries of K */
    int pivots, chain;    /* pivots, unknowns in pivots; the last n - chain unknowns are
                             the final group */
    int blocks;
    const int *first;     /* [pivots + 1] first unknown of each pivot */
    const int *block;     /* [blocks + 1] first pivot of each block */
    const int *row_start, *row; /* [blocks + 1] the unknowns below the pivots of each block, ascending */
    const int *part_start; /* [blocks + 1] */
    const dmoc_part *part;
    const int *target;
    const int *height; /* [blocks + 1] entries of a column of each panel: unknowns of the block, rows,
                         zeros up to a multiple of four */
    const int *panel_start; /* [blocks + 2] the panels by columns; the last one is the final group */
    const int *place; /* [entries] position of each entry of K in the panels */
    double *panel;    /* K, then L; of the final group what ldl_dense.h says */
    double *D;        /* [3*pivots] inverse of each pivot: (1,1), (1,2), (2,2) */
    int *exchange;    /* [n - chain] see ldl_dense.h */
    double *work;     /* the columns of a block times D, then four columns of what it subtracts;
                         or the unknowns of one */
    double *product;  /* the second part of it */
    int panel_size, work_size, product_at; /* doubles of panel and work; where the second part is */
    int positive, negative, zero; /* eigenvalues of D by sign after a factorisation; zero ones are
                                     counted twice, by the sign they are given */
    int shares; /* whether the analysis is that of another one */
} dmoc_ldl;

/* Analyse. first[pivots + 1] gives the pivots; returns NULL without memory. */
dmoc_ldl *dmoc_ldl_new(int n, int pivots, const int *first, const int *start, const int *row);
/* Another one of the same pattern, with numbers of its own and the analysis of the first, which
 * stays as long; returns NULL without memory. */
dmoc_ldl *dmoc_ldl_like(const dmoc_ldl *analysed);
void dmoc_ldl_free(dmoc_ldl *f);
/* Factorise the values[entries] of K; pivots below tiny count as zero and are replaced by it. */
void dmoc_ldl_factor(dmoc_ldl *f, const double *values, double tiny);
/* Solve K x = b in place. */
void dmoc_ldl_solve(const dmoc_ldl *f, double *x);

#endif
