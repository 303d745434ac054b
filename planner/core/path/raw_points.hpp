// What raw points of a polyline look like: their noise, their usual distance, their turns.
#pragma once

#include <algorithm>
#include <cmath>

#include "path/path_deviation.hpp"

namespace slopewise {

// Median of numbers, which are put in another order.
inline double median(double* values, Index count) noexcept {
  double* middle = values + count / 2;
  std::nth_element(values, middle, values + count);
  return count % 2 == 1 ? *middle : 0.5 * (*std::max_element(values, middle) + *middle);
}

// Median size of the third differences of points, which nearly vanish on a smooth path [m]; at
// least 4 points, room for 2 numbers each.
inline double third_difference(Line line, double* room) noexcept {
  const Index count = 2 * (line.count - 3);
  for (Index i = 0; i < count; ++i) {
    const double* p = line.xy + i;
    room[i] = std::abs(p[6] - 3.0 * p[4] + 3.0 * p[2] - p[0]);
  }
  return median(room, count);
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
