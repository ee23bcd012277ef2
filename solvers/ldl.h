/* Sparse symmetric indefinite factorisation P K P' = L D L' with pivots that are chosen before the
 * numbers are known.
 *
 * The unknowns are given in elimination order, as pivots of one or two unknowns followed by a
 * final group that is factorised densely with complete pivoting (Bunch & Parlett 1971). An optimal
 * control problem tells which unknown and which equation belong together as a pivot of two
 * (solvers/kkt_layout.py), so that K needs to be analysed once and pivots are not zero by their
 * structure.
 *
 * K is given by its upper triangle, by columns: start[n + 1], row[entries] with row <= column, in
 * elimination order. Rows of L are computed one after the other ("up-looking", as in Davis, Direct
 * Methods for Sparse Linear Systems, 2006, chapter 4).
 */
#ifndef DMOC_LDL_H
#define DMOC_LDL_H

typedef struct {
    int n, pivots, chain;    /* unknowns, pivots, unknowns in pivots; the last n - chain unknowns
                                are the final group */
    const int *start, *row;  /* pattern of K */
    int *first;              /* [pivots + 1] first unknown of each pivot */
    int *pattern_start;      /* [pivots + dense + 1] pivots that occur in each block row of L; the
                                final group has rows of one unknown */
    int *pattern;
    int *column_start;       /* [pivots + 1] entries of each block column of L: one unknown by the
                                width of the pivot */
    int *column_row;         /* row of each entry */
    int *filled;             /* [pivots] entries so far */
    double *L;               /* [2*entries] */
    double *D;               /* [3*pivots] inverse of each pivot: (1,1), (1,2), (2,2) */
    double *dense;           /* [(n - chain)^2] factors of the final group, by rows */
    int *exchange;           /* [n - chain] its permutation; a negative entry ~j marks the first of
                                two unknowns in one pivot */
    double *work;            /* [2*n] */
    int positive, negative, zero; /* eigenvalues of D by sign after a factorisation; zero ones are
                                     counted twice, by the sign they are given */
} dmoc_ldl;

/* Analyse. first[pivots + 1] gives the pivots; returns NULL without memory. */
dmoc_ldl *dmoc_ldl_new(int n, int pivots, const int *first, const int *start, const int *row);
void dmoc_ldl_free(dmoc_ldl *f);
/* Factorise the values[entries] of K; pivots below tiny count as zero and are replaced by it. */
void dmoc_ldl_factor(dmoc_ldl *f, const double *values, double tiny);
/* Solve K x = b in place. */
void dmoc_ldl_solve(const dmoc_ldl *f, double *x);

#endif
