/* A stepper in C that speaks protocol 1: an example of what `mushrooms check` grades.
 *
 *     cc -O3 -o stepper stepper.c -ljansson -lm && mushrooms check -- ./stepper
 *
 * Here requests are read and answered; laws.h has the laws of motion, flight.h finds the collisions. Scenes are
 * refused where one of N_SAMPLES instants of the period breaks them: sampling, not proof. Scalar code on libm's
 * sin and cos, as most people would write it.
 */
#include <float.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "flight.h"

enum { N_SAMPLES = 512 };
static const char *const WALLS[] = {"arc", "base", "left", "right", "floor"};

static char reason[256];

static int refuse(const char *what, double value, const char *bound) {
    snprintf(reason, sizeof reason, "%s = %.17g, must be %s", what, value, bound);
    return REJECTED;
}

static int read_number(json_t *object, const char *name, double *value) {
    json_t *number = json_object_get(object, name);
    if (!json_is_number(number)) {
        snprintf(reason, sizeof reason, "%s is missing or no number", name);
        return REJECTED;
    }
    *value = json_number_value(number);
    return FOUND;
}

static int are_numbers(json_t *list) {
    json_t *value;
    size_t i;
    if (!json_is_array(list)) return 0;
    json_array_foreach(list, i, value) if (!json_is_number(value)) return 0;
    return 1;
}

static int read_knots(json_t *knots, Law *law) {
    double t[2], v[2], first = 0;
    size_t n = json_array_size(knots);
    if (n < 2 || n > MAX_PIECES / 2 + 1) return refuse("number of knots", (double)n, "2 to 256");
    for (size_t i = 0; i < n; i++) {
        json_t *pair = json_array_get(knots, i);
        if (json_array_size(pair) != 2 || !are_numbers(pair)) return refuse("a knot", 0, "a pair of numbers");
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
    double back = law->period - t[1], lost = (t[1] - (law->period - back)) - (law->start + back);
    if (lost != 0) return refuse("period of the knots", law->period, "a binary64 number, exactly");
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
    if ((cosines && !are_numbers(cosines)) || (sines && !are_numbers(sines))) return refuse("amplitudes", 0, "numbers");
    size_t n = fmax(json_array_size(cosines), json_array_size(sines));
    if (n > MAX_WAVES) return refuse("number of amplitudes", (double)n, "at most 16");
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
