// One emergency stop, marched along a path from its command on.
//
// Source: Braking (7), (8), (12), with v dv = −a(θ(s), v_i) ds along the varying slope; the dead
// time at held speed comes first. Within a step the deceleration is that of its middle, so v² is
// linear: exact for forces that are linear in station, second order for the motion terms.
#pragma once

#include <span>

#include "candidate_rows.hpp"
#include "generated/laws.hpp"
#include "profile/time_optimal.hpp"
#include "vehicle.hpp"

namespace slopewise {

static_assert(laws::motion_value_count <= most_motion_values);

// One path as a stop is marched along it.
struct StopStation {
  double station, grade, sin_grade;                   // [m], [rad], [1]
  double lower_slope, lower_intercept;                // bounds of F_b/W [s/m], [1]
  double upper_slope, upper_intercept;
  double dead_time, shortest_dead_time;  // from command to onset, of the surfaces there [s]
  double slowest;    // speed below which the force no longer changes [m/s]
  double upright;    // cos(roll) cos(grade)
  double tilt;       // cos(grade) sin(roll), positive where it falls away from the turn
  double lean;       // by how much v² adds to that [s²/m²]
  double falls;      // share of the load that v² takes [s²/m²]
  double bend;       // |curvature| [1/m]
  double yaw;        // heading, without jumps [rad]
};
using StopPath = std::span<const StopStation>;

// What a stop has to keep.
struct StopConditions {
  const MotionTerms& motion;
  const Vehicle& vehicle;
  double target;   // the vehicle must stand here [m]
  double height;   // the stop may fall by this much further than the map says [m]
  double watched;  // behind it no load can run short, and the target is known to be kept [m]
};

enum class Ending { stopped, overrun, rear_load, side_load };

struct StopEnd {
  Ending how;
  double where;  // [m]; of an overrun extrapolated from the first station behind the target
};

namespace detail {

// Steps of a stop in a segment [1]: v² is close to linear within, halves keep its error below 1 mm.
inline constexpr double substeps = 2.0;
// Share kept free under brakes for what changes within half a step [1].
inline constexpr double load_guard = 5e-4;
// No step is shorter [m]; nor is a speed that divides lower [m/s].
inline constexpr double least_step = 1e-3;

// Where a stop is, and what of it the next step needs.
struct StopState {
  double energy;    // v² [m²/s²]
  double previous;  // deceleration in the step before [m/s²]
  double force;     // that has built up, over the weight
  double heat;      // of the brakes [J/kg]
};

// Least loads of the rear axle, and of sides and wheels; shares of the weight.
struct LeastLoads {
  double rear, wheel;
};

// A share of the way from one station to the next.
struct Between {
  const StopStation &here, &ahead;
  double u;

  [[nodiscard]] double operator()(double StopStation::* row) const noexcept {
    return (1.0 - u) * (here.*row) + u * (ahead.*row);
  }
  // F_b/W for a speed at onset.
  [[nodiscard]] double force(double speed, double StopStation::* slope,
                             double StopStation::* intercept) const noexcept {
    return speed * (*this)(slope) + (*this)(intercept);
  }
  // Sine of a linear grade.
  [[nodiscard]] double sine() const noexcept {
    const double turn = ahead.grade - here.grade;
    return (*this)(&StopStation::sin_grade) * (1.0 + 0.5 * u * (1.0 - u) * turn * turn);
  }
};

// Loads at a station at a held speed.
inline LeastLoads held_loads(const StopStation& at, double energy, const Vehicle& v) noexcept {
  const double up = at.upright - at.falls * energy;
  const double rear = up + v.rear_lever * at.sin_grade;
  const double axle = min_of(rear, up - v.front_lever * at.sin_grade);
  const double side = up - v.side_lever * std::fabs(at.tilt + at.lean * energy);
  return {rear, min_of(side, axle + side - up)};
}

// Force of the brakes over one piece of a stop, over the weight: pressure builds it up, hot pads
// reduce it, friction caps it.
inline double brake(const MotionTerms& motion, double wanted, double up, double piece,
                    double seconds, StopState& state) noexcept {
  double applied = wanted;
  if (motion.lag > 0.0) {
    const double decay = std::exp(-0.5 * seconds / motion.lag);
    applied = wanted + (state.force - wanted) * decay;
    state.force = wanted + (state.force - wanted) * decay * decay;
  }
  if (motion.fade > 0.0) applied /= 1.0 + motion.fade * state.heat;
  applied = min_of(applied, motion.friction * up);
  if (motion.fade > 0.0) {
    state.heat += gravity * max_of(applied, 0.0) * piece -
                  state.heat * min_of(seconds / motion.fade_tau, 1.0);
  }
  return applied;
}

// One piece of a stop, by what acts in its middle; `v_i` is the speed at onset. Leaves the
// deceleration in `state.previous`.
inline LeastLoads slow_down_over(const Between& middle, double piece, double v_i,
                                 const StopConditions& conditions, StopState& state) noexcept {
  const MotionTerms& motion = conditions.motion;
  const Vehicle& v = conditions.vehicle;
  const double speed = std::sqrt(max_of(state.energy - state.previous * piece, 0.0));
  const double wanted =
      middle.force(v_i, &StopStation::lower_slope, &StopStation::lower_intercept);
  double up = middle(&StopStation::upright);
  const double seconds = piece / max_of(speed, least_step);
  const double applied = brake(motion, wanted, up, piece, seconds, state);
  double a = gravity * (applied + middle.sine());
  double upper = min_of(
      middle.force(v_i, &StopStation::upper_slope, &StopStation::upper_intercept),
      motion.friction * up);
  if (motion.moves) {
    const double bend = middle(&StopStation::bend), yaw = middle(&StopStation::yaw);
    const double* values = motion.values.data();
    const double fastest = std::sqrt(state.energy);
    a += laws::motion_deceleration(speed, bend, yaw, values);
    upper += max_of(laws::motion_deceleration(fastest, bend, yaw, values), 0.0) / gravity;
  }
  // The load lost over a crest is that at the fastest end of the piece.
  up -= middle(&StopStation::falls) * state.energy;
  const double rear = up - v.rear_lever * upper;
  const double side = up - v.side_lever * std::fabs(middle(&StopStation::tilt) +
                                                    middle(&StopStation::lean) * state.energy);
  state.previous = a;
  return {rear, min_of(side, rear + side - up)};
}

// Where a held speed leads: the segment in which the brakes take hold, or at whose start a side or
// wheel lifts, and the least loads up to there.
struct Held {
  std::size_t segment;
  LeastLoads least;
};

inline Held hold_speed(std::size_t k, double onset, double energy, StopPath path,
                       const Vehicle& v) noexcept {
  Held held{k, held_loads(path[k], energy, v)};
  for (std::size_t i = k + 1; i < path.size(); held.segment = i++) {
    if (path[i].station > onset || held.least.wheel < v.min_load) break;
    const LeastLoads loads = held_loads(path[i], energy, v);
    held.least = {min_of(held.least.rear, loads.rear), min_of(held.least.wheel, loads.wheel)};
  }
  return held;
}

// Are loads enough at a station on any stop from up to a speed, braking or not?
inline bool is_loaded(const StopStation& at, double speed, const Vehicle& v) noexcept {
  const double energy = speed * speed, up = at.upright - at.falls * energy;
  const double braking = speed * at.upper_slope + at.upper_intercept;
  const double held = min_of(v.rear_lever * at.sin_grade, -v.front_lever * at.sin_grade);
  const double axle = up + min_of(held, -v.rear_lever * braking);
  const double tilt = max_of(std::fabs(at.tilt), std::fabs(at.tilt + at.lean * energy));
  const double side = up - v.side_lever * tilt;
  return min_of(min_of(axle, side), axle + side - up) >= v.min_load + load_guard;
}

// Are loads enough all the way of a stop from station k, up to its end or `watched`, even if it kept
// its speed? Of stops that the brakes alone decide.
inline bool is_loaded_throughout(std::size_t k, double speed, StopPath path,
                          const StopConditions& conditions) noexcept {
  const double v_i = max_of(speed, path[k].slowest);
  const auto force = [v_i](const StopStation& at) {
    return v_i * at.lower_slope + at.lower_intercept;
  };
  double energy = speed * speed, onset = path[k].station + speed * path[k].dead_time;
  for (std::size_t i = k; is_loaded(path[i], v_i, conditions.vehicle); ++i) {
    if (energy <= 0.0 || path[i].station > conditions.watched || i + 1 == path.size()) return true;
    // Between stations neither force nor sine is below the lower end.
    const StopStation &here = path[i], &ahead = path[i + 1];
    const double least =
        min_of(force(here), force(ahead)) + min_of(here.sin_grade, ahead.sin_grade);
    if (least <= 0.0) return false;
    const double braked = ahead.station - max_of(here.station, onset);
    energy -= 2.0 * gravity * least * max_of(braked, 0.0);
  }
  return false;
}

// Length of the next step in a segment [m].
inline double next_piece(double left, double length, double energy, double lag) noexcept {
  const double piece = min_of(left, max_of(length / substeps, least_step));
  // A force that builds up is followed in shares of its time constant.
  return lag > 0.0 ? min_of(piece, max_of(0.2 * lag * std::sqrt(energy), least_step)) : piece;
}

// Where the brakes may take hold first: on any ground ahead whose dead time is over by then [m].
inline double earliest_onset(std::size_t k, double speed, double latest, StopPath path) noexcept {
  double onset = latest;
  for (std::size_t i = k; i < path.size() && path[i].station < onset; ++i) {
    const double there = path[k].station + speed * path[i].shortest_dead_time;
    onset = min_of(onset, max_of(there, path[i].station));
  }
  return onset;
}

// What runs short under brakes that take hold at any place between two, at a speed that is held.
inline StopEnd brake_between(std::size_t k, double speed, double first, double last, StopPath path,
                             const StopConditions& conditions) noexcept {
  const double v_i = max_of(speed, path[k].slowest);
  const double enough = conditions.vehicle.min_load + load_guard;
  double s = first;
  for (std::size_t i = k; i + 1 < path.size() && s < last; ++i) {
    const StopStation &here = path[i], &ahead = path[i + 1];
    if (ahead.station <= s) continue;
    StopState state{speed * speed, 0.0, 0.0, conditions.motion.heat};
    const double u = (s - here.station) / (ahead.station - here.station);
    const LeastLoads loads = slow_down_over({here, ahead, u}, 0.0, v_i, conditions, state);
    if (loads.rear < enough) return {Ending::rear_load, s};
    if (loads.wheel < enough) return {Ending::side_load, s};
    s = ahead.station;
  }
  return {Ending::stopped, last};
}

// March the stop whose brakes take hold at this place.
inline StopEnd march_from(std::size_t k, double speed, double onset, StopPath path,
                          const StopConditions& conditions) noexcept {
  const double v_i = max_of(speed, path[k].slowest), target = conditions.target;
  const double min_load = conditions.vehicle.min_load, enough = min_load + load_guard;
  StopState state{speed * speed, 0.0, 0.0, conditions.motion.heat};
  double s = onset;
  const Held held = hold_speed(k, s, state.energy, path, conditions.vehicle);
  if (held.least.wheel < min_load) return {Ending::side_load, path[held.segment].station};
  double rear = held.least.rear;
  for (std::size_t i = held.segment; i + 1 < path.size(); ++i) {
    const StopStation &here = path[i], &ahead = path[i + 1];
    const double length = ahead.station - here.station;
    while (s < ahead.station) {
      const double left = ahead.station - s;
      const double piece =
          next_piece(left, length, state.energy, conditions.motion.lag);
      const Between middle{here, ahead, (s + 0.5 * piece - here.station) / length};
      const auto loads = slow_down_over(middle, piece, v_i, conditions, state);
      rear = min_of(rear, loads.rear);
      if (rear < enough) return {Ending::rear_load, s};
      if (loads.wheel < enough) return {Ending::side_load, s};
      const double a = state.previous, after = state.energy - 2.0 * a * piece;
      if (after <= 0.0 && a > 0.0) {
        s += (0.5 * state.energy + gravity * conditions.height) / a;
        return {s <= target ? Ending::stopped : Ending::overrun, s};
      }
      state.energy = after;
      s = piece < left ? s + piece : ahead.station;
    }
    if (s > conditions.watched) return {Ending::stopped, s};
    if (s > target) {
      const double a = state.previous;
      return {Ending::overrun, a > 0.0 ? s + state.energy / (2.0 * a) : no_limit};
    }
  }
  return {Ending::overrun, s};
}

}  // namespace detail

// March one stop from station k and a speed there [m/s]. Where surfaces have different dead times
// it ends as with the longest, and loads have to suffice wherever the brakes may take hold. A load
// is concave in v²: the first and the last onset bound those between.
inline StopEnd march_stop(std::size_t k, double speed, StopPath path,
                          const StopConditions& conditions) noexcept {
  const double latest = path[k].station + speed * path[k].dead_time;
  const double earliest = detail::earliest_onset(k, speed, latest, path);
  if (earliest < latest) {
    const StopEnd between =
        detail::brake_between(k, speed, earliest, latest, path, conditions);
    if (between.how > Ending::overrun) return between;
    const StopEnd early = detail::march_from(k, speed, earliest, path, conditions);
    if (early.how > Ending::overrun) return early;
  }
  return detail::march_from(k, speed, latest, path, conditions);
}

}  // namespace slopewise
