// Highest speed from which the vehicle can still stop, found by trial, stop by stop.
//
// The bound for candidates along which an effect acts on the motion itself, or a load may run short
// on the way: there the closed form does not hold, or does not know of the load.
#pragma once

#include <cmath>
#include <numbers>

#include "bounds/closed_form_stop.hpp"
#include "bounds/stop_march.hpp"

namespace slopewise {

namespace detail {

// Brackets of the speed at most [1]: bisection alone reaches 1e-12 of the first bracket.
inline constexpr int trials = 40;
// Trials that are guessed from where stops end; then, and where loads decide, they bisect.
inline constexpr int guesses = 8;
// How close below the highest speed a trial is good enough [m/s].
inline constexpr double speed_error = 1e-4;
// How close before the target a stop is good enough [m].
inline constexpr double stop_error = 1e-7;

// What limits the speed where stops from higher ones end like that.
constexpr Label label_of(Ending how) noexcept {
  if (how == Ending::rear_load) return limiting::tip_over;
  return how == Ending::side_load ? limiting::rollover : limiting::stopping_path;
}

// A stop that was tried: from which speed, and how far beyond the target it ends.
struct Trial {
  double speed, beyond;  // [m/s], [m]
};

// Speed whose stop ends close before the target, from two stops: between them the distance grows as
// dead time * v + c v².
inline double meeting(const Trial& one, const Trial& other, double dead_time) noexcept {
  const double v = other.speed;
  const double c = (other.beyond - one.beyond - dead_time * (v - one.speed)) /
                   (v * v - one.speed * one.speed);
  const double distance = c * v * v + dead_time * v - other.beyond - 0.5 * stop_error;
  const double root = dead_time * dead_time + 4.0 * c * distance;
  return root > 0.0 ? 2.0 * distance / (dead_time + std::sqrt(root)) : 0.0;
}

struct HighestStop {
  double speed;  // [m/s]
  Ending why;    // how stops from above it end; stopped where none was tried
};

// Highest speed up to `high` whose stop ends well.
inline HighestStop highest_stop(std::size_t k, double high, StopPath path,
                                const StopConditions& conditions) noexcept {
  HighestStop found{0.0, Ending::stopped};
  Trial before{0.0, path[k].station - conditions.target};
  double speed = high;
  for (int step = 0; step < trials; ++step) {
    const StopEnd end = march_stop(k, speed, path, conditions);
    const Trial trial{speed, end.where - conditions.target};
    if (end.how == Ending::stopped) {
      found.speed = speed;
      if (step == 0 || trial.beyond > -stop_error) break;
    } else {
      high = speed;
      found.why = end.how;
    }
    if (high - found.speed < speed_error) break;
    speed = 0.5 * (found.speed + high);
    if (end.how <= Ending::overrun && step < guesses) {
      const double guess = meeting(before, trial, path[k].dead_time);
      if (found.speed < guess && guess < high) speed = guess;
    }
    before = trial;
  }
  return found;
}

inline StopStation stop_station(const StopLane& lane, Index k, double yaw_before) noexcept {
  const TerrainRows& t = lane.problem.terrain;
  const ForceRows& f = lane.problem.forces;
  const Index j = lane.j;
  const double sin_grade = t.sin_grade.at(k)[j], sin_roll = t.sin_roll.at(k)[j];
  const double curvature = t.curvature.at(k)[j];
  const double cosine = std::sqrt(1.0 - sin_grade * sin_grade);
  const double cos_lean = std::sqrt(1.0 - sin_roll * sin_roll);
  const double bank = cosine * sin_roll, bend = std::fabs(curvature);
  const double yaw = std::atan2(t.heading_y.at(k)[j], t.heading_x.at(k)[j]);
  const double turns = k > 0 ? (yaw - yaw_before) / (2.0 * std::numbers::pi) : 0.0;
  return {t.station.at(k)[j],
          t.grade.at(k)[j],
          sin_grade,
          lane.bounds.lower_slope.at(k)[j],
          lane.bounds.lower_intercept.at(k)[j],
          f.upper_slope.at(k)[j],
          f.upper_intercept.at(k)[j],
          lane.dead_time(k),
          f.shortest_dead_time.at(k)[j] + lane.problem.errors.latency,
          f.slowest.at(k)[j],
          cosine * cos_lean,
          curvature > 0.0 ? bank : -bank,
          bend / (gravity * cos_lean),
          max_of(-t.vertical_curvature.at(k)[j], 0.0) / gravity,
          bend,
          yaw - 2.0 * std::numbers::pi * std::nearbyint(turns)};
}

}  // namespace detail

// Lower bounds of a candidate to speeds whose marched stop ends before the target, loads kept;
// v² <= 0 stays. Where the closed form holds already, only loads are looked after, up to the last
// station at which they may run short.
inline void bound_stops_by_trial(const StopLane& lane, Index last_risk,
                                 StopStation* memory) noexcept {
  const Index count = lane.problem.terrain.counts[lane.j];
  for (Index k = 0; k < count; ++k) {
    memory[k] = detail::stop_station(lane, k, k > 0 ? memory[k - 1].yaw : 0.0);
  }
  const StopPath path(memory, static_cast<std::size_t>(count));
  const bool everywhere = !lane.problem.closed_form;
  const Index last = everywhere ? count : last_risk + 1;
  const double watched = everywhere ? no_limit : memory[std::min(last, count - 1)].station;
  const StopConditions conditions{lane.problem.motion, lane.problem.vehicle, lane.target,
                                  lane.problem.errors.height, watched};
  for (Index k = 0; k < last; ++k) {
    double& bound = lane.speed_sq_max(k);
    if (bound <= 0.0) continue;
    const auto from = static_cast<std::size_t>(k);
    const double speed = std::sqrt(bound);
    if (!everywhere && detail::is_loaded_throughout(from, speed, path, conditions)) continue;
    const auto found = detail::highest_stop(from, speed, path, conditions);
    if (found.why == Ending::stopped) continue;
    bound = found.speed * found.speed;
    lane.bounds.limiting.at(k)[lane.j] = detail::label_of(found.why);
  }
}

}  // namespace slopewise
