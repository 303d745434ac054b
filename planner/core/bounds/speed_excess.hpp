// How much faster than planned the vehicle may be when its brakes take hold.
//
// The speed controller misses its speed by some error; and while the dead time runs, the drive may
// be cut, so that a slope steeper than the motion resistance speeds the vehicle up. A stop is
// bounded for the speed that the vehicle may really have, as if it had it from the command on,
// which is longer still.
#pragma once

#include <algorithm>

#include "bounds/bound_problem.hpp"
#include "profile/time_optimal.hpp"

namespace slopewise {

// The highest number at the stations of each candidate, (M,).
inline void highest_of(const Numbers& rows, const TerrainRows& terrain, double* highest) noexcept {
  std::copy_n(rows.at(0), terrain.candidates, highest);
  for (Index k = 1; k < terrain.stations; ++k) {
    const double* row = rows.at(k);
    SLOPEWISE_INDEPENDENT
    for (Index j = 0; j < terrain.candidates; ++j) {
      highest[j] = k < terrain.counts[j] ? max_of(highest[j], row[j]) : highest[j];
    }
  }
}

// Gain on the steepest ground that the dead time may lead over from each station, (N, M) [m/s];
// false where a cut drive gains nothing anywhere. Of each candidate the longest dead time [s] and
// the highest trained speed [m/s].
inline bool find_run_off(const BoundProblem& problem, const double* longest_dead_time,
                         const double* fastest, double* excess) noexcept {
  const TerrainRows& t = problem.terrain;
  if (!problem.errors.drive_cut) return false;
  const auto downhill = [&](double sine) {
    return gravity * max_of(-sine - problem.vehicle.rolling, 0.0);
  };
  bool gains = false;
  for (Index j = 0; j < t.candidates; ++j) {
    const auto count = static_cast<Index>(t.counts[j]);
    double lowest = 0.0;
    for (Index k = 0; k < count; ++k) lowest = min_of(lowest, t.sin_grade.at(k)[j]);
    gains |= downhill(lowest) > 0.0;
    const double dead = longest_dead_time[j];
    const double distance = (fastest[j] + problem.errors.speed + downhill(lowest) * dead) * dead;
    for (Index k = 0; k < t.stations; ++k) {
      double steepest = t.sin_grade.at(k)[j];
      for (Index i = k + 1; i < count; ++i) {
        // Up to the second station behind the distance, because grades bend between stations.
        const double passed = t.station.at(std::max(i - 2, k))[j] - t.station.at(k)[j];
        if (!(passed <= distance)) break;
        steepest = min_of(steepest, t.sin_grade.at(i)[j]);
      }
      excess[k * t.candidates + j] =
          problem.errors.speed + downhill(steepest) * problem.forces.dead_time.at(k)[j];
    }
  }
  return gains;
}

// Add (+1) or take away (−1) an excess of speed from bounds on v² of a tile; those <= 0 stay.
inline void add_speed(const Rows<double>& speed_sq, const Numbers& excess, double sign,
                      Index stations, Index lanes) noexcept {
  for (Index k = 0; k < stations; ++k) {
    double* row = speed_sq.at(k);
    const double* extra = excess.at(k);
    SLOPEWISE_INDEPENDENT
    for (Index j = 0; j < lanes; ++j) {
      const double there = row[j];
      const double speed = max_of(std::sqrt(max_of(there, 0.0)) + sign * extra[j], 0.0);
      row[j] = (there > 0.0) & (extra[j] != 0.0) ? speed * speed : there;
    }
  }
}

}  // namespace slopewise
