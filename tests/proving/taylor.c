/* proving/taylor.h at one example, whose derivatives are known: f(a) = a^2/(1 + a) as a line, and
 * (a + b + c) (f(a) (b + c)) (1 + b c) as a jet of three durations. */
#include "taylor.h"

void example(const double *centre, const interval *box, line *one, jet *three);

void example(const double *centre, const interval *box, line *one, jet *three)
{
    const interval none = {0, 0}, unit = {1, 1};
    const line a = {interval_of(centre[0]), unit, none, box[0], unit, none, none};
    interval away[3];
    jet x[3], sum, rest, product, part;
    *one = line_mul(line_mul(a, a), line_inverse(line_add(line_of(1), a)));
    jet_zero(3, &sum);
    jet_zero(3, &rest);
    for (int i = 0; i < 3; i++) {
        away[i] = interval_sub(box[i], interval_of(centre[i]));
        jet_zero(3, x + i);
        x[i].v = box[i], x[i].v0 = interval_of(centre[i]);
        x[i].g[i] = x[i].g0[i] = unit;
        jet_add_scaled(3, &sum, 1, x + i);
        jet_add_scaled(3, &rest, i > 0, x + i);
    }
    *one = line_centred(*one, away[0]);
    jet_zero(3, &part);
    jet_add_line(3, 0, &part, *one, &rest);
    jet_zero(3, &product);
    jet_add_mul(3, &product, &part, &sum);
    jet_zero(3, &rest);
    rest.v = rest.v0 = unit;
    jet_add_mul(3, &rest, x + 1, x + 2);
    jet_zero(3, three);
    jet_add_mul(3, three, &product, &rest);
    jet_centred(3, three, away);
}
