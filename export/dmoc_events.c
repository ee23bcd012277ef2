/* What tells that an event has happened: gaps, switches and ends of surfaces at states at the time
 * 0, and their rates where nothing accelerates. */
#include "dmoc_inside.h"

/* A function of positions by surface and its rate. */
static void along(const dmoc_solver *s, const dmoc_entry *function, const dmoc_entry *of_rates,
                  int surface, const double *q, const double *v, double *value, double *rate)
{
    const double time = 0;
    double *values = s->work, *parameters = values + s->c->places.nc;
    carried_parameters(s, 0, parameters);
    const double *there[DMOC_MOST] = {q, &time, parameters};
    const double *moving[DMOC_MOST] = {q, v, &time, parameters};
    carried_call(function, there, values, NULL);
    *value = values[surface];
    carried_call(of_rates, moving, values, NULL);
    *rate = values[surface];
}

static void gap_of(const dmoc_solver *s, int surface, const double *q, const double *v,
                   double *gap, double *rate)
{
    along(s, s->c->places.surface, s->c->places.gap_rate, surface, q, v, gap, rate);
}

/* The value of a switch, and its rate without acceleration. */
static void switch_of(const dmoc_solver *s, int number, const double *q, const double *v,
                      double *value, double *rate)
{
    const dmoc_places *places = &s->c->places;
    const dmoc_functions *f = &places->crossing;
    const double time = 0;
    double *values = s->work, *slopes = values + f->count, *parameters = slopes + f->entries;
    carried_parameters(s, 0, parameters);
    const double *in[DMOC_MOST] = {q, v, &time, parameters};
    carried_call(f->rates, in, values, NULL);
    carried_call(f->slopes, in, slopes, NULL);
    *value = values[number], *rate = 0;
    for (int e = 0; e < f->entries; ++e) {
        const int column = f->column[e], n = places->nq;
        if (f->row[e] == number && (column < n || column == 2*n))
            *rate += slopes[e]*(column < n ? v[column] : 1);
    }
}

/* How far a contact is past an end of its surface, and the rate. */
static void past_of(const dmoc_solver *s, int surface, const double *q, const double *v,
                    double *past, double *rate)
{
    along(s, s->c->places.within, s->c->places.within_rate, surface, q, v, past, rate);
    *past = -*past, *rate = -*rate;
}

void carried_event(const dmoc_solver *s, int kind, int number, const double *q, const double *v,
                   double *value, double *rate)
{
    (kind == DMOC_OF_SWITCH ? switch_of : kind == DMOC_OF_END ? past_of : gap_of)(s, number, q, v,
                                                                                  value, rate);
}
