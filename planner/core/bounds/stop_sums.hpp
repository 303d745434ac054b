// What the brakes take out from each station to the target, where nothing but the grade acts.
//
// The energy from onset to the target is an integral, summed once from the target back.
// Source: Braking (7), (8), (12).
#pragma once

#include "bounds/bound_problem.hpp"
#include "profile/time_optimal.hpp"

namespace slopewise {

// By how much v² must be free of the stopping path to be called free [1].
inline constexpr double clearly = 1.0 + 1e-6;

// Integrals over a stretch: of the slope of F_b/W over the speed at onset [s], and of its intercept
// plus sin θ [m].
struct StopSum {
  double slope, intercept;
};

// Highest speed at onset that the brakes take out over a stretch [m/s]: v with
// v²/2 = g (max(v, slowest) * slope + intercept), 0 where there is none; below `slowest` the
// coefficients no longer change.
[[nodiscard]] inline double onset_speed(const StopSum& sum, double slowest) noexcept {
  const double half = gravity * sum.slope;
  const double root = half * half + 2.0 * gravity * sum.intercept;
  const double fast = root > 0.0 ? half + std::sqrt(max_of(root, 0.0)) : 0.0;
  const double energy = 2.0 * gravity * (slowest * sum.slope + sum.intercept);
  const double slow = energy > 0.0 ? min_of(std::sqrt(max_of(energy, 0.0)), slowest) : 0.0;
  return fast < slowest ? slow : fast;
}

// A stop of a tile: terrain, the lower bound of the force that crests leave, targets.
struct StopTile {
  const BoundProblem& problem;
  const Bounds& bounds;
  const double* target;  // the vehicle must stand here [m]
  Index lanes;

  [[nodiscard]] Index stations() const noexcept { return problem.terrain.stations; }
  [[nodiscard]] double station(Index k, Index j) const noexcept {
    return problem.terrain.station.at(k)[j];
  }
  [[nodiscard]] double dead_time(Index k, Index j) const noexcept {
    return problem.forces.dead_time.at(k)[j] + problem.errors.latency;
  }
};

// Sums of a tile, (N, wide) in the memory of the thread.
struct StopSums {
  double *slope, *intercept, *onset;  // the last: speed at onset that leaves nothing of both [m/s]
  LaneLabels last;                    // last station up to the target
  Lane first_slope, first_intercept;  // sums from there to the target
  Index first_tight;                  // the stations before it are free for all candidates

  static Index memory(Index stations) noexcept { return 3 * stations * wide; }
  StopSums(Index stations, double* memory_of_thread) noexcept
      : slope(memory_of_thread),
        intercept(slope + stations * wide),
        onset(intercept + stations * wide),
        last{}, first_slope{}, first_intercept{}, first_tight(stations) {}

  [[nodiscard]] StopSum at(Index k, Index j) const noexcept {
    return {slope[k * wide + j], intercept[k * wide + j]};
  }
};

namespace detail {

// Index of the last station up to the target, 0 if all are beyond.
inline Index last_before(const StopTile& tile, Index j) noexcept {
  const Index count = tile.problem.terrain.counts[j];
  Index k = std::max<Index>(std::min<Index>(tile.bounds.barrier_station[j], count) - 1, 0);
  while (k > 0 && tile.station(k, j) > tile.target[j]) --k;
  return k;
}

// Sums over the segment in which the target lies, from its station k.
inline StopSum to_target(const StopTile& tile, Index k, Index j) noexcept {
  const TerrainRows& t = tile.problem.terrain;
  const Bounds& b = tile.bounds;
  const double ds = max_of(min_of(tile.target[j] - tile.station(k, j), 1e9), 0.0);
  const Index next = std::min<Index>(k + 1, t.counts[j] - 1);
  const double length = tile.station(next, j) - tile.station(k, j);
  const double u = length > 0.0 ? min_of(ds / length, 1.0) : 0.0;
  const double seen = t.known.at(next)[j] ? u : 0.0;
  const double turn = u * (t.grade.at(next)[j] - t.grade.at(k)[j]);
  const auto summed = [&](const auto& rows) {
    const double here = rows.at(k)[j];
    return 0.5 * ds * (2.0 * here + seen * (rows.at(next)[j] - here));
  };
  const double falls =
      summed(t.sin_grade) * (1.0 + turn * turn / 12.0) - tile.problem.errors.height;
  return {summed(b.lower_slope), summed(b.lower_intercept) + falls};
}

// Sums from row k; whether that is not clearly enough for all to stop from the fastest speed.
inline bool sum_row(const StopTile& tile, Index k, StopSums& sums) noexcept {
  const TerrainRows& t = tile.problem.terrain;
  const Index after = std::min(k + 1, t.stations - 1);
  const double *s = t.station.at(k), *s_ahead = t.station.at(after), *grade = t.grade.at(k),
               *grade_ahead = t.grade.at(after), *sine = t.sin_grade.at(k),
               *sine_ahead = t.sin_grade.at(after), *slowest = tile.problem.forces.slowest.at(k);
  const double *slope = tile.bounds.lower_slope.at(k),
               *slope_ahead = tile.bounds.lower_slope.at(after),
               *intercept = tile.bounds.lower_intercept.at(k),
               *intercept_ahead = tile.bounds.lower_intercept.at(after);
  const double *slopes_ahead = sums.slope + after * wide,
               *intercepts_ahead = sums.intercept + after * wide;
  double *slopes = sums.slope + k * wide, *intercepts = sums.intercept + k * wide;
  const double* fastest_of = tile.problem.fastest;
  Label tight = 0;
  SLOPEWISE_INDEPENDENT
  for (Index j = 0; j < tile.lanes; ++j) {
    const auto n = static_cast<std::size_t>(j);
    const double fastest = fastest_of[j];
    const double half = 0.5 * (s_ahead[j] - s[j]), turn = grade_ahead[j] - grade[j];
    // sin of a linear grade: trapezoid, with the next term of its expansion.
    const double falls =
        half * (sine[j] + sine_ahead[j]) * (1.0 + turn * turn * (1.0 / 12.0));
    const double by_slope = slopes_ahead[j] + half * (slope[j] + slope_ahead[j]);
    const double by_intercept =
        intercepts_ahead[j] + half * (intercept[j] + intercept_ahead[j]) + falls;
    const bool inside = k < sums.last[n];
    slopes[j] = inside ? by_slope : sums.first_slope[n];
    intercepts[j] = inside ? by_intercept : sums.first_intercept[n];
    const double enough =
        2.0 * gravity * (max_of(fastest, slowest[j]) * slopes[j] + intercepts[j]);
    tight += (enough < clearly * fastest * fastest) | !inside ? 1 : 0;
  }
  return tight > 0;
}

// Speed at onset in row k; whether it is higher in the row ahead for any candidate.
inline bool onset_row(const StopTile& tile, Index k, StopSums& sums) noexcept {
  const double* slowest = tile.problem.forces.slowest.at(k);
  const double *slope = sums.slope + k * wide, *intercept = sums.intercept + k * wide;
  const double* ahead = sums.onset + std::min(k + 1, tile.stations() - 1) * wide;
  double* onset = sums.onset + k * wide;
  Label rises = 0;
  SLOPEWISE_INDEPENDENT
  for (Index j = 0; j < tile.lanes; ++j) {
    const double speed = onset_speed({slope[j], intercept[j]}, slowest[j]);
    const double v = k <= sums.last[static_cast<std::size_t>(j)] ? speed : 0.0;
    rises += v < ahead[j] ? 1 : 0;
    onset[j] = v;
  }
  return rises > 0;
}

}  // namespace detail

// Sums from every station of a tile to the targets.
inline void sum_to_targets(const StopTile& tile, StopSums& sums) noexcept {
  for (Index j = 0; j < tile.lanes; ++j) {
    const auto n = static_cast<std::size_t>(j);
    sums.last[n] = detail::last_before(tile, j);
    const StopSum first = detail::to_target(tile, sums.last[n], j);
    sums.first_slope[n] = first.slope;
    sums.first_intercept[n] = first.intercept;
  }
  std::fill_n(sums.onset + (tile.stations() - 1) * wide, wide, 0.0);  // no row lies ahead of it
  for (Index k = tile.stations() - 1; k >= 0; --k) {
    if (detail::sum_row(tile, k, sums)) sums.first_tight = k;
  }
}

}  // namespace slopewise
