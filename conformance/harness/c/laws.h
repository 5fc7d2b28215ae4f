/* Laws of motion, and a table made of them: values, increments and bounds. */
#pragma once
#include <math.h>

enum { MAX_WAVES = 16, MAX_PIECES = 510 };
enum { CAP = 1, STEM = 2, MUSHROOM = 3 };

typedef struct { double frequency, cos, sin; } Wave;
typedef struct { double start, length, value, rate, acceleration; } Piece;
typedef struct {
    double mean, period, start, high, slope, curvature; /* bounds on |f|, |f'|, |f''| */
    int n_waves, n_pieces;
    Wave waves[MAX_WAVES];
    Piece pieces[MAX_PIECES];
} Law;
typedef struct { int kind, has_nu; Law r, h, w, lean; } Table; /* `w` holds nu where has_nu */

static int piece_at(const Law *law, double t, double *since) {
    double tau = fmod(t - law->start, law->period);
    int i = law->n_pieces - 1;
    tau = law->start + (tau < 0 ? tau + law->period : tau);
    while (i > 0 && law->pieces[i].start > tau) i--;
    *since = fmin(tau - law->pieces[i].start, law->pieces[i].length);
    return i;
}

static double at(const Law *law, double t) {
    double sum = law->mean;
    if (law->n_pieces) {
        double q;
        const Piece *p = &law->pieces[piece_at(law, t, &q)];
        return p->value + q * (p->rate + p->acceleration * q / 2);
    }
    for (const Wave *v = law->waves; v < law->waves + law->n_waves; v++)
        sum += v->cos * cos(v->frequency * t) + v->sin * sin(v->frequency * t);
    return sum;
}

/* f(t + s) - f(t) without cancellation; *rate is f'(t + s). */
static double rise(const Law *law, double t, double s, double *rate) {
    double change = *rate = 0;
    if (law->n_pieces) {
        double q;
        int i = piece_at(law, t, &q);
        s = fmod(s, law->period);
        for (;; i = (i + 1) % law->n_pieces, q = 0) {
            const Piece *p = &law->pieces[i];
            double part = fmin(s, p->length - q);
            change += part * (p->rate + p->acceleration * q + p->acceleration * part / 2);
            *rate = p->rate + p->acceleration * (q + part);
            if (s < p->length - q) return change;
            s -= part;
        }
    }
    for (const Wave *v = law->waves; v < law->waves + law->n_waves; v++) {
        double k = v->frequency, half = k * s / 2, middle = k * t + half, end = k * t + k * s;
        change += 2 * sin(half) * (v->sin * cos(middle) - v->cos * sin(middle));
        *rate += k * (v->sin * cos(end) - v->cos * sin(end));
    }
    return change;
}

/* The mouth: w, or nu r. */
static double mouth_at(const Table *table, double t) {
    return table->has_nu ? at(&table->w, t) * at(&table->r, t) : at(&table->w, t);
}

static Law mouth_bounds(const Table *table) {
    Law w = {.high = table->w.high, .slope = table->w.slope, .curvature = table->w.curvature};
    if (table->has_nu) {
        w.curvature = w.curvature * table->r.high + 2 * w.slope * table->r.slope + w.high * table->r.curvature;
        w.slope = w.slope * table->r.high + w.high * table->r.slope;
        w.high *= table->r.high;
    }
    return w;
}
