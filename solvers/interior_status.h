/* How the interior-point method ends, and who hears of its iterations. */
#ifndef DMOC_INTERIOR_STATUS_H
#define DMOC_INTERIOR_STATUS_H

enum {
    DMOC_SOLVED, DMOC_INFEASIBLE, DMOC_ITERATION_LIMIT, DMOC_TIME_LIMIT, DMOC_STALLED,
    DMOC_INTERRUPTED, DMOC_NO_MEMORY
};

/* Called after each iteration; a result other than 0 stops. */
typedef int dmoc_report(void *user, int iteration, double cost, double violation, double mu,
                        int restoring);

#endif
