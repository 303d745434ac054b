// Bounds on speed.
#include <nanobind/stl/optional.h>

#include "bindings/bind_rows.hpp"
#include "bindings/bind_vehicle.hpp"
#include "bounds/speed_bounds.hpp"

namespace slopewise {
namespace {

using Curves = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

std::tuple<Made<double>, Made<Label>, Made<Label>, Made<std::int64_t>, Made<double>> speed_bounds(
    const nb::handle& profile, const nb::handle& ground, const nb::handle& hazards,
    const nb::handle& speed_limit, const Input1& clear, const nb::handle& vehicle,
    std::optional<Curves> curves) {
  const TerrainRows t = terrain_of(profile);
  const Index n = t.stations, m = t.candidates;
  if (n < 2 || m < 1) throw nb::value_error("profile: expected a candidate and two stations");
  expect_shape("clear", clear, {m});
  const auto rows = make_rows(7, n, m);
  const auto limiting = make_rows<Label>(n, m);
  const auto barrier = make_array<Label>(m);
  const auto barrier_station = make_array<std::int64_t>(m);
  const auto clear_distance = make_array(m);
  const auto speeds = [&](const char* name, const nb::handle& array) {
    return alike_infinite.unless(rows_of<double>(name, array, n, m));
  };
  BoundProblem problem{
      t, forces_of(ground, n, m),
      alike_zero.unless(rows_of<std::int64_t>("code", hazards.attr("code"), n, m)),
      speeds("rough_speed", hazards.attr("rough_speed")),
      speeds("steering_speed", hazards.attr("steering_speed")), speeds("speed_limit", speed_limit),
      rows_of<double>("friction", ground.attr("friction"), n, m), clear.data(),
      errors_of(ground.attr("errors")), vehicle_of(vehicle), motion_of(ground.attr("motion")),
      nb::cast<bool>(ground.attr("closed_form"))};
  if (curves) {
    expect_shape("curves", *curves, {limiting::count, n});
    problem.curves = curves->data();
  }
  const auto row = [&](Index r) { return Rows<double>{rows.data() + r * n * m, m}; };
  const Bounds out{row(0), {limiting.data(), m}, row(1), row(2), row(3), row(4),
                   row(5), row(6), barrier.data(), barrier_station.data(), clear_distance.data()};
  BoundMemory& memory = BoundMemory::of_thread(n, m);
  const nb::gil_scoped_release release;
  bound_speeds(problem, out, memory);
  return {rows, limiting, barrier, barrier_station, clear_distance};
}

}  // namespace

void bind_bounds(nb::module_& m) {
  using namespace nb::literals;
  m.attr("STOP_GUARD") = stop_guard;
  m.attr("HOLDING") = least_slowing;
  m.attr("MOTION_LAWS") = laws::motion_laws;
  m.def("speed_bounds", &speed_bounds, "profile"_a, "ground"_a, "hazards"_a,
        "speed_limit"_a.none(), "clear"_a, "vehicle"_a, "curves"_a.none());
}

}  // namespace slopewise
