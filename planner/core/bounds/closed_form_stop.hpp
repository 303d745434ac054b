// Highest speed from which the vehicle can still stop, where the stopping path has a closed form.
//
// The onset lies a dead time behind the command, so each station looks for the place where the
// speed that the distance up to it allows and the speed that the brakes take out from there on are
// one. Most stations need not look: they are slower for other reasons.
#pragma once

#include "bounds/stop_sums.hpp"

namespace slopewise {

namespace detail {

// Stations that wait to be solved together; each column is a row of numbers, to vectorise.
struct OnsetQueue {
  static constexpr std::size_t enough = 256;  // solved when so many wait
  using Column = std::array<double, enough + static_cast<std::size_t>(wide)>;

  std::size_t waiting = 0;
  std::array<Index, enough + static_cast<std::size_t>(wide)> station, lane;
  Column here, dead;                // command [m], dead time [s]
  Column left, right;               // segment in which the onset lies [m]
  Column short_left, short_right;   // by how much its ends fall short of the onset [m]
  Column per_length;                // of the whole segment [1/m]
  Column slope, slope_rise, intercept, intercept_rise;  // force and sine along it
  Column slope_sum, intercept_sum;                      // from its left end to the target
  Column slowest, answer;
};

// Put lane j of row k into the queue; `i` is where its last search ended and this one ends: the
// onset lies in segment [i, i + 1].
inline void enqueue(const StopTile& tile, const StopSums& sums, Index k, Index j, Label& segment,
                    OnsetQueue& queue) noexcept {
  const TerrainRows& t = tile.problem.terrain;
  const Bounds& b = tile.bounds;
  const double here = tile.station(k, j), dead = tile.dead_time(k, j);
  const auto onset = [&](Index i) { return here + dead * sums.onset[i * wide + j]; };
  const auto reaches = [&](Index i) { return onset(i) > tile.station(i, j); };
  const Index last = sums.last[static_cast<std::size_t>(j)];
  Index i = segment;
  while (i > k && !reaches(i)) --i;
  while (i < last && reaches(i + 1)) ++i;
  segment = i;
  const Index next = std::min<Index>(i + 1, t.counts[j] - 1);
  const double left = tile.station(i, j), length = tile.station(next, j) - left;
  const double seen = t.known.at(next)[j] ? 1.0 : 0.0;
  const auto rise = [&](const auto& rows) { return rows.at(next)[j] - rows.at(i)[j]; };
  const double intercept = b.lower_intercept.at(i)[j] + t.sin_grade.at(i)[j];
  const double intercept_ahead = b.lower_intercept.at(next)[j] + t.sin_grade.at(next)[j];
  const StopSum sum = sums.at(i, j);
  const std::size_t q = queue.waiting++;
  queue.station[q] = k;
  queue.lane[q] = j;
  queue.here[q] = here;
  queue.dead[q] = dead;
  queue.left[q] = left;
  queue.right[q] = i < last ? tile.station(i + 1, j) : tile.target[j];
  queue.short_left[q] = onset(i) - left;
  queue.short_right[q] = (i < last ? onset(i + 1) : here) - queue.right[q];
  queue.per_length[q] = length > 0.0 ? 1.0 / length : 0.0;
  queue.slope[q] = b.lower_slope.at(i)[j];
  queue.slope_rise[q] = seen > 0.0 ? rise(b.lower_slope) : 0.0;
  queue.intercept[q] = intercept;
  queue.intercept_rise[q] = seen > 0.0 ? intercept_ahead - intercept : 0.0;
  queue.slope_sum[q] = sum.slope;
  queue.intercept_sum[q] = sum.intercept;
  queue.slowest[q] = tile.problem.forces.slowest.at(i)[j];
}

// Regula falsi on the place of onset; each iterate is itself a safe speed.
inline void solve_onsets(OnsetQueue& queue) noexcept {
  SLOPEWISE_INDEPENDENT
  for (std::size_t q = 0; q < queue.waiting; ++q) {
    double a = queue.left[q], b = queue.right[q], best = 0.0;
    double short_a = queue.short_left[q], short_b = queue.short_right[q];
    for (int step = 0; step < 3; ++step) {
      const double share = short_a / (short_a - short_b);
      const double p = a + (short_a > short_b ? share : 0.0) * (b - a);
      const double back = p - queue.left[q], w = back * queue.per_length[q];
      const StopSum sum{
          queue.slope_sum[q] - 0.5 * back * (2.0 * queue.slope[q] + w * queue.slope_rise[q]),
          queue.intercept_sum[q] -
              0.5 * back * (2.0 * queue.intercept[q] + w * queue.intercept_rise[q])};
      const double v = onset_speed(sum, queue.slowest[q]);
      best = max_of(best, min_of(v, (p - queue.here[q]) / queue.dead[q]));
      const double residual = queue.here[q] + queue.dead[q] * v - p;
      const bool falls_short = residual > 0.0;
      a = falls_short ? p : a;
      short_a = falls_short ? residual : short_a;
      b = falls_short ? b : p;
      short_b = falls_short ? short_b : residual;
    }
    queue.answer[q] = best;
  }
}

// Solve what waits, and lower the bounds where the stopping path is the tightest.
inline void solve_waiting(OnsetQueue& queue, const Bounds& bounds) noexcept {
  solve_onsets(queue);
  for (std::size_t q = 0; q < queue.waiting; ++q) {
    const double speed_sq = queue.answer[q] * queue.answer[q];
    double& bound = bounds.speed_sq_max.at(queue.station[q])[queue.lane[q]];
    if (!(speed_sq < bound)) continue;
    bound = speed_sq;
    bounds.limiting.at(queue.station[q])[queue.lane[q]] = limiting::stopping_path;
  }
  queue.waiting = 0;
}

// Does row i lie beyond this distance from row k for all candidates that reach so far?
inline bool covers(const StopTile& tile, const StopSums& sums, Index i, Index k,
                   double distance) noexcept {
  const Numbers& station = tile.problem.terrain.station;
  const double *far = station.at(i), *here = station.at(k);
  Label short_of_it = 0;
  for (Index j = 0; j < tile.lanes; ++j) {
    const bool inside = i <= sums.last[static_cast<std::size_t>(j)];
    short_of_it += (far[j] < here[j] + distance) & inside ? 1 : 0;
  }
  return short_of_it == 0;
}

// Settle the candidates of a row that need no search, and mark the others; whether there are any.
// `least` is the least speed at onset on the distance of the dead time, up to row `reach`.
inline bool settle_row(const StopTile& tile, const StopSums& sums, Index k, Index reach,
                       const Lane& least, LaneLabels& near) noexcept {
  const BoundProblem& p = tile.problem;
  const double *station = p.terrain.station.at(k), *station_reach = p.terrain.station.at(reach),
               *dead_time = p.forces.dead_time.at(k), *target = tile.target,
               *onset = sums.onset + k * wide;
  const std::int64_t* barrier_station = tile.bounds.barrier_station;
  const Label* barrier = tile.bounds.barrier;
  double* speed_sq_max = tile.bounds.speed_sq_max.at(k);
  Label *label = tile.bounds.limiting.at(k), some = 0;
  const double* fastest = p.fastest;
  const double latency = p.errors.latency;
  const Index lanes = tile.lanes;
  SLOPEWISE_INDEPENDENT
  for (Index j = 0; j < lanes; ++j) {
    const auto n = static_cast<std::size_t>(j);
    const double here = station[j], dead = dead_time[j] + latency, bound = speed_sq_max[j];
    const double at_onset = onset[j] * onset[j];
    const bool inside = k < barrier_station[j];
    const bool beyond = inside & ((k > sums.last[n]) | (target[j] <= here));
    const bool free = (station_reach[j] >= here + dead * fastest[j]) &
                      (least[n] * least[n] > clearly * bound);
    const bool searching = inside & (dead > 0.0) & !beyond & !free;
    near[n] = searching ? 1 : 0;
    some += searching ? 1 : 0;
    const bool at_once = inside & (dead <= 0.0) & (at_onset < bound);
    const double settled = at_once ? at_onset : bound;
    const Label why = at_once ? limiting::stopping_path : label[j];
    speed_sq_max[j] = beyond ? -1.0 : settled;
    label[j] = beyond ? barrier[j] : why;
  }
  return some > 0;
}

// Least speed at onset on the rows from k up to `reach`; where none rises it is the last one's.
inline void least_onset(const StopSums& sums, Index k, Index reach, bool rises, Index lanes,
                        Lane& least) noexcept {
  std::copy_n(sums.onset + reach * wide, lanes, least.begin());
  for (Index i = k; rises && i < reach; ++i) {
    const double* onset = sums.onset + i * wide;
    for (Index j = 0; j < lanes; ++j) {
      const auto n = static_cast<std::size_t>(j);
      least[n] = min_of(least[n], onset[j]);
    }
  }
}

}  // namespace detail

// Lower bounds of a tile so that every stop ends before the target; −1 where none can.
inline void bound_stops(const StopTile& tile, double* memory) noexcept {
  StopSums sums(tile.stations(), memory);
  sum_to_targets(tile, sums);
  detail::OnsetQueue queue;
  Lane least{};
  LaneLabels near{}, segment = sums.last;
  double distance = 0.0;
  for (Index j = 0; j < tile.lanes; ++j) {
    distance = max_of(distance, tile.problem.longest_dead_time[j] * tile.problem.fastest[j]);
  }
  Index reach = tile.stations() - 1, rise = tile.stations();
  for (Index k = tile.stations() - 1; k >= 0; --k) {
    while (reach > k && detail::covers(tile, sums, reach - 1, k, distance)) --reach;
    if (reach < sums.first_tight) break;
    if (detail::onset_row(tile, k, sums)) rise = k;
    detail::least_onset(sums, k, reach, rise < reach, tile.lanes, least);
    if (!detail::settle_row(tile, sums, k, reach, least, near)) continue;
    for (Index j = 0; j < tile.lanes; ++j) {
      if (near[static_cast<std::size_t>(j)] == 0) continue;
      detail::enqueue(tile, sums, k, j, segment[static_cast<std::size_t>(j)], queue);
    }
    if (queue.waiting >= detail::OnsetQueue::enough) detail::solve_waiting(queue, tile.bounds);
  }
  detail::solve_waiting(queue, tile.bounds);
}

}  // namespace slopewise
