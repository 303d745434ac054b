// The quadratic program of smoothing, as rows over three neighbouring stations each, and the
// jerk-limited profile nearest to the time-optimal one.
//
// The time in which the acceleration changes, from the middle of one segment to that of the next,
// is convex in v². Its tangent never exceeds it, so a limit written with the tangent is on the safe
// side wherever the answer ends up, and exact where it touches.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "profile/nearest_point.hpp"
#include "profile/time_optimal.hpp"

namespace slopewise {

// Tangents are taken at this speed or above [m/s]; below it they would be vertical.
inline constexpr double lowest_tangent_speed = 0.15;
// The acceleration before the start may change within a segment driven at this speed or above [m/s].
inline constexpr double lowest_start_speed = 0.05;
// Limits are tightened by more than the solvers' tolerance, so that they hold exactly [m/s², …].
inline constexpr double tightening = 1.5e-4;
inline constexpr Index min_stations = 3;
// In which the time for a segment and the speed at its end become one another's [1].
inline constexpr int reach_rounds = 6;
// Programs per smoothing at most [1]: the second is needed by one problem in sixteen.
inline constexpr int max_linearisations = 4;
// Share of the distance to the time-optimal profile for which tangents are taken anew [1].
inline constexpr double relinearise_share = 0.05;

// In place of iterations: it is proven that no profile keeps the tangents' limits.
inline constexpr int no_profile = 0;

struct SmoothingProblem {
  Index stations;                        // N, at least min_stations
  const double *ds;                      // (N − 1,) segment lengths [m]
  const double *speed_sq_max;            // (N,) the time-optimal profile [m²/s²]
  const double *accel_max, *decel_max;   // (N − 1,) [m/s²]
  double jerk;                           // [m/s³]
  double start_accel;                    // before the first segment, NaN if it does not matter

  [[nodiscard]] bool stands(Index k) const noexcept { return speed_sq_max[k] <= standstill_sq; }
};

struct Tangent {
  double value;                  // where all v² are 0 [s]
  std::array<double, 3> change;  // over the three v² [s³/m²]
};

// Of the time between the middles of two segments of lengths ds, around the v² at their ends.
inline Tangent mid_time(const double* around, const double* ds) noexcept {
  const auto speed = [](double speed_sq) {
    return std::max(std::sqrt(std::max(speed_sq, 0.0)), lowest_tangent_speed);
  };
  const double u = speed(around[0]), v = speed(around[1]), w = speed(around[2]);
  const double time = ds[0] / (u + v), time_2 = ds[1] / (v + w);
  const double per_sum = -time / (u + v), per_sum_2 = -time_2 / (v + w);
  const double a = 0.5 * per_sum / u, b = 0.5 * (per_sum + per_sum_2) / v, c = 0.5 * per_sum_2 / w;
  return {time + time_2 - (a * u * u + b * v * v + c * w * w), {a, b, c}};
}

// The time-optimal profile, lowered to where the acceleration rises from its first value as fast
// as it may.
inline void lower_to_reachable(const SmoothingProblem& p, double* speed_sq) noexcept {
  std::copy_n(p.speed_sq_max, p.stations, speed_sq);
  if (std::isnan(p.start_accel) || p.stands(0)) return;
  double before = speed_sq[0];
  double accel = p.start_accel + p.jerk * p.ds[0] / std::sqrt(before);
  double taken = 0.0;
  for (Index k = 0; k + 1 < p.stations; ++k) {
    const double last_taken = taken, last_accel = accel;
    double after = before;
    for (int round = 0; round < reach_rounds; ++round) {
      taken = 2.0 * p.ds[k] / (std::sqrt(before) + std::sqrt(after));
      if (k > 0) accel = last_accel + 0.5 * p.jerk * (last_taken + taken);
      after = std::max(before + 2.0 * accel * p.ds[k], lowest_tangent_speed * lowest_tangent_speed);
    }
    if (after >= speed_sq[k + 1]) return;
    speed_sq[k + 1] = before = after;
  }
}

inline void write_speed_rows(const SmoothingProblem& p, NearestProblem& out) noexcept {
  for (Index k = 0; k < p.stations; ++k) {
    const bool fixed = k == 0 || p.stands(k);
    out.open[k] = fixed ? 0.0 : 1.0;
    if (fixed) continue;
    out.at(speed_max, 0)[k] = 1.0;
    out.limit_of(speed_max)[k] = std::max(p.speed_sq_max[k] - tightening, 0.0);
    out.at(speed_min, 0)[k] = -1.0;
    out.limit_of(speed_min)[k] = 0.0;
  }
}

inline void write_jerk_rows(const SmoothingProblem& p, const double* around, Index k,
                            NearestProblem& out) noexcept {
  const double half = 0.5 / p.ds[k], half_2 = 0.5 / p.ds[k + 1];
  const Tangent tangent = mid_time(around + k, p.ds + k);
  std::array<double, 3> t{};
  for (std::size_t i = 0; i < 3; ++i) t[i] = p.jerk * tangent.change[i];
  const double limit = p.jerk * tangent.value - 2.0 * tightening;
  out.limit_of(jerk_max)[k] = out.limit_of(jerk_min)[k] = limit;
  out.at(jerk_max, 0)[k] = half - t[0];
  out.at(jerk_max, 1)[k] = -half - half_2 - t[1];
  out.at(jerk_max, 2)[k] = half_2 - t[2];
  out.at(jerk_min, 0)[k] = -half - t[0];
  out.at(jerk_min, 1)[k] = half + half_2 - t[1];
  out.at(jerk_min, 2)[k] = -half_2 - t[2];
}

// The rows a · x[k] + b · x[k + 1] + c · x[k + 2] <= limit, with tangents taken at the v² `around`.
inline void write_program(const SmoothingProblem& p, const double* around,
                          NearestProblem& out) noexcept {
  const Index n = p.stations;
  std::fill_n(out.rows, kind_count * 3 * n, 0.0);
  std::fill_n(out.limit, kind_count * n, 1.0);
  write_speed_rows(p, out);
  for (Index k = 0; k + 1 < n; ++k) {
    // Stations at standstill stay there, and nothing is required of the segments between them.
    if (p.stands(k) && p.stands(k + 1)) continue;
    double highest = p.accel_max[k] - tightening, lowest = -(p.decel_max[k] - tightening);
    if (k == 0 && !std::isnan(p.start_accel)) {
      const double start_speed = std::max(std::sqrt(p.speed_sq_max[0]), lowest_start_speed);
      const double reach = p.jerk * p.ds[0] / start_speed;
      highest = std::min(highest, p.start_accel + reach);
      lowest = std::max(lowest, p.start_accel - reach);
    }
    const double half = 0.5 / p.ds[k];
    out.at(accel_max, 0)[k] = out.at(accel_min, 1)[k] = -half;
    out.at(accel_max, 1)[k] = out.at(accel_min, 0)[k] = half;
    out.limit_of(accel_max)[k] = highest;
    out.limit_of(accel_min)[k] = -lowest;
    if (k == n - 2 || (p.stands(k + 1) && p.stands(k + 2))) continue;
    write_jerk_rows(p, around, k, out);
  }
}

inline Index smoothing_memory(Index stations) noexcept {
  return 2 * stations + NearestProblem::memory(stations) + NearestSolver::memory(stations);
}

// The profile by the interior-point method into `speed_sq`; its iterations, negative if it finds
// none, and no_profile if there is none.
//
// Far below the profile of the tangents these give time away. What more exact ones allow is weighed
// by the multipliers: where that is much, they are taken anew at the answer.
inline int smooth(const SmoothingProblem& p, double* memory, double* speed_sq) noexcept {
  const Index n = p.stations;
  double *around = memory, *x = memory + n;
  memory += 2 * n;
  NearestProblem program(n, p.speed_sq_max, memory);
  NearestSolver solver(program, memory + NearestProblem::memory(n));
  lower_to_reachable(p, around);
  int used = 0;
  for (int turn = 0; turn < max_linearisations; ++turn) {
    write_program(p, around, program);
    if (turn > 0) {
      double distance_sq = 0.0;
      for (Index k = 0; k < n; ++k) {
        const double missed = speed_sq[k] - p.speed_sq_max[k];
        distance_sq += missed * missed;
      }
      if (solver.weighed_slack(speed_sq) <= relinearise_share * 0.5 * distance_sq) break;
    }
    const int iterations = solver.solve(x);
    used += std::abs(iterations);
    if (iterations < 0) {
      if (turn > 0) return used;
      return solver.is_infeasible() ? no_profile : -used;
    }
    for (Index k = 0; k < n; ++k) {
      speed_sq[k] = x[k];
      around[k] = std::min(std::max(x[k], 0.0), p.speed_sq_max[k]);
    }
  }
  return used;
}

// Solvers keep limits to their tolerance, and may end in creeping; the first station is given.
inline void keep_inside(const double* speed_sq, const double* speed_sq_max, Index stations,
                        double* out) noexcept {
  for (Index k = 0; k < stations; ++k) {
    out[k] = std::min(std::max(speed_sq[k], 0.0), speed_sq_max[k]);
  }
  out[0] = speed_sq_max[0];
  rest_for_good(out, stations);
}

}  // namespace slopewise
