// Hazards along paths. Arrays belong to the caller; only a broad phase keeps its map.
#include <array>
#include <optional>
#include <vector>

#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>

#include "bindings/bind_rows.hpp"
#include "ground/map_grid.hpp"
#include "swept/rough_ground.hpp"
#include "swept/sweep.hpp"

namespace slopewise {
namespace {

using Floats3 = nb::ndarray<const float, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

template <class T>
T number(nb::handle object, const char* name) {
  return nb::cast<T>(object.attr(name));
}

// From an object with attributes of the same names.
VehicleEnvelope envelope_of(nb::handle sizes) {
  const auto length = [&](const char* name) { return number<double>(sizes, name); };
  return {length("half_length"), length("half_width"),   length("front"),    length("rear"),
          length("side"),        length("margin"),       length("touch"),    length("clearance"),
          length("wheel_travel"), length("radius"),      length("half_tyre"), length("max_step"),
          length("stride"),      length("chord"),        length("steepest"), length("cleared"),
          length("trend"),       number<Index>(sizes, "tyres"), number<bool>(sizes, "fine")};
}

// A map that stays while its broad phase does.
struct MapBroadPhase {
  Input2 elevation;
  BroadPhase grid;
};

Positions positions_of(const Input2& x, const Input2& y) {
  const auto n = static_cast<Index>(x.shape(0)), m = static_cast<Index>(x.shape(1));
  expect_shape("y", y, {n, m});
  if (n * m == 0) throw nb::value_error("x: expected positions, got none");
  return {n, m, x.data(), y.data()};
}

void make_broad_phase(MapBroadPhase* self, const Input2& elevation, double origin_x,
                      double origin_y, double resolution, nb::handle sizes,
                      const std::optional<std::array<double, 3>>& band, const Input2& x,
                      const Input2& y, double beside) {
  const MapView map{elevation.data(), static_cast<Index>(elevation.shape(0)),
                    static_cast<Index>(elevation.shape(1)), origin_x, origin_y, 1.0 / resolution};
  const VehicleEnvelope envelope = envelope_of(sizes);
  const Positions at = positions_of(x, y);
  std::optional<BandWidth> width;
  if (band) width = {(*band)[0], (*band)[1], (*band)[2]};
  Input2 kept = elevation;
  const nb::gil_scoped_release release;
  BroadPhase grid(map, resolution, envelope, width, at, beside);
  new (self) MapBroadPhase{std::move(kept), std::move(grid)};
}

MapBroadPhase widened(const MapBroadPhase& self, nb::handle sizes,
                      const std::array<double, 3>& band) {
  const VehicleEnvelope envelope = envelope_of(sizes);
  const nb::gil_scoped_release release;
  return {self.elevation, self.grid.widened(envelope, {band[0], band[1], band[2]})};
}

bool covers(const MapBroadPhase& self, const Input2& x, const Input2& y) {
  return self.grid.covers(positions_of(x, y));
}

// Rows of a profile that begins with the poses and may go on beyond them.
template <class T>
const T* beginning_of(const nb::handle& profile, const char* name, Index stations,
                      Index candidates) {
  const auto rows =
      member_array<nb::ndarray<const T, nb::ndim<2>, nb::c_contig, nb::device::cpu>>(profile, name);
  if (static_cast<Index>(rows.shape(0)) < stations) {
    throw nb::value_error((std::string(name) + ": expected a row for each pose").c_str());
  }
  expect_shape(name, rows, {static_cast<Index>(rows.shape(0)), candidates});
  return rows.data();
}

// Of `BodyRows` along a `TerrainProfile`.
std::tuple<Made<std::int64_t>, Made<double>, Index> sweep_paths(
    const MapBroadPhase& self, const nb::handle& body, const nb::handle& profile, double spacing,
    const std::optional<Input2>& across, const Counts1& code_of_kind) {
  const PoseRows poses = poses_of(body);
  const Index n = poses.stations, m = poses.candidates;
  const auto code = make_rows<std::int64_t>(n, m);
  const auto found = make_array(m, 4);
  expect_shape("code_of_kind", code_of_kind, {hazard_kinds});
  if (across.has_value() != self.grid.band().has_width) {
    throw nb::value_error("across: expected an array where the broad phase has a band, else None");
  }
  if (across) expect_shape("across", *across, {n, m});
  const SweptPaths paths{poses, beginning_of<double>(profile, "station", n, m),
                         member_line<std::int64_t>(profile, "count", m),
                         beginning_of<bool>(profile, "known", n, m),
                         beginning_of<float>(profile, "twist", n, m),
                         spacing, across ? across->data() : nullptr};
  double* memory =
      Workspace::of_thread().reserve(NarrowPhase::memory_size(self.grid, spacing));
  const nb::gil_scoped_release release;
  const Index searched =
      sweep(self.grid, paths, {code_of_kind.data(), code.data(), found.data()}, memory);
  return {code, found, searched};
}

// `limits` are those of a ride, in the order of RideLimits.
Made<double> roughness_speeds(const MapGrid& map, const nb::handle& profile, const Input1& spacing,
                              nb::handle sizes, const std::array<double, 6>& limits) {
  const PoseRows poses = poses_of(profile.attr("body"));
  const Index n = poses.stations, m = poses.candidates;
  const auto front = member_array<Floats3>(profile, "front");
  expect_shape("spacing", spacing, {m});
  expect_shape("front", front, {n, 2, m});
  const auto held = make_rows(n, m);
  const RiddenPaths on{poses, member_rows<double>(profile, "z", n, m).data, spacing.data(),
                       member_line<std::int64_t>(profile, "count", m), front.data(), held.data()};
  const VehicleEnvelope envelope = envelope_of(sizes);
  const auto& [frequency, damping, vertical_accel, speed, noise, cell] = limits;
  const RideLimits ride{frequency, damping, vertical_accel, speed, noise, cell};
  const nb::gil_scoped_release release;
  limit_ride_speeds(map.grid, envelope, ride, on);
  return held;
}

// Every block needs every check: tests compare that with what the blocks say.
void suspect_all(MapBroadPhase& self) {
  ScreenedBlocks &blocks = self.grid.blocks(), all(blocks.rows, blocks.columns);
  all.east.swap(blocks.east);
  all.north.swap(blocks.north);
  blocks = std::move(all);
}

}  // namespace

void bind_swept(nb::module_& m) {
  using namespace nb::literals;
  m.attr("SLOPE_MARGIN") = slope_margin;
  nb::class_<MapBroadPhase>(m, "BroadPhase")
      .def("__init__", &make_broad_phase, "elevation"_a.noconvert(), "origin_x"_a, "origin_y"_a,
           "resolution"_a, "sizes"_a, "band"_a.none(), "x"_a, "y"_a, "beside"_a)
      .def("widened", &widened, "sizes"_a, "band"_a)
      .def("covers", &covers, "x"_a, "y"_a)
      .def("sweep", &sweep_paths, "body"_a, "profile"_a, "spacing"_a, "across"_a.none(),
           "code_of_kind"_a)
      .def("suspect_all", &suspect_all);
  m.def("roughness_speeds", &roughness_speeds);
}

}  // namespace slopewise
