// Bounds and fastest profiles along candidates.
#include "bounds/speed_bounds.hpp"
#include "profile/time_optimal.hpp"
#include "slopewise/candidates.hpp"

namespace slopewise {

// Above that a start speed is no speed of a vehicle, and its square may not be a number [m/s].
constexpr double most_speed = 1e3;

TerrainRows Planner::Candidates::terrain() const noexcept {
  return {stations, candidates, count.data(), station.read(), heading_x.read(), heading_y.read(),
          curvature.read(), grade.read(), sin_grade.read(), sin_roll.read(), bends.read(),
          flags(known)};
}

ForceRows Planner::Candidates::forces(const OwnRows& slope,
                                      const OwnRows& intercept) const noexcept {
  return {slope.read(), intercept.read(), force_upper_slope.read(), force_upper.read(),
          dead_time.read(), shortest_dead_time.read(), slowest.read(), fastest.read(),
          flags(trained), distance_offset.data()};
}

void Planner::Candidates::bound(const std::vector<double>& free) {
  const auto cells = static_cast<std::size_t>(stations * candidates);
  const auto lanes = static_cast<std::size_t>(candidates);
  allocate({&speed_sq_max, &accel_max, &lift, &lift_per_speed_sq, &demand, &slope_left, &force_left});
  limiting.assign(cells, 0);
  barrier.assign(lanes, 0);
  barrier_station.assign(lanes, 0);
  clear_distance.assign(lanes, 0.0);
  const BoundProblem problem{
      terrain(), forces(force_lower_slope, force_lower), {hazard.data(), candidates},
      rough_speed.read(), steering_speed.read(), alike_infinite.unless({}), sliding_friction(),
      free.data(), model.errors, model.limits, model.motion, true};
  bound_speeds(problem,
               {speed_sq_max.rows(), {limiting.data(), candidates}, accel_max.rows(), lift.rows(),
                lift_per_speed_sq.rows(), demand.rows(), slope_left.rows(), force_left.rows(),
                barrier.data(), barrier_station.data(), clear_distance.data()},
               BoundMemory::of_thread(stations, candidates));
}

void Planner::solve(double start_speed, double clear) {
  Candidates& c = *candidates_;
  expect(c.candidates > 0, "solve: expected sample_terrain before");
  expect(start_speed >= 0.0 && start_speed <= most_speed, "start_speed: expected 0 to 1000 m/s");
  expect(clear >= 0.0, "clear: expected a distance >= 0");
  const auto lanes = static_cast<std::size_t>(c.candidates);
  // The front of the vehicle stays on the free way.
  c.bound(std::vector<double>(lanes, max_of(clear - c.model.front, 0.0)));
  c.allocate({&c.speed_sq});
  c.reachable.assign(lanes, 0.0);
  c.start_sq = start_speed * start_speed;
  const std::vector<double> start(lanes, c.start_sq);
  solve_time_optimal({c.stations, c.candidates, c.station.read(), c.speed_sq_max.read(),
                      c.sin_grade.read(), c.slope_left.read(), c.force_left.read(),
                      c.slowest.read(), c.accel_max.read(), c.demand.read(), c.lift.read(),
                      c.lift_per_speed_sq.read(), c.model.limits.decel,
                      c.model.limits.specific_power, c.speed_sq.rows()},
                     start.data(), c.reachable.data());
  c.solved = true;
}

}  // namespace slopewise
