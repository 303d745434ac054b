// The verifier of plans, and their labels. Arrays belong to the caller; no call keeps one.
#include <nanobind/stl/array.h>

#include "bindings/bind_vehicle.hpp"
#include "verify/labels.hpp"
#include "verify/verify.hpp"
#include "verify/verify_ground.hpp"

namespace slopewise {
namespace {

using namespace verify;

using Codes1 = nb::ndarray<std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Labels1 = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Flags1 = nb::ndarray<bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Columns = std::array<Input1, track_columns>;
using Rows = std::array<Input2, track_columns>;

double number(const nb::handle& tuple, const char* name) {
  return nb::cast<double>(tuple.attr(name));
}

// Of a `Terms`.
VerifyTerms terms_of(const nb::handle& terms) {
  const nb::object body = terms.attr("body"), steering = terms.attr("steering");
  return {{number(body, "wheelbase"), number(body, "track_width"), number(body, "cg_x"),
           number(body, "cg_z"), number(body, "slip_track")},
          vehicle_of(terms.attr("limits")),
          motion_of(terms.attr("motion")),
          errors_of(terms.attr("errors")),
          {number(steering, "centre_offset"), number(steering, "arm"),
           number(steering, "max_curvature"), number(steering, "max_rate")},
          nb::cast<bool>(terms.attr("in_time")),
          nb::cast<Index>(terms.attr("between")),
          number(terms, "time_step"),
          nb::cast<bool>(terms.attr("all_loads"))};
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

TrackRows rows_of(const Counts1& count, const Rows& rows, const Input2& friction) {
  const auto n = static_cast<Index>(rows[0].shape(0)), m = static_cast<Index>(rows[0].shape(1));
  expect_shape("count", count, {m});
  for (Index j = 0; j < m; ++j) {
    if (count.data()[j] > n) throw nb::value_error("count: expected no more stations than rows");
  }
  for (const Input2& row : rows) expect_shape("rows", row, {n, m});
  const bool known = friction.shape(0) > 0;
  if (known) expect_shape("friction", friction, {n, m});
  const auto& r = rows;
  return {n, m, count.data(), r[0].data(), r[1].data(), r[2].data(), r[3].data(), r[4].data(),
          r[5].data(), r[6].data(), r[7].data(), r[8].data(), r[9].data(), r[10].data(),
          r[11].data(), r[12].data(), r[13].data(), known ? friction.data() : nullptr};
}

void copy_track(const Counts1& count, const Rows& rows, const Input2& friction, Index candidate,
                Index first, const Output2& columns) {
  const TrackRows source = rows_of(count, rows, friction);
  if (candidate < 0 || candidate >= source.candidates) {
    throw nb::value_error("candidate: expected one of the batch");
  }
  if (first < 0) throw nb::value_error("first: expected a station");
  const auto n = static_cast<Index>(count.data()[candidate]) - first;
  expect_shape("columns", columns, {track_columns, n});
  const nb::gil_scoped_release release;
  copy_columns(source, candidate, first, true, columns.data(), n);
}

void verify_one(const Columns& track, const Columns& even, const Input1& speed_sq,
                double clear_distance, double distance_offset, Index beyond,
                const nb::handle& terms, const Output2& told, const Output1& worst,
                const Flags1& bad) {
  const Track on = track_of(track), on_even = track_of(even);
  const Index n = on.stations;
  if (on_even.stations != n) throw nb::value_error("even: expected the stations of the track");
  expect_shape("speed_sq", speed_sq, {n});
  expect_shape("told", told, {3, n});
  expect_shape("worst", worst, {static_cast<Index>(breach_count)});
  expect_shape("bad", bad, {n - 1});
  const VerifyTerms by = terms_of(terms);
  if (beyond < 0 || beyond >= static_cast<Index>(breach_count)) {
    throw nb::value_error("beyond: expected a kind of violation");
  }
  const VerifiedPlan plan{on,       on_even, speed_sq.data(), clear_distance, distance_offset,
                          static_cast<Breach>(beyond)};
  double* out = told.data();
  const VerifyNotes notes{out, out + n, out + 2 * n, worst.data(), bad.data()};
  double* memory = Workspace::of_thread().reserve(verify_memory(n));
  const nb::gil_scoped_release release;
  verify_plan(plan, by, notes, memory);
}

void verify_all(const Counts1& count, const Rows& rows, const Input2& friction,
                  const Input2& speed_sq, const Input1& clear_distance,
                  const Input1& distance_offset, const nb::handle& terms, const Output2& worst) {
  const TrackRows source = rows_of(count, rows, friction);
  const Index m = source.candidates;
  expect_shape("speed_sq", speed_sq, {source.stations, m});
  expect_shape("clear_distance", clear_distance, {m});
  expect_shape("distance_offset", distance_offset, {m});
  expect_shape("worst", worst, {m, static_cast<Index>(breach_count)});
  for (Index j = 0; j < m; ++j) {
    if (count.data()[j] < 2) throw nb::value_error("count: expected two stations at least");
  }
  const VerifyTerms by = terms_of(terms);
  double* memory = Workspace::of_thread().reserve(verify_batch_memory(source.stations));
  const nb::gil_scoped_release release;
  verify_batch(source, {speed_sq.data(), clear_distance.data(), distance_offset.data()}, by, memory,
               worst.data());
}

BodySizes sizes_of(const nb::handle& sizes) {
  return {number(sizes, "wheelbase"),     number(sizes, "track_width"),
          number(sizes, "wheel_radius"),  number(sizes, "wheel_width"),
          number(sizes, "front"),         number(sizes, "rear"),
          number(sizes, "width"),         number(sizes, "clearance"),
          number(sizes, "max_step"),      number(sizes, "wheel_travel"),
          number(sizes, "centre_offset"), number(sizes, "body_offset")};
}

nb::tuple blocked(const Input2& elevation, double origin_x, double origin_y, double resolution,
                 const nb::handle& sizes, const std::array<Input1, 3>& line,
                 const std::array<Input1, 4>& resting, const std::array<double, 7>& limits,
                 const std::array<double, 4>& tolerance, double begin, double end) {
  const MapView map{elevation.data(), static_cast<Index>(elevation.shape(0)),
                    static_cast<Index>(elevation.shape(1)), origin_x, origin_y, resolution,
                    1.0 / resolution};
  if (map.rows < 2 || map.columns < 2) {
    throw nb::value_error("elevation: expected two rows and two columns at least");
  }
  const auto n = static_cast<Index>(line[0].shape(0));
  if (n < 2) throw nb::value_error("x: expected two stations at least");
  for (const Input1& column : line) expect_shape("line", column, {n});
  for (const Input1& column : resting) expect_shape("resting", column, {n});
  const BodySizes body = sizes_of(sizes);
  const auto& [low, high, roll_low, roll_high, across, per_curvature, turned] = limits;
  const PlannedLine path{n, line[0].data(), line[1].data(), line[2].data()};
  const Index poses = count_poses(path, pose_step(map, body));
  double* memory = Workspace::of_thread().reserve(ground_memory(path, poses, map.columns));
  GroundFinding found;
  {
    const nb::gil_scoped_release release;
    found = first_blocked(
        map, body, path,
        {resting[0].data(), resting[1].data(), resting[2].data(), resting[3].data()},
        {low, high, roll_low, roll_high, across, per_curvature, turned},
        {tolerance[0], tolerance[1], tolerance[2], tolerance[3]}, {begin, end}, memory);
  }
  return nb::make_tuple(static_cast<int>(found.kind), found.station, found.value, found.x, found.y);
}

void segment_limits(const Columns& track, const Input1& speed_sq, const Input1& accel_max,
                    const Input1& demand, const Input1& braking_intercept,
                    const nb::handle& limits, const Output1& accel, const Output1& decel) {
  const Track on = track_of(track);
  for (const Input1* column : {&speed_sq, &accel_max, &demand, &braking_intercept}) {
    expect_shape("speed_sq, bounds", *column, {on.stations});
  }
  expect_shape("accel", accel, {on.last()});
  expect_shape("decel", decel, {on.last()});
  const Vehicle vehicle = vehicle_of(limits);
  const nb::gil_scoped_release release;
  limit_segments(on, speed_sq.data(), {accel_max.data(), demand.data(), braking_intercept.data()},
                 vehicle, accel.data(), decel.data());
}

void motion(const Input1& station, const Input1& speed_sq, const Output1& accel,
            const Output1& time) {
  const auto n = static_cast<Index>(station.shape(0));
  if (n == 0) throw nb::value_error("station: expected stations, got none");
  expect_shape("speed_sq", speed_sq, {n});
  expect_shape("accel", accel, {n});
  expect_shape("time", time, {n});
  const nb::gil_scoped_release release;
  move_along(station.data(), speed_sq.data(), n, accel.data(), time.data());
}

void labels(const Input1& speed_sq, const Input1& accel, const Input1& bound,
            const Labels1& bound_label, const Input1& accel_max, const Input1& decel_max,
            double most_accel, bool smoothed, const Codes1& out) {
  const auto n = static_cast<Index>(speed_sq.shape(0));
  if (n < 2) throw nb::value_error("speed_sq: expected two stations at least");
  expect_shape("accel", accel, {n});
  expect_shape("bound", bound, {n});
  expect_shape("bound_label", bound_label, {n});
  expect_shape("accel_max", accel_max, {n - 1});
  expect_shape("decel_max", decel_max, {n - 1});
  expect_shape("out", out, {n});
  const Labelled plan{n, speed_sq.data(), accel.data(), bound.data(), bound_label.data(),
                      accel_max.data(), decel_max.data(), most_accel, smoothed};
  const nb::gil_scoped_release release;
  label_stations(plan, out.data());
}

}  // namespace

void bind_verify(nb::module_& m) {
  using namespace nb::literals;
  m.def("copy_track", &copy_track, "count"_a, "rows"_a, "friction"_a, "candidate"_a, "first"_a,
        "columns"_a.noconvert());
  m.def("verify", &verify_one, "track"_a, "even"_a, "speed_sq"_a, "clear_distance"_a,
        "distance_offset"_a, "beyond"_a, "terms"_a, "told"_a.noconvert(), "worst"_a.noconvert(),
        "bad"_a.noconvert());
  m.def("verify_batch", &verify_all, "count"_a, "rows"_a, "friction"_a, "speed_sq"_a,
        "clear_distance"_a, "distance_offset"_a, "terms"_a, "worst"_a.noconvert());
  m.def("first_blocked", &blocked, "elevation"_a, "origin_x"_a, "origin_y"_a, "resolution"_a,
        "sizes"_a, "line"_a, "resting"_a, "limits"_a, "tolerance"_a, "begin"_a, "end"_a);
  m.def("segment_limits", &segment_limits, "track"_a, "speed_sq"_a, "accel_max"_a, "demand"_a,
        "braking_intercept"_a, "limits"_a, "accel"_a.noconvert(), "decel"_a.noconvert());
  m.def("motion", &motion, "station"_a, "speed_sq"_a, "accel"_a.noconvert(),
        "time"_a.noconvert());
  m.def("labels", &labels, "speed_sq"_a, "accel"_a, "bound"_a, "bound_label"_a, "accel_max"_a,
        "decel_max"_a, "most_accel"_a, "smoothed"_a, "out"_a.noconvert());
}

}  // namespace slopewise
