// Rows of the core from the objects of Python: arrays are read by name, and must all be there.
#pragma once

#include "bindings/bindings.hpp"
#include "candidate_rows.hpp"
#include "profile/time_optimal.hpp"

namespace slopewise {

// An (N, M) array; (0, 0) and None are nothing.
template <class T>
Rows<const T> rows_of(const char* name, const nb::handle& array, Index stations, Index candidates) {
  using Array = nb::ndarray<const T, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
  if (array.is_none()) return {};
  Array rows;
  if (!nb::try_cast<Array>(array, rows, false)) {
    throw nb::type_error((std::string(name) + ": expected a contiguous (N, M) array").c_str());
  }
  if (rows.size() == 0) return {};
  expect_shape(name, rows, {stations, candidates});
  return {rows.data(), candidates};
}

// As `rows_of`, of what must be there, under this name.
template <class T>
Rows<const T> member_rows(const nb::handle& owner, const char* name, Index stations,
                          Index candidates) {
  const Rows<const T> rows = rows_of<T>(name, owner.attr(name), stations, candidates);
  if (rows.data == nullptr) {
    throw nb::value_error((std::string(name) + ": expected an array, got none").c_str());
  }
  return rows;
}

// An array that the owner keeps: never a copy, which would end with this call.
template <class Array>
Array member_array(const nb::handle& owner, const char* name) {
  Array array;
  if (!nb::try_cast<Array>(owner.attr(name), array, false)) {
    throw nb::type_error((std::string(name) + ": expected a contiguous array of its type").c_str());
  }
  return array;
}

template <class T>
const T* member_line(const nb::handle& owner, const char* name, Index candidates) {
  using Array = nb::ndarray<const T, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
  const auto line = member_array<Array>(owner, name);
  expect_shape(name, line, {candidates});
  return line.data();
}

// Of a `BodyRows`.
inline PoseRows poses_of(const nb::handle& rows) {
  const auto x = member_array<Input2>(rows, "x");
  const auto n = static_cast<Index>(x.shape(0)), m = static_cast<Index>(x.shape(1));
  if (n * m == 0) throw nb::value_error("x: expected positions, got none");
  const auto row = [&](const char* name) { return member_rows<double>(rows, name, n, m).data; };
  return {n, m, row("x"), row("y"), row("heading_x"), row("heading_y")};
}

// Of a `TerrainProfile`.
inline TerrainRows terrain_of(const nb::handle& rows) {
  const auto station = nb::cast<Input2>(rows.attr("station"));
  const auto n = static_cast<Index>(station.shape(0)), m = static_cast<Index>(station.shape(1));
  const auto numbers = [&](const char* name) { return member_rows<double>(rows, name, n, m); };
  return {n,
          m,
          member_line<std::int64_t>(rows, "count", m),
          numbers("station"),
          numbers("heading_x"),
          numbers("heading_y"),
          numbers("curvature"),
          numbers("grade"),
          numbers("sin_grade"),
          numbers("sin_roll"),
          numbers("vertical_curvature"),
          member_rows<bool>(rows, "known", n, m)};
}

// Of a `BrakingGround` along it.
inline ForceRows forces_of(const nb::handle& rows, Index stations, Index candidates) {
  const auto numbers = [&](const char* name) {
    return member_rows<double>(rows, name, stations, candidates);
  };
  return {numbers("lower_slope"),
          numbers("lower_intercept"),
          numbers("upper_slope"),
          numbers("upper_intercept"),
          numbers("dead_time"),
          numbers("shortest_dead_time"),
          numbers("slowest"),
          numbers("fastest"),
          member_rows<bool>(rows, "trained", stations, candidates),
          member_line<double>(rows, "distance_offset", candidates)};
}

// Of a `ProfileProblem`, without what receives the answer.
inline ProfileProblem profile_problem_of(const nb::handle& problem) {
  const auto station = member_array<Input2>(problem, "station");
  const auto n = static_cast<Index>(station.shape(0)), m = static_cast<Index>(station.shape(1));
  const auto rows = [&](const char* name) { return member_rows<double>(problem, name, n, m); };
  const auto lift = [&](const char* name) {
    return rows_of<double>(name, problem.attr(name), n, m);
  };
  const auto number = [&](const char* name) { return nb::cast<double>(problem.attr(name)); };
  return {n, m, rows("station"), rows("speed_sq_max"), rows("sin_grade"), rows("lower_slope"),
          rows("lower_intercept"), rows("slowest"), rows("accel_max"), rows("demand"),
          lift("lift"), lift("lift_per_speed_sq"), number("decel"), number("specific_power"), {}};
}

}  // namespace slopewise
