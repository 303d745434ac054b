// Paths of a moving horizon. Arrays belong to the caller; no call keeps one.
#include "bindings/bindings.hpp"
#include "path/polyline.hpp"

namespace slopewise {
namespace {

using Codes1 = nb::ndarray<std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Flags1 = nb::ndarray<bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

Paths paths_of(const Input2& x, const Input2& y, const Counts1& count) {
  const auto n = static_cast<Index>(x.shape(0)), m = static_cast<Index>(x.shape(1));
  expect_shape("y", y, {n, m});
  expect_shape("count", count, {m});
  for (Index j = 0; j < m; ++j) {
    if (count.data()[j] > n) throw nb::value_error("count: expected no more stations than rows");
  }
  return {n, m, x.data(), y.data(), count.data()};
}

// Places need a segment to be on.
Paths segments_of(const Input2& x, const Input2& y, const Counts1& count) {
  const Paths paths = paths_of(x, y, count);
  for (Index j = 0; j < paths.candidates; ++j) {
    if (count.data()[j] < 2) throw nb::value_error("count: expected two stations at least");
  }
  return paths;
}

void feet(const Input1& line_x, const Input1& line_y, const Input1& x, const Input1& y, Index low,
          Index high, const Codes1& segment, const Output1& share, const Output1& distance) {
  const auto stations = static_cast<Index>(line_x.shape(0)), n = static_cast<Index>(x.shape(0));
  expect_shape("line_y", line_y, {stations});
  expect_shape("y", y, {n});
  expect_shape("segment", segment, {n});
  expect_shape("share", share, {n});
  expect_shape("distance", distance, {n});
  if (low < 0 || high >= stations) throw nb::value_error("low, high: expected segments of the line");
  const nb::gil_scoped_release release;
  feet_on_line(line_x.data(), line_y.data(), low, high, x.data(), y.data(), n, segment.data(),
               share.data(), distance.data());
}

void locate(const Input2& x, const Input2& y, const Counts1& count, double at_x, double at_y,
            double heading, const Codes1& segment, const Output2& values) {
  const Paths paths = segments_of(x, y, count);
  const Index m = paths.candidates;
  expect_shape("segment", segment, {m});
  expect_shape("values", values, {6, m});
  double* v = values.data();
  const nb::gil_scoped_release release;
  locate_on_paths(paths, {at_x, at_y}, heading,
                  {segment.data(), v, v + m, v + 2 * m, v + 3 * m, v + 4 * m, v + 5 * m});
}

void cut(const Input2& x, const Input2& y, const Counts1& count, const Counts1& segment,
         const Input1& start_x, const Input1& start_y, Index fewest, const Output3& rest,
         const Codes1& kept, const Flags1& near, const Codes1& new_count) {
  const Paths paths = segments_of(x, y, count);
  const Index n = paths.stations, m = paths.candidates;
  expect_shape("segment", segment, {m});
  for (const Input1* column : {&start_x, &start_y}) expect_shape("start", *column, {m});
  for (const Codes1* column : {&kept, &new_count}) expect_shape("kept, new_count", *column, {m});
  expect_shape("near", near, {m});
  expect_shape("rest", rest, {2, n + 1, m});
  for (Index j = 0; j < m; ++j) {
    const std::int64_t behind = segment.data()[j];
    if (behind < -1 || behind + 1 >= count.data()[j]) {
      throw nb::value_error("segment: expected one of the path, or -1");
    }
  }
  double* out = rest.data();
  const nb::gil_scoped_release release;
  cut_paths(paths, {segment.data(), start_x.data(), start_y.data()}, fewest,
            {out, out + (n + 1) * m, kept.data(), near.data(), new_count.data()});
}

void soundness(const Input2& x, const Input2& y, const Counts1& count, const Flags1& finite,
               const Flags1& moving) {
  const Paths paths = paths_of(x, y, count);
  expect_shape("finite", finite, {paths.candidates});
  expect_shape("moving", moving, {paths.candidates});
  const nb::gil_scoped_release release;
  find_sound(paths, finite.data(), moving.data());
}

}  // namespace

void bind_horizon(nb::module_& m) {
  using namespace nb::literals;
  m.def("feet_on_line", &feet, "line_x"_a, "line_y"_a, "x"_a, "y"_a, "low"_a, "high"_a,
        "segment"_a.noconvert(), "share"_a.noconvert(), "distance"_a.noconvert());
  m.def("locate_on_paths", &locate, "x"_a, "y"_a, "count"_a, "at_x"_a, "at_y"_a, "heading"_a,
        "segment"_a.noconvert(), "values"_a.noconvert());
  m.def("cut_paths", &cut, "x"_a, "y"_a, "count"_a, "segment"_a, "start_x"_a, "start_y"_a,
        "fewest"_a, "rest"_a.noconvert(), "kept"_a.noconvert(), "near"_a.noconvert(),
        "new_count"_a.noconvert());
  m.def("find_sound", &soundness, "x"_a, "y"_a, "count"_a, "finite"_a.noconvert(),
        "moving"_a.noconvert());
}

}  // namespace slopewise
