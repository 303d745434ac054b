// Bounds on speed. Arrays belong to the caller; no call keeps one.
#include "bindings/bind_rows.hpp"
#include "bindings/bind_vehicle.hpp"
#include "bounds/speed_bounds.hpp"

namespace slopewise {
namespace {

using Labels1 = nb::ndarray<std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Labels2 = nb::ndarray<std::int64_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

void speed_bounds(const nb::handle& profile, const nb::handle& ground, const nb::handle& hazards,
                  const nb::handle& speed_limit, const Input1& clear, const nb::handle& vehicle,
                  const Output3& rows, const Labels2& limiting,
                  const Labels1& barrier, const Labels1& barrier_station,
                  const Output1& clear_distance) {
  const TerrainRows t = terrain_of(profile);
  const Index n = t.stations, m = t.candidates;
  if (n < 2 || m < 1) throw nb::value_error("profile: expected a candidate and two stations");
  expect_shape("clear", clear, {m});
  expect_shape("rows", rows, {5, n, m});
  expect_shape("limiting", limiting, {n, m});
  expect_shape("barrier", barrier, {m});
  expect_shape("barrier_station", barrier_station, {m});
  expect_shape("clear_distance", clear_distance, {m});
  const auto speeds = [&](const char* name, const nb::handle& array) {
    return alike_infinite.unless(rows_of<double>(name, array, n, m));
  };
  const BoundProblem problem{
      t, forces_of(ground, n, m),
      alike_zero.unless(rows_of<std::int64_t>("code", hazards.attr("code"), n, m)),
      speeds("rough_speed", hazards.attr("rough_speed")),
      speeds("steering_speed", hazards.attr("steering_speed")), speeds("speed_limit", speed_limit),
      rows_of<double>("friction", ground.attr("friction"), n, m), clear.data(),
      errors_of(ground.attr("errors")), vehicle_of(vehicle), motion_of(ground.attr("motion")),
      nb::cast<bool>(ground.attr("closed_form"))};
  const auto row = [&](Index r) { return Rows<double>{rows.data() + r * n * m, m}; };
  const Bounds out{row(0), {limiting.data(), m}, row(1), row(2), row(3), row(4),
                   barrier.data(), barrier_station.data(), clear_distance.data()};
  BoundMemory& memory = BoundMemory::of_thread(n, m);
  const nb::gil_scoped_release release;
  bound_speeds(problem, out, memory);
}

void speed_excess(const nb::handle& profile, const nb::handle& ground, double resistance,
                  const Output2& excess) {
  BoundProblem problem{};
  problem.terrain = terrain_of(profile);
  problem.forces = forces_of(ground, problem.terrain.stations, problem.terrain.candidates);
  expect_shape("excess", excess, {problem.terrain.stations, problem.terrain.candidates});
  problem.errors = errors_of(ground.attr("errors"));
  problem.vehicle.resistance = resistance;
  if (!find_run_off(problem, excess.data())) {
    std::fill_n(excess.data(), excess.size(), problem.errors.speed);
  }
}

double speed_at_onset(double slope_sum, double intercept_sum, double slowest) {
  return onset_speed({slope_sum, intercept_sum}, slowest);
}

}  // namespace

void bind_bounds(nb::module_& m) {
  using namespace nb::literals;
  m.attr("STOP_GUARD") = stop_guard;
  m.attr("HOLDING") = least_slowing;
  m.attr("SPENT") = crest_spent;
  m.def("speed_bounds", &speed_bounds, "profile"_a, "ground"_a, "hazards"_a,
        "speed_limit"_a.none(), "clear"_a, "vehicle"_a,
        "rows"_a.noconvert(), "limiting"_a.noconvert(), "barrier"_a.noconvert(),
        "barrier_station"_a.noconvert(), "clear_distance"_a.noconvert());
  m.def("speed_excess", &speed_excess, "profile"_a, "ground"_a, "resistance"_a,
        "excess"_a.noconvert());
  m.def("onset_speed", &speed_at_onset, "slope_sum"_a, "intercept_sum"_a, "slowest"_a);
}

}  // namespace slopewise
