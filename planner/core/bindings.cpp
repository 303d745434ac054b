// What Python calls. Arrays belong to the caller; no call keeps one.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#if defined(__x86_64__)
#include <cpuid.h>
#endif

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <mutex>
#include <string>

#include "averaged_heights.hpp"
#include "ground_behind.hpp"
#include "height_grid.hpp"
#include "smoothing.hpp"
#include "terrain.hpp"
#include "time_optimal.hpp"

namespace nb = nanobind;

namespace slopewise {
namespace {

using Input1 = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Input2 = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Output1 = nb::ndarray<double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Output2 = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Output3 = nb::ndarray<double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

template <class Array>
void expect_shape(const char* name, const Array& array, std::initializer_list<Index> shape) {
  std::size_t axis = 0;
  for (const Index size : shape) {
    const auto found = static_cast<Index>(array.shape(axis++));
    if (found == size) continue;
    std::string text = name;
    text.append(": expected ").append(std::to_string(size)).append(" along axis ");
    text.append(std::to_string(axis - 1)).append(", got ").append(std::to_string(found));
    throw nb::value_error(text.c_str());
  }
}

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

using Taps1 = nb::ndarray<const std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Floats1 = nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Floats2 = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Floats3 = nb::ndarray<const float, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

Taps taps_of(const Taps1& row, const Taps1& column) {
  const auto count = static_cast<Index>(row.shape(0));
  expect_shape("column", column, {count});
  return {count, row.data(), column.data()};
}

Contrasts contrasts_of(const Taps1& row, const Taps1& column, const Floats2& weights,
                       const Floats1& std) {
  const auto count = static_cast<Index>(weights.shape(0));
  const Taps taps = taps_of(row, column);
  expect_shape("weights", weights, {count, taps.count});
  expect_shape("std", std, {count});
  return {taps, count, 0, weights.data(), std.data(), nullptr, nullptr};
}

void average(const Input2& elevation, const Taps1& wide_row, const Taps1& wide_column,
              const Floats2& wide_weights, const Floats1& wide_std, const Floats3& slopes,
              const Taps1& narrow_row, const Taps1& narrow_column, const Floats2& narrow_weights,
              const Floats1& narrow_std, const Taps1& row, const Taps1& column, const Taps1& start,
              const Input1& variance, Index stride, Index reach, double noise, double block_noise,
              double significance, double known_share, const Output2& heights) {
  const auto rows = static_cast<Index>(elevation.shape(0));
  const auto columns = static_cast<Index>(elevation.shape(1));
  const auto windows = static_cast<Index>(variance.shape(0));
  expect_shape("heights", heights, {rows, columns});
  expect_shape("start", start, {windows + 1});
  AveragingTools tools{contrasts_of(wide_row, wide_column, wide_weights, wide_std),
                       contrasts_of(narrow_row, narrow_column, narrow_weights, narrow_std),
                       {taps_of(row, column), windows, start.data(), variance.data()},
                       stride, noise, block_noise, significance, known_share};
  tools.wide.jumps = static_cast<Index>(slopes.shape(1));
  expect_shape("slopes", slopes, {2, tools.wide.jumps, tools.wide.taps.count});
  tools.wide.slope_x = slopes.data();
  tools.wide.slope_y = slopes.data() + tools.wide.jumps * tools.wide.taps.count;
  const nb::gil_scoped_release release;
  average_heights(elevation.data(), rows, columns, reach, tools, heights.data());
}

using Counts1 = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Known2 = nb::ndarray<bool, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Singles2 = nb::ndarray<float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Singles3 = nb::ndarray<float, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

// A map that stays while its grid does.
struct MapGrid {
  Input2 elevation;
  HeightGrid grid;

  MapGrid(const Input2& heights, double origin_x, double origin_y, double resolution,
          double half_length, double half_width, double radius)
      : elevation(heights),
        grid(heights.data(), static_cast<Index>(heights.shape(0)),
             static_cast<Index>(heights.shape(1)), origin_x, origin_y, resolution,
             {half_length, half_width, radius}) {
    if (heights.shape(0) < 2 || heights.shape(1) < 2) {
      throw nb::value_error("elevation: expected two rows and two columns at least");
    }
  }
};

// Paths need a second station, and no more stations than they have rows.
void expect_paths(const Input2& x, const Input2& y, const Counts1& count) {
  const auto stations = static_cast<Index>(x.shape(0)), candidates = static_cast<Index>(x.shape(1));
  expect_shape("y", y, {stations, candidates});
  expect_shape("count", count, {candidates});
  if (stations < 2) throw nb::value_error("x: expected two stations at least");
}

void terrain(MapGrid& map, const Input2& x, const Input2& y, const Counts1& count,
             const Input2& body_x, const Input2& body_y, double body_offset, double length,
             double width, const Output3& rows, const Known2& known, const Singles2& twist,
             const Singles3& front) {
  expect_paths(x, y, count);
  const auto n = static_cast<Index>(x.shape(0)), m = static_cast<Index>(x.shape(1));
  expect_shape("body_x", body_x, {n, m});
  expect_shape("body_y", body_y, {n, m});
  expect_shape("rows", rows, {9, n, m});
  expect_shape("known", known, {n, m});
  expect_shape("twist", twist, {n, m});
  expect_shape("front", front, {n, 2, m});
  std::array<double*, 9> row{};
  for (std::size_t r = 0; r < row.size(); ++r) row[r] = rows.data() + static_cast<Index>(r) * n * m;
  const TerrainTable table{n,           m,      x.data(),      y.data(),      count.data(),
                           body_x.data(),       body_y.data(), body_offset,   row[0],
                           row[1],      row[2], row[3],        row[4],        row[5],
                           row[6],      row[7], row[8],        known.data(),  twist.data(),
                           front.data()};
  const nb::gil_scoped_release release;
  sample_terrain(map.grid, table, length, width);
}

void stations(MapGrid& map, const Input2& x, const Input2& y, const Counts1& count,
              const Output2& station) {
  expect_paths(x, y, count);
  const auto n = static_cast<Index>(x.shape(0)), m = static_cast<Index>(x.shape(1));
  expect_shape("station", station, {n, m});
  const nb::gil_scoped_release release;
  walk_stations(map.grid, x.data(), y.data(), count.data(), n, m, station.data());
}

void ground_behind(const MapGrid& map, const Input1& x, const Input1& y, const Input1& heading_x,
                   const Input1& heading_y, const Input1& spacing, const Input1& level,
                   const Floats2& front, double length, double width, const Singles3& behind) {
  const auto m = static_cast<Index>(x.shape(0));
  for (const Input1* column : {&y, &heading_x, &heading_y, &spacing, &level}) {
    expect_shape("y, heading, spacing, level", *column, {m});
  }
  expect_shape("front", front, {2, m});
  const auto n = static_cast<Index>(behind.shape(0));
  expect_shape("behind", behind, {n, 2, m});
  const WayBehind way{n, m, x.data(), y.data(), heading_x.data(), heading_y.data(), spacing.data(),
                      level.data(), front.data(), behind.data()};
  const nb::gil_scoped_release release;
  sample_behind(map.grid, way, length, width);
}

void tyre_lifts(MapGrid& map, Index heading, const Output2& out) {
  const Index rows = map.grid.rows(), columns = map.grid.columns();
  expect_shape("out", out, {rows, columns});
  if (heading < 0 || heading >= heading_count || !map.grid.resolves_wheels()) {
    throw nb::value_error("heading: expected one of 16, of a map that resolves wheels");
  }
  const nb::gil_scoped_release release;
  const std::scoped_lock lock(map.grid.mutex());
  for (Index i = 0; i < rows; ++i) {
    for (Index j = 0; j < columns; ++j) {
      out.data()[i * columns + j] = map.grid.lift(heading, i, j, 0.0, 0.0);
    }
  }
}

nb::tuple rows() {
  nb::list table;
  for (const RowInfo& row : row_table) {
    table.append(nb::make_tuple(row.name, row.type, row.unit, row.meaning));
  }
  return nb::tuple(table);
}

// A module for a newer processor would end the process without a message. The processor is asked
// directly, because compiler-rt of zig knows no processor.
void expect_processor() {
#if defined(__x86_64__)
  unsigned needed = 0, a = 0, features = 0, c = 0, d = 0;
#ifdef __AVX2__
  needed |= bit_AVX2;
#endif
#ifdef __AVX512F__
  needed |= bit_AVX512F;
#endif
  __get_cpuid_count(7, 0, &a, &features, &c, &d);
  if ((features & needed) != needed) {
    throw nb::import_error("it was compiled for another processor: install slopewise again here");
  }
#endif
}

}  // namespace
}  // namespace slopewise

NB_MODULE(_core, m) {
  using namespace nb::literals;
  namespace sw = slopewise;
  sw::expect_processor();
  nb::set_leak_warnings(false);  // grids of the last maps live until the process ends
  m.attr("DIGEST") = SLOPEWISE_DIGEST;
  m.attr("ROWS") = sw::rows();
  m.attr("STANDSTILL_SQ") = sw::standstill_sq;
  m.attr("TIGHTENING") = sw::tightening;
  m.attr("MIN_STATIONS") = sw::min_stations;
  m.attr("NO_PROFILE") = sw::no_profile;
  m.attr("KIND_COUNT") = sw::kind_count;
  m.def("time_optimal", &sw::time_optimal, "station"_a, "speed_sq_max"_a, "sin_grade"_a,
        "force_lower_slope"_a, "force_lower_intercept"_a, "trained_speed_min"_a, "accel_max"_a,
        "required_thrust_ratio"_a, "start_sq"_a, "decel"_a, "specific_power"_a,
        "speed_sq"_a.noconvert(), "reachable_start_sq"_a.noconvert());
  m.def("average_heights", &sw::average, "elevation"_a, "wide_row"_a, "wide_column"_a,
        "wide_weights"_a, "wide_std"_a, "slopes"_a, "narrow_row"_a, "narrow_column"_a,
        "narrow_weights"_a, "narrow_std"_a, "row"_a, "column"_a, "start"_a, "variance"_a,
        "stride"_a, "reach"_a, "noise"_a, "block_noise"_a, "significance"_a, "known_share"_a,
        "heights"_a.noconvert());
  m.attr("HEADING_COUNT") = sw::heading_count;
  nb::class_<sw::MapGrid>(m, "HeightGrid")
      .def(nb::init<const sw::Input2&, double, double, double, double, double, double>(),
           "elevation"_a.noconvert(), "origin_x"_a, "origin_y"_a, "resolution"_a, "half_length"_a,
           "half_width"_a, "radius"_a)
      .def_prop_ro("memory", [](sw::MapGrid& map) {
        const std::scoped_lock lock(map.grid.mutex());
        return map.grid.memory();
      })
      .def("tyre_lifts", &sw::tyre_lifts, "heading"_a, "out"_a.noconvert())
      .def("sample_terrain", &sw::terrain, "x"_a, "y"_a, "count"_a, "body_x"_a, "body_y"_a,
           "body_offset"_a, "length"_a, "width"_a, "rows"_a.noconvert(), "known"_a.noconvert(), "twist"_a.noconvert(),
           "front"_a.noconvert())
      .def("stations", &sw::stations, "x"_a, "y"_a, "count"_a, "station"_a.noconvert())
      .def("ground_behind", &sw::ground_behind, "x"_a, "y"_a, "heading_x"_a, "heading_y"_a,
           "spacing"_a, "level"_a, "front"_a, "length"_a, "width"_a, "behind"_a.noconvert());
  m.def("travel_cost", &sw::travel_cost, "station"_a, "speed_sq"_a, "horizon_penalty"_a,
        "cost"_a.noconvert());
  m.def("smooth", &sw::smooth_profile, "ds"_a, "speed_sq_max"_a, "accel_max"_a, "decel_max"_a,
        "jerk"_a, "start_accel"_a, "speed_sq"_a.noconvert());
  m.def("smoothing_program", &sw::smoothing_program, "ds"_a, "speed_sq_max"_a, "accel_max"_a,
        "decel_max"_a, "jerk"_a, "start_accel"_a, "open"_a.noconvert(), "rows"_a.noconvert(),
        "limit"_a.noconvert());
  m.def("keep_inside", &sw::keep_profile_inside, "speed_sq"_a, "speed_sq_max"_a,
        "out"_a.noconvert());
}
