/* A stepper in C that speaks protocol 1: an example of what `mushrooms check` grades.
 *
 *     cc -O3 -o stepper stepper.c -ljansson -lm && mushrooms check -- ./stepper
 *
 * Each wall is a function f(s) of the flight time s, positive inside. From a time at which f > 0, the parabola
 * with the largest curvature that the laws allow stays below f; its root is therefore a safe step, and such
 * steps walk up to the first root and never past it. What rounding leaves open (two walls at once, a graze,
 * the mouth's edge) is answered `undecided`. Scenes are refused where one of N_SAMPLES instants of the period
 * breaks them: sampling, not proof. Scalar code on libm's sin and cos, as most people would write it.
 */
#include <float.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { MAX_WAVES = 16, MAX_PIECES = 510, MAX_STEPS = 20000, N_SAMPLES = 512 };
enum { ARC, BASE, LEFT, RIGHT, FLOOR, N_WALLS, NOWHERE, MOUTH, HORIZON };
enum { CAP = 1, STEM = 2, MUSHROOM = 3 };
enum { FOUND, REJECTED, UNDECIDED };
static const char *const WALLS[] = {"arc", "base", "left", "right", "floor"};
static const double U = 0x1p-53;    /* a rounding error */
static const double SLACK = 16.0;   /* how many of them one evaluation of f may add up */
static const double LARGEST = 1e100; /* beyond it squares might overflow */
static const double LEAST = 1e-150; /* below it they vanish, and with them hits of the arc */

typedef struct { double frequency, cos, sin; } Wave;
typedef struct { double start, length, value, rate, acceleration; } Piece;
typedef struct {
    double mean, period, start, high, slope, curvature;
    int n_waves, n_pieces;
    Wave waves[MAX_WAVES];
    Piece pieces[MAX_PIECES];
} Law;
typedef struct { int kind, has_nu; Law r, h, w, lean; } Table; /* `w` holds nu where has_nu */
typedef struct { double t, x, y, vx, vy; int wall; } State;
typedef struct { double f, slope, error; } Gap;
typedef struct {
    const Table *table;
    State from;
    double r, h, w, lean; /* at the start */
    int status;           /* the first trouble sticks */
    const char *why;
} Flight;
typedef struct { int kind, wall; double s, slope; } Event;

static char reason[256];

static int refuse(const char *what, double value, const char *bound) {
    snprintf(reason, sizeof reason, "%s = %.17g, must be %s", what, value, bound);
    return REJECTED;
}

static void stop(Flight *flight, int status, const char *why) {
    if (flight->status == FOUND) flight->status = status, flight->why = why;
}

/* Laws ------------------------------------------------------------------------------------------------- */

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

static double mouth_rise(const Flight *flight, double s, double *rate) {
    const Table *table = flight->table;
    double t = flight->from.t, change = rise(&table->w, t, s, rate);
    if (table->has_nu) {
        double r_rate, r = rise(&table->r, t, s, &r_rate), nu = flight->w / flight->r;
        *rate = *rate * (flight->r + r) + (nu + change) * r_rate;
        change = nu * r + change * (flight->r + r);
    }
    return change;
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

/* Flights ---------------------------------------------------------------------------------------------- */

/* Bound what a law may have changed by on the way to s, where it has this rate, and come back by. */
static double swing(const Law *law, double rate, double s) { return s * fmin(law->slope, fabs(rate) + s * law->curvature); }

/* f is written as f(0) plus its change; f(0) is taken out for the wall that the particle leaves. Where a law's
   argument is rounded, late in time, f moves by that of it: `late`, the part of f' that the laws make, times t. */
static Gap gap(const Flight *flight, int wall, double s) {
    const Table *table = flight->table;
    double t = flight->from.t, x = flight->from.x, y = flight->from.y, vx = flight->from.vx, vy = flight->from.vy;
    double first, size, change, moved, slope, rate, up, late = 0;
    int is_own = wall == flight->from.wall; /* it may have gone and come back: no net change is its rounding */
    if (wall == ARC) {
        double grown = rise(&table->r, t, s, &rate), square = vx * vx + vy * vy, along = x * vx + y * vy;
        first = flight->r * flight->r - (x * x + y * y);
        size = table->r.high * table->r.high + x * x + y * y;
        change = grown * (2 * flight->r + grown) - s * (2 * along + s * square);
        moved = (is_own ? swing(&table->r, rate, s) : fabs(grown)) * 2 * table->r.high + s * (2 * fabs(x * vx) + 2 * fabs(y * vy) + s * square);
        late = 2 * (flight->r + grown) * rate, slope = late - 2 * (along + s * square);
    } else if (wall == LEFT || wall == RIGHT) {
        double side = wall == LEFT ? 1 : -1, tilt_rate;
        double grown = mouth_rise(flight, s, &rate), tilt = rise(&table->lean, t, s, &tilt_rate);
        first = flight->w + flight->lean * y + side * x;
        size = mouth_bounds(table).high + table->lean.high * fabs(y) + fabs(x);
        change = grown + tilt * (y + s * vy) + s * (flight->lean * vy + side * vx);
        Law mouth = mouth_bounds(table);
        moved = is_own ? swing(&mouth, rate, s) : fabs(grown);
        moved += (is_own ? swing(&table->lean, tilt_rate, s) : fabs(tilt)) * (fabs(y) + s * fabs(vy));
        moved += s * (fabs(flight->lean * vy) + fabs(vx));
        late = rate + tilt_rate * (y + s * vy), slope = late + (flight->lean + tilt) * vy + side * vx;
    } else if (wall == FLOOR) {
        double grown = rise(&table->h, t, s, &rate);
        first = y + flight->h, size = fabs(y) + table->h.high;
        change = s * vy + grown, late = rate, slope = vy + late;
        moved = s * fabs(vy) + (is_own ? swing(&table->h, rate, s) : fabs(grown));
    } else {
        up = table->kind == STEM ? -1 : 1;
        first = up * y, size = fabs(y), change = up * s * vy, moved = s * fabs(vy), slope = up * vy;
    }
    if (is_own) first = size = late = 0;
    return (Gap){first + change, slope, SLACK * U * (size + moved + fabs(late * t))};
}

static double curvature(const Flight *flight, int wall) {
    const Table *table = flight->table;
    double vx = flight->from.vx, vy = flight->from.vy, r_slope = table->r.slope;
    switch (wall) {
    case ARC: return 2 * (vx * vx + vy * vy + table->r.high * table->r.curvature + r_slope * r_slope);
    case FLOOR: return table->h.curvature;
    case BASE: return 0;
    }
    return mouth_bounds(table).curvature + table->lean.curvature * table->h.high + 2 * table->lean.slope * fabs(vy);
}

/* Take one safe step from *s towards the first root of f; true when there, with the error of its time. */
static int advance(Flight *flight, int wall, double *s, double *slope, double *error) {
    double bend = curvature(flight, wall), root;
    Gap g = gap(flight, wall, *s);
    if (g.f > g.error) {
        root = sqrt(g.slope * g.slope + 2 * bend * g.f);
        *s += g.slope < 0 ? 2 * g.f / (root - g.slope) : bend ? (g.slope + root) / bend : INFINITY;
        return 0;
    }
    if (g.slope >= 0 || g.slope * g.slope <= 4 * bend * g.error) {
        stop(flight, UNDECIDED, "a wall is grazed or touched within rounding");
        return 0;
    }
    *s -= g.f / g.slope;
    *s -= gap(flight, wall, *s).f / g.slope;
    *slope = gap(flight, wall, *s).slope;
    *error = 2 * g.error / -g.slope + 4 * U * *s;
    return 1;
}

/* Where the search for a wall's root begins: f > f'(0) s - bend s^2 / 2 > 0 before, on the wall being left. */
static double beginning(const Flight *flight, int wall, double begin) {
    double bend = curvature(flight, wall);
    if (wall != flight->from.wall) return begin;
    return bend ? fmax(begin, 2 * gap(flight, wall, 0).slope / bend) : INFINITY;
}

static int is_in_cap(Flight *flight) {
    State from = flight->from;
    if (flight->table->kind != MUSHROOM) return flight->table->kind == CAP;
    if (from.wall != NOWHERE) return from.wall == ARC || from.wall == BASE;
    if (from.y == 0 && from.vy == 0) stop(flight, UNDECIDED, "it flies along the mouth");
    return from.y > 0 || (from.y == 0 && from.vy > 0);
}

static int is_on_base(Flight *flight, double s) {
    Law w = mouth_bounds(flight->table);
    double rate, width = flight->w + mouth_rise(flight, s, &rate);
    double x = flight->from.x, vx = flight->from.vx, beside = fabs(x + s * vx) - width;
    if (fabs(beside) <= SLACK * U * (fabs(x) + 2 * s * fabs(vx) + 2 * w.high + s * w.slope))
        stop(flight, UNDECIDED, "the mouth's edge is hit within rounding");
    return beside > 0;
}

static int has_wall(const Flight *flight, int inside, int wall) {
    if (wall == BASE) return flight->table->kind != MUSHROOM;
    return inside ? wall == ARC : wall == LEFT || wall == RIGHT || wall == FLOOR;
}

static void check_inside(Flight *flight, int inside) {
    State from = flight->from;
    /* On y = 0 the mouth ends at the sides, and the base at the arc. */
    int is_level = flight->table->kind == MUSHROOM && from.wall == NOWHERE && from.y == 0;
    for (int wall = 0; wall < N_WALLS; wall++) {
        int is_near = has_wall(flight, inside, wall);
        if (wall == from.wall || !(is_near || (is_level && wall != BASE && wall != FLOOR))) continue;
        Gap g = gap(flight, wall, 0);
        if (wall == BASE && from.wall == NOWHERE && g.f == 0 && g.slope > 0) continue;
        if (fabs(g.f) <= g.error) stop(flight, UNDECIDED, "the state is on a wall within rounding");
        if (is_near && g.f < 0) stop(flight, REJECTED, "the state is beyond a wall, must be inside the table");
    }
}

static void check_wall(Flight *flight) {
    int wall = flight->from.wall, kind = flight->table->kind;
    double y = flight->from.y;
    if (wall == NOWHERE) return;
    if ((kind == CAP && wall > BASE) || (kind == STEM && wall == ARC) || (wall == ARC && y < 0) ||
        (wall > BASE && kind == MUSHROOM && y > 0)) {
        stop(flight, REJECTED, "state.wall: there is no such wall, or not at this y");
        return;
    }
    if (kind == MUSHROOM && wall != BASE && y == 0) stop(flight, UNDECIDED, "the state is in a corner");
    flight->from.wall = NOWHERE;
    Gap g = gap(flight, wall, 0);
    flight->from.wall = wall;
    double size = wall == FLOOR ? flight->h : kind == STEM ? flight->w : flight->r; /* the wall's own, now */
    if (wall == LEFT || wall == RIGHT) size = fmax(flight->w, fabs(flight->from.x));
    double off = fabs(g.f) - 0x1p-20 * size * (wall == ARC ? 2 * size : 1);
    if (off > g.error) stop(flight, REJECTED, "state.wall: the state is not on that wall");
    if (off > 0) stop(flight, UNDECIDED, "state.wall: the state may be on that wall within rounding of its phase");
    if (g.slope < -SLACK * U * fabs(flight->from.t) * curvature(flight, wall))
        stop(flight, REJECTED, "state.wall: starts on it and moves into it");
    if (g.slope <= 0) stop(flight, UNDECIDED, "it rests on its wall, or does within rounding of its phase");
}

static Event first_hit(Flight *flight, double horizon) {
    State from = flight->from;
    int inside = is_in_cap(flight);
    double begin = 0;
    check_inside(flight, inside); /* first: a corner is one whichever way the particle moves */
    check_wall(flight);
    for (;;) {
        int leaves = inside ? from.vy < 0 : from.vy > 0;
        double level = INFINITY; /* when it reaches the level of the mouth */
        if (flight->table->kind == MUSHROOM && leaves && from.wall != BASE) level = fmax(0, -from.y / from.vy);
        Event first = {HORIZON, NOWHERE, horizon, 0}, other = {MOUTH, NOWHERE, level, 0};
        double error = 2 * U * horizon, its_error = level < INFINITY ? 4 * U * level : 0, times[N_WALLS];
        if (other.s < first.s) {
            Event e = first; first = other, other = e;
            double d = error; error = its_error, its_error = d;
        }
        for (int wall = 0; wall < N_WALLS; wall++)
            times[wall] = has_wall(flight, inside, wall) ? beginning(flight, wall, begin) : INFINITY;
        for (int i = 0; flight->status == FOUND; i++) {
            int wall = ARC; /* the one farthest behind */
            for (int w = 1; w < N_WALLS; w++) if (times[w] < times[wall]) wall = w;
            if (!(times[wall] <= (first.s + error) * (1 + 8 * U)) || times[wall] == INFINITY) break;
            if (i > MAX_STEPS) stop(flight, UNDECIDED, "no decision within the limit of steps");
            Event hit = {wall, wall, 0, 0};
            double hit_error;
            if (!advance(flight, wall, &times[wall], &hit.slope, &hit_error)) continue;
            hit.s = times[wall], times[wall] = INFINITY;
            if (hit.s < first.s) other = first, its_error = error, first = hit, error = hit_error;
            else if (hit.s < other.s) other = hit, its_error = hit_error;
            else if (hit.s - first.s <= error + hit_error) stop(flight, UNDECIDED, "three events come within rounding");
        }
        if (flight->status != FOUND) return first;
        int on_base = first.kind == MOUTH && inside && is_on_base(flight, first.s);
        int is_pair = first.kind + other.kind == MOUTH + HORIZON;
        if (other.s - first.s <= error + its_error && (on_base || !is_pair))
            stop(flight, UNDECIDED, "two events come within rounding");
        if (on_base) return (Event){BASE, BASE, first.s, from.vy};
        if (first.kind != MOUTH || flight->status != FOUND) return first;
        inside = !inside, begin = first.s;
    }
}

/* One step: moves *state on. The event says what happened; flight->status whether it did. */
static Event step(Flight *flight, const Table *table, State *state, double t_end) {
    State q = *state;
    *flight = (Flight){table, q, 0, 0, 0, 0, FOUND, ""};
    if (table->kind & CAP) flight->r = at(&table->r, q.t);
    if (table->kind & STEM) {
        flight->h = at(&table->h, q.t), flight->lean = at(&table->lean, q.t);
        flight->w = table->has_nu ? at(&table->w, q.t) * flight->r : at(&table->w, q.t);
    }
    if (fmax(fmax(fabs(q.x), fabs(q.y)), fmax(fabs(q.vx), fabs(q.vy))) > LARGEST)
        stop(flight, UNDECIDED, "numbers beyond 1e100 may overflow");
    double speed = fmax(fabs(q.vx), fabs(q.vy));
    if ((table->kind & CAP) && (flight->r < LEAST || (speed > 0 && speed < LEAST)))
        stop(flight, UNDECIDED, "squares of numbers below 1e-150 may vanish");
    Event event = first_hit(flight, t_end - q.t);
    double s = event.s, nx = 0, ny = table->kind == STEM && event.wall == BASE ? -1 : 1, rate;
    state->x += s * q.vx, state->y = event.wall == BASE ? 0 : q.y + s * q.vy;
    state->t = event.kind == HORIZON ? t_end : q.t + s, state->wall = event.wall;
    if (event.kind == HORIZON || flight->status != FOUND) return event;
    if (event.wall == ARC) nx = -2 * state->x, ny = -2 * state->y;
    if (event.wall == LEFT || event.wall == RIGHT)
        nx = event.wall == LEFT ? 1 : -1, ny = flight->lean + rise(&table->lean, q.t, s, &rate);
    double factor = 2 * event.slope / (nx * nx + ny * ny); /* v - 2 (v.n - u) n, as f' = (v.n - u) |grad f| */
    state->vx -= factor * nx, state->vy -= factor * ny;
    return event;
}

/* Requests --------------------------------------------------------------------------------------------- */

static int read_number(json_t *object, const char *name, double *value) {
    json_t *number = json_object_get(object, name);
    if (!json_is_number(number)) {
        snprintf(reason, sizeof reason, "%s is missing or no number", name);
        return REJECTED;
    }
    *value = json_number_value(number);
    return FOUND;
}

static int read_knots(json_t *knots, Law *law) {
    double t[2], v[2], first = 0;
    size_t n = json_array_size(knots);
    if (n < 2 || n > MAX_PIECES / 2 + 1) return refuse("number of knots", (double)n, "2 to 256");
    for (size_t i = 0; i < n; i++) {
        json_t *pair = json_array_get(knots, i);
        t[1] = json_number_value(json_array_get(pair, 0)), v[1] = json_number_value(json_array_get(pair, 1));
        law->high = fmax(law->high, fabs(v[1]));
        if (i && t[1] <= t[0]) return refuse("time of a knot", t[1], "later than the knot before");
        if (i) {
            double half = (t[1] - t[0]) / 2, a = 4 * (v[1] - v[0]) / ((t[1] - t[0]) * (t[1] - t[0]));
            law->pieces[law->n_pieces++] = (Piece){t[0], half, v[0], 0, a};
            law->pieces[law->n_pieces++] = (Piece){t[0] + half, t[1] - t[0] - half, (v[0] + v[1]) / 2, a * half, -a};
            law->slope = fmax(law->slope, fabs(a * half)), law->curvature = fmax(law->curvature, fabs(a));
        } else law->start = t[1], law->mean = first = v[1];
        t[0] = t[1], v[0] = v[1];
    }
    law->period = t[1] - law->start;
    if (v[1] != first) return refuse("value of the last knot", v[1], "that of the first: no jumps");
    if (law->slope == 0) law->n_pieces = 0, law->period = 0;
    return FOUND;
}

static int read_law(json_t *scene, const char *name, Law *law) {
    json_t *data = json_object_get(scene, name), *cosines, *sines;
    const char *kind = json_string_value(json_object_get(data, "kind"));
    double omega, period;
    memset(law, 0, sizeof *law);
    if (!data && strcmp(name, "slope") == 0) return FOUND;
    if (kind && strcmp(kind, "bang-bang") == 0) return read_knots(json_object_get(data, "knots"), law);
    if (!kind || strcmp(kind, "fourier") != 0) {
        int status = read_number(scene, name, &law->mean);
        return law->high = fabs(law->mean), status;
    }
    const char *given = json_object_get(data, "period") ? "period" : "omega";
    if (json_object_get(data, "period") && json_object_get(data, "omega")) return refuse("number of omega and period", 2, "1");
    if (read_number(data, "mean", &law->mean) || read_number(data, given, &period)) return REJECTED;
    if (period <= 0) return refuse(given, period, "> 0");
    omega = given[0] == 'o' ? period : 2 * M_PI / period;
    if (given[0] == 'o') period = 2 * M_PI / omega;
    law->high = fabs(law->mean);
    cosines = json_object_get(data, "cos"), sines = json_object_get(data, "sin");
    for (int k = 1; k <= MAX_WAVES; k++) {
        Wave v = {k * omega, json_number_value(json_array_get(cosines, k - 1)),
                  json_number_value(json_array_get(sines, k - 1))};
        double size = hypot(v.cos, v.sin);
        if (size == 0) continue;
        law->waves[law->n_waves++] = v, law->period = period;
        law->high += size, law->slope += k * omega * size, law->curvature += k * omega * k * omega * size;
    }
    return FOUND;
}

static int read_table(json_t *scene, Table *table) {
    static const char *const KNOWN[] = {
        "", " table name notes r ", " table name notes w h slope ", " table name notes r h w nu slope "};
    const char *kind = json_string_value(json_object_get(scene, "table")), *key;
    double period = 0, start = 0;
    json_t *value;
    table->kind = !kind ? 0 : !strcmp(kind, "cap") ? CAP : !strcmp(kind, "stem") ? STEM : !strcmp(kind, "mushroom") ? MUSHROOM : 0;
    if (!table->kind) return refuse("table", 0, "cap, stem or mushroom");
    json_object_foreach(scene, key, value) {
        char word[32];
        snprintf(word, sizeof word, " %s ", key);
        if (!strstr(KNOWN[table->kind], word)) return refuse("scene", 0, "an object without unknown fields");
    }
    table->has_nu = json_object_get(scene, "nu") != NULL;
    if (table->kind == MUSHROOM && table->has_nu == (json_object_get(scene, "w") != NULL))
        return refuse("number of nu and w", 2 * table->has_nu, "1");
    memset(&table->r, 0, sizeof(Law)), memset(&table->h, 0, sizeof(Law)), memset(&table->w, 0, sizeof(Law));
    if ((table->kind & CAP) && read_law(scene, "r", &table->r)) return REJECTED;
    if ((table->kind & STEM) && (read_law(scene, "h", &table->h) || read_law(scene, "slope", &table->lean) ||
                                 read_law(scene, table->has_nu ? "nu" : "w", &table->w)))
        return REJECTED;
    if (table->kind == CAP) memset(&table->lean, 0, sizeof(Law));
    Law *laws[] = {&table->r, &table->h, &table->w, &table->lean};
    for (int i = 0; i < 4; i++) {
        if (laws[i]->period && period && laws[i]->period != period) return refuse("period", laws[i]->period, "shared");
        if (laws[i]->period) period = laws[i]->period, start = laws[i]->start;
    }
    for (int i = 0; i < (period ? N_SAMPLES : 1); i++) {
        double t = start + period * i / N_SAMPLES, r = at(&table->r, t), h = at(&table->h, t), w = mouth_at(table, t);
        if ((table->kind & CAP) && r <= 0) return refuse("r", r, "> 0 at all times");
        if ((table->kind & STEM) && h <= 0) return refuse("h", h, "> 0 at all times");
        if ((table->kind & STEM) && w <= 0) return refuse("w", w, "> 0 at all times");
        if (table->has_nu && at(&table->w, t) > 1) return refuse("nu", at(&table->w, t), "<= 1 at all times");
        if (table->kind == MUSHROOM && !table->has_nu && w > r) return refuse("w", w, "<= r at all times");
        if ((table->kind & STEM) && w <= h * at(&table->lean, t)) return refuse("w", w, "> h slope at all times");
    }
    return FOUND;
}

static int read_state(json_t *request, State *state, double *t_end) {
    json_t *data = json_object_get(request, "state"), *wall = json_object_get(data, "wall");
    if (read_number(data, "t", &state->t) || read_number(data, "x", &state->x) || read_number(data, "y", &state->y) ||
        read_number(data, "vx", &state->vx) || read_number(data, "vy", &state->vy))
        return REJECTED;
    if (wall && !json_is_null(wall) && !json_is_string(wall)) return refuse("state.wall", 0, "null or the name of a wall");
    state->wall = json_is_string(wall) ? 0 : NOWHERE;
    while (state->wall < N_WALLS && strcmp(WALLS[state->wall], json_string_value(wall))) state->wall++;
    if (state->wall == N_WALLS) return refuse("state.wall", 0, "null or the name of a wall");
    *t_end = DBL_MAX;
    if (strcmp(json_string_value(json_object_get(request, "cmd")), "time") && read_number(request, "t_end", t_end))
        return REJECTED;
    return *t_end < state->t ? refuse("t_end", *t_end, ">= state.t") : FOUND;
}

static int read_count(json_t *request, const char *name, double least, double *count) {
    if (read_number(request, name, count)) return REJECTED;
    return *count >= least && *count <= 0x1p53 && *count == floor(*count) ? FOUND : refuse(name, *count, "a whole number, and not less");
}

/* A number that returns with all its bits; "-0" would be read as an integer. */
static void print_number(const char *name, double value) {
    char text[40];
    snprintf(text, sizeof text, "%.17g", value);
    printf("%s%s%s", name, text, strspn(text, "-0123456789") == strlen(text) ? ".0" : "");
}

static void print_outcome(const Flight *flight, const Event *event, const State *state) {
    if (flight->status != FOUND) {
        printf("\"outcome\":\"%s\",\"reason\":\"%s\"", flight->status == REJECTED ? "rejected" : "undecided", flight->why);
        return;
    }
    if (event->kind == HORIZON) printf("\"outcome\":\"horizon\"");
    else printf("\"outcome\":\"collision\",\"wall\":\"%s\"", WALLS[event->wall]), print_number(",\"dt\":", event->s);
    print_number(",\"t\":", state->t), print_number(",\"x\":", state->x), print_number(",\"y\":", state->y);
    print_number(",\"vx\":", state->vx), print_number(",\"vy\":", state->vy);
}

static void answer(json_t *request, const char *command) {
    static Table table;
    State start, state;
    Flight flight;
    Event event;
    double t_end, seq, n = 0, repeat = 0;
    int is_step = strcmp(command, "step") == 0, is_time = strcmp(command, "time") == 0;
    if (read_count(request, "seq", 0, &seq)) {
        printf("{\"seq\":null,\"outcome\":\"rejected\",\"reason\":\"%s\"}\n", reason);
        return;
    }
    printf("{\"seq\":%.0f,", seq);
    if (!is_step && !is_time && strcmp(command, "trajectory")) {
        printf("\"outcome\":\"rejected\",\"reason\":\"there is no such cmd\"}\n");
        return;
    }
    if (read_table(json_object_get(request, "scene"), &table) || read_state(request, &start, &t_end) ||
        (!is_step && read_count(request, "collisions", is_time, &n)) ||
        (is_time && read_count(request, "repeat", 1, &repeat))) {
        printf("\"outcome\":\"rejected\",\"reason\":\"%s\"}\n", reason);
        return;
    }
    state = start;
    if (is_step) {
        event = step(&flight, &table, &state, t_end);
        print_outcome(&flight, &event, &state);
    } else if (!is_time) {
        printf("\"steps\":[");
        for (double i = 0; i < n; i++) {
            event = step(&flight, &table, &state, t_end);
            printf(i ? ",{" : "{"), print_outcome(&flight, &event, &state), printf("}");
            if (flight.status != FOUND || event.kind == HORIZON) break;
        }
        printf("]");
    } else {
        printf("\"ns\":[");
        for (double k = 0; k < repeat; k++) {
            struct timespec begin, end;
            state = start;
            clock_gettime(CLOCK_MONOTONIC, &begin);
            for (double i = 0; i < n; i++) {
                event = step(&flight, &table, &state, t_end);
                if (flight.status != FOUND || event.kind == HORIZON) break;
            }
            clock_gettime(CLOCK_MONOTONIC, &end);
            printf("%s%lld", k ? "," : "",
                   (end.tv_sec - begin.tv_sec) * 1000000000LL + (end.tv_nsec - begin.tv_nsec));
        }
        printf("],\"steps\":[{"), print_outcome(&flight, &event, &state), printf("}]");
    }
    printf("}\n");
}

int main(void) {
    char *line = NULL;
    size_t room = 0, i;
    while (getline(&line, &room, stdin) > 0) {
        json_t *request = json_loads(line, JSON_DECODE_INT_AS_REAL, NULL), *value, *values;
        const char *command = json_string_value(json_object_get(request, "cmd"));
        if (!command) printf("{\"seq\":null,\"outcome\":\"rejected\",\"reason\":\"no JSON object with a cmd\"}\n");
        else if (strcmp(command, "stop") == 0) return 0;
        else if (strcmp(command, "start") == 0)
            printf("{\"protocol\":1,\"name\":\"example-c\",\"version\":\"1.0\",\"language\":\"C\","
                   "\"profiles\":[\"step\",\"trajectory\",\"time\"],\"tables\":[\"cap\",\"stem\",\"mushroom\"],"
                   "\"laws\":[\"constant\",\"fourier\",\"bang-bang\"]}\n");
        else if (strcmp(command, "echo") == 0) {
            int is_good = json_is_array(values = json_object_get(request, "values"));
            json_array_foreach(values, i, value) is_good = is_good && json_is_number(value);
            printf(is_good ? "{\"values\":[" : "{\"seq\":null,\"outcome\":\"rejected\",\"reason\":\"values must be numbers\"}\n");
            if (is_good) {
                json_array_foreach(values, i, value) print_number(i ? "," : "", json_number_value(value));
                printf("]}\n");
            }
        } else answer(request, command);
        fflush(stdout);
        json_decref(request);
    }
    return 0;
}
