// Time-optimal profile: one backward and one forward pass over v², W candidates at once.
//
// With v² linear between stations, acceleration is constant on each segment, and the pointwise
// highest feasible v² is reached by lowering the bound once from the end (what braking can still
// slow) and once from the start (what the drive can reach).
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

#include "batch.hpp"

namespace slopewise {

inline constexpr double gravity = 9.80665;  // [m/s²]
// Factor by which a required deceleration is rounded up [1].
inline constexpr double decel_rounding = 1.0 + 1e-9;
// Below this speed power does not matter [m/s].
inline constexpr double standstill_speed = 1e-3;
inline constexpr double standstill_speed_sq = standstill_speed * standstill_speed;

struct Limits {
  double decel;           // service deceleration [m/s²], inf to brake as hard as the model allows
  double specific_power;  // drive power over weight [m/s]
};

// Two neighbouring stations of a batch; both are lowered in place.
template <int W>
struct Segment {
  const Batch<W>& batch;
  Index k;

  [[nodiscard]] const double* here(Row row) const noexcept { return batch.at(row, k); }
  [[nodiscard]] const double* ahead(Row row) const noexcept { return batch.at(row, k + 1); }
};

template <int W>
using Lanes = std::array<double, static_cast<std::size_t>(W)>;

// Whether a lane is not 0.0. Masks are doubles: a bool beside doubles ends vectorisation silently.
template <std::size_t W>
bool any_of(const std::array<double, W>& masks) noexcept {
  std::int64_t bits = 0;
  for (const double mask : masks) bits |= std::bit_cast<std::int64_t>(mask);
  return bits != 0;
}

// One station back at service deceleration; whether and in which lanes brakes may be too weak for it.
template <int W>
bool slow_down(const Segment<W>& segment, double decel, Lanes<W>& weak) noexcept {
  const double *s = segment.here(Row::station), *s_ahead = segment.ahead(Row::station);
  const double *slope_0 = segment.here(Row::force_lower_slope),
               *slope_1 = segment.ahead(Row::force_lower_slope);
  const double *force_0 = segment.here(Row::force_lower_intercept),
               *force_1 = segment.ahead(Row::force_lower_intercept);
  const double *sine_0 = segment.here(Row::sin_grade), *sine_1 = segment.ahead(Row::sin_grade);
  const double *v_min = segment.here(Row::trained_speed_min),
               *bound = segment.here(Row::speed_sq_max);
  const double* __restrict after = segment.ahead(Row::speed_sq);
  double* __restrict out = segment.batch.at(Row::speed_sq, segment.k);
  const double required = decel / gravity * decel_rounding;
  SLOPEWISE_INDEPENDENT
  for (std::size_t j = 0; j < W; ++j) {
    const double top = bound[j], ds = s_ahead[j] - s[j];
    out[j] = min_of(top, after[j] + 2.0 * ds * decel);
    const double slope = min_of(slope_0[j], slope_1[j]);
    const double spare = min_of(force_0[j] + sine_0[j], force_1[j] + sine_1[j]) - required;
    double mask = spare * spare < slope * slope * top ? 1.0 : 0.0;
    mask = slope < 0.0 ? mask : 0.0;
    mask = spare + slope * v_min[j] < 0.0 ? 1.0 : mask;
    weak[j] = top > 0.0 ? mask : 0.0;
  }
  return any_of(weak);
}

// Lower a station in weak lanes to what the brakes can slow down from.
//
// Their least force on a segment is at its slower end where force grows with speed, else at its
// faster end, which is the root of a quadratic: one square root serves either.
template <int W>
void brake(const Segment<W>& segment, const Lanes<W>& weak) noexcept {
  const double *s = segment.here(Row::station), *s_ahead = segment.ahead(Row::station);
  const double *slope_0 = segment.here(Row::force_lower_slope),
               *slope_1 = segment.ahead(Row::force_lower_slope);
  const double *force_0 = segment.here(Row::force_lower_intercept),
               *force_1 = segment.ahead(Row::force_lower_intercept);
  const double *sine_0 = segment.here(Row::sin_grade), *sine_1 = segment.ahead(Row::sin_grade);
  const double* v_min = segment.here(Row::trained_speed_min);
  const double* __restrict after = segment.ahead(Row::speed_sq);
  double* __restrict out = segment.batch.at(Row::speed_sq, segment.k);
  SLOPEWISE_INDEPENDENT
  for (std::size_t j = 0; j < W; ++j) {
    const double ds = s_ahead[j] - s[j];
    const double slope = min_of(slope_0[j], slope_1[j]);
    const double intercept = min_of(force_0[j] + sine_0[j], force_1[j] + sine_1[j]);
    const double half = gravity * ds * slope, least = v_min[j];
    const double reach = after[j] + 2.0 * gravity * ds * intercept;
    const double root = std::sqrt(max_of(half > 0.0 ? after[j] : half * half + reach, 0.0));
    const double speed = half > 0.0 ? max_of(root, least) : half + root;
    double braked = reach + 2.0 * half * max_of(speed, least);
    braked = half > 0.0 ? braked : min_of(speed * speed, braked);
    const double before = out[j], lowered = min_of(before, max_of(braked, 0.0));
    out[j] = weak[j] > 0.0 ? lowered : before;
  }
}

// One station on under acceleration; whether and in which lanes power may not do for it.
template <int W>
bool speed_up(const Segment<W>& segment, double specific_power, Lanes<W>& weak) noexcept {
  const double *s = segment.here(Row::station), *s_ahead = segment.ahead(Row::station);
  const double *accel_0 = segment.here(Row::accel_max), *accel_1 = segment.ahead(Row::accel_max);
  const double *thrust_0 = segment.here(Row::required_thrust_ratio),
               *thrust_1 = segment.ahead(Row::required_thrust_ratio);
  const double* __restrict before = segment.here(Row::speed_sq);
  double* __restrict out = segment.batch.at(Row::speed_sq, segment.k + 1);
  SLOPEWISE_INDEPENDENT
  for (std::size_t j = 0; j < W; ++j) {
    const double twice = 2.0 * (s_ahead[j] - s[j]);
    const double here = before[j];
    const double top = min_of(out[j], here + twice * min_of(accel_0[j], accel_1[j]));
    out[j] = top;
    // Power is scarcest at the segment's faster end.
    const double needed = top - here + twice * gravity * max_of(thrust_0[j], thrust_1[j]);
    const double power = twice * gravity * specific_power;
    const double mask = needed * needed * top > power * power ? 1.0 : 0.0;
    weak[j] = needed > 0.0 ? mask : 0.0;
  }
  return any_of(weak);
}

// Lower a station in weak lanes to what power can reach.
//
// The speed there is the root of a cubic, which Newton's steps approach from above; v² is the root
// of a concave function, so that the last step, on its tangent, ends at or below it. Holding the
// speed is always possible, because no bound is above what power sustains.
template <int W>
void power_up(const Segment<W>& segment, double specific_power, const Lanes<W>& weak) noexcept {
  const double *s = segment.here(Row::station), *s_ahead = segment.ahead(Row::station);
  const double *thrust_0 = segment.here(Row::required_thrust_ratio),
               *thrust_1 = segment.ahead(Row::required_thrust_ratio);
  const double* __restrict before = segment.here(Row::speed_sq);
  double* __restrict out = segment.batch.at(Row::speed_sq, segment.k + 1);
  SLOPEWISE_INDEPENDENT
  for (std::size_t j = 0; j < W; ++j) {
    const double twice = 2.0 * (s_ahead[j] - s[j]);
    const double here = before[j], top = out[j];
    const double cost = twice * gravity * max_of(thrust_0[j], thrust_1[j]) - here;
    const double power = twice * gravity * specific_power;
    double v = std::sqrt(max_of(top, standstill_speed_sq));
    for (int step = 0; step < 2; ++step) {
      const double lacking = max_of(v * (v * v + cost) - power, 0.0);
      v -= lacking / max_of(3.0 * v * v + cost, standstill_speed_sq);
      v = max_of(v, standstill_speed);
    }
    const double gain = power / v;
    double reached = v * v;
    const double lacking = max_of(reached + cost - gain, 0.0);
    reached -= lacking * reached / (reached + 0.5 * gain);
    const double lowered = min_of(top, max_of(reached, here));
    out[j] = weak[j] > 0.0 ? lowered : top;
  }
}

// `reachable_start_sq` (M,) receives the highest v² at the first station from which the bounds can
// still be kept; below `start_sq` the profile begins there all the same.
template <int W>
void solve_time_optimal(const Batch<W>& batch, const Limits& limits, const double* start_sq,
                        double* reachable_start_sq) noexcept {
  const Index last = batch.stations() - 1;
  Lanes<W> weak;
  std::copy_n(batch.at(Row::speed_sq_max, last), W, batch.at(Row::speed_sq, last));
  for (Index k = last - 1; k >= 0; --k) {
    const Segment<W> segment{batch, k};
    if (slow_down(segment, limits.decel, weak)) brake(segment, weak);
  }
  double* first = batch.at(Row::speed_sq, 0);
  auto lanes = batch.lanes_of(start_sq);
  for (std::size_t j = 0; j < W; ++j) {
    const double reachable = first[j];
    first[j] = min_of(reachable, lanes[j]);
    lanes[j] = reachable;
  }
  batch.give_back(lanes, reachable_start_sq);
  for (Index k = 0; k < last; ++k) {
    const Segment<W> segment{batch, k};
    if (speed_up(segment, limits.specific_power, weak)) {
      power_up(segment, limits.specific_power, weak);
    }
  }
  batch.give_back();
}

inline Index time_optimal_memory(Index stations) noexcept {
  return Batch<narrow>::copy_size(stations);
}

inline void solve_time_optimal(const Table& table, const Limits& limits, const double* start_sq,
                               double* reachable_start_sq, double* memory) noexcept {
  Index first = 0;
  for (; first + wide <= table.candidates; first += wide) {
    solve_time_optimal(Batch<wide>(table, first, memory), limits, start_sq, reachable_start_sq);
  }
  for (; first < table.candidates; first += narrow) {
    solve_time_optimal(Batch<narrow>(table, first, memory), limits, start_sq, reachable_start_sq);
  }
}

// Travel time plus a charge for each metre on which the vehicle does not move, (M,) [s].
inline void add_travel_cost(const double* station, const double* speed_sq, Index stations,
                            Index candidates, double horizon_penalty, double* cost) noexcept {
  for (Index first = 0; first < candidates; first += wide) {
    const Index lanes = std::min<Index>(wide, candidates - first);
    std::array<double, wide> total{}, speed{};
    for (Index j = 0; j < lanes; ++j) {
      speed[static_cast<std::size_t>(j)] = std::sqrt(speed_sq[first + j]);
    }
    for (Index k = 0; k + 1 < stations; ++k) {
      const double *s = station + k * candidates + first, *s_ahead = s + candidates;
      const double* ahead_sq = speed_sq + (k + 1) * candidates + first;
      for (Index j = 0; j < lanes; ++j) {
        const auto lane = static_cast<std::size_t>(j);
        const double ds = s_ahead[j] - s[j], ahead = std::sqrt(ahead_sq[j]);
        const double sum = speed[lane] + ahead;
        total[lane] += sum > 0.0 ? 2.0 * ds / sum : horizon_penalty * ds;
        speed[lane] = ahead;
      }
    }
    std::copy_n(total.begin(), lanes, cost + first);
  }
}

}  // namespace slopewise
