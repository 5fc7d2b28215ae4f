// The kit in C++ with an engine of parabola steps: an example of what `mushrooms check` grades.
//
//     c++ -std=c++17 -O3 -o engine engine.cpp && mushrooms check -- ./engine
//
// Each wall is a function f(s) of the flight time s, positive inside. The parabola with the largest curvature that
// the laws allow stays below f; a part of the way to its root is therefore a safe step. Where f must fall through
// 0, once, within a known time, Newton steps within that bracket find the crossing.
#include "adapter.hpp"

using namespace mushrooms;

namespace {

constexpr double SHORT = 1 - 0x1p-6;  // of a safe step: at rest f is the parabola, and would be left with no sign
constexpr int MAX_STEPS = 20000;

struct Gap {
    double f, rate;
};

struct Flight {
    const Scene& scene;
    const State q;

    // f is f(0) and its change, free of cancellation; on the wall that is left f(0) is 0.
    Gap gap(Wall wall, double s) const {
        double rate = 0, lean_rate = 0, first, change, y = q.y + s * q.vy;
        if (wall == ARC) {
            double r = scene.r.at(q.t), grown = scene.r.rise(q.t, s, rate);
            double along = q.x * q.vx + q.y * q.vy, square = q.vx * q.vx + q.vy * q.vy;
            first = r * r - (q.x * q.x + q.y * q.y);
            change = grown * (2 * r + grown) - s * (2 * along + s * square);
            rate = 2 * (r + grown) * rate - 2 * (along + s * square);
        } else if (wall == BASE) {
            double up = scene.has_cap ? 1 : -1;
            first = up * q.y, change = up * s * q.vy, rate = up * q.vy;
        } else if (wall == FLOOR) {
            first = q.y + scene.h.at(q.t), change = scene.h.rise(q.t, s, rate) + s * q.vy, rate += q.vy;
        } else {
            double side = wall == LEFT ? 1 : -1, lean = scene.slope.at(q.t);
            double grown = scene.width_rise(q.t, s, rate), tilt = scene.slope.rise(q.t, s, lean_rate);
            first = scene.width(q.t) + lean * q.y + side * q.x;
            change = grown + tilt * y + s * (lean * q.vy + side * q.vx);
            rate += lean_rate * y + (lean + tilt) * q.vy + side * q.vx;
        }
        return {(wall == q.wall ? 0 : first) + change, rate};
    }

    double bend(Wall wall) const {  // a bound on |f''|
        const Law &r = scene.r, &w = scene.w, &lean = scene.slope;
        if (wall == BASE) return 0;
        if (wall == FLOOR) return scene.h.curvature;
        if (wall == ARC) return 2 * (q.vx * q.vx + q.vy * q.vy + r.slope * r.slope + r.high * r.curvature);
        double width = w.curvature;
        if (scene.nu) width = scene.nu->curvature * r.high + 2 * scene.nu->slope * r.slope + scene.nu->high * r.curvature;
        return width + lean.curvature * scene.h.high + 2 * lean.slope * std::abs(q.vy);
    }

    // The first crossing of a wall after a and up to b, or infinity.
    double first(Wall wall, double a, double b) const {
        double s = a, curve = bend(wall);
        for (int i = 0; i < MAX_STEPS && s <= b; i++) {
            Gap g = gap(wall, s);
            bool is_left = wall == q.wall && s == 0;
            if (g.f <= 0 && !is_left) break;
            double square = g.rate * g.rate - 4 * curve * g.f, root = std::sqrt(g.rate * g.rate + 2 * curve * g.f);
            if (!is_left && g.rate < 0 && square > 0) return crossing(wall, s, s + (1 + 0x1p-40) * 2 * g.f / (std::sqrt(square) - g.rate));
            if (is_left) s = curve ? g.rate / curve : INFINITY;
            else s += SHORT * (g.rate < 0 ? 2 * g.f / (root - g.rate) : curve ? (g.rate + root) / curve : INFINITY);
        }
        if (s <= b) throw Undecided("a wall is grazed within rounding, or nothing is met for long");
        return INFINITY;
    }

    double crossing(Wall wall, double a, double b) const {
        for (double s = b, next;; s = next) {
            Gap g = gap(wall, s);
            (g.f > 0 ? a : b) = s;
            next = g.rate < 0 ? s - g.f / g.rate : a;
            if (!(a < next && next < b)) next = a + (b - a) / 2;
            if (std::abs(next - s) <= 0x1p-52 * s) return next;
        }
    }
};

std::optional<Hit> next_hit(const Scene& scene, const State& q) {
    Flight flight{scene, q};
    bool in_cap = scene.is_in_cap(q), is_towards = in_cap ? q.vy < 0 : q.vy > 0;
    double speed = std::hypot(q.vx, q.vy), escape = 8 * scene.size() / speed, begin = 0;
    double mouth = scene.is_mushroom() && is_towards && q.wall != BASE ? std::max(0.0, -q.y / q.vy) : INFINITY;
    if (!(escape < LARGEST)) escape = LARGEST;
    for (;; in_cap = !in_cap, begin = mouth, mouth = INFINITY) {
        double s = std::min(mouth, escape), second = INFINITY;
        Wall wall = NO_WALL;
        for (Wall near : scene.near(in_cap)) {
            double hit = flight.first(near, begin, std::min(s, escape) * (1 + 0x1p-44));
            if (hit < s) second = s, s = hit, wall = near;
            else if (hit < second) second = hit;
        }
        if (wall == NO_WALL && mouth > escape) throw Undecided("no wall is met in the time that it takes to leave the table");
        if (second - s <= 0x1p-46 * s) throw Undecided("two walls are met within rounding");
        double x = q.x + s * q.vx, y = q.y + s * q.vy, rate, t = q.t + s;
        if (wall == NO_WALL) {
            double beside = std::abs(x) - (scene.width(q.t) + scene.width_rise(q.t, s, rate));
            if (std::abs(beside) <= 0x1p-46 * std::abs(x)) throw Undecided("the mouth's edge is met within rounding");
            if (!in_cap || beside < 0) continue;
            wall = BASE, y = 0;
        }
        double nx = 0, ny = wall == BASE && !scene.has_cap ? -1 : 1;
        if (wall == ARC) nx = -2 * x, ny = -2 * y;
        if (wall == LEFT || wall == RIGHT) nx = wall == LEFT ? 1 : -1, ny = scene.slope.at(q.t) + scene.slope.rise(q.t, s, rate);
        double factor = 2 * flight.gap(wall, s).rate / (nx * nx + ny * ny);  // f' = (v.n - u) |grad f|
        return Hit{t, x, y, q.vx - factor * nx, q.vy - factor * ny};
    }
}

}  // namespace

int main() { return serve("example-cpp", next_hit); }
