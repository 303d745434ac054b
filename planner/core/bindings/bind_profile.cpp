// Profiles along paths.
#include <algorithm>

#include "bindings/bind_rows.hpp"
#include "profile/smoothing.hpp"
#include "profile/time_optimal.hpp"

namespace slopewise {
namespace {

// Of a `ProfileProblem`.
std::tuple<Made<double>, Made<double>> time_optimal(const nb::handle& problem) {
  ProfileProblem of = profile_problem_of(problem);
  const Index m = of.candidates;
  const auto speed_sq = make_rows(of.stations, m), reachable_start_sq = make_array(m);
  of.speed_sq = {speed_sq.data(), m};
  const double* start_sq = member_line<double>(problem, "start_sq", m);
  const nb::gil_scoped_release release;
  solve_time_optimal(of, start_sq, reachable_start_sq.data());
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

// Of a `SmoothingProblem`.
SmoothingProblem problem_of(const nb::handle& problem) {
  const auto top = member_array<Input1>(problem, "speed_sq_max");
  const auto n = static_cast<Index>(top.shape(0));
  if (n < min_stations) throw nb::value_error("speed_sq_max: expected at least 3 stations");
  const auto row = [&](const char* name) { return member_line<double>(problem, name, n - 1); };
  const nb::object before = problem.attr("start_accel");
  return {n, row("ds"), top.data(), row("accel_max"), row("decel_max"),
          nb::cast<double>(problem.attr("jerk")),
          before.is_none() ? std::numeric_limits<double>::quiet_NaN() : nb::cast<double>(before)};
}

std::tuple<int, Made<double>> smooth_profile(const nb::handle& problem) {
  const SmoothingProblem p = problem_of(problem);
  const auto speed_sq = make_array(p.stations);
  double* memory = Workspace::of_thread().reserve(smoothing_memory(p.stations));
  const nb::gil_scoped_release release;
  const int iterations = smooth(p, memory, speed_sq.data());
  return {iterations, speed_sq};
}

std::tuple<Made<double>, Made<double>, Made<double>> smoothing_program(const nb::handle& problem) {
  const SmoothingProblem p = problem_of(problem);
  const auto open = make_array(p.stations), rows = make_array(kind_count, 3, p.stations),
             limit = make_array(kind_count, p.stations);
  double* around = Workspace::of_thread().reserve(p.stations);
  NearestProblem program(p.stations, p.speed_sq_max, open.data());
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
  m.attr("STANDSTILL_SQ") = standstill_sq;
  m.attr("TIGHTENING") = tightening;
  m.attr("MIN_STATIONS") = min_stations;
  m.attr("NO_PROFILE") = no_profile;
  m.attr("KIND_COUNT") = kind_count;
  m.def("time_optimal", &time_optimal);
  m.def("travel_cost", &travel_cost);
  m.def("smooth", &smooth_profile);
  m.def("smoothing_program", &smoothing_program);
  m.def("keep_inside", &keep_profile_inside);
}

}  // namespace slopewise
