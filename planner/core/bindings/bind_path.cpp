// Given polylines.
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>

#include "bindings/bindings.hpp"
#include "path/given_path.hpp"
#include "path/raw_points.hpp"
#include "path/spline_path.hpp"

namespace slopewise {
namespace {

// A polyline (n, 2).
Line line_of(const char* name, const Input2& points, Index least) {
  expect_shape(name, points, {static_cast<Index>(points.shape(0)), 2});
  const auto count = static_cast<Index>(points.shape(0));
  if (count < least) {
    throw nb::value_error(
        (std::string(name) + ": expected " + std::to_string(least) + " points at least").c_str());
  }
  return {points.data(), count};
}

// Largest distances of two lines around the points of the second; of the part that both have in
// common where that is what was passed before it, and the length of the whole path [m].
Made<double> deviation_of(const Input2& given, const Input2& line,
                          const std::optional<std::array<double, 2>>& part) {
  const Line a = line_of("given", given, 2), b = line_of("line", line, 2);
  const auto distance = make_array(b.count);
  double* memory = Workspace::of_thread().reserve(part ? PartDeviation::memory(a.count, b.count)
                                                       : Deviation::memory(a.count, b.count));
  const nb::gil_scoped_release release;
  if (part) {
    PartDeviation(a, b, (*part)[0], (*part)[1], memory).compare(distance.data());
  } else {
    Deviation(a, b, distance.data(), memory).compare();
  }
  return distance;
}

Index first_turn_of(const Input2& points, double reach, double angle) {
  return first_turn(line_of("points", points, 2), reach, angle);
}

double third_difference_of(const Input2& points) {
  const Line line = line_of("points", points, 4);
  return third_difference(line, Workspace::of_thread().reserve(line.count));
}

// First points of groups; the array is longer than their number, which comes first.
std::tuple<Index, Made<std::int64_t>> group_points_of(const Input2& points, double reach) {
  const Line line = line_of("points", points, 2);
  const auto first = make_rows<std::int64_t>(line.count);
  return {group_points(line, reach, first.data()), first};
}

double usual_step_of(const Input1& along) {
  const auto count = static_cast<Index>(along.shape(0));
  if (count < 2) throw nb::value_error("along: expected 2 places at least");
  return usual_step(along.data(), count, Workspace::of_thread().reserve(count));
}

Index first_cusp_of(const Input2& points, double angle, double shortest) {
  return first_cusp(line_of("points", points, 2), angle, shortest);
}

// The arrays are longer than the number of places, which comes first.
std::tuple<Index, Made<double>, Made<double>, Made<double>> dense_places(const Input2& points,
                                                                         const Input1& along,
                                                                         double stray) {
  const Line line = line_of("points", points, 2);
  expect_shape("along", along, {line.count});
  const Index most = dense_count(line.count, along.data()[line.count - 1]);
  const auto dense_along = make_array(most), places = make_array(most, 2),
             weights = make_array(most);
  const Index used = between_vertices(line, along.data(), stray,
                                      {dense_along.data(), places.data(), weights.data()});
  return {used, dense_along, places, weights};
}

Made<double> spline_stations(const Input1& knots, const Input1& x, const Input1& y, Index degree,
                             double length, const Input1& first, const Input1& last, Index count) {
  const auto coefficients = static_cast<Index>(x.shape(0));
  expect_shape("y", y, {coefficients});
  expect_shape("first", first, {2});
  expect_shape("last", last, {2});
  if (degree < 1 || degree > max_degree || coefficients <= degree || count < 2 ||
      static_cast<Index>(knots.shape(0)) < coefficients + degree + 1) {
    throw nb::value_error("knots, x, degree, count: expected a spline and two stations at least");
  }
  double* memory = Workspace::of_thread().reserve(Spline::memory(count));
  const auto even = make_array(count, 2);
  const Spline spline(knots.data(), x.data(), y.data(), coefficients, degree, length);
  const nb::gil_scoped_release release;
  spline.stations(count, {first.data()[0], first.data()[1]}, {last.data()[0], last.data()[1]},
                  even.data(), memory);
  return even;
}

// A polyline as a vehicle follows it; keeps what Python asks for in turn.
class Followed {
 public:
  Followed(const Input2& points, double half)
      : points_(points),
        half_(half),
        given_(line_of("points", points, 2)),
        samples_(FollowedLine::samples(length_of(given_, half), half)),
        memory_(static_cast<std::size_t>(FollowedLine::memory(given_.count, samples_))),
        line_(given_, samples_, memory_.data()) {}

  [[nodiscard]] double length() const { return line_.length(); }
  [[nodiscard]] double sharpest() const { return line_.sharpest(); }

  [[nodiscard]] std::tuple<Made<double>, Made<double>> stations(Index count) const {
    if (count < 2) throw nb::value_error("count: expected two stations at least");
    const auto even = make_array(count, 2), place = make_array(count);
    line_.stations(count, even.data(), place.data());
    return {even, place};
  }

  [[nodiscard]] Made<double> curvature(const Input1& place) const {
    const auto count = static_cast<Index>(place.shape(0));
    const auto out = make_array(count);
    for (Index k = 0; k < count; ++k) {
      if (!(place.data()[k] >= 0.0 && place.data()[k] <= 1.0)) {
        throw nb::value_error("place: expected shares of the polyline");
      }
    }
    line_.curvature(place.data(), count, out.data());
    return out;
  }

  [[nodiscard]] std::optional<Made<double>> sharper_than(const Input2& even, double felt,
                                                         double limiting, double noise) const {
    const Line line = line_of("even", even, 3);
    const Index samples = FollowedLine::samples(length_of(line, half_), half_);
    double* memory = Workspace::of_thread().reserve(FollowedLine::memory(line.count, samples));
    const auto sharper = make_array(line.count);
    const Bends from{felt, limiting, noise};
    if (!line_.agrees(line, {line, samples, memory}, from, sharper.data())) return std::nullopt;
    return sharper;
  }

 private:
  static double length_of(Line line, double half) {
    double length = 0.0;
    for (Index i = 1; i < line.count; ++i) length += distance_of(line[i - 1], line[i]);
    if (!(half > 0.0) || !(length > 0.0) || !std::isfinite(length / half)) {
      throw nb::value_error("points, half: expected a polyline and a half width of some length");
    }
    return length;
  }

  Input2 points_;
  double half_;
  Line given_;
  Index samples_;
  std::vector<double> memory_;
  FollowedLine line_;
};

}  // namespace

void bind_path(nb::module_& m) {
  using namespace nb::literals;
  m.def("deviation", &deviation_of, "given"_a, "line"_a, "part"_a.none() = nb::none());
  m.def("first_turn", &first_turn_of);
  m.def("third_difference", &third_difference_of);
  m.def("group_points", &group_points_of);
  m.def("usual_step", &usual_step_of);
  m.def("first_cusp", &first_cusp_of);
  m.def("dense_places", &dense_places);
  m.def("spline_stations", &spline_stations);
  nb::class_<Followed>(m, "FollowedLine")
      .def(nb::init<const Input2&, double>())
      .def_prop_ro("length", &Followed::length)
      .def_prop_ro("sharpest", &Followed::sharpest)
      .def("stations", &Followed::stations)
      .def("curvature", &Followed::curvature)
      .def("sharper_than", &Followed::sharper_than);
}

}  // namespace slopewise
