/* proving/taylor.h and models.h at one example, whose values are known: f(a) = a^2/(1 + a) as a line
 * and as a curve, and (a + b + c) (f(a) (b + c)) (1 + b c) - 2 f(a) as a model of three durations. */
#include "models.h"

void example(const double *centre, const interval *box, line *one, double *most, curve *bent,
             double *terms);

void example(const double *centre, const interval *box, line *one, double *most, curve *bent,
             double *terms)
{
    const interval none = {0, 0}, unit = {1, 1};
    const line a = {interval_of(centre[0]), unit, none, box[0], unit, none, none};
    static Frame f;
    static model x[3], sum, rest, part, product, three;
    frame_begin(3, &f);
    for (int i = 0; i < 3; i++)
        most[i] = f.most[i] = interval_mag(interval_sub(box[i], interval_of(centre[i])));
    *one = line_mul(line_mul(a, a), line_inverse(line_add(line_of(1), a)));
    *one = line_centred(*one, interval_sub(box[0], interval_of(centre[0])));
    *bent = curve_of(*one, most[0]);
    model_zero(&f, &sum);
    model_zero(&f, &rest);
    for (int i = 0; i < 3; i++) {
        model_constant(&f, interval_of(centre[i]), x + i);
        x[i].c[1 + i] = most[i];
        model_settle(&f, x + i);
        model_add_scaled(&f, 1, x + i, &sum);
        model_add_scaled(&f, i > 0, x + i, &rest);
    }
    model_zero(&f, &part);
    model_add_curve(&f, 1, 0, bent, &rest, &part);
    model_settle(&f, &part);
    model_zero(&f, &product);
    model_add_mul(&f, -0.5, &part, &sum, &product);
    model_constant(&f, unit, &rest);
    model_add_mul(&f, 1, x + 1, x + 2, &rest);
    model_of_curve(&f, 0, bent, &part);
    model_zero(&f, &three);
    model_add_scaled(&f, -2, &part, &three);
    model_add_mul(&f, -2, &product, &rest, &three);
    memcpy(terms, three.c, sizeof(double) * 20);
    terms[20] = three.rest;
    const interval range = model_range(&three);
    terms[21] = range.lo, terms[22] = range.hi;
}

/* Rests of products of powers of x_0, from -1 to 1, that make its fourth power: of models and, after
 * them, of curves with models. */
void fourth_powers(double *rests);

void fourth_powers(double *rests)
{
    static Frame f;
    static model power[4], product;
    frame_begin(2, &f);
    model_constant(&f, interval_of(1), power);
    for (int k = 1; k < 4; k++) {
        model_zero(&f, power + k);
        model_add_curve(&f, 1, 0, &(curve){{0, 1, 0, 0}, 0}, power + k - 1, power + k);
        model_settle(&f, power + k);
    }
    for (int k = 1; k < 4; k++) {
        curve of = {{0}, 0};
        of.c[k] = 1;
        model_zero(&f, &product);
        model_add_mul(&f, -1, power + k, power + 4 - k, &product);
        rests[k - 1] = product.rest;
        model_zero(&f, &product);
        model_add_curve(&f, -1, 0, &of, power + 4 - k, &product);
        rests[k + 2] = product.rest;
    }
}
