/* Parts of the interior-point method alone, with the functions that their files keep to themselves:
 * one number a line.
 */
#include "interior_search.c"
#include "interior_system.c"

#include <stdio.h>

/* What the filter of the line search takes and refuses. */
static void filter_entries(void)
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
}

/* The longest steps of one unknown, whose distance from each bound is 1, and of a slack of 1. */
static void longest_steps(double tau, double dx, double ds)
{
    double lo[] = {-1, 0}, up[] = {1, INFINITY}, v[] = {0, 1}, zl[] = {1, 1}, zu[] = {1, 0};
    double stretch[] = {INFINITY}, step[] = {dx, ds}, upper[] = {dx, 0}, still[] = {0, 0};
    solver s = {.n = 1, .nv = 2, .tau = tau, .lo = lo, .up = up, .stretch = stretch};
    s.now.v = v, s.now.zl = zl, s.now.zu = zu;
    printf("%.17g\n", longest_primal(&s, step));
    s.dzl = step, s.dzu = still;
    printf("%.17g\n", longest_dual(&s));
    s.dzl = still, s.dzu = upper;
    printf("%.17g\n", longest_dual(&s));
}

/* An unknown with the curvature 3 and sigma 1, and a row 2 x - s with the slack's sigma 1/2: what a
 * Newton step leaves of the equations of both and of the row. */
static void newton_step(void)
{
    const int place[] = {0, 1}, start[] = {0, 1, 3}, row[] = {0, 0, 1}, first[] = {0};
    const int diagonal[] = {0, 2};
    const dmoc_options options = {0};
    const dmoc_kkt kkt = {2, 0, place, start, row, first, NULL, NULL, diagonal};
    double size[] = {1}, sigma[] = {1, 0.5}, dual[] = {0.7, 0.2}, pull[] = {0.3, 0.05};
    double residual[] = {0.75}, base[] = {3, 0}, K[] = {0, 2, 0}, rest[2];
    double right[2], solution[2], change[2], dv[2], dy[1];
    solver s = {.kkt = &kkt, .n = 1, .m = 1, .slacks = 1, .nv = 2, .size = size, .sigma = sigma};
    s.options = &options;
    s.dual = dual, s.pull = pull, s.K = K, s.rest = rest;
    s.right = right, s.solution = solution, s.change = change;
    s.ldl = dmoc_ldl_new(2, 0, first, start, row);
    factor(&s, base);
    ip_newton_step(&s, residual, dv, dy);
    printf("%.17g\n", 4*dv[0] + 2*dy[0] + 1);
    printf("%.17g\n", 0.5*dv[1] - dy[0] + 0.25);
    printf("%.17g\n", 2*dv[0] - dv[1] + 0.75);
    /* Factors of 1 for a matrix of 3: the correction -2 of the solution 1 doubles the residual. */
    K[0] = K[2] = 1, K[1] = 0;
    dmoc_ldl_factor(s.ldl, K, TINY_PIVOT);
    K[0] = K[2] = 3;
    right[0] = 1, right[1] = 0;
    printf("%.17g\n", ip_solve_linear(&s));
    printf("%.17g\n", solution[0]);
    dmoc_ldl_free(s.ldl);
}

int main(void)
{
    filter_entries();
    longest_steps(0.75, -3, -6);
    longest_steps(0.75, 3, -0.5);
    newton_step();
    return 0;
}
