// Random polylines through the rooms of given paths, for the sanitizers.
#include <cmath>
#include <vector>

#include "driver.hpp"
#include "path/given_path.hpp"
#include "path/raw_points.hpp"
#include "path/spline_path.hpp"

using namespace slopewise;
using namespace slopewise::driver;

namespace {

std::mt19937_64 generator;

// A random walk; memory of the exact size, so that a step beyond it is found.
std::vector<double> polyline(Index count) {
  std::vector<double> points(static_cast<std::size_t>(2 * count));
  const double step = uniform(0.01, 2.0), wild = uniform(0.0, 3.2);
  double x = 0.0, y = 0.0, heading = 0.0;
  for (std::size_t i = 0; i < points.size(); i += 2) {
    points[i] = x;
    points[i + 1] = y;
    heading += uniform(-wild, wild);
    const double length = uniform(0.05, 1.0) * step;
    x += length * std::cos(heading);
    y += length * std::sin(heading);
  }
  return points;
}

Line line_of(const std::vector<double>& points) {
  return {points.data(), static_cast<Index>(points.size()) / 2};
}

std::vector<double> memory_of(Index count) {
  return std::vector<double>(static_cast<std::size_t>(count));
}

void compare() {
  const auto first = polyline(whole(2, 60)), second = polyline(whole(2, 60));
  const Line given = line_of(first), line = line_of(second);
  auto distance = memory_of(line.count);
  auto memory = memory_of(Deviation::memory(given.count, line.count));
  Deviation(given, line, distance.data(), memory.data()).compare();
  auto same = memory_of(given.count);
  auto other = memory_of(Deviation::memory(given.count, given.count));
  Deviation(given, given, same.data(), other.data()).compare();
  for (const double away : distance) expect(away >= 0.0 && std::isfinite(away), "a distance");
  auto part = memory_of(PartDeviation::memory(given.count, line.count));
  PartDeviation(given, line, uniform(-3.0, 20.0), uniform(1.0, 40.0), part.data())
      .compare(distance.data());
}

void follow() {
  const auto points = polyline(whole(3, 80)), stations = polyline(whole(3, 80));
  const Line line = line_of(points), even = line_of(stations);
  double length = 0.0;
  for (Index i = 1; i < line.count; ++i) length += distance_of(line[i - 1], line[i]);
  const double half = uniform(0.02, 3.0);
  const Index samples = FollowedLine::samples(length, half);
  auto memory = memory_of(FollowedLine::memory(line.count, samples));
  const FollowedLine mean(line, samples, memory.data());
  expect(mean.length() <= length * (1.0 + 1e-9), "a mean is not longer than its polyline");
  const Index count = whole(2, 200);
  auto out = memory_of(2 * count), place = memory_of(count), curvature = memory_of(count);
  mean.stations(count, out.data(), place.data());
  expect(out[0] == points[0] && out.back() == points.back(), "ends stay");
  for (double& share : place) share = std::min(share / length, 1.0);
  mean.curvature(place.data(), count, curvature.data());
  for (const double bend : curvature) expect(bend >= 0.0 && std::isfinite(bend), "a curvature");
  auto more = memory_of(FollowedLine::memory(even.count, samples)), bends = memory_of(even.count);
  (void)mean.agrees(even, FollowedLine(even, samples, more.data()), {0.01, 0.1, uniform(0.0, 0.1)}, bends.data());
  auto room = memory_of(line.count - 3), along = memory_of(line.count);
  if (line.count > 3) expect(third_difference(line, room.data()) >= 0.0, "a size");
  std::vector<std::int64_t> groups(static_cast<std::size_t>(line.count));
  const Index found = group_points(line, uniform(0.0, 3.0), groups.data());
  expect(found >= 2 && found <= line.count, "groups of points");
  expect(groups[static_cast<std::size_t>(found - 1)] == line.count - 1, "the end is alone");
  line.measure(along.data());
  auto steps = memory_of(line.count - 1);
  expect(usual_step(along.data(), line.count, steps.data()) > 0.0, "a step");
  expect(first_cusp(line, 2.1, 1e-3) < line.count, "a cusp is a point");
  const Index tip = first_turn(line, uniform(0.05, 1.0), 2.1);
  expect(tip >= 0 && tip < line.count, "a tip is a point");
}

void spline() {
  const auto points = polyline(whole(3, 60));
  const Line line = line_of(points);
  auto along = memory_of(line.count);
  line.measure(along.data());
  const Index most = dense_count(line.count, along.back());
  auto at = memory_of(most), places = memory_of(2 * most), weights = memory_of(most);
  const Index n = between_vertices(line, along.data(), uniform(0.0, 0.2),
                                   {at.data(), places.data(), weights.data()});
  expect(n <= most, "no more places than room");
  const Index degree = whole(1, max_degree), coefficients = degree + whole(1, 20);
  std::vector<double> knots(static_cast<std::size_t>(coefficients + degree + 1));
  const double last = static_cast<double>(coefficients - degree);
  for (std::size_t i = 0; i < knots.size(); ++i) {
    knots[i] = min_of(max_of(static_cast<double>(i) - static_cast<double>(degree), 0.0), last);
  }
  std::vector<double> x(static_cast<std::size_t>(coefficients)), y(x);
  for (std::size_t i = 0; i < x.size(); ++i) {
    x[i] = static_cast<double>(i);
    y[i] = uniform(-1.0, 1.0);
  }
  const Index count = whole(2, 90);
  auto even = memory_of(2 * count), memory = memory_of(Spline::memory(count));
  Spline(knots.data(), x.data(), y.data(), coefficients, degree, last)
      .stations(count, {0.0, y[0]}, {x.back(), y.back()}, even.data(), memory.data());
  for (const double value : even) expect(std::isfinite(value), "a station");
}

}  // namespace

int main(int count, char** arguments) {
  return run(count, arguments, [](Index) {
    compare();
    follow();
    spline();
  });
}
