// Emergency stops integrated in time, for effects that act on the motion itself.
//
// A fourth-order Runge–Kutta scheme on the laws of `models`, grade linear between stations: in time,
// where the bound marches along the path. Thirty times slower than stop_by_energy.hpp, which it
// agrees with where nothing acts on the motion.
#pragma once

#include "verify/stop_by_energy.hpp"
#include "vehicle.hpp"

namespace slopewise::verify {

// Force above what friction leaves that is rounding [1]: bounds work with sines.
inline constexpr double friction_rounding = 1e-9;

// What a stop in time is integrated with.
struct StopModel {
  const Track& track;
  const Vehicle& limits;
  const MotionTerms& motion;
  const Body& body;
  double time_step;  // [s]
};

// F_b/W that bank, turn and crest leave of friction at v², until an axle locks; inf if unknown. A
// stop that was commanded before a turn is faster in it than the plan, for which the track has what
// friction leaves.
[[nodiscard]] inline double grip_at(const Track& track, const Vehicle& limits, Index i, double u,
                                    double mu, double energy) noexcept {
  if (mu == infinite) return infinite;
  const double grade = at(track.grade, i, u), roll = at(track.roll, i, u);
  const double crest = min_of(at(track.vertical_curvature, i, u), 0.0);
  const double normal = laws::normal_ratio(grade, roll, crest, energy);
  const double side = laws::side_force_ratio(grade, roll, at(track.curvature, i, u), energy);
  const double grip = laws::braking_left(mu, normal, side);
  if (limits.brake_share < 0.0) return grip;
  const double lift = limits.high * grip / max_of(normal, 1e-9);
  const double rear = grip * (1.0 - limits.ahead) / (1.0 - limits.brake_share + lift);
  const double front = grip * limits.ahead / max_of(limits.brake_share - lift, 1e-9);
  return min_of(grip, min_of(rear, front));
}

// Could a stop that is nowhere faster than this slide between the stations around k? What friction
// leaves is concave in v² and along a segment: where it does at rest and at the highest speed, and
// at both ends, it does everywhere.
[[nodiscard]] inline bool may_slide(const Track& track, const Vehicle& limits, Index k,
                                    double fastest) noexcept {
  const Index last = track.last(), i = std::min(k, last - 1);
  const double* friction = track.friction;
  const double mu =
      min_of(friction[k], min_of(friction[std::max<Index>(k - 1, 0)], friction[std::min(k + 1, last)]));
  if (mu == infinite) return false;
  const double u = static_cast<double>(k - i);
  double grip = grip_at(track, limits, i, u, mu, fastest * fastest);
  grip = min_of(grip, grip_at(track, limits, i, u, mu, 0.0));
  const double slow = track.slowest[k], part = track.lower_slope[k];
  const double force = track.lower_intercept[k] + max_of(slow * part, max_of(fastest, slow) * part);
  return !(force <= grip + friction_rounding);
}

namespace detail {

// Place, speed, built-up force and heat of a stop [m], [m/s], [1], [J/kg].
struct StopState {
  double s, v, force, heat;
};

// One stop on its way; `slips`: turns, banks and crests take of its friction.
struct StopInTime {
  const StopModel& model;
  double v_i;
  bool slips;
  Index segment;

  // Where a place is: segment and share of it. Beyond the last station the ground stays as it was.
  [[nodiscard]] std::pair<Index, double> place(double s) const noexcept {
    const Track& track = model.track;
    const Index i = segment_of(track, s, segment);
    return {i, min_of((s - track.station[i]) / (track.station[i + 1] - track.station[i]), 1.0)};
  }

  // Deceleration by all effects on the motion [m/s²].
  [[nodiscard]] double effects(Index i, double u, double speed) const noexcept {
    const auto& [track, limits, motion, body, step] = model;
    if (!motion.moves) return 0.0;
    return laws::motion_deceleration(speed, at(track.curvature, i, u), at(track.yaw, i, u),
                                     motion.values.data());
  }

  // Deceleration (in v), growth of the built-up force and of the heat; s is not filled in.
  [[nodiscard]] StopState rates(const StopState& now) const noexcept {
    const auto& [track, limits, motion, body, step] = model;
    const auto [i, u] = place(now.s);
    const double grade = at(track.grade, i, u);
    const double wanted = v_i * at(track.lower_slope, i, u) + at(track.lower_intercept, i, u);
    double force = (motion.lag > 0.0 ? now.force : wanted) / (1.0 + motion.fade * max_of(now.heat, 0.0));
    if (motion.friction < infinite) {
      force = min_of(force, motion.friction * (std::cos(grade) * std::cos(at(track.roll, i, u))));
    }
    const double speed = max_of(now.v, 0.0);
    if (slips) {
      const double mu = min_of(track.friction[i], track.friction[i + 1]);
      force = min_of(force, grip_at(track, limits, i, u, mu, speed * speed));
    }
    const double extra = effects(i, u, speed);
    const double growth = motion.lag > 0.0 ? (wanted - now.force) / motion.lag : 0.0;
    const double heating = gravity * max_of(force, 0.0) * speed - now.heat / motion.fade_tau;
    return {0.0, gravity * (force + std::sin(grade)) + extra, growth, heating};
  }

  // Shares of rear, lighter side and lightest wheel at s, braking or holding the speed.
  [[nodiscard]] Shares shares(double s, double v, bool braking) const noexcept {
    const auto& [track, limits, motion, b, step] = model;
    const auto [i, u] = place(s);
    const double grade = at(track.grade, i, u), roll = at(track.roll, i, u);
    const double bend = at(track.curvature, i, u);
    double decel = 0.0;
    if (braking) {
      double upper = v_i * at(track.upper_slope, i, u) + at(track.upper_intercept, i, u);
      upper = min_of(upper, motion.friction * std::cos(grade) * std::cos(roll));
      decel = gravity * (upper + std::sin(grade));
      decel += max_of(effects(i, u, max_of(v, 0.0)), 0.0);
    }
    const double normal = max_of(-at(track.vertical_curvature, i, u), 0.0) * v * v / gravity;
    const double rear = laws::rear_load_share(grade, roll, decel, b.wheelbase, b.cg_x, b.cg_z) - normal;
    const double front = laws::front_load_share(grade, roll, decel, b.wheelbase, b.cg_x, b.cg_z) - normal;
    const double lateral = v * v * bend / std::cos(roll);
    const double left = laws::left_load_share(grade, roll, lateral, b.track_width, b.cg_z);
    const double right = laws::right_load_share(grade, roll, lateral, b.track_width, b.cg_z);
    const double side = min_of(left, right) - normal;
    return {rear, side, min_of(rear, front) + side - (0.5 * (left + right) - normal)};
  }

  // A step in time; in the last one the deceleration is as good as constant, and the stop may fall
  // by `height` further than the track [m].
  void advance(StopState& now, double height) const noexcept {
    const double h = model.time_step, b = 0.5 * h, v = now.v;
    const StopState r1 = rates(now);
    const double v2 = v - b * r1.v;
    const StopState r2 =
        rates({now.s + b * v, v2, now.force + b * r1.force, now.heat + b * r1.heat});
    const double v3 = v - b * r2.v;
    const StopState r3 =
        rates({now.s + b * v2, v3, now.force + b * r2.force, now.heat + b * r2.heat});
    const double v4 = v - h * r3.v;
    const StopState r4 =
        rates({now.s + h * v3, v4, now.force + h * r3.force, now.heat + h * r3.heat});
    const double after = v - h * (r1.v + 2.0 * r2.v + 2.0 * r3.v + r4.v) / 6.0;
    now.v = after;
    if (after <= 0.0) {
      now.s += 0.5 * v * h * v / (v - after) + gravity * height * h / (v - after);
      return;
    }
    now.s += h * (v + 2.0 * v2 + 2.0 * v3 + v4) / 6.0;
    now.force += h * (r1.force + 2.0 * r2.force + 2.0 * r3.force + r4.force) / 6.0;
    now.heat += h * (r1.heat + 2.0 * r2.heat + 2.0 * r3.heat + r4.heat) / 6.0;
  }

  // Note the loads at the stations that the stop passes up to s.
  void pass(double s, double v, bool braking, Shares& least) noexcept {
    const Track& track = model.track;
    while (track.station[segment + 1] < s && segment + 2 < track.stations) {
      ++segment;
      least.lower_to(shares(track.station[segment], v, braking));
    }
  }
};

}  // namespace detail

// Where a stop commanded in segment i has to be followed to, and how.
struct StopWatch {
  double limit;   // a stop that gets here is not followed further [m]
  double height;  // it may fall by this much further than the track [m]
  bool slips;     // turns, banks and crests take of its friction
};

// Where any stop ends [m], and the least shares of rear axle, sides and wheels on its way.
[[nodiscard]] inline double stop_in_time(const StopModel& model, const StopCommand& command, Index i,
                                         const StopWatch& watch, Shares& least) noexcept {
  detail::StopInTime stop{model, command.force_speed(), watch.slips, i};
  const double onset = command.onset();
  least = stop.shares(command.station, command.speed, false);
  stop.pass(onset, command.speed, false, least);
  least.lower_to(stop.shares(onset, command.speed, false));
  detail::StopState now{onset, command.speed, 0.0, model.motion.heat};
  while (now.s <= watch.limit) {
    least.lower_to(stop.shares(now.s, now.v, true));
    if (now.v <= 0.0) break;
    const double before = now.v;
    stop.advance(now, watch.height);
    stop.pass(now.s, before, true, least);
    if (now.v <= 0.0) {
      least.lower_to(stop.shares(now.s, 0.0, true));
      break;
    }
  }
  return now.s;
}

}  // namespace slopewise::verify
