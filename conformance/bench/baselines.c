/* Two ways in which a billiard with moving walls is usually programmed, as baselines of the benchmark.
 *
 *     cc -std=gnu11 -O3 -march=native -shared -fPIC -o baselines.so baselines.c -lm
 *
 * Event-driven: the first root of each wall function by Newton's method, the earliest wall counts. By time
 * steps: move by dt; if the new place is outside, put it back on the wall and reflect. Neither checks what it
 * finds: no residual, no order of events within rounding, no care for the wall just left. They use plain
 * doubles, absolute time, and the sin and cos of the mathematics library.
 */
#include <math.h>
#include <time.h>

enum { ARC, BASE, LEFT, RIGHT, FLOOR, NONE };
enum { CAP, STEM, MUSHROOM };
enum { CONSTANT, FOURIER, BANG_BANG };
enum { MOST_NEWTON = 30, MOST_PARTS = 400 };

/* A law of motion, in doubles throughout, as Python writes it. Fourier: `pairs` are amplitudes (cos, sin) of
 * k = 1, 2, ...; bang-bang: knots (time, value); constant: `mean`. */
typedef struct {
    double kind, n, mean, omega, pairs[512];
} Law;

/* The half width of the mouth is w = width * factor: w * 1, or nu * r. */
typedef struct {
    Law r, width, factor, h, slope;
} Laws;

typedef struct {
    double t, x, y, vx, vy, wall;
} State;

typedef struct {
    double dt;
    State after;
} Hit;

typedef struct {
    const Laws *laws;
    int table;     /* CAP, STEM or MUSHROOM */
    int parts;     /* 0: event-driven; else time steps, so many to a flight of this length */
    double length;
} Method;

/* Laws ------------------------------------------------------------------------------------------------- */

static double bang_bang(const Law *law, double t, double *rate)
{
    const double *knot = law->pairs, *last = knot + 2 * ((int)law->n - 1);
    double since = fmod(t - knot[0], last[0] - knot[0]);
    t = knot[0] + (since < 0 ? since + last[0] - knot[0] : since);
    while (knot + 2 < last && t >= knot[2])
        knot += 2;
    double leg = knot[2] - knot[0], change = knot[3] - knot[1], part = (t - knot[0]) / leg;
    if (part < 0.5) {
        *rate = 4 * change * part / leg;
        return knot[1] + 2 * change * part * part;
    }
    part = 1 - part;
    *rate = 4 * change * part / leg;
    return knot[3] - 2 * change * part * part;
}

static double at(const Law *law, double t, double *rate)
{
    double sum = law->mean;
    *rate = 0;
    if (law->kind == CONSTANT)
        return sum;
    if (law->kind == BANG_BANG)
        return bang_bang(law, t, rate);
    for (int k = 1; k <= (int)law->n; k++) {
        double a = law->pairs[2 * k - 2], b = law->pairs[2 * k - 1], k_omega = k * law->omega;
        double c = cos(k_omega * t), s = sin(k_omega * t);
        sum += a * c + b * s;
        *rate += k_omega * (b * c - a * s);
    }
    return sum;
}

static double mouth(const Laws *laws, double t, double *rate)
{
    double width_rate, factor_rate;
    double width = at(&laws->width, t, &width_rate), factor = at(&laws->factor, t, &factor_rate);
    *rate = width_rate * factor + width * factor_rate;
    return width * factor;
}

/* Walls ------------------------------------------------------------------------------------------------ */

static State moved(State q, double s)
{
    q.t += s, q.x += s * q.vx, q.y += s * q.vy;
    return q;
}

/* A wall is a function, positive inside: returns its value at q, its rate of change along the flight, and its
 * gradient. */
static double gap(const Laws *laws, int wall, const State *q, double *rate, double *gx, double *gy)
{
    double v, lean_rate;
    if (wall == ARC) {
        double r = at(&laws->r, q->t, &v);
        *gx = -2 * q->x, *gy = -2 * q->y;
        *rate = 2 * r * v + *gx * q->vx + *gy * q->vy;
        return r * r - q->x * q->x - q->y * q->y;
    }
    if (wall == FLOOR) {
        double h = at(&laws->h, q->t, &v);
        *gx = 0, *gy = 1;
        *rate = q->vy + v;
        return q->y + h;
    }
    double w = mouth(laws, q->t, &v), lean = at(&laws->slope, q->t, &lean_rate);
    *gx = wall == LEFT ? 1 : -1, *gy = lean;
    *rate = v + lean_rate * q->y + lean * q->vy + *gx * q->vx;
    return w + lean * q->y + *gx * q->x;
}

/* Reflect: v - 2 (v.n - u) n; the rate of change of the wall function is (v.n - u) times its gradient. */
static void bounce(const Laws *laws, int wall, State *q)
{
    double rate, gx, gy;
    q->wall = wall;
    if (wall == BASE) {
        q->vy = -q->vy;
        return;
    }
    gap(laws, wall, q, &rate, &gx, &gy);
    double push = 2 * rate / (gx * gx + gy * gy);
    q->vx -= push * gx, q->vy -= push * gy;
}

static int begins_in_cap(const Method *method, const State *q)
{
    if (method->table != MUSHROOM)
        return method->table == CAP;
    if (q->wall == ARC || q->wall == BASE)
        return 1;
    return q->wall == NONE && (q->y > 0 || (q->y == 0 && q->vy > 0));
}

/* Event by event --------------------------------------------------------------------------------------- */

/* Newton's method ends where a change is so small that the next one, its square, is lost in rounding. */
static double newton(const Laws *laws, int wall, const State *q, double s)
{
    double rate, gx, gy, change;
    for (int i = 0; i < MOST_NEWTON; i++) {
        State there = moved(*q, s);
        change = gap(laws, wall, &there, &rate, &gx, &gy) / rate;
        s -= change;
        if (fabs(change) <= 1e-8 * fabs(s))
            break;
    }
    return s > 0 ? s : INFINITY;
}

/* The arc: where it would be met if it moved on as it does now, |q + v s| = r + r' s, then Newton. */
static double arc_time(const Laws *laws, const State *q)
{
    double v, r = at(&laws->r, q->t, &v);
    double square = q->vx * q->vx + q->vy * q->vy - v * v, along = q->x * q->vx + q->y * q->vy - r * v;
    double inside = r * r - q->x * q->x - q->y * q->y;
    double root = sqrt(fmax(along * along + square * inside, 0));
    return newton(laws, ARC, q, (root - along) / square);
}

/* The first of the stem's walls, by Newton from where each would be met if it moved on as it does now; one
 * that does not approach, or has just been left, is not met. */
static double stem_time(const Laws *laws, const State *q, int *first)
{
    double h_rate, w_rate, lean_rate, soonest = INFINITY;
    double h = at(&laws->h, q->t, &h_rate), w = mouth(laws, q->t, &w_rate);
    double lean = at(&laws->slope, q->t, &lean_rate);
    w += lean * q->y, w_rate += lean_rate * q->y + lean * q->vy;
    double inside[] = {w + q->x, w - q->x, q->y + h};
    double rate[] = {w_rate + q->vx, w_rate - q->vx, q->vy + h_rate};
    for (int i = 0; i < 3; i++) {
        if (LEFT + i == (int)q->wall || rate[i] >= 0)
            continue;
        double s = newton(laws, LEFT + i, q, -inside[i] / rate[i]);
        if (s < soonest)
            soonest = s, *first = LEFT + i;
    }
    return soonest;
}

/* Cap and stem are convex: a flight that crosses the level of the mouth within the part has met no wall. */
static Hit next_hit(const Method *method, State q)
{
    const Laws *laws = method->laws;
    int in_cap = begins_in_cap(method, &q), wall = ARC;
    double dt = 0, rate, s;
    for (;;) {
        if (in_cap ? q.vy < 0 : q.vy > 0) {
            s = -q.y / q.vy;
            State there = moved(q, s);
            double x = fabs(there.x);
            int is_open = method->table != CAP && x < mouth(laws, there.t, &rate);
            if (is_open || (in_cap && x < at(&laws->r, there.t, &rate))) {
                q = there, q.y = 0, dt += s;
                if (method->table == MUSHROOM && is_open) {
                    in_cap = !in_cap;
                    continue;
                }
                bounce(laws, BASE, &q);
                return (Hit){dt, q};
            }
        }
        s = in_cap ? arc_time(laws, &q) : stem_time(laws, &q, &wall);
        if (s == INFINITY) {
            q.wall = NONE;
            return (Hit){INFINITY, q};
        }
        q = moved(q, s);
        bounce(laws, wall, &q);
        return (Hit){dt + s, q};
    }
}

/* Time step by time step ------------------------------------------------------------------------------- */

/* Move by dt. Returns the wall that was met, of several the first in the order of the names, or NONE. */
static int time_step(const Method *method, State *q, int *in_cap, double dt)
{
    const Laws *laws = method->laws;
    double inside, rate, gx, gy;
    *q = moved(*q, dt);
    if (*in_cap ? q->y < 0 : q->y > 0) {
        if (method->table != MUSHROOM || fabs(q->x) >= mouth(laws, q->t, &rate)) {
            q->y = 0;
            bounce(laws, BASE, q);
            return BASE;
        }
        *in_cap = !*in_cap;
    }
    for (int wall = *in_cap ? ARC : LEFT; wall <= (*in_cap ? ARC : FLOOR); wall++) {
        inside = gap(laws, wall, q, &rate, &gx, &gy);
        if (inside < 0 && rate < 0) { /* put it back along the normal: onto the arc to first order */
            double push = inside / (gx * gx + gy * gy);
            q->x -= push * gx, q->y -= push * gy;
            bounce(laws, wall, q);
            return wall;
        }
    }
    return NONE;
}

static double step_length(const Method *method, const State *q)
{
    return method->length / hypot(q->vx, q->vy) / method->parts;
}

static Hit stepped_hit(const Method *method, State q)
{
    int in_cap = begins_in_cap(method, &q), wall = NONE;
    double begin = q.t, dt = step_length(method, &q);
    for (long i = 0; i < (long)method->parts * MOST_PARTS && wall == NONE; i++)
        wall = time_step(method, &q, &in_cap, dt);
    if (wall == NONE)
        q.wall = NONE;
    return (Hit){wall == NONE ? INFINITY : q.t - begin, q};
}

/* What Python calls ------------------------------------------------------------------------------------ */

/* The next collision of each of n states; NONE and an infinite time where there is none. */
void next_hits(const Method *method, long n, const State *states, Hit *hits)
{
    for (long i = 0; i < n; i++)
        hits[i] = method->parts ? stepped_hit(method, states[i]) : next_hit(method, states[i]);
}

static long follow_one(const Method *method, State q, double t_end, long most)
{
    long n_hits = 0;
    if (!method->parts) {
        for (; n_hits < most && q.t < t_end; n_hits++) {
            q = next_hit(method, q).after;
            if (q.wall == NONE)
                break;
        }
        return n_hits;
    }
    int in_cap = begins_in_cap(method, &q);
    for (double dt = step_length(method, &q); n_hits < most && q.t < t_end;)
        n_hits += time_step(method, &q, &in_cap, dt) != NONE;
    return n_hits;
}

/* Follow each of n states to t_end or for `most` collisions, n_times; returns seconds, *n_hits in all. */
double follow(const Method *method, long n, const State *states, double t_end, long most, long n_times,
              long *n_hits)
{
    struct timespec begin, end;
    *n_hits = 0;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    for (long i = 0; i < n * n_times; i++)
        *n_hits += follow_one(method, states[i % n], t_end, most);
    clock_gettime(CLOCK_MONOTONIC, &end);
    return (double)(end.tv_sec - begin.tv_sec) + 1e-9 * (double)(end.tv_nsec - begin.tv_nsec);
}
