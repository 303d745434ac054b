// Profiles along paths. Arrays belong to the caller; no call keeps one.
#include <algorithm>
#include <array>

#include "bindings/bindings.hpp"
#include "profile/smoothing.hpp"
#include "profile/time_optimal.hpp"

namespace slopewise {
namespace {

void time_optimal(const Input2& station, const Input2& speed_sq_max, const Input2& sin_grade,
                  const Input2& force_lower_slope, const Input2& force_lower_intercept,
                  const Input2& trained_speed_min, const Input2& accel_bound,
                  const Input2& required_thrust_ratio, const Input1& start_sq, double decel,
                  double specific_power, const Output2& speed_sq,
                  const Output1& reachable_start_sq) {
  Table table{static_cast<Index>(speed_sq.shape(0)), static_cast<Index>(speed_sq.shape(1)), {}};
  std::size_t r = 0;
  for (const Input2* row :
       {&station, &speed_sq_max, &sin_grade, &force_lower_slope, &force_lower_intercept,
        &trained_speed_min, &accel_bound, &required_thrust_ratio}) {
    expect_shape(row_table[r].name, *row, {table.stations, table.candidates});
    table.rows[r++] = const_cast<double*>(row->data());  // only the answer is written
  }
  table.rows[r] = speed_sq.data();
  expect_shape("start_sq", start_sq, {table.candidates});
  expect_shape("reachable_start_sq", reachable_start_sq, {table.candidates});
  if (table.stations == 0) throw nb::value_error("speed_sq: expected stations, got none");
  double* memory = Workspace::of_thread().reserve(time_optimal_memory(table.stations));
  const nb::gil_scoped_release release;
  solve_time_optimal(table, {decel, specific_power}, start_sq.data(), reachable_start_sq.data(),
                     memory);
}

void travel_cost(const Input2& station, const Input2& speed_sq, double horizon_penalty,
                 const Output1& cost) {
  const auto stations = static_cast<Index>(station.shape(0)),
             candidates = static_cast<Index>(station.shape(1));
  expect_shape("speed_sq", speed_sq, {stations, candidates});
  expect_shape("cost", cost, {candidates});
  if (stations == 0) throw nb::value_error("station: expected stations, got none");
  const nb::gil_scoped_release release;
  add_travel_cost(station.data(), speed_sq.data(), stations, candidates, horizon_penalty,
                  cost.data());
}

SmoothingProblem problem_of(const Input1& ds, const Input1& speed_sq_max, const Input1& accel,
                            const Input1& decel, double jerk, double start_accel) {
  const auto n = static_cast<Index>(speed_sq_max.shape(0));
  if (n < min_stations) throw nb::value_error("speed_sq_max: expected at least 3 stations");
  expect_shape("ds", ds, {n - 1});
  expect_shape("accel_max", accel, {n - 1});
  expect_shape("decel_max", decel, {n - 1});
  return {n, ds.data(), speed_sq_max.data(), accel.data(), decel.data(), jerk, start_accel};
}

int smooth_profile(const Input1& ds, const Input1& speed_sq_max, const Input1& accel,
                   const Input1& decel, double jerk, double start_accel, const Output1& speed_sq) {
  const SmoothingProblem p = problem_of(ds, speed_sq_max, accel, decel, jerk, start_accel);
  expect_shape("speed_sq", speed_sq, {p.stations});
  double* memory = Workspace::of_thread().reserve(smoothing_memory(p.stations));
  const nb::gil_scoped_release release;
  return smooth(p, memory, speed_sq.data());
}

void smoothing_program(const Input1& ds, const Input1& speed_sq_max, const Input1& accel,
                       const Input1& decel, double jerk, double start_accel, const Output1& open,
                       const Output3& rows, const Output2& limit) {
  const SmoothingProblem p = problem_of(ds, speed_sq_max, accel, decel, jerk, start_accel);
  expect_shape("open", open, {p.stations});
  expect_shape("rows", rows, {kind_count, 3, p.stations});
  expect_shape("limit", limit, {kind_count, p.stations});
  double* around = Workspace::of_thread().reserve(p.stations);
  NearestProblem program(p.stations, speed_sq_max.data(), open.data());
  program.rows = rows.data();
  program.limit = limit.data();
  lower_to_reachable(p, around);
  write_program(p, around, program);
}

void keep_profile_inside(const Input1& speed_sq, const Input1& speed_sq_max, const Output1& out) {
  const auto n = static_cast<Index>(std::min(speed_sq.shape(0), speed_sq_max.shape(0)));
  if (n == 0 || static_cast<Index>(out.shape(0)) < n) {
    throw nb::value_error("out: expected a number for each station");
  }
  keep_inside(speed_sq.data(), speed_sq_max.data(), n, out.data());
}

}  // namespace

void bind_profile(nb::module_& m) {
  using namespace nb::literals;
  m.attr("STANDSTILL_SQ") = standstill_sq;
  m.attr("TIGHTENING") = tightening;
  m.attr("MIN_STATIONS") = min_stations;
  m.attr("NO_PROFILE") = no_profile;
  m.attr("KIND_COUNT") = kind_count;
  m.def("time_optimal", &time_optimal, "station"_a, "speed_sq_max"_a, "sin_grade"_a,
        "force_lower_slope"_a, "force_lower_intercept"_a, "trained_speed_min"_a, "accel_max"_a,
        "required_thrust_ratio"_a, "start_sq"_a, "decel"_a, "specific_power"_a,
        "speed_sq"_a.noconvert(), "reachable_start_sq"_a.noconvert());
  m.def("travel_cost", &travel_cost, "station"_a, "speed_sq"_a, "horizon_penalty"_a,
        "cost"_a.noconvert());
  m.def("smooth", &smooth_profile, "ds"_a, "speed_sq_max"_a, "accel_max"_a, "decel_max"_a,
        "jerk"_a, "start_accel"_a, "speed_sq"_a.noconvert());
  m.def("smoothing_program", &smoothing_program, "ds"_a, "speed_sq_max"_a, "accel_max"_a,
        "decel_max"_a, "jerk"_a, "start_accel"_a, "open"_a.noconvert(), "rows"_a.noconvert(),
        "limit"_a.noconvert());
  m.def("keep_inside", &keep_profile_inside, "speed_sq"_a, "speed_sq_max"_a,
        "out"_a.noconvert());
}

}  // namespace slopewise
