// Speed bounds along candidates: how fast each station may be passed, and what says so.
//
// Ground on which the vehicle must not even stand is a barrier: unknown ground, ground steeper than
// the model was trained on, a slope on which an axle or a side is too light, that the brakes cannot
// hold or the drive cannot climb. The clear distance ends at the last station before it, and the
// stopping path must end before the clear distance. All other bounds are speeds.
#pragma once

#include <vector>

#include "bounds/chords.hpp"
#include "bounds/closed_form_stop.hpp"
#include "bounds/crest_force.hpp"
#include "bounds/integrated_stop.hpp"
#include "bounds/pointwise.hpp"
#include "bounds/speed_excess.hpp"

namespace slopewise {

// Memory of a thread for the bounds of a batch, kept from call to call.
struct BoundMemory {
  std::vector<double> sums, excess, of_candidates;
  std::vector<StopStation> path;

  static BoundMemory& of_thread(Index stations, Index candidates);
};

namespace detail {

// Station up to which the vehicle may stop; what is clear at most is no barrier.
inline void clear_lanes(const BoundProblem& problem, Index lanes, const Bounds& out) noexcept {
  for (Index j = 0; j < lanes; ++j) {
    const std::int64_t first = out.barrier_station[j];
    const Index last = std::max<Index>(std::min<Index>(first, problem.terrain.counts[j]) - 1, 0);
    const double reach = first > 0 ? problem.terrain.station.at(last)[j] : 0.0;
    if (problem.clear[j] < reach) out.barrier[j] = limiting::stopping_path;
    out.clear_distance[j] = min_of(reach, problem.clear[j]);
  }
}

// Lower v² of a tile to what stops before the clear distance, from the speed that it may really
// have.
inline void bound_stopping_path(const BoundProblem& problem, Index lanes, const Bounds& out,
                                const LaneLabels& last_risk, BoundMemory& memory) noexcept {
  const Index stations = problem.terrain.stations;
  Lane target{};
  for (Index j = 0; j < lanes; ++j) {
    const double clear = out.clear_distance[j] - problem.forces.distance_offset[j];
    target[static_cast<std::size_t>(j)] = clear - problem.errors.along_track - stop_guard;
  }
  if (problem.exceeds) add_speed(out.speed_sq_max, problem.excess, 1.0, stations, lanes);
  lose_on_crests(problem, target.data(), lanes, out);
  for (Index j = 0; j < lanes; ++j) {
    const auto n = static_cast<std::size_t>(j);
    const StopLane lane{problem, out, j, target[n]};
    const ClosedFormStops stops(lane, memory.sums.data());
    stops.end_at_target();
    // Effects on the motion, of which it knows none, may allow more: those stops are tried for.
    if (!problem.motion.moves) stops.lower();
    const Index risk = last_risk[n];
    if (!problem.closed_form || risk >= 0) bound_stops_by_trial(lane, risk, memory.path.data());
  }
  if (problem.exceeds) add_speed(out.speed_sq_max, problem.excess, -1.0, stations, lanes);
}

inline void bound_tile(const BoundProblem& problem, Index lanes, const Bounds& out,
                       BoundMemory& memory) noexcept {
  LaneLabels last_risk;
  bound_points(problem, lanes, out, last_risk);
  clear_lanes(problem, lanes, out);
  bound_stopping_path(problem, lanes, out, last_risk, memory);
  keep_chords_below(out, problem.terrain.stations, lanes);
  const double limit = problem.vehicle.speed;
  keep_limit(out, limit * limit, problem.terrain.stations, lanes);
}

}  // namespace detail

inline BoundMemory& BoundMemory::of_thread(Index stations, Index candidates) {
  thread_local BoundMemory memory;
  const auto enough = [](auto& part, Index count) {
    if (part.size() < static_cast<std::size_t>(count)) part.resize(static_cast<std::size_t>(count));
  };
  enough(memory.sums, ClosedFormStops::memory(stations));
  enough(memory.excess, stations * candidates);
  enough(memory.of_candidates, 4 * candidates);
  enough(memory.path, stations);
  return memory;
}

// Bounds of a batch.
inline void bound_speeds(BoundProblem problem, const Bounds& out, BoundMemory& memory) noexcept {
  const Index candidates = problem.terrain.candidates;
  double* fastest = memory.of_candidates.data();
  double *top = fastest + candidates, *longest = top + candidates, *excess = longest + candidates;
  highest_of(problem.forces.fastest, problem.terrain, fastest);
  highest_of(problem.forces.dead_time, problem.terrain, longest);
  const Alike<double> error{problem.errors.speed};
  problem.excess = {error.lanes.data(), 0};
  problem.exceeds = problem.errors.speed > 0.0;
  if (find_run_off(problem, longest, fastest, memory.excess.data())) {
    problem.excess = {memory.excess.data(), candidates};
    problem.exceeds = true;
  }
  std::fill_n(excess, candidates, problem.errors.speed);
  if (problem.excess.stride > 0) highest_of(problem.excess, problem.terrain, excess);
  for (Index j = 0; j < candidates; ++j) {
    // What crests and turns take of brakes and drive is that at the highest trained speed: at the
    // speed limit a lower one would leave more of them, and make a plan faster.
    top[j] = max_of(problem.vehicle.speed, fastest[j]);
    fastest[j] += excess[j];
  }
  problem.top = top;
  problem.fastest = fastest;
  for_each_tile(candidates, [&](const Tile& tile) {
    detail::bound_tile(problem.from(tile.first), tile.lanes, out.from(tile.first), memory);
  });
}

}  // namespace slopewise
