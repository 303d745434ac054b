// The verifier of plans, and their labels.
#include <nanobind/stl/array.h>

#include <algorithm>
#include <vector>

#include "bindings/bind_rows.hpp"
#include "bindings/bind_vehicle.hpp"
#include "verify/labels.hpp"
#include "verify/verify_lane.hpp"
#include "verify/verify_ground.hpp"

namespace slopewise {
namespace {

using namespace verify;

using Columns = std::array<Input1, track_columns>;

// Of a `Terms`.
VerifyTerms terms_of(const nb::handle& terms) {
  const nb::object body = terms.attr("body"), steering = terms.attr("steering");
  return {numbers_of<Body>(body, {"wheelbase", "track_width", "cg_x", "cg_z", "slip_track"}),
          vehicle_of(terms.attr("limits")),
          motion_of(terms.attr("motion")),
          errors_of(terms.attr("errors")),
          numbers_of<SteeringTerms>(steering, {"centre_offset", "arm", "max_curvature", "max_rate"}),
          nb::cast<bool>(terms.attr("in_time")),
          nb::cast<Index>(terms.attr("between")),
          nb::cast<double>(terms.attr("time_step")),
          nb::cast<bool>(terms.attr("all_loads")),
          nb::cast<bool>(terms.attr("changes"))};
}

Track track_of(const Columns& columns) {
  const auto n = static_cast<Index>(columns[0].shape(0));
  if (n < 2) throw nb::value_error("station: expected two stations at least");
  std::array<const double*, track_columns> column{};
  for (std::size_t c = 0; c < columns.size(); ++c) {
    expect_shape("track", columns[c], {n});
    column[c] = columns[c].data();
  }
  return track_at(n, column);
}

Breach breach_at(Index kind) {
  if (kind < 0 || kind >= static_cast<Index>(breach_count)) {
    throw nb::value_error("beyond: expected a kind of violation");
  }
  return static_cast<Breach>(kind);
}

// Stations of a candidate, at least two.
Index stations_of(const TerrainRows& terrain, Index candidate) {
  if (candidate < 0 || candidate >= terrain.candidates) {
    throw nb::value_error("candidate: expected one of the batch");
  }
  const auto count = static_cast<Index>(terrain.counts[candidate]);
  if (count < 2 || count > terrain.stations) {
    throw nb::value_error("count: expected two stations at least, and no more than rows");
  }
  return count;
}

TrackRows track_rows_of(const nb::handle& profile, const nb::handle& ground, const Input2& speed_limit) {
  const TerrainRows terrain = terrain_of(profile);
  const Index n = terrain.stations, m = terrain.candidates;
  for (Index j = 0; j < m; ++j) stations_of(terrain, j);
  expect_shape("speed_limit", speed_limit, {n, m});
  return {terrain, forces_of(ground, n, m), {speed_limit.data(), m},
          rows_of<double>("friction", ground.attr("friction"), n, m)};
}

Made<double> copy_track(const nb::handle& profile, const nb::handle& ground,
                        const Input2& speed_limit, Index candidate, Index first) {
  const TrackRows source = track_rows_of(profile, ground, speed_limit);
  const auto n = stations_of(source.terrain, candidate) - first;
  if (first < 0 || n < 1) throw nb::value_error("first: expected a station");
  const auto columns = make_array(track_columns, n);
  const nb::gil_scoped_release release;
  copy_columns(source, candidate, first, true, columns.data(), n);
  return columns;
}

std::tuple<Made<double>, Made<double>, Made<Label>> verify_one(
    const Columns& track, const Columns& even, const Input1& speed_sq, double clear_distance,
    double distance_offset, Index beyond, const nb::handle& terms) {
  const Track on = track_of(track), on_even = track_of(even);
  const Index n = on.stations;
  if (on_even.stations != n) throw nb::value_error("even: expected the stations of the track");
  expect_shape("speed_sq", speed_sq, {n});
  const VerifyTerms by = terms_of(terms);
  const VerifiedPlan plan{on,       on_even, speed_sq.data(), clear_distance, distance_offset,
                          breach_at(beyond)};
  const auto told = make_array(3, n), worst = make_array(breach_count);
  const auto bad = make_rows<Label>(n - 1);
  std::fill_n(bad.data(), n - 1, limiting::none);
  double* out = told.data();
  const VerifyNotes notes{out, out + n, out + 2 * n, worst.data(), bad.data()};
  double* memory = Workspace::of_thread().reserve(verify_memory(n));
  const nb::gil_scoped_release release;
  verify_plan(plan, by, notes, memory);
  return {told, worst, bad};
}

// Highest held v² in steps from those of a plan to its bounds, and what breaks the first of each.
std::tuple<Made<double>, Made<Label>> raise_held(
    const Columns& track, const Input1& speed_sq, const Input1& bound, double clear_distance,
    double distance_offset, Index beyond, Index steps, const nb::handle& terms) {
  const Track on = track_of(track);
  const Index n = on.stations;
  expect_shape("speed_sq", speed_sq, {n});
  expect_shape("bound", bound, {n});
  VerifyTerms by = terms_of(terms);
  by.all_loads = false;
  const auto highest = make_array(n);
  const auto bad = make_rows<Label>(n);
  std::fill_n(bad.data(), n, limiting::none);
  std::array<double, breach_count> worst{};
  double* memory = Workspace::of_thread().reserve(verify_memory(n) + n);
  double* profile = memory + verify_memory(n);
  std::copy_n(bound.data(), n, profile);
  const VerifiedPlan plan{on, on, profile, clear_distance, distance_offset, breach_at(beyond)};
  const nb::gil_scoped_release release;
  raise_speeds(plan, by, {nullptr, nullptr, nullptr, worst.data(), bad.data()}, speed_sq.data(),
               bound.data(), steps, profile, highest.data(), memory);
  return {highest, bad};
}

Made<double> verify_all(const nb::handle& profile, const nb::handle& ground,
                        const Input2& speed_limit, const Input2& speed_sq,
                        const Input1& clear_distance, const nb::handle& terms,
                        const Counts1& lanes) {
  const TrackRows source = track_rows_of(profile, ground, speed_limit);
  const Index n = source.terrain.stations, m = source.terrain.candidates;
  expect_shape("speed_sq", speed_sq, {n, m});
  expect_shape("clear_distance", clear_distance, {m});
  const auto count = static_cast<Index>(lanes.shape(0));
  for (Index i = 0; i < count; ++i) stations_of(source.terrain, lanes.data()[i]);
  const auto worst = make_array(count, breach_count);
  const VerifyTerms by = terms_of(terms);
  double* memory = Workspace::of_thread().reserve(verify_lane_memory(n));
  const nb::gil_scoped_release release;
  for (Index i = 0; i < count; ++i) {
    verify_lane(source, lanes.data()[i], {speed_sq.data(), m}, clear_distance.data(), by, memory,
                worst.data() + i * static_cast<Index>(breach_count));
  }
  return worst;
}

// Of a candidate in a batch; the vehicle stands at station `first` of it.
std::tuple<int, double, double, double, double> blocked(
    const Input2& elevation, double origin_x, double origin_y, double resolution,
    const nb::handle& sizes, const nb::handle& profile, const nb::handle& ground, Index candidate,
    const std::array<double, 7>& limits, Index first, double end) {
  const MapView map{elevation.data(), static_cast<Index>(elevation.shape(0)),
                    static_cast<Index>(elevation.shape(1)), origin_x, origin_y, resolution,
                    1.0 / resolution};
  if (map.rows < 2 || map.columns < 2) {
    throw nb::value_error("elevation: expected two rows and two columns at least");
  }
  const TerrainRows terrain = terrain_of(profile);
  const ForceRows forces = forces_of(ground, terrain.stations, terrain.candidates);
  const Index n = stations_of(terrain, candidate);
  const auto column = [&](const Numbers& rows, double otherwise = 0.0) {
    std::vector<double> out(static_cast<std::size_t>(n), otherwise);
    for (Index k = 0; k < n && rows.data != nullptr; ++k) out[static_cast<std::size_t>(k)] = rows.at(k)[candidate];
    return out;
  };
  const auto named = [&](const nb::handle& owner, const char* name) {
    return rows_of<double>(name, owner.attr(name), terrain.stations, terrain.candidates);
  };
  const auto x = column(named(profile, "x")), y = column(named(profile, "y")),
             station = column(terrain.station), curvature = column(terrain.curvature),
             offset = column(named(profile, "follower_offset")),
             friction = column(named(ground, "friction"), infinite),
             slope = column(forces.lower_slope), slowest = column(forces.slowest);
  std::vector<double> force = column(forces.lower_intercept);
  for (std::size_t k = 0; k < force.size(); ++k) force[k] += slowest[k] * slope[k];
  const auto body = numbers_of<BodySizes>(
      sizes, {"wheelbase", "track_width", "wheel_radius", "wheel_width", "front", "rear", "width",
              "clearance", "max_step", "wheel_travel", "centre_offset", "body_offset"});
  const auto& [low, high, roll_low, roll_high, across, per_curvature, turned] = limits;
  const PlannedLine path{n, x.data(), y.data(), station.data()};
  const double begin = station[static_cast<std::size_t>(std::clamp<Index>(first + 1, 0, n - 1))];
  const Index poses = count_poses(path, pose_step(map, body));
  double* memory = Workspace::of_thread().reserve(ground_memory(path, poses, map.columns));
  const nb::gil_scoped_release release;
  const GroundFinding found = first_blocked(
      map, body, path, {force.data(), friction.data(), curvature.data(), offset.data()},
      {low, high, roll_low, roll_high, across, per_curvature, turned}, {}, {begin, end}, memory);
  return {static_cast<int>(found.kind), found.station, found.value, found.x, found.y};
}

std::tuple<Made<double>, Made<double>> segment_limits(
    const Columns& track, const Input1& speed_sq, const nb::handle& problem,
    const nb::handle& limits) {
  const Track on = track_of(track);
  const ProfileProblem of = profile_problem_of(problem);
  expect_shape("speed_sq", speed_sq, {on.stations});
  if (of.stations != on.stations || of.candidates != 1 || of.lift.data == nullptr) {
    throw nb::value_error("problem: expected that of the track, of one candidate, with lift");
  }
  const auto accel = make_array(on.last()), decel = make_array(on.last());
  const Vehicle vehicle = vehicle_of(limits);
  const nb::gil_scoped_release release;
  limit_segments(on, speed_sq.data(), of, vehicle, accel.data(), decel.data());
  return {accel, decel};
}

std::tuple<Made<double>, Made<double>> motion(const Input1& station, const Input1& speed_sq) {
  const auto n = static_cast<Index>(station.shape(0));
  if (n == 0) throw nb::value_error("station: expected stations, got none");
  expect_shape("speed_sq", speed_sq, {n});
  const auto accel = make_array(n), time = make_array(n);
  const nb::gil_scoped_release release;
  move_along(station.data(), speed_sq.data(), n, accel.data(), time.data());
  return {accel, time};
}

Made<std::int64_t> labels(const Input1& speed_sq, const Input1& accel, const Input1& bound,
                          const Counts1& bound_label, const Input1& accel_max,
                          const Input1& decel_max, double most_accel, bool smoothed) {
  const auto n = static_cast<Index>(speed_sq.shape(0));
  if (n < 2) throw nb::value_error("speed_sq: expected two stations at least");
  expect_shape("accel", accel, {n});
  expect_shape("bound", bound, {n});
  expect_shape("bound_label", bound_label, {n});
  expect_shape("accel_max", accel_max, {n - 1});
  expect_shape("decel_max", decel_max, {n - 1});
  const auto out = make_array<std::int64_t>(n);
  const Labelled plan{n, speed_sq.data(), accel.data(), bound.data(), bound_label.data(),
                      accel_max.data(), decel_max.data(), most_accel, smoothed};
  const nb::gil_scoped_release release;
  label_stations(plan, out.data());
  return out;
}

}  // namespace

void bind_verify(nb::module_& m) {
  m.def("copy_track", &copy_track);
  m.def("verify", &verify_one);
  m.def("verify_batch", &verify_all);
  m.def("raise_held", &raise_held);
  m.def("first_blocked", &blocked);
  m.def("segment_limits", &segment_limits);
  m.def("motion", &motion);
  m.def("labels", &labels);
}

}  // namespace slopewise
