// What a plan may gain and lose on each segment, and what holds it at each station.
#pragma once

#include "bounds/limiting.hpp"
#include "verify/candidate.hpp"
#include "profile/time_optimal.hpp"
#include "vehicle.hpp"

namespace slopewise::verify {

// Accelerations closer than this are one to a reader [m/s²].
inline constexpr double hardly = 0.01;

// Share of an allowed acceleration that is all of it to a reader [1].
inline constexpr double nearly_all = 0.99;

// Highest acceleration and deceleration on each segment at any speed up to a profile v² (N,)
// of the candidate of a problem; (N - 1,) each, both >= 0 [m/s²].
inline void limit_segments(const Track& track, const double* speed_sq, const ProfileProblem& p,
                           const Vehicle& n, double* accel, double* decel) noexcept {
  // The part of the lower bound of the force that depends on speed, up to this one.
  const auto least_force = [&track](Index k, double fast) noexcept {
    const double slow = track.slowest[k], part = track.lower_slope[k];
    return min_of(slow * part, max_of(fast, slow) * part);
  };
  double sine_before = std::sin(track.grade[0]);
  for (Index k = 0; k < track.last(); ++k) {
    const double sine = std::sin(track.grade[k + 1]);
    const double fast = std::sqrt(max_of(max_of(speed_sq[k], speed_sq[k + 1]), 1e-6));
    // Brakes that grow weaker with speed do so at either end from the segment's fastest.
    const double braking =
        min_of(least_force(k, fast) + *p.lower_intercept.at(k) + sine_before,
               least_force(k + 1, fast) + *p.lower_intercept.at(k + 1) + sine);
    const double demand = max_of(*p.demand.at(k), *p.demand.at(k + 1));
    const double powered = gravity * (n.specific_power / fast - demand);
    const double lost = max_of(*p.lift_per_speed_sq.at(k), *p.lift_per_speed_sq.at(k + 1));
    const double lifting = min_of(*p.lift.at(k), *p.lift.at(k + 1)) - lost * fast * fast;
    const double most = min_of(min_of(*p.accel_max.at(k), *p.accel_max.at(k + 1)), lifting);
    accel[k] = max_of(min_of(most, powered), 0.0);
    decel[k] = max_of(min_of(gravity * braking, n.decel), 0.0);
    sine_before = sine;
  }
}

// Acceleration from each station to the next, 0 at the last [m/s²], and time since the first, which
// stands once the profile rests [s], of N stations of v² that is linear between them.
inline void move_along(const double* station, const double* speed_sq, Index stations, double* accel,
                       double* time) noexcept {
  time[0] = accel[stations - 1] = 0.0;
  for (Index k = 0; k + 1 < stations; ++k) {
    const double ds = station[k + 1] - station[k];
    const double both = std::sqrt(speed_sq[k]) + std::sqrt(speed_sq[k + 1]);
    accel[k] = (speed_sq[k + 1] - speed_sq[k]) / (2.0 * ds);
    time[k + 1] = time[k] + (both > 0.0 ? 2.0 * ds / both : 0.0);
  }
}

// A plan of N stations, and what holds it.
struct Labelled {
  Index stations;
  const double *speed_sq, *accel;         // (N,) the plan [m²/s²], [m/s²]
  const double* bound;                    // (N,) highest v²
  const Label* bound_label;               // (N,) what says so
  const double *accel_max, *decel_max;    // (N - 1,) of limit_segments
  double most_accel;                      // by comfort; less is for want of traction [m/s²]
  bool smoothed;                          // what neither bound nor acceleration holds, jerk does
};

// What holds at each station: its bound, or how fast the speed may change around it; (N,) codes.
inline void label_stations(const Labelled& plan, Label* out) noexcept {
  for (Index k = 0; k < plan.stations; ++k) {
    // What may change too fast is lowered as well: how it changes says by what.
    const Label label = plan.bound_label[k];
    const bool changes = label == limiting::accel || label == limiting::decel;
    if (!changes && plan.speed_sq[k] >= plan.bound[k] - 1e-3 * max_of(plan.bound[k], 0.05)) {
      out[k] = plan.bound_label[k];
      continue;
    }
    const Index segment = std::min(k, plan.stations - 2);
    const double here = plan.accel[k], before = plan.accel[std::max<Index>(k - 1, 0)];
    const double lowest = min_of(here, before), highest = max_of(here, before);
    const double most = plan.accel_max[segment];
    const bool slows = lowest < -hardly;
    const bool full = slows ? lowest <= -plan.decel_max[segment] * nearly_all
                            : highest >= most * nearly_all - hardly;
    const Label speeding = most < nearly_all * plan.most_accel ? limiting::traction : limiting::accel;
    out[k] = full || !plan.smoothed ? (slows ? limiting::decel : speeding) : limiting::jerk;
  }
}

}  // namespace slopewise::verify
