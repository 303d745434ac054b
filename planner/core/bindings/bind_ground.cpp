// Ground below paths.
#include <mutex>
#include <optional>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>

#include "ground/averaged_heights.hpp"
#include "bindings/bind_rows.hpp"
#include "ground/ground_and_body.hpp"
#include "ground/map_grid.hpp"

namespace slopewise {
namespace {

using Taps1 = nb::ndarray<const std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Floats1 = nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Floats2 = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Floats3 = nb::ndarray<const float, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

// Of `Taps`.
Taps taps_of(const nb::handle& taps) {
  const auto row = member_array<Taps1>(taps, "row"), column = member_array<Taps1>(taps, "column");
  const auto count = static_cast<Index>(row.shape(0));
  expect_shape("column", column, {count});
  return {count, row.data(), column.data()};
}

// Of `Contrasts`.
Contrasts contrasts_of(const nb::handle& contrasts) {
  const auto weights = member_array<Floats2>(contrasts, "weights");
  const auto std = member_array<Floats1>(contrasts, "std");
  const auto slopes = member_array<Floats3>(contrasts, "slopes");
  const Taps taps = taps_of(contrasts.attr("taps"));
  const auto count = static_cast<Index>(weights.shape(0)), jumps = static_cast<Index>(slopes.shape(1));
  expect_shape("weights", weights, {count, taps.count});
  expect_shape("std", std, {count});
  expect_shape("slopes", slopes, {2, jumps, taps.count});
  return {taps, count, jumps, weights.data(), std.data(), slopes.data(),
          slopes.data() + jumps * taps.count};
}

// By `AveragingWindows`.
Made<double> average(const Input2& elevation, const nb::handle& by, double noise,
                     double significance, double known_share) {
  const auto rows = static_cast<Index>(elevation.shape(0));
  const auto columns = static_cast<Index>(elevation.shape(1));
  const auto start = member_array<Taps1>(by, "start");
  const auto variance = member_array<Input1>(by, "variance");
  const auto windows = static_cast<Index>(variance.shape(0));
  expect_shape("start", start, {windows + 1});
  const AveragingTools tools{contrasts_of(by.attr("wide")), contrasts_of(by.attr("narrow")),
                             {taps_of(by.attr("taps")), windows, start.data(), variance.data()},
                             nb::cast<Index>(by.attr("stride")), noise,
                             noise * nb::cast<double>(by.attr("block_std")), significance, known_share};
  const auto reach = nb::cast<Index>(by.attr("reach"));
  const auto heights = make_array(rows, columns);
  const nb::gil_scoped_release release;
  average_heights(elevation.data(), rows, columns, reach, tools, heights.data());
  return heights;
}

// Paths need a second station, and no more stations than they have rows.
void expect_paths(const Input2& x, const Input2& y, const Counts1& count) {
  const auto stations = static_cast<Index>(x.shape(0)), candidates = static_cast<Index>(x.shape(1));
  expect_shape("y", y, {stations, candidates});
  expect_shape("count", count, {candidates});
  if (stations < 2) throw nb::value_error("x: expected two stations at least");
}

// Nine rows of the ground, and four of the body where its pose is not that of the path. `heading` is
// that of the body, where it does not follow from the path.
std::tuple<Made<double>, Made<bool>, Made<float>, Made<float>> ground_along(
    MapGrid& map, const Input2& x, const Input2& y, const Counts1& count, double rod,
    double body_offset, double length, double width,
    const std::optional<std::pair<Input2, Input2>>& heading) {
  expect_paths(x, y, count);
  const auto n = static_cast<Index>(x.shape(0)), m = static_cast<Index>(x.shape(1));
  const double *heading_x = nullptr, *heading_y = nullptr;
  if (heading) {
    expect_shape("heading x", heading->first, {n, m});
    expect_shape("heading y", heading->second, {n, m});
    heading_x = heading->first.data();
    heading_y = heading->second.data();
  }
  const bool has_body = heading || rod > 0.0 || body_offset > 0.0;
  const auto rows = make_rows(has_body ? 13 : 9, n, m);
  const auto known = make_rows<bool>(n, m);
  const auto twist = make_rows<float>(n, m), front = make_rows<float>(n, 2, m);
  const auto row = [&](Index r) { return rows.data() + r * n * m; };
  const TerrainTable table{n, m, x.data(), y.data(), count.data(), heading_x, heading_y,
                           body_offset, row(0), row(1), row(2), row(3), row(4), row(5), row(6), row(7), row(8),
                           known.data(), twist.data(), front.data()};
  const BodyTable body = has_body ? BodyTable{row(9), row(10), row(11), row(12)} : BodyTable{};
  const nb::gil_scoped_release release;
  sample_ground(map.grid, table, body, rod, length, width);
  return {rows, known, twist, front};
}

Made<double> tyre_lifts(MapGrid& map, Index heading) {
  const Index rows = map.grid.rows(), columns = map.grid.columns();
  if (heading < 0 || heading >= heading_count || !map.grid.resolves_wheels()) {
    throw nb::value_error("heading: expected one of 16, of a map that resolves wheels");
  }
  const auto out = make_array(rows, columns);
  const nb::gil_scoped_release release;
  const std::scoped_lock lock(map.grid.mutex());
  for (Index i = 0; i < rows; ++i) {
    for (Index j = 0; j < columns; ++j) {
      out.data()[i * columns + j] = map.grid.lift(heading, i, j, 0.0, 0.0);
    }
  }
  return out;
}

}  // namespace

void bind_ground(nb::module_& m) {
  using namespace nb::literals;
  m.def("average_heights", &average);
  nb::class_<MapGrid>(m, "HeightGrid")
      .def(nb::init<const Input2&, double, double, double, double, double, double>(),
           "elevation"_a.noconvert(), "origin_x"_a, "origin_y"_a, "resolution"_a, "half_length"_a,
           "half_width"_a, "radius"_a)
      .def_prop_ro("memory", [](MapGrid& map) {
        const std::scoped_lock lock(map.grid.mutex());
        return map.grid.memory();
      })
      .def("tyre_lifts", &tyre_lifts)
      .def("sample_ground", &ground_along, "x"_a, "y"_a, "count"_a, "centre_offset"_a,
           "body_offset"_a, "length"_a, "width"_a, "heading"_a = nb::none());
}

}  // namespace slopewise
