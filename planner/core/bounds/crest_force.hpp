// What crests take from the braking force of a stop that ends before the clear distance.
//
// The loss grows with v². Of all stops that end in time none is faster at a station than what the
// brakes could take out from there to the target, were no load lost; nor than the station's own
// bound by more than a plan slows down during a dead time. Up to that speed the force that is left
// is known without following any stop. A stop that is faster there does not end in time with this
// force, and all the less with its own. Law: models/laws/crest.
#pragma once

#include "bounds/bound_problem.hpp"
#include "bounds/contact_bound.hpp"

namespace slopewise {

// More than what the sum of a sine between two stations leaves out [1].
inline constexpr double sum_rounding = 1.0 + 1e-3;

namespace detail {

// From a station on to the target.
struct CrestSums {
  Lane taken_out;    // what the brakes take out, over m g [m]
  Lane force_ahead;  // force and slope at the next station, over the weight
  Lane least;        // share of the force that any station keeps
};

inline void lose_on_row(const BoundProblem& problem, const double* target, const Bounds& bounds,
                        Index k, Index lanes, CrestSums& sums) noexcept {
  const TerrainRows& t = problem.terrain;
  const double *station = t.station.at(k), *sin_grade = t.sin_grade.at(k),
               *sin_roll = t.sin_roll.at(k), *vertical = t.vertical_curvature.at(k),
               *station_ahead = t.station.at(std::min(k + 1, t.stations - 1)),
               *dead_time = problem.forces.dead_time.at(k), *slowest = problem.forces.slowest.at(k),
               *speed_sq_max = bounds.speed_sq_max.at(k);
  double *slope = bounds.lower_slope.at(k), *intercept = bounds.lower_intercept.at(k);
  const double* fastest_of = problem.fastest;
  const double latency = problem.errors.latency;
  const double decel = problem.vehicle.decel, crest_share = problem.vehicle.crest_share;
  SLOPEWISE_INDEPENDENT
  for (Index j = 0; j < lanes; ++j) {
    const auto n = static_cast<std::size_t>(j);
    const double sine = sin_grade[j], slow = slowest[j], fastest = fastest_of[j];
    const ForceLine line{slope[j], intercept[j]};
    const double up = std::sqrt((1.0 - sine * sine) * (1.0 - sin_roll[j] * sin_roll[j]));
    const double length = max_of(min_of(station_ahead[j], target[j]) - station[j], 0.0);
    const double part = max_of(slow * line.slope, max_of(fastest, slow) * line.slope);
    const double most = max_of(part + line.intercept + sine, sums.force_ahead[n]);
    const double energy =
        2.0 * gravity * (sums.taken_out[n] + length * max_of(most, 0.0)) * sum_rounding;
    const double passed =
        std::sqrt(max_of(speed_sq_max[j], 0.0)) + decel * (dead_time[j] + latency);
    const double reached = min_of(passed, fastest);
    const double speed_sq = min_of(reached * reached, energy);
    const double falls = max_of(-vertical[j], 0.0);
    const double left = max_of(1.0 - crest_share * falls * speed_sq / (gravity * up), 0.0);
    const double least = line.intercept + min_of(slow * line.slope, fastest * line.slope);
    const double kept = least > 0.0 ? left : 1.0;
    slope[j] = line.slope * kept;
    intercept[j] = line.intercept * kept;
    sums.least[n] = min_of(sums.least[n], length > 0.0 ? kept : 1.0);
    const double here = kept * (part + line.intercept) + sine;
    sums.taken_out[n] =
        max_of(sums.taken_out[n] + 0.5 * length * (here + sums.force_ahead[n]), 0.0);
    sums.force_ahead[n] = here;
  }
}

}  // namespace detail

// Lower the force of a tile's bounds to what crests leave of it.
//
// Where effects move the vehicle every station may be met at the highest speed. Where the force
// lags, what a crest takes anywhere is missing everywhere: a force that has built up before it does
// not wait to be lost on it.
inline void lose_on_crests(const BoundProblem& problem, const double* target, Index lanes,
                           const Bounds& bounds) noexcept {
  detail::CrestSums sums{};
  sums.taken_out.fill(problem.motion.moves ? no_limit : 0.0);
  sums.least.fill(1.0);
  for (Index k = problem.terrain.stations - 1; k >= 0; --k) {
    detail::lose_on_row(problem, target, bounds, k, lanes, sums);
  }
  if (problem.motion.lag <= 0.0) return;
  for (Index k = 0; k < problem.terrain.stations; ++k) {
    double *slope = bounds.lower_slope.at(k), *intercept = bounds.lower_intercept.at(k);
    for (Index j = 0; j < lanes; ++j) {
      slope[j] *= sums.least[static_cast<std::size_t>(j)];
      intercept[j] *= sums.least[static_cast<std::size_t>(j)];
    }
  }
}

}  // namespace slopewise
