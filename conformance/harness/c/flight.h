/* One flight to the first wall that it meets.
 *
 * Each wall is a function f(s) of the flight time s, positive inside. From a time at which f > 0, the parabola
 * with the largest curvature that the laws allow stays below f; its root is therefore a safe step, and such
 * steps walk up to the first root and never past it. What rounding leaves open (two walls at once, a graze,
 * the mouth's edge) is UNDECIDED.
 */
#pragma once
#include "laws.h"

enum { MAX_STEPS = 20000 };
enum { ARC, BASE, LEFT, RIGHT, FLOOR, N_WALLS, NOWHERE, MOUTH, HORIZON };
enum { FOUND, REJECTED, UNDECIDED };
static const double U = 0x1p-53;    /* a rounding error */
static const double SLACK = 16.0;   /* how many of them one evaluation of f may add up */
static const double LARGEST = 1e100; /* beyond it squares might overflow */
static const double LEAST = 1e-150; /* below it they vanish, and with them hits of the arc */

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

static void stop(Flight *flight, int status, const char *why) {
    if (flight->status == FOUND) flight->status = status, flight->why = why;
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

static int is_in_cap(Flight *flight, double horizon) {
    State from = flight->from;
    if (flight->table->kind != MUSHROOM) return flight->table->kind == CAP;
    if (from.wall != NOWHERE) return from.wall == ARC || from.wall == BASE;
    if (from.y == 0 && from.vy == 0 && horizon > 0) stop(flight, UNDECIDED, "it flies along the mouth");
    return from.y > 0 || (from.y == 0 && from.vy >= 0);
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

static void check_wall(Flight *flight, double horizon) {
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
    if (wall == BASE && g.slope == 0 && horizon == 0) return; /* it slides, and has arrived */
    if (g.slope <= 0) stop(flight, UNDECIDED, "it rests on its wall, or does within rounding of its phase");
}

static Event first_hit(Flight *flight, double horizon) {
    State from = flight->from;
    int inside = is_in_cap(flight, horizon);
    double begin = 0;
    check_inside(flight, inside); /* first: a corner is one whichever way the particle moves */
    check_wall(flight, horizon);
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
