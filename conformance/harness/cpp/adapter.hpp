// An adapter kit in C++17: an engine that was not written for protocol 1 speaks it with one call.
//
//     std::optional<mushrooms::Hit> next_hit(const mushrooms::Scene&, const mushrooms::State&);
//     int main() { return mushrooms::serve("my-engine", next_hit); }
//
// The engine returns time, place and velocity just after the next hit, however late; nothing for a particle that
// meets no wall. It may throw mushrooms::Undecided where it cannot decide: of a tie (a corner, the mouth's edge, a hit
// at t_end) a next hit tells nothing, so that the kit takes what the engine returns for its answer. The kit reads
// and checks the questions, keeps the horizon, names the wall (least |f| / |grad f| at the place of the hit),
// chains trajectories and flows, times them, and refuses what is no state of the scene. A scene is refused where
// one of N_SAMPLES instants of its period breaks it: sampling, not proof. scene.hpp has what engine and kit share;
// JSON is read by json.hpp, which another library can replace.
#pragma once
#include <cfloat>
#include <chrono>
#include <cstdio>
#include <functional>
#include <iostream>
#include <stdexcept>

#include "json.hpp"
#include "scene.hpp"

namespace mushrooms {

constexpr int N_SAMPLES = 512;
constexpr double ROUNDING = 0x1p-44;  // of the table's size: nearer to a wall, a place may be on either side of it
constexpr double ON_WALL = 0x1p-20;   // of a wall's: farther from the wall that it names, a state is not on that wall
constexpr double LARGEST = 1e100;     // beyond it squares might overflow
constexpr long MAX_COLLISIONS = 1000000, MAX_REPEAT = 1000;
constexpr size_t MAX_WAVES = 16, MAX_KNOTS = 256;
constexpr double MAX_SEQ = 0x1p53;

struct Undecided : std::runtime_error {  // answered `undecided`
    using std::runtime_error::runtime_error;
};
struct Refused : std::runtime_error {  // answered `rejected`
    using std::runtime_error::runtime_error;
};
struct Failed : std::runtime_error {  // answered as a failure of its own
    using std::runtime_error::runtime_error;
};

struct Hit {
    double t, x, y, vx, vy;
};

using Engine = std::function<std::optional<Hit>(const Scene&, const State&)>;

// Reading ----------------------------------------------------------------------------------------------

inline double number_of(const json::Value& object, const char* name) {
    if (!object.at(name).is_number()) throw Refused(std::string(name) + " is missing or no number");
    return object.at(name).number;
}

inline void read_knots(const json::Value& knots, Law& law) {
    if (knots.items.size() < 2 || knots.items.size() > MAX_KNOTS) throw Refused("there must be 2 to 256 knots");
    double t0 = 0, v0 = 0;
    for (size_t i = 0; i < knots.items.size(); i++) {
        const auto& pair = knots.items[i].items;
        if (pair.size() != 2 || !pair[0].is_number() || !pair[1].is_number()) throw Refused("a knot is no pair of numbers");
        double t = pair[0].number, v = pair[1].number;
        law.high = std::max(law.high, std::abs(v));
        if (!i) law.start = t, law.mean = v;
        else {
            if (t <= t0) throw Refused("knots must be in the order of time");
            double half = (t - t0) / 2, a = 4 * (v - v0) / (t - t0) / (t - t0);
            law.pieces.push_back({t0, half, v0, 0, a});
            law.pieces.push_back({t0 + half, t - t0 - half, (v0 + v) / 2, a * half, -a});
            law.slope = std::max(law.slope, std::abs(a * half)), law.curvature = std::max(law.curvature, std::abs(a));
        }
        t0 = t, v0 = v;
    }
    law.period = t0 - law.start;
    double back = law.period - t0, lost = (t0 - (law.period - back)) - (law.start + back);
    if (lost != 0) throw Refused("the period of the knots must be a binary64 number, exactly");
    if (v0 != law.mean) throw Refused("the last knot must have the value of the first");
    if (law.slope == 0) law.pieces.clear(), law.period = 0;
}

inline Law read_law(const json::Value& scene, const char* name) {
    const json::Value& data = scene.at(name);
    Law law;
    if (data.is_null() && !scene.has(name) && std::string(name) == "slope") return law;
    if (data.is_object() && data.at("kind").text == "bang-bang") return read_knots(data.at("knots"), law), law;
    if (!data.is_object() || data.at("kind").text != "fourier") {
        law.mean = number_of(scene, name), law.high = std::abs(law.mean);
        return law;
    }
    if (data.has("omega") == data.has("period")) throw Refused("a fourier law needs one of omega and period");
    bool by_omega = data.has("omega");
    double given = number_of(data, by_omega ? "omega" : "period"), other = 2 * M_PI / given;
    if (given <= 0) throw Refused("omega and period must be > 0");
    law.mean = number_of(data, "mean"), law.high = std::abs(law.mean);
    for (const char* part : {"cos", "sin"}) {
        if (data.has(part) && !data.at(part).is_list()) throw Refused("amplitudes must be a list");
        for (const auto& value : data.at(part).items)
            if (!value.is_number()) throw Refused("amplitudes must be numbers");
    }
    const auto &cosines = data.at("cos").items, &sines = data.at("sin").items;
    if (std::max(cosines.size(), sines.size()) > MAX_WAVES) throw Refused("cos and sin have at most 16 numbers");
    for (size_t k = 1; k <= std::max(cosines.size(), sines.size()); k++) {
        double c = k <= cosines.size() ? cosines[k - 1].number : 0, s = k <= sines.size() ? sines[k - 1].number : 0;
        double frequency = static_cast<double>(k) * (by_omega ? given : other), size = std::hypot(c, s);
        if (size == 0) continue;
        law.waves.push_back({frequency, c, s}), law.period = by_omega ? other : given;
        law.high += size, law.slope += frequency * size, law.curvature += frequency * frequency * size;
    }
    return law;
}

inline void check(const Scene& scene) {
    double period = 0, start = 0;
    Law none;
    for (const Law* law : {&scene.r, &scene.h, &scene.w, &scene.slope, scene.nu ? &*scene.nu : &none}) {
        if (law->period && period && law->period != period) throw Refused("laws that move must share one period");
        if (law->period) period = law->period, start = law->start;
    }
    for (int i = 0; i < (period ? N_SAMPLES : 1); i++) {
        double t = start + period * i / N_SAMPLES, r = scene.r.at(t), h = scene.h.at(t), w = scene.width(t);
        if (scene.has_cap && !(r > 0)) throw Refused("r must be > 0 at all times");
        if (scene.has_stem && !(h > 0 && w > 0)) throw Refused("h and w must be > 0 at all times");
        if (scene.has_stem && !(w > h * scene.slope.at(t))) throw Refused("w must be > h slope at all times");
        if (scene.is_mushroom() && (scene.nu ? scene.nu->at(t) > 1 : w > r)) throw Refused("w must be <= r at all times");
    }
}

inline Scene read_scene(const json::Value& data) {
    const std::string& table = data.at("table").text;
    Scene scene;
    scene.has_cap = table == "cap" || table == "mushroom", scene.has_stem = table == "stem" || table == "mushroom";
    if (!scene.has_cap && !scene.has_stem) throw Refused("table must be cap, stem or mushroom");
    for (const auto& field : data.fields) {
        const std::string& name = field.first;
        bool is_known = name == "table" || name == "name" || name == "notes" || (scene.has_cap && name == "r");
        is_known |= scene.has_stem && (name == "h" || name == "w" || name == "slope");
        if (!is_known && !(scene.is_mushroom() && name == "nu")) throw Refused("scene has no field " + name);
    }
    if (scene.has_cap) scene.r = read_law(data, "r");
    if (scene.has_stem) {
        if (scene.is_mushroom() && data.has("nu") == data.has("w")) throw Refused("a mushroom needs one of nu and w");
        scene.h = read_law(data, "h"), scene.slope = read_law(data, "slope");
        if (data.has("nu")) scene.nu = read_law(data, "nu");
        else scene.w = read_law(data, "w");
    }
    return check(scene), scene;
}

inline State read_state(const json::Value& data, const Scene& scene) {
    State q = {number_of(data, "t"), number_of(data, "x"), number_of(data, "y"), number_of(data, "vx"), number_of(data, "vy"), NO_WALL};
    const json::Value& wall = data.at("wall");
    if (!wall.is_null()) {
        auto found = std::find_if(WALLS.begin(), WALLS.end(), [&](const char* name) { return wall.text == name; });
        q.wall = static_cast<Wall>(found - WALLS.begin());
        bool is_absent = (q.wall == ARC && !scene.has_cap) || (q.wall > BASE && !scene.has_stem);
        if (!wall.is_text() || q.wall == NO_WALL || is_absent) throw Refused("state.wall must be null or a wall");
    }
    for (double number : {q.x, q.y, q.vx, q.vy})
        if (std::abs(number) > LARGEST) throw Undecided("numbers beyond 1e100 may overflow");
    if (q.wall == NO_WALL && q.y == 0 && !scene.is_mushroom()) q.wall = BASE;
    return q;
}

// Judging ----------------------------------------------------------------------------------------------

inline void judge(const Scene& scene, const State& q, double t_end) {
    bool has_arrived = t_end == q.t;
    if (q.wall == NO_WALL && q.y == 0 && q.vy == 0 && !has_arrived) throw Undecided("it flies along the mouth");
    bool in_cap = scene.is_in_cap(q);
    double size = scene.size() + std::abs(q.t) * (scene.r.slope + scene.h.slope + scene.w.slope);
    if (q.y == 0 && q.wall != NO_WALL && q.wall != BASE) throw Undecided("the state is in a corner");
    if (scene.is_mushroom() && q.wall == NO_WALL && q.y == 0)
        for (Wall wall : {ARC, LEFT, RIGHT})  // at which the mouth and the base end
            if (std::abs(scene.distance(wall, q.t, q.x, q.y)) <= ROUNDING * size)
                throw Undecided("the state is at the end of mouth or base within rounding");
    for (Wall wall : scene.near(in_cap)) {
        double gap = scene.distance(wall, q.t, q.x, q.y);
        if (wall == q.wall || gap > ROUNDING * size) continue;
        if (gap < -ROUNDING * size) throw Refused(std::string("the state is beyond wall ") + WALLS[wall]);
        throw Undecided(std::string("the state is within rounding of wall ") + WALLS[wall]);
    }
    if (q.wall == NO_WALL) return;
    bool is_beyond = scene.is_mushroom() && (q.wall == ARC ? q.y < 0 : q.wall > BASE && q.y > 0);
    double rate = scene.rate(q.wall, q), off = std::abs(scene.distance(q.wall, q.t, q.x, q.y)) - ON_WALL * scene.size(q);
    if (is_beyond || off > ROUNDING * size) throw Refused("the state is not on the wall that it names");
    if (off > 0) throw Undecided("the state may be on the wall that it names within rounding of its phase");
    double turns = scene.r.curvature + scene.h.curvature + scene.w.curvature + scene.slope.curvature * scene.h.high;
    if (scene.nu) turns += scene.nu->curvature * scene.r.high;
    if (q.wall == BASE) turns = 0;
    if (rate < -ROUNDING * std::abs(q.t) * turns) throw Refused("the state is on a wall and moves into it");
    if (q.wall == BASE && rate == 0 && has_arrived) return;  // it slides, and need not fly on
    if (rate <= 0) throw Undecided("the state rests on its wall, or does within rounding of its phase");
}

// Answering --------------------------------------------------------------------------------------------

// A number that returns with all its bits; "-0" would be read as an integer.
inline std::string shown(double value) {
    char text[40];
    std::snprintf(text, sizeof text, "%.17g", value);
    std::string found = text;
    return found.find_first_not_of("-0123456789") == std::string::npos ? found + ".0" : found;
}

inline std::string place(double t, double x, double y, double vx, double vy) {
    return "\"t\":" + shown(t) + ",\"x\":" + shown(x) + ",\"y\":" + shown(y) + ",\"vx\":" + shown(vx) + ",\"vy\":" + shown(vy);
}

// The fields of an outcome, or of the reason why there is none.
inline std::string outcome_of(const std::function<std::string()>& make) {
    try {
        return make();
    } catch (const Undecided& question) {
        return std::string("\"outcome\":\"undecided\",\"reason\":\"") + question.what() + '"';
    } catch (const Refused& refusal) {
        return std::string("\"outcome\":\"rejected\",\"reason\":\"") + refusal.what() + '"';
    }
}

const std::string HORIZON = "\"outcome\":\"horizon\",";

// One step: the outcome's fields, and the state after; `goes_on` where it is a collision.
inline std::string step(const Engine& engine, const Scene& scene, State& q, double t_end, bool& goes_on) {
    goes_on = false;
    return outcome_of([&] {
        judge(scene, q, t_end);
        std::optional<Hit> hit = t_end == q.t ? std::nullopt : engine(scene, q);
        if (!hit || hit->t >= t_end) {
            double s = t_end - q.t;
            return HORIZON + place(t_end, q.x + s * q.vx, q.y + s * q.vy, q.vx, q.vy);
        }
        bool is_finite = std::isfinite(hit->t + hit->x + hit->y) && std::isfinite(hit->vx + hit->vy);
        if (!is_finite || hit->t < q.t) throw Failed("the engine returned no hit: a time that has passed, or no number");
        Wall wall = scene.nearest_wall(hit->t, hit->x, hit->y);
        q = {hit->t, hit->x, wall == BASE ? 0.0 : hit->y, hit->vx, hit->vy, wall};
        goes_on = true;
        return std::string("\"outcome\":\"collision\",\"wall\":\"") + WALLS[wall] + "\"," + place(q.t, q.x, q.y, q.vx, q.vy);
    });
}

// The first captured stay in the cap, as its hits tell it.
struct Stay {
    double begin = NAN, end = NAN;  // nan: not yet
    bool is_over = false;

    void add(const Scene& scene, const State& before, const State& hit) {
        if (is_over || (std::isnan(begin) && hit.wall != ARC)) return;
        if (hit.wall == ARC && scene.is_mushroom()) {
            double spin = std::abs(hit.x * before.vy - hit.y * before.vx);
            if (spin > scene.width(hit.t) * std::hypot(before.vx, before.vy)) {
                if (std::isnan(begin)) begin = hit.t;
                end = NAN;
                return;
            }
        }
        is_over = hit.wall > BASE;
        if (!std::isnan(begin) && std::isnan(end) && hit.wall != BASE) end = hit.t;
    }
};

// One particle of a flow: followed from hit to hit up to t_end.
inline std::string arrival(const Engine& engine, const Scene& scene, const json::Value& data, double t_end) {
    Stay stay;
    std::string found = outcome_of([&] {
        State q = read_state(data, scene);
        if (t_end < q.t) throw Refused("t_end must be >= state.t");
        bool goes_on = true;
        for (long i = 0; i < MAX_COLLISIONS; i++) {
            State before = q;
            std::string last = step(engine, scene, q, t_end, goes_on);
            if (!goes_on) return last;
            stay.add(scene, before, q);
        }
        throw Undecided("there are over 1000000 collisions up to t_end");
    });
    if (found.compare(0, HORIZON.size(), HORIZON) || std::isnan(stay.begin)) return found;
    return found + ",\"captured\":[" + shown(stay.begin) + "," + shown(std::isnan(stay.end) ? t_end : stay.end) + "]";
}

inline std::string outcome(const Engine& engine, const json::Value& request) {
    const std::string& command = request.at("cmd").text;
    Scene scene = read_scene(request.at("scene"));
    if (command == "flow") {
        double t_end = number_of(request, "t_end");
        std::string states;
        if (!request.at("states").is_list()) throw Refused("states is missing or no list");
        for (const json::Value& state : request.at("states").items)
            states += (states.empty() ? "{" : ",{") + arrival(engine, scene, state, t_end) + "}";
        return "\"states\":[" + states + "]";
    }
    State start = read_state(request.at("state"), scene), q = start;
    double t_end = command == "time" ? DBL_MAX : number_of(request, "t_end");
    if (t_end < start.t) throw Refused("t_end must be >= state.t");
    bool goes_on = true;
    if (command == "step") return step(engine, scene, q, t_end, goes_on);
    double collisions = number_of(request, "collisions"), repeat = command == "time" ? number_of(request, "repeat") : 1;
    if (!(collisions >= (command == "time") && collisions <= MAX_COLLISIONS && collisions == std::floor(collisions)))
        throw Refused("collisions must be a whole number, 0 (of `time`, 1) to 1000000");
    if (!(repeat >= 1 && repeat <= MAX_REPEAT && repeat == std::floor(repeat))) throw Refused("repeat must be 1 to 1000");
    std::string steps, ns;
    for (int k = 0; k < static_cast<int>(repeat); k++) {
        auto begin = std::chrono::steady_clock::now();
        q = start, goes_on = true;
        for (long i = 0; i < static_cast<long>(collisions) && goes_on; i++) {
            std::string found = step(engine, scene, q, t_end, goes_on);
            steps = (command == "time" || steps.empty() ? "" : steps + ",") + "{" + found + "}";
        }
        auto took = std::chrono::steady_clock::now() - begin;
        ns += (k ? "," : "") + std::to_string(std::chrono::duration_cast<std::chrono::nanoseconds>(took).count());
    }
    return (command == "time" ? "\"ns\":[" + ns + "]," : "") + "\"steps\":[" + steps + "]";
}

inline std::string answer(const std::string& name, const Engine& engine, const std::string& line) {
    std::string seq = "null", refusal;
    try {
        json::Value request = json::parse(line);
        const std::string& command = request.at("cmd").text;
        const json::Value& number = request.at("seq");
        if (number.is_integer && number.number >= 0 && number.number <= MAX_SEQ) seq = std::to_string(static_cast<long long>(request.at("seq").number));
        if (command == "start")
            return "{\"protocol\":1,\"name\":\"" + name +
                   "\",\"version\":\"1\",\"language\":\"C++\",\"profiles\":[\"step\",\"trajectory\",\"flow\",\"time\"],"
                   "\"tables\":[\"cap\",\"stem\",\"mushroom\"],\"laws\":[\"constant\",\"fourier\",\"bang-bang\"]}";
        if (command == "echo") {
            std::string values;
            bool is_good = request.at("values").kind == json::Value::LIST;
            for (const json::Value& value : request.at("values").items) {
                is_good = is_good && value.is_number();
                values += (values.empty() ? "" : ",") + shown(value.number);
            }
            if (is_good) return "{\"values\":[" + values + "]}";
            throw Refused("values must be numbers");
        }
        if (command != "step" && command != "trajectory" && command != "flow" && command != "time") throw Refused("there is no such cmd");
        if (seq == "null") throw Refused("seq must be a whole number");
        return "{\"seq\":" + seq + "," + outcome(engine, request) + "}";
    } catch (const Undecided& question) {
        return "{\"seq\":" + seq + ",\"outcome\":\"undecided\",\"reason\":\"" + question.what() + "\"}";
    } catch (const Failed& failure) {
        return "{\"seq\":" + seq + ",\"error\":\"" + failure.what() + "\"}";
    } catch (const std::runtime_error& error) {  // Refused, json::Error
        refusal = error.what();
    }
    for (char& c : refusal)  // it may quote the line
        if (c == '"' || c == '\\' || static_cast<unsigned char>(c) < 0x20) c = '?';
    return "{\"seq\":" + seq + ",\"outcome\":\"rejected\",\"reason\":\"" + refusal + "\"}";
}

// Answer requests until `stop` or the end of input; returns the exit status.
inline int serve(const std::string& name, const Engine& engine) {
    std::string line;
    while (std::getline(std::cin, line)) {
        if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
        if (line.find("\"stop\"") != std::string::npos) {
            try {
                if (json::parse(line).at("cmd").text == "stop") return 0;
            } catch (const json::Error&) {
            }
        }
        std::cout << answer(name, engine, line) << std::endl;
    }
    return 0;
}

}  // namespace mushrooms
