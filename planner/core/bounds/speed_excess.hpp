// How much faster than planned the vehicle may be when its brakes take hold.
//
// The speed controller misses its speed by some error; and while the dead time runs, the drive may
// be cut, so that a slope steeper than the motion resistance speeds the vehicle up. A stop is
// bounded for the speed that the vehicle may really have, as if it had it from the command on,
// which is longer still.
#pragma once

#include "bounds/bound_problem.hpp"
#include "profile/time_optimal.hpp"

namespace slopewise {

struct Least {
  double operator()(double a, double b) const noexcept { return min_of(a, b); }
};
struct Greatest {
  double operator()(double a, double b) const noexcept { return max_of(a, b); }
};

// One of all numbers, lane by lane, to vectorise.
template <class Choose>
double one_of_all(const Numbers& rows, Index stations, Index candidates) noexcept {
  constexpr Choose choose;
  Lane lanes;
  lanes.fill(rows.at(0)[0]);
  for (Index k = 0; k < stations; ++k) {
    for_each_tile(candidates, [&](const Tile& tile) {
      const double* row = rows.at(k) + tile.first;
      for (std::size_t j = 0; j < static_cast<std::size_t>(tile.lanes); ++j) {
        lanes[j] = choose(lanes[j], row[j]);
      }
    });
  }
  double chosen = lanes[0];
  for (const double lane : lanes) chosen = choose(chosen, lane);
  return chosen;
}

// Ground that the dead time may lead over.
struct RunOff {
  Index reach;        // stations ahead that it may reach
  double resistance;  // f_r [1]
  double error;       // of the speed controller [m/s]
};

namespace detail {

inline void run_off_tile(const BoundProblem& problem, const Tile& tile, const RunOff& run_off,
                         double* excess) noexcept {
  const Index last = problem.terrain.stations - 1;
  const auto lanes = static_cast<std::size_t>(tile.lanes);
  for (Index k = 0; k <= last; ++k) {
    Lane lowest{};
    std::copy_n(problem.terrain.sin_grade.at(k) + tile.first, lanes, lowest.begin());
    for (Index i = k + 1; i <= std::min(k + run_off.reach, last); ++i) {
      const double* sine = problem.terrain.sin_grade.at(i) + tile.first;
      for (std::size_t j = 0; j < lanes; ++j) lowest[j] = min_of(lowest[j], sine[j]);
    }
    const double* dead = problem.forces.dead_time.at(k) + tile.first;
    double* out = excess + k * problem.terrain.candidates + tile.first;
    for (std::size_t j = 0; j < lanes; ++j) {
      const double downhill = max_of(-lowest[j] - run_off.resistance, 0.0);
      out[j] = run_off.error + gravity * downhill * dead[j];
    }
  }
}

}  // namespace detail

// Gain on the steepest ground that the dead time may lead over from each station, (N, M) [m/s];
// false, and nothing written, where a cut drive gains nothing anywhere.
inline bool find_run_off(const BoundProblem& problem, double* excess) noexcept {
  const TerrainRows& t = problem.terrain;
  const double resistance = problem.vehicle.resistance, error = problem.errors.speed;
  const double steepest = one_of_all<Least>(t.sin_grade, t.stations, t.candidates);
  if (!problem.errors.drive_cut || !(-steepest > resistance)) return false;
  const double longest = one_of_all<Greatest>(problem.forces.dead_time, t.stations, t.candidates);
  const double fastest = one_of_all<Greatest>(problem.forces.fastest, t.stations, t.candidates);
  const double gained = gravity * (-steepest - resistance) * longest;
  const double step = max_of(t.station.at(1)[0] - t.station.at(0)[0], 1e-3);
  const double reach = std::ceil((fastest + error + gained) * longest / step) + 1.0;
  const RunOff run_off{static_cast<Index>(min_of(reach, static_cast<double>(t.stations))),
                       resistance, error};
  for_each_tile(t.candidates, [&](const Tile& tile) {
    detail::run_off_tile(problem, tile, run_off, excess);
  });
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
      row[j] = there > 0.0 ? speed * speed : there;
    }
  }
}

}  // namespace slopewise
