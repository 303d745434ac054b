// Braking force along paths, and what it is found from.
#include <span>

#include "bindings/bind_rows.hpp"
#include "ground/braking_forces.hpp"
#include "ground/surface_bits.hpp"

namespace slopewise {
namespace {

using Table = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Table3 = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Classes2 = nb::ndarray<const std::int64_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// Bits of one integer, one of them ground that was never braked on.
constexpr std::size_t most_surfaces = 63;

// Of a `SurfaceCache`, which keeps its arrays.
struct Surfaces {
  std::span<const Surface> table;
  std::span<const std::int64_t> class_bits;
  std::span<const HullLine> hull;
  const double* margins = nullptr;

  explicit Surfaces(const nb::handle& known) {
    const auto rows = member_array<Table>(known, "table");
    const auto bits = member_array<Counts1>(known, "class_bits");
    const auto count = static_cast<Index>(rows.shape(0));
    class_bits = {bits.data(), bits.shape(0)};
    if (rows.size() == 0 || rows.shape(0) > most_surfaces) {
      throw nb::value_error("table: expected 1 to 63 surfaces");
    }
    if (class_bits.empty() || class_bits.size() > most_surfaces) {
      throw nb::value_error("class_bits: expected 1 to 63 classes");
    }
    expect_shape("table", rows, {count, surface_columns});
    table = {reinterpret_cast<const Surface*>(rows.data()), rows.shape(0)};
    if (!known.attr("hull").is_none()) {
      const auto lines = member_array<Table3>(known, "hull");
      expect_shape("hull", lines, {count, static_cast<Index>(lines.shape(1)), 2});
      hull = {reinterpret_cast<const HullLine*>(lines.data()), lines.shape(0) * lines.shape(1)};
    }
    if (known.attr("margins").is_none()) return;
    const auto matrices = member_array<Table3>(known, "margins");
    expect_shape("margins", matrices, {count, 4, 4});
    margins = matrices.data();
  }
};

std::tuple<Made<double>, Made<bool>, Made<double>> braking_forces(
    const nb::handle& profile, const nb::handle& surfaces, double margin,
    const nb::handle& least_term, const nb::handle& most_term, const nb::handle& drag) {
  const auto grade = nb::cast<Input2>(profile.attr("grade"));
  const auto n = static_cast<Index>(grade.shape(0)), m = static_cast<Index>(grade.shape(1));
  const Surfaces known(surfaces);
  const bool slides = nb::cast<bool>(surfaces.attr("slides"));
  const auto rows = make_rows(slides ? 9 : 8, n, m);
  const auto trained = make_rows<bool>(n, m);
  // A copy where all stations are alike.
  const auto classes = nb::cast<Classes2>(profile.attr("surfaces"));
  expect_shape("surfaces", classes, {n, m});
  const auto numbers = [&](const char* name) {
    return member_rows<double>(profile, name, n, m);
  };
  const ForceProblem problem{
      n,
      m,
      member_line<std::int64_t>(profile, "count", m),
      numbers("grade"),
      numbers("sin_grade"),
      numbers("sin_roll"),
      member_rows<bool>(profile, "known", n, m),
      known.class_bits.size() > 1 ? Labels{classes.data(), m} : Labels{},
      known.class_bits,
      known.table,
      margin,
      known.hull,
      rows_of<double>("least_term", least_term, n, m),
      rows_of<double>("most_term", most_term, n, m),
      known.margins,
      rows_of<double>("drag", drag, n, m),
      slides};
  const auto distance_offset = make_array(m);
  const auto row = [&](Index r) { return Rows<double>{rows.data() + r * n * m, m}; };
  const ForceBounds out{row(0), row(1), row(2), row(3), row(4), row(5), row(6), row(7),
                        slides ? row(8) : Rows<double>{}, {trained.data(), m},
                        distance_offset.data()};
  const nb::gil_scoped_release release;
  find_forces(problem, out);
  return {rows, trained, distance_offset};
}

Made<std::int64_t> surface_bits(const Classes2& classes, double origin_x, double origin_y,
                                double per_metre, const nb::handle& body, double half_length,
                                double half_width) {
  const PoseRows poses = poses_of(body);
  const auto bits = make_rows<std::int64_t>(poses.stations, poses.candidates);
  const ClassMap map{classes.data(), static_cast<Index>(classes.shape(0)),
                     static_cast<Index>(classes.shape(1)), origin_x, origin_y, per_metre};
  const nb::gil_scoped_release release;
  find_surface_bits(map, poses, half_length, half_width, bits.data());
  return bits;
}

}  // namespace

void bind_forces(nb::module_& m) {
  using namespace nb::literals;
  m.def("braking_forces", &braking_forces, "profile"_a, "surfaces"_a, "margin"_a,
        "least_term"_a.none(), "most_term"_a.none(), "drag"_a.none());
  m.def("surface_bits", &surface_bits);
}

}  // namespace slopewise
