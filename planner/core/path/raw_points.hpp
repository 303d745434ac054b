// What raw points of a polyline look like: their noise, their usual distance, their turns.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "path/path_deviation.hpp"

namespace slopewise {

// Median of numbers, which are put in another order.
inline double median(double* values, Index count) noexcept {
  double* middle = values + count / 2;
  std::nth_element(values, middle, values + count);
  return count % 2 == 1 ? *middle : 0.5 * (*std::max_element(values, middle) + *middle);
}

// Median size of the third differences of points across the line, from each to the third after it
// [m]: on a smooth path they nearly vanish. At least 4 points, room for a number each.
inline double third_difference(Line line, double* room) noexcept {
  const Index count = line.count - 3;
  for (Index i = 0; i < count; ++i) {
    const double* p = line.xy + 2 * i;
    const double x = p[6] - 3.0 * p[4] + 3.0 * p[2] - p[0], on_x = p[6] - p[0];
    const double y = p[7] - 3.0 * p[5] + 3.0 * p[3] - p[1], on_y = p[7] - p[1];
    room[i] = std::abs(on_x * y - on_y * x) / max_of(std::hypot(on_x, on_y), 1e-9);
  }
  return median(room, count);
}

// Groups of points in a row that lie closer together than about `reach` [m]: the first point of each
// into `first`, how many there are. Both ends are alone. A group ends where the way has left the
// middle of the one before by one and a half of the reach: noise of single points moves that little.
inline Index group_points(Line line, double reach, std::int64_t* first) noexcept {
  const Index last = line.count - 1;
  const double far = 1.5 * reach;
  Point before = line[0], sum{0.0, 0.0};
  Index begin = 1, groups = 1;
  first[0] = 0;
  const auto middle = [&](Index end) noexcept {
    const auto size = static_cast<double>(end - begin);
    return Point{sum.x / size, sum.y / size};
  };
  for (Index i = 1; i < last; ++i) {
    const Point p = line[i];
    if (i > begin && max_of(distance_of(before, p), distance_of(line[begin], p)) >= far) {
      before = middle(i);
      first[groups++] = begin;
      begin = i;
      sum = {0.0, 0.0};
    }
    sum.x += p.x;
    sum.y += p.y;
  }
  // What is left next to the end belongs to the group before.
  if (begin < last && (groups == 1 || distance_of(middle(last), line[last]) >= 0.5 * reach)) {
    first[groups++] = begin;
  }
  first[groups++] = last;
  return groups;
}

// Median distance from one place along a polyline to the next [m]; at least 2 of them.
inline double usual_step(const double* along, Index count, double* room) noexcept {
  for (Index i = 0; i + 1 < count; ++i) room[i] = along[i + 1] - along[i];
  return median(room, count - 1);
}

// Index of the first point at which a line turns by more than an angle [rad], 0 if none does.
// Steps shorter than `shortest` [m] have no direction.
inline Index first_cusp(Line line, double angle, double shortest) noexcept {
  double ax = 0.0, ay = 0.0;
  for (Index i = 1; i < line.count; ++i) {
    const double x = line[i].x - line[i - 1].x, y = line[i].y - line[i - 1].y;
    if (x * x + y * y < shortest * shortest) continue;
    const double along = ax * x + ay * y;
    // Most turns are less than a right angle.
    if (along < 0.0 && std::abs(std::atan2(ax * y - ay * x, along)) > angle) return i - 1;
    ax = x;
    ay = y;
  }
  return 0;
}

}  // namespace slopewise
