// Given polylines. Arrays belong to the caller.
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

void deviation_along(const Input2& given, const Input2& line, const Output1& distance) {
  const Line a = line_of("given", given, 2), b = line_of("line", line, 2);
  expect_shape("distance", distance, {b.count});
  double* memory = Workspace::of_thread().reserve(Deviation::memory(a.count, b.count));
  const nb::gil_scoped_release release;
  Deviation(a, b, distance.data(), memory).compare();
}

void deviation_of_part(const Input2& given, const Input2& line, double passed, double length,
                       const Output1& distance) {
  const Line a = line_of("given", given, 2), b = line_of("line", line, 2);
  expect_shape("distance", distance, {b.count});
  double* memory = Workspace::of_thread().reserve(PartDeviation::memory(a.count, b.count));
  const nb::gil_scoped_release release;
  PartDeviation(a, b, passed, length, memory).compare(distance.data());
}

Index first_turn_of(const Input2& points, double reach, double angle) {
  return first_turn(line_of("points", points, 2), reach, angle);
}

double third_difference_of(const Input2& points) {
  const Line line = line_of("points", points, 4);
  return third_difference(line, Workspace::of_thread().reserve(2 * line.count));
}

double usual_step_of(const Input1& along) {
  const auto count = static_cast<Index>(along.shape(0));
  if (count < 2) throw nb::value_error("along: expected 2 places at least");
  return usual_step(along.data(), count, Workspace::of_thread().reserve(count));
}

Index first_cusp_of(const Input2& points, double angle, double shortest) {
  return first_cusp(line_of("points", points, 2), angle, shortest);
}

Index dense_places(const Input2& points, const Input1& along, double stray,
                   const Output1& dense_along, const Output2& places, const Output1& weights) {
  const Line line = line_of("points", points, 2);
  expect_shape("along", along, {line.count});
  const Index most = dense_count(line.count, along.data()[line.count - 1]);
  expect_shape("dense_along", dense_along, {most});
  expect_shape("places", places, {most, 2});
  expect_shape("weights", weights, {most});
  return between_vertices(line, along.data(), stray,
                          {dense_along.data(), places.data(), weights.data()});
}

void spline_stations(const Input1& knots, const Input1& x, const Input1& y, Index degree,
                     double length, const Input1& first, const Input1& last, const Output2& even) {
  const auto count = static_cast<Index>(even.shape(0));
  const auto coefficients = static_cast<Index>(x.shape(0));
  expect_shape("even", even, {count, 2});
  expect_shape("y", y, {coefficients});
  expect_shape("first", first, {2});
  expect_shape("last", last, {2});
  if (degree < 1 || degree > max_degree || coefficients <= degree || count < 2 ||
      static_cast<Index>(knots.shape(0)) < coefficients + degree + 1) {
    throw nb::value_error("knots, x, degree, even: expected a spline and two stations at least");
  }
  double* memory = Workspace::of_thread().reserve(Spline::memory(count));
  const Spline spline(knots.data(), x.data(), y.data(), coefficients, degree, length);
  const nb::gil_scoped_release release;
  spline.stations(count, {first.data()[0], first.data()[1]}, {last.data()[0], last.data()[1]},
                  even.data(), memory);
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

  void stations(const Output2& even, const Output1& place) const {
    const auto count = static_cast<Index>(even.shape(0));
    expect_shape("even", even, {count, 2});
    expect_shape("place", place, {count});
    if (count < 2) throw nb::value_error("even: expected two stations at least");
    line_.stations(count, even.data(), place.data());
  }

  void curvature(const Input1& place, const Output1& out) const {
    const auto count = static_cast<Index>(place.shape(0));
    expect_shape("out", out, {count});
    for (Index k = 0; k < count; ++k) {
      if (!(place.data()[k] >= 0.0 && place.data()[k] <= 1.0)) {
        throw nb::value_error("place: expected shares of the polyline");
      }
    }
    line_.curvature(place.data(), count, out.data());
  }

  [[nodiscard]] bool agrees(const Input2& even, double felt, double limiting) const {
    const Line line = line_of("even", even, 3);
    const Index samples = FollowedLine::samples(length_of(line, half_), half_);
    const Index needed = FollowedLine::memory(line.count, samples);
    double* memory = Workspace::of_thread().reserve(needed + line.count);
    const nb::gil_scoped_release release;
    return line_.agrees(line, {line, samples, memory}, {felt, limiting}, memory + needed);
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
  m.def("deviation_along", &deviation_along, "given"_a, "line"_a, "distance"_a.noconvert());
  m.def("deviation_of_part", &deviation_of_part, "given"_a, "line"_a, "passed"_a, "length"_a,
        "distance"_a.noconvert());
  m.def("first_turn", &first_turn_of, "points"_a, "reach"_a, "angle"_a);
  m.def("third_difference", &third_difference_of, "points"_a);
  m.def("usual_step", &usual_step_of, "along"_a);
  m.def("first_cusp", &first_cusp_of, "points"_a, "angle"_a, "shortest"_a);
  m.def("dense_count", &dense_count, "points"_a, "length"_a);
  m.def("dense_places", &dense_places, "points"_a, "along"_a, "stray"_a,
        "dense_along"_a.noconvert(), "places"_a.noconvert(), "weights"_a.noconvert());
  m.def("spline_stations", &spline_stations, "knots"_a, "x"_a, "y"_a, "degree"_a, "length"_a,
        "first"_a, "last"_a, "even"_a.noconvert());
  nb::class_<Followed>(m, "FollowedLine")
      .def(nb::init<const Input2&, double>(), "points"_a, "half"_a)
      .def_prop_ro("length", &Followed::length)
      .def_prop_ro("sharpest", &Followed::sharpest)
      .def("stations", &Followed::stations, "even"_a.noconvert(), "place"_a.noconvert())
      .def("curvature", &Followed::curvature, "place"_a, "out"_a.noconvert())
      .def("agrees", &Followed::agrees, "even"_a, "felt"_a, "limiting"_a);
}

}  // namespace slopewise
