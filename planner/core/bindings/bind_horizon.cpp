// Paths of a moving horizon.
#include "bindings/bindings.hpp"
#include "path/polyline.hpp"

namespace slopewise {
namespace {

// Places need a segment to be on.
Paths segments_of(const Input2& x, const Input2& y, const Counts1& count) {
  const auto n = static_cast<Index>(x.shape(0)), m = static_cast<Index>(x.shape(1));
  expect_shape("y", y, {n, m});
  expect_shape("count", count, {m});
  for (Index j = 0; j < m; ++j) {
    if (count.data()[j] < 2 || count.data()[j] > n) {
      throw nb::value_error("count: expected two stations at least, and no more than rows");
    }
  }
  return {n, m, x.data(), y.data(), count.data()};
}

std::tuple<Made<std::int64_t>, Made<double>, Made<double>> feet(
    const Input1& line_x, const Input1& line_y, const Input1& x, const Input1& y, Index low,
    Index high) {
  const auto stations = static_cast<Index>(line_x.shape(0)), n = static_cast<Index>(x.shape(0));
  expect_shape("line_y", line_y, {stations});
  expect_shape("y", y, {n});
  if (low < 0 || high >= stations) throw nb::value_error("low, high: expected segments of the line");
  const auto segment = make_array<std::int64_t>(n);
  const auto share = make_array(n), distance = make_array(n);
  const nb::gil_scoped_release release;
  feet_on_line(line_x.data(), line_y.data(), low, high, x.data(), y.data(), n, segment.data(),
               share.data(), distance.data());
  return {segment, share, distance};
}

std::tuple<Made<std::int64_t>, Made<double>> locate(const Input2& x, const Input2& y,
                                                    const Counts1& count, double at_x, double at_y,
                                                    double heading) {
  const Paths paths = segments_of(x, y, count);
  const Index m = paths.candidates;
  const auto segment = make_array<std::int64_t>(m);
  const auto values = make_array(6, m);
  double* v = values.data();
  const nb::gil_scoped_release release;
  locate_on_paths(paths, {at_x, at_y}, heading,
                  {segment.data(), v, v + m, v + 2 * m, v + 3 * m, v + 4 * m, v + 5 * m});
  return {segment, values};
}

}  // namespace

void bind_horizon(nb::module_& m) {
  m.def("feet_on_line", &feet);
  m.def("locate_on_paths", &locate);
}

}  // namespace slopewise
