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

namespace detail {

// How far the dead time may lead at most, of each lane [m].
inline Lane run_off_distance(const BoundProblem& problem, const Tile& tile) noexcept {
  const TerrainRows& t = problem.terrain;
  const auto lanes = static_cast<std::size_t>(tile.lanes);
  const std::int64_t* count = t.counts + tile.first;
  Lane lowest{}, longest{}, fastest{}, distance{};
  for (Index k = 0; k < t.stations; ++k) {
    const double* sine = t.sin_grade.at(k) + tile.first;
    const double* dead = problem.forces.dead_time.at(k) + tile.first;
    const double* fast = problem.forces.fastest.at(k) + tile.first;
    SLOPEWISE_INDEPENDENT
    for (std::size_t j = 0; j < lanes; ++j) {
      const bool own = k < count[j];
      lowest[j] = own ? min_of(lowest[j], sine[j]) : lowest[j];
      longest[j] = own ? max_of(longest[j], dead[j]) : longest[j];
      fastest[j] = own ? max_of(fastest[j], fast[j]) : fastest[j];
    }
  }
  for (std::size_t j = 0; j < lanes; ++j) {
    const double downhill = max_of(-lowest[j] - problem.vehicle.resistance, 0.0);
    const double gained = gravity * downhill * longest[j];
    distance[j] = (fastest[j] + problem.errors.speed + gained) * longest[j];
  }
  return distance;
}

inline void run_off_tile(const BoundProblem& problem, const Tile& tile, double* excess) noexcept {
  const TerrainRows& t = problem.terrain;
  const auto lanes = static_cast<std::size_t>(tile.lanes);
  const Lane distance = run_off_distance(problem, tile);
  const std::int64_t* count = t.counts + tile.first;
  for (Index k = 0; k < t.stations; ++k) {
    const double* here = t.station.at(k) + tile.first;
    Lane lowest{};
    std::copy_n(t.sin_grade.at(k) + tile.first, lanes, lowest.begin());
    Label some = 1;
    for (Index i = k + 1; i < t.stations && some > 0; ++i) {
      // Up to the second station behind the distance, because grades bend between stations.
      const double* before = t.station.at(std::max(i - 2, k)) + tile.first;
      const double* sine = t.sin_grade.at(i) + tile.first;
      some = 0;
      SLOPEWISE_INDEPENDENT
      for (std::size_t j = 0; j < lanes; ++j) {
        const double ahead = i < count[j] ? min_of(lowest[j], sine[j]) : lowest[j];
        const bool within = before[j] - here[j] <= distance[j];
        lowest[j] = within ? ahead : lowest[j];
        some += within ? 1 : 0;
      }
    }
    const double* dead = problem.forces.dead_time.at(k) + tile.first;
    double* out = excess + k * t.candidates + tile.first;
    for (std::size_t j = 0; j < lanes; ++j) {
      const double downhill = max_of(-lowest[j] - problem.vehicle.resistance, 0.0);
      out[j] = problem.errors.speed + gravity * downhill * dead[j];
    }
  }
}

}  // namespace detail

// Gain on the steepest ground that the dead time may lead over from each station, (N, M) [m/s];
// false, and nothing written, where a cut drive gains nothing anywhere.
inline bool find_run_off(const BoundProblem& problem, double* excess) noexcept {
  const TerrainRows& t = problem.terrain;
  if (!problem.errors.drive_cut) return false;
  bool gains = false;
  for (Index k = 0; k < t.stations && !gains; ++k) {
    const double* sine = t.sin_grade.at(k);
    gains = std::any_of(sine, sine + t.candidates,
                        [&](double here) { return -here > problem.vehicle.resistance; });
  }
  if (!gains) return false;
  for_each_tile(t.candidates,
                [&](const Tile& tile) { detail::run_off_tile(problem, tile, excess); });
  return true;
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
