// A wheel on all lines within its band: ground that is even on all of them, and edges across.
#pragma once

#include "swept/wheel_sweep.hpp"

namespace slopewise {

// One wheel of one pose, which may be off by a band to either side [m].
struct WheelBand {
  const FacetGrid& ground;
  const Pose2d& pose;
  Place wheel;
  double band;
  const VehicleEnvelope& sizes;
};

namespace detail {

// A rectangle of cells around a place, turned as a pose is; in cells.
struct CellRectangle {
  double u, v, along_x, along_y, length, width;

  [[nodiscard]] double extent_u() const noexcept {
    return length * std::abs(along_x) + width * std::abs(along_y);
  }
  [[nodiscard]] double extent_v() const noexcept {
    return length * std::abs(along_y) + width * std::abs(along_x);
  }
  [[nodiscard]] bool holds(double du, double dv) const noexcept {
    return std::abs(du * along_x + dv * along_y) <= length &&
           std::abs(dv * along_x - du * along_y) <= width;
  }
};

// How far apart the corners of facets are, above a plane with such rises over a cell [m]; NaN where
// some cell is unknown or off the map.
inline double range_above(const FacetGrid& ground, const CellRectangle& area, double east,
                          double north) noexcept {
  const auto first_row = static_cast<Index>(std::ceil(area.v - area.extent_v()));
  const auto end_row = static_cast<Index>(std::floor(area.v + area.extent_v())) + 1;
  const auto first_column = static_cast<Index>(std::ceil(area.u - area.extent_u()));
  const auto end_column = static_cast<Index>(std::floor(area.u + area.extent_u())) + 1;
  constexpr double none = std::numeric_limits<double>::quiet_NaN();
  if (first_row < 0 || first_column < 0 || end_row > ground.rows || end_column > ground.columns) {
    return none;
  }
  double highest = -std::numeric_limits<double>::infinity(), lowest = -highest;
  for (Index i = first_row; i < end_row; ++i) {
    for (Index j = first_column; j < end_column; ++j) {
      const double du = static_cast<double>(j) - area.u, dv = static_cast<double>(i) - area.v;
      if (!area.holds(du, dv)) continue;
      const Facet& cell = ground.cells[static_cast<std::size_t>(i * ground.columns + j)];
      const double height = static_cast<double>(cell.height) - east * du - north * dv;
      if (height != height) return none;
      const double tilt = std::abs(static_cast<double>(cell.east) - east) +
                          std::abs(static_cast<double>(cell.north) - north);
      highest = max_of(highest, height + 0.5 * tilt);
      lowest = min_of(lowest, height - 0.5 * tilt);
    }
  }
  return highest - lowest;
}

}  // namespace detail

// Can no line of the wheel within the band meet a step or an edge? All cells that any line touches,
// since the pose so far back, lie so close to one plane that no climb and no change across exceeds
// what is cleared of a single line. `difference` is by how much the slope along is another one on
// other lines.
inline bool is_even_swath(const WheelBand& of, double back, WheelSlopes plane,
                          double difference) noexcept {
  const VehicleEnvelope& sizes = of.sizes;
  const double cell = 1.0 / of.ground.per_metre, reach = sizes.radius + sizes.stride;
  const double begin = of.wheel.x - back - reach, end = of.wheel.x + sizes.chord + reach;
  const double margin = 0.5 * diagonal * cell;
  const double length = 0.5 * (end - begin) + margin;
  const double width = of.band + 2.0 * sizes.half_tyre + margin;
  const Place at = of.pose.at(0.5 * (begin + end), of.wheel.y);
  const double along_x = of.pose.heading_x, along_y = of.pose.heading_y;
  const detail::CellRectangle area{of.ground.u(at.x),           of.ground.v(at.y),
                                   along_x,                     along_y,
                                   length * of.ground.per_metre, width * of.ground.per_metre};
  const double east = (plane.along * along_x - plane.across * along_y) * cell;
  const double north = (plane.along * along_y + plane.across * along_x) * cell;
  double lift = sizes.radius * (std::sqrt(1.0 + plane.along * plane.along) - 1.0);
  lift += 2.0 * slope_margin * sizes.half_tyre + difference * (end - begin);
  return detail::range_above(of.ground, area, east, north) + lift <= sizes.cleared;
}

// An edge along the way that the wheel would cross sideways within the band. What it stands on may
// rise or fall from line to line as the slope around does; within the chord that distinguishes a
// step from a ramp, what remains is at most a step. On lines beyond the band only ground that falls
// counts: with its middle beyond an edge a wheel no longer stands safely on it.
inline Hazard find_edge(const WheelBand& of, double max_stride, WheelSlopes slopes, const Rim& rim,
                        double* heights) noexcept {
  constexpr double same_line = 1e-9;  // rounding of distances between lines [m]
  const VehicleEnvelope& sizes = of.sizes;
  const double edge = of.band + sizes.half_tyre;
  const auto count = static_cast<Index>(std::ceil(edge / max_stride));
  const double stride = edge / static_cast<double>(count);
  const auto aside = [&](Index line) {
    return of.wheel.y + static_cast<double>(line - count) * stride;
  };
  const Index lines = 2 * count + 1;
  for (Index i = 0; i < lines; ++i) {
    heights[i] = standing_height(of.ground, of.pose, {of.wheel.x, aside(i)}, sizes, rim, true);
  }
  const auto window = static_cast<Index>(std::ceil(sizes.chord / stride));
  const bool is_known = slopes.across == slopes.across;
  const double slope = is_known ? min_of(std::abs(slopes.across), steepest_ground) : 0.0;
  for (Index i = 0; i < lines; ++i) {
    for (Index k = i + 1; k < std::min(i + window + 1, lines); ++k) {
      const double change = heights[k] - heights[i];
      const double explained = (slope + slope_margin) * static_cast<double>(k - i) * stride;
      if (!(std::abs(change) - explained > sizes.max_step)) continue;
      const Index outer = k + i >= 2 * count ? k : i;
      const bool rises = outer == k ? change > 0.0 : change < 0.0;
      const double away = static_cast<double>(std::abs(outer - count)) * stride;
      if (rises && away > of.band + same_line) continue;
      return {rises ? HazardKind::rise : HazardKind::drop, std::abs(change), of.wheel.x,
              aside(outer)};
    }
  }
  return {};
}

}  // namespace slopewise
