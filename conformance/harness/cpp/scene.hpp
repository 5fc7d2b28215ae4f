// A state, laws of motion, and a scene made of them: values, increments, bounds and distances.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

namespace mushrooms {

enum Wall { ARC, BASE, LEFT, RIGHT, FLOOR, NO_WALL };
constexpr std::array<const char*, 5> WALLS = {"arc", "base", "left", "right", "floor"};

struct State {
    double t, x, y, vx, vy;
    Wall wall;  // that is left; NO_WALL in free flight
};

// A law of motion: mean + waves, or pieces of constant acceleration.
struct Law {
    struct Wave { double frequency, cos, sin; };
    struct Piece { double start, length, value, rate, acceleration; };
    double mean = 0, period = 0, start = 0;
    double high = 0, slope = 0, curvature = 0;  // bounds on |f|, |f'|, |f''|
    std::vector<Wave> waves;
    std::vector<Piece> pieces;

    size_t piece_at(double t, double& since) const {
        double tau = std::fmod(t - start, period);
        tau = start + (tau < 0 ? tau + period : tau);
        size_t i = pieces.size() - 1;
        while (i > 0 && pieces[i].start > tau) i--;
        since = std::min(tau - pieces[i].start, pieces[i].length);
        return i;
    }
    double at(double t) const {
        if (!pieces.empty()) {
            double q;
            const Piece& p = pieces[piece_at(t, q)];
            return p.value + q * (p.rate + p.acceleration * q / 2);
        }
        double sum = mean;
        for (const Wave& v : waves) sum += v.cos * std::cos(v.frequency * t) + v.sin * std::sin(v.frequency * t);
        return sum;
    }
    // f(t + s) - f(t) without cancellation; rate is f'(t + s).
    double rise(double t, double s, double& rate) const {
        double change = rate = 0;
        if (!pieces.empty()) {
            double q;
            size_t i = piece_at(t, q);
            for (s = std::fmod(s, period);; i = (i + 1) % pieces.size(), q = 0) {
                const Piece& p = pieces[i];
                double part = std::min(s, p.length - q);
                change += part * (p.rate + p.acceleration * q + p.acceleration * part / 2);
                rate = p.rate + p.acceleration * (q + part);
                if (s < p.length - q) return change;
                s -= part;
            }
        }
        for (const Wave& v : waves) {
            double k = v.frequency, half = k * s / 2, middle = k * t + half, end = k * t + k * s;
            change += 2 * std::sin(half) * (v.sin * std::cos(middle) - v.cos * std::sin(middle));
            rate += k * (v.sin * std::cos(end) - v.cos * std::sin(end));
        }
        return change;
    }
};

struct Scene {
    bool has_cap = false, has_stem = false;
    Law r, h, w, slope;
    std::optional<Law> nu;  // then w = nu r

    bool is_mushroom() const { return has_cap && has_stem; }
    double width(double t) const { return nu ? nu->at(t) * r.at(t) : w.at(t); }
    double width_rise(double t, double s, double& rate) const {
        if (!nu) return w.rise(t, s, rate);
        double r_rate, nu_rate, grown = r.rise(t, s, r_rate), change = nu->rise(t, s, nu_rate);
        double r_now = r.at(t) + grown;
        rate = nu_rate * r_now + (nu->at(t) + change) * r_rate;
        return nu->at(t) * grown + change * r_now;
    }
    double size(const State& q) const {  // of the wall that a state names, now
        double half = has_stem ? width(q.t) : 0, radius = has_cap ? r.at(q.t) : 0;
        if (q.wall == FLOOR) return h.at(q.t);
        return q.wall == LEFT || q.wall == RIGHT ? std::max(half, std::abs(q.x)) : std::max(half, radius);
    }
    double size() const { return 2 * r.high + 2 * (nu ? nu->high * r.high : w.high) + h.high; }
    bool is_in_cap(const State& q) const {
        if (!is_mushroom()) return has_cap;
        if (q.wall != NO_WALL) return q.wall == ARC || q.wall == BASE;
        return q.y > 0 || (q.y == 0 && q.vy >= 0);
    }
    std::vector<Wall> near(bool in_cap) const {  // a mushroom's base is met at y = 0, beside the mouth
        std::vector<Wall> found = in_cap ? std::vector<Wall>{ARC} : std::vector<Wall>{LEFT, RIGHT, FLOOR};
        if (!is_mushroom()) found.push_back(BASE);
        return found;
    }
    // A wall's distance, positive inside, at time t; and the rate of it along a flight.
    double distance(Wall wall, double t, double x, double y) const {
        if (wall == ARC) return r.at(t) - std::hypot(x, y);
        if (wall == FLOOR) return y + h.at(t);
        if (wall == BASE) return has_cap ? y : -y;
        return width(t) + slope.at(t) * y + (wall == LEFT ? x : -x);
    }
    double rate(Wall wall, const State& q) const {
        double rate = 0, lean = 0;
        if (wall == BASE) return has_cap ? q.vy : -q.vy;
        if (wall == ARC) return r.rise(q.t, 0, rate), rate - (q.x * q.vx + q.y * q.vy) / std::hypot(q.x, q.y);
        if (wall == FLOOR) return h.rise(q.t, 0, rate), rate + q.vy;
        width_rise(q.t, 0, rate), slope.rise(q.t, 0, lean);
        return rate + lean * q.y + slope.at(q.t) * q.vy + (wall == LEFT ? q.vx : -q.vx);
    }
    Wall nearest_wall(double t, double x, double y) const {
        double above = std::max(0.0, y), below = std::max(0.0, -y), least = INFINITY;
        double steep = has_stem ? std::hypot(1, slope.at(t)) : 1;
        Wall found = BASE;
        for (int i = ARC; i < NO_WALL; i++) {
            Wall wall = static_cast<Wall>(i);
            if ((wall == ARC && !has_cap) || (wall > BASE && !has_stem)) continue;
            double far = std::abs(distance(wall, t, x, y));
            if (wall == ARC) far += below;
            if (wall == LEFT || wall == RIGHT) far = far / steep + above;
            if (wall == BASE && is_mushroom()) far += std::max(0.0, width(t) - std::abs(x));
            if (far < least) least = far, found = wall;
        }
        return found;
    }
};

}  // namespace mushrooms
