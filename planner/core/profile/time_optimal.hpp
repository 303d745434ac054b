// Time-optimal profile: one backward and one forward pass over v², a tile of candidates at
// once.
//
// With v² linear between stations, acceleration is constant on each segment, and the pointwise
// highest feasible v² is reached by lowering the bound once from the end (what braking can still
// slow) and once from the start (what the drive can reach).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "candidate_rows.hpp"

namespace slopewise {

inline constexpr double gravity = 9.80665;  // [m/s²]
// Up to this speed a vehicle is at rest: power does not matter, and no plan creeps [m/s].
inline constexpr double standstill_speed = 1e-3;
inline constexpr double standstill_sq = standstill_speed * standstill_speed;

// M candidates of up to N stations.
struct ProfileProblem {
  Index stations, candidates;
  Numbers station;         // distance from the path start, increasing [m]
  Numbers speed_sq_max;    // highest admissible v² [m²/s²]
  Numbers sin_grade;
  Numbers lower_slope;     // change of the lower force with speed [s/m]
  Numbers lower_intercept; // lower force over weight at rest [1]
  Numbers slowest;         // below it the force does not change with speed [m/s]
  Numbers accel_max;       // by comfort, thrust and front axle load [m/s²]
  Numbers demand;          // thrust that holds the speed, over weight [1]
  Numbers lift, lift_per_speed_sq;  // lift − lift_per_speed_sq v² by front wheels in turns [m/s²], [1/m]
  double decel;            // of service, inf to brake as hard as the model allows [m/s²]
  double specific_power;   // drive power over weight [m/s]
  Rows<double> speed_sq;   // out, v² of the profile [m²/s²]
};

// One station back at service deceleration, or at what the brakes can slow down from.
//
// Their least force on a segment is at its slower end where force grows with speed, else at its
// faster end, which is the root of a quadratic: one square root serves either.
inline void slow_down(const ProfileProblem& p, Index k, Index lanes) noexcept {
  const double decel = p.decel;
  const double *s = p.station.at(k), *s_ahead = p.station.at(k + 1);
  const double *slope_0 = p.lower_slope.at(k), *slope_1 = p.lower_slope.at(k + 1);
  const double *force_0 = p.lower_intercept.at(k), *force_1 = p.lower_intercept.at(k + 1);
  const double *sine_0 = p.sin_grade.at(k), *sine_1 = p.sin_grade.at(k + 1);
  const double *v_min = p.slowest.at(k), *bound = p.speed_sq_max.at(k);
  const double* bound_ahead = p.speed_sq_max.at(k + 1);
  const double* __restrict after = p.speed_sq.at(k + 1);
  double* __restrict out = p.speed_sq.at(k);
  const double creeping = k > 0 ? standstill_sq : -1.0;  // the start is as it is
  SLOPEWISE_INDEPENDENT
  for (Index j = 0; j < lanes; ++j) {
    const double ds = s_ahead[j] - s[j];
    const double top = max_of(bound[j], bound_ahead[j]) <= creeping ? 0.0 : bound[j];
    const double served = min_of(top, after[j] + 2.0 * ds * decel);
    const double slope = min_of(slope_0[j], slope_1[j]);
    const double intercept = min_of(force_0[j] + sine_0[j], force_1[j] + sine_1[j]);
    const double half = gravity * ds * slope, least = v_min[j];
    const double reach = after[j] + 2.0 * gravity * ds * intercept;
    const double root = std::sqrt(max_of(half > 0.0 ? after[j] : half * half + reach, 0.0));
    const double speed = half > 0.0 ? max_of(root, least) : half + root;
    double braked = reach + 2.0 * half * max_of(speed, least);
    braked = half > 0.0 ? braked : min_of(speed * speed, braked);
    out[j] = min_of(served, max_of(braked, 0.0));
  }
}

// Lower the next station to what keeps every front wheel loaded: the faster end of the segment counts.
inline void turn(const ProfileProblem& p, Index k, Index lanes) noexcept {
  const double *s = p.station.at(k), *s_ahead = p.station.at(k + 1);
  const double *lift_0 = p.lift.at(k), *lift_1 = p.lift.at(k + 1);
  const double *lost_0 = p.lift_per_speed_sq.at(k), *lost_1 = p.lift_per_speed_sq.at(k + 1);
  const double* __restrict before = p.speed_sq.at(k);
  double* __restrict out = p.speed_sq.at(k + 1);
  SLOPEWISE_INDEPENDENT
  for (Index j = 0; j < lanes; ++j) {
    const double twice = 2.0 * (s_ahead[j] - s[j]), lost = max_of(lost_0[j], lost_1[j]);
    const double most = (before[j] + twice * min_of(lift_0[j], lift_1[j])) / (1.0 + twice * lost);
    out[j] = min_of(out[j], max_of(before[j], most));
  }
}

// One station on under acceleration, or to what power can reach.
//
// The speed there is the root of a cubic, which Newton's steps approach from above; v² is the root
// of a concave function, so that the last step, on its tangent, ends at or below it. After four
// steps it is within 1e-11 m/s: were it not, a higher acceleration limit, from which they begin
// farther away, would make a plan slower. Holding the speed is always possible, because no bound is
// above what power sustains.
inline void speed_up(const ProfileProblem& p, Index k, Index lanes) noexcept {
  const double specific_power = p.specific_power;
  const double *s = p.station.at(k), *s_ahead = p.station.at(k + 1);
  const double *accel_0 = p.accel_max.at(k), *accel_1 = p.accel_max.at(k + 1);
  const double *thrust_0 = p.demand.at(k), *thrust_1 = p.demand.at(k + 1);
  const double* __restrict before = p.speed_sq.at(k);
  double* __restrict out = p.speed_sq.at(k + 1);
  SLOPEWISE_INDEPENDENT
  for (Index j = 0; j < lanes; ++j) {
    const double twice = 2.0 * (s_ahead[j] - s[j]), here = before[j];
    const double top = min_of(out[j], here + twice * min_of(accel_0[j], accel_1[j]));
    // Power is scarcest at the segment's faster end.
    const double cost = twice * gravity * max_of(thrust_0[j], thrust_1[j]) - here;
    const double power = twice * gravity * specific_power, needed = top + cost;
    double v = std::sqrt(max_of(top, standstill_sq));
    for (int step = 0; step < 4; ++step) {
      const double lacking = max_of(v * (v * v + cost) - power, 0.0);
      v -= lacking / max_of(3.0 * v * v + cost, standstill_sq);
      v = max_of(v, standstill_speed);
    }
    const double gain = power / v;
    double reached = v * v;
    const double lacking = max_of(reached + cost - gain, 0.0);
    reached -= lacking * reached / (reached + 0.5 * gain);
    const double lowered = min_of(top, max_of(reached, here));
    const double suffices = max_of(needed, 0.0) * needed * top <= power * power ? 1.0 : 0.0;
    out[j] = suffices > 0.0 ? top : lowered;
  }
}

// Rest from the first segment on along which the vehicle would hardly move: to creep takes hours.
// The start is as it is; `stride` from a station to the next.
inline void rest_for_good(double* speed_sq, Index stations, Index stride = 1) noexcept {
  for (Index k = 1; k < stations; ++k) {
    const Index last = k - 1;
    if (max_of(speed_sq[last * stride], speed_sq[k * stride]) > standstill_sq) continue;
    for (Index n = std::max<Index>(last, 1); n < stations; ++n) speed_sq[n * stride] = 0.0;
    return;
  }
}

// `reachable_start_sq` (M,) receives the highest v² at the first station from which the bounds can
// still be kept; below `start_sq` the profile begins there all the same.
inline void solve_time_optimal(const ProfileProblem& p, const double* start_sq,
                               double* reachable_start_sq) noexcept {
  const Index last = p.stations - 1, lanes = p.candidates;
  double* first = p.speed_sq.at(0);
  std::copy_n(p.speed_sq_max.at(last), lanes, p.speed_sq.at(last));
  for (Index k = last - 1; k >= 0; --k) slow_down(p, k, lanes);
  std::copy_n(first, lanes, reachable_start_sq);
  for (Index j = 0; j < lanes; ++j) first[j] = min_of(first[j], start_sq[j]);
  for (Index k = 0; k < last; ++k) {
    if (p.lift.data != nullptr) turn(p, k, lanes);
    speed_up(p, k, lanes);
  }
  for (Index j = 0; j < lanes; ++j) {
    rest_for_good(p.speed_sq.data + j, p.stations, p.speed_sq.stride);
  }
}

// Travel time plus a charge for each metre on which the vehicle does not move, (M,) [s].
inline void add_travel_cost(const double* station, const double* speed_sq, Index stations,
                            Index candidates, double horizon_penalty, double* cost) noexcept {
  std::fill_n(cost, candidates, 0.0);
  for (Index k = 0; k + 1 < stations; ++k) {
    const double *s = station + k * candidates, *s_ahead = s + candidates;
    const double *here = speed_sq + k * candidates, *ahead = here + candidates;
    SLOPEWISE_INDEPENDENT
    for (Index j = 0; j < candidates; ++j) {
      const double ds = s_ahead[j] - s[j], sum = std::sqrt(here[j]) + std::sqrt(ahead[j]);
      cost[j] += sum > 0.0 ? 2.0 * ds / sum : horizon_penalty * ds;
    }
  }
}

}  // namespace slopewise
