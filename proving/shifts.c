/* See shifts.h. */
#include "shifts.h"

#include "interval_functions.h"

static line of_constant(const double *bounds)
{
    return line_constant((interval){bounds[0], bounds[1]});
}

void shifts_over(const Shifts *s, interval centre, interval range, line *values)
{
    const interval one = {1, 1}, none = {0, 0}, away = interval_sub(range, centre);
    const line time = {centre, one, none, range, one, none, none};
    line done[MOST_OPERATIONS];
    for (int i = 0; i < s->operations; i++) {
        const int *op = s->operation + 3 * i;
        const line a = op[0] < CONSTANT ? done[op[1]] : time;
        line *to = done + i;
        switch (op[0]) {
        case SUM: *to = line_add(a, done[op[2]]); break;
        case PRODUCT: *to = line_mul(a, done[op[2]]); break;
        case POWER: *to = line_function(a, of_power(a.v0, done[op[2]].v), of_power(a.v, done[op[2]].v)); break;
        case NEGATIVE: *to = line_scaled(a, -1); break;
        case SQUARE: *to = line_sqr(a); break;
        case INVERSE: *to = line_inverse(a); break;
        case ROOT: *to = line_function(a, of_sqrt(a.v0), of_sqrt(a.v)); break;
        case SINE: *to = line_function(a, of_sin(a.v0), of_sin(a.v)); break;
        case COSINE: *to = line_function(a, of_cos(a.v0), of_cos(a.v)); break;
        case EXPONENTIAL: *to = line_function(a, of_exp(a.v0), of_exp(a.v)); break;
        case LOGARITHM: *to = line_function(a, of_log(a.v0), of_log(a.v)); break;
        case ARCTANGENT: *to = line_function(a, of_atan(a.v0), of_atan(a.v)); break;
        case CONSTANT: *to = of_constant(s->constant + 2 * i); break;
        default: *to = time;
        }
        *to = line_centred(*to, away);
    }
    for (int i = 0; i < s->shifts; i++)
        values[i] = done[s->result[i]];
}
