// Profiles along paths.
#include <algorithm>
#include <array>

#include "bindings/bindings.hpp"
#include "profile/smoothing.hpp"
#include "profile/time_optimal.hpp"

namespace slopewise {
namespace {

std::tuple<Made<double>, Made<double>> time_optimal(
    const Input2& station, const Input2& speed_sq_max, const Input2& sin_grade,
    const Input2& force_lower_slope, const Input2& force_lower_intercept,
    const Input2& trained_speed_min, const Input2& accel_bound,
    const Input2& required_thrust_ratio, const Input1& start_sq, double decel,
    double specific_power) {
  Table table{static_cast<Index>(station.shape(0)), static_cast<Index>(station.shape(1)), {}};
  if (table.stations == 0) throw nb::value_error("station: expected stations, got none");
  std::size_t r = 0;
  for (const Input2* row :
       {&station, &speed_sq_max, &sin_grade, &force_lower_slope, &force_lower_intercept,
        &trained_speed_min, &accel_bound, &required_thrust_ratio}) {
    expect_shape(row_table[r].name, *row, {table.stations, table.candidates});
    table.rows[r++] = const_cast<double*>(row->data());  // only the answer is written
  }
  const auto speed_sq = make_rows(table.stations, table.candidates);
  table.rows[r] = speed_sq.data();
  expect_shape("start_sq", start_sq, {table.candidates});
  const auto reachable_start_sq = make_array(table.candidates);
  double* memory = Workspace::of_thread().reserve(time_optimal_memory(table.stations));
  const nb::gil_scoped_release release;
  solve_time_optimal(table, {decel, specific_power}, start_sq.data(), reachable_start_sq.data(),
                     memory);
  return {speed_sq, reachable_start_sq};
}

Made<double> travel_cost(const Input2& station, const Input2& speed_sq, double horizon_penalty) {
  const auto stations = static_cast<Index>(station.shape(0)),
             candidates = static_cast<Index>(station.shape(1));
  expect_shape("speed_sq", speed_sq, {stations, candidates});
  if (stations == 0) throw nb::value_error("station: expected stations, got none");
  const auto cost = make_array(candidates);
  const nb::gil_scoped_release release;
  add_travel_cost(station.data(), speed_sq.data(), stations, candidates, horizon_penalty,
                  cost.data());
  return cost;
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

std::tuple<int, Made<double>> smooth_profile(const Input1& ds, const Input1& speed_sq_max,
                                             const Input1& accel, const Input1& decel, double jerk,
                                             double start_accel) {
  const SmoothingProblem p = problem_of(ds, speed_sq_max, accel, decel, jerk, start_accel);
  const auto speed_sq = make_array(p.stations);
  double* memory = Workspace::of_thread().reserve(smoothing_memory(p.stations));
  const nb::gil_scoped_release release;
  const int iterations = smooth(p, memory, speed_sq.data());
  return {iterations, speed_sq};
}

std::tuple<Made<double>, Made<double>, Made<double>> smoothing_program(
    const Input1& ds, const Input1& speed_sq_max, const Input1& accel, const Input1& decel,
    double jerk, double start_accel) {
  const SmoothingProblem p = problem_of(ds, speed_sq_max, accel, decel, jerk, start_accel);
  const auto open = make_array(p.stations), rows = make_array(kind_count, 3, p.stations),
             limit = make_array(kind_count, p.stations);
  double* around = Workspace::of_thread().reserve(p.stations);
  NearestProblem program(p.stations, speed_sq_max.data(), open.data());
  program.rows = rows.data();
  program.limit = limit.data();
  lower_to_reachable(p, around);
  write_program(p, around, program);
  return {open, rows, limit};
}

// (N,) as the bound; 0 behind the profile.
Made<double> keep_profile_inside(const Input1& speed_sq, const Input1& speed_sq_max) {
  const auto n = static_cast<Index>(std::min(speed_sq.shape(0), speed_sq_max.shape(0)));
  if (n == 0) throw nb::value_error("speed_sq: expected a number for each station");
  const auto out = make_array(speed_sq_max.shape(0));
  keep_inside(speed_sq.data(), speed_sq_max.data(), n, out.data());
  return out;
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
        "required_thrust_ratio"_a, "start_sq"_a, "decel"_a, "specific_power"_a);
  m.def("travel_cost", &travel_cost);
  m.def("smooth", &smooth_profile);
  m.def("smoothing_program", &smoothing_program);
  m.def("keep_inside", &keep_profile_inside);
}

}  // namespace slopewise
