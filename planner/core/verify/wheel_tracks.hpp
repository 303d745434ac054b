// Where body and wheels go along one candidate, and what the wheels stand on: the verifier's own
// sampling of the map. It takes heights at points of lines along the track of each tyre, on all of
// which a wheel rests, where the planner takes all cells under its footprint.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "verify/candidate.hpp"

namespace slopewise::verify {

// Heights of a map in the memory of the caller, NaN where unknown; centre of cell [0, 0] [m], cells a metre.
class MapView {
 public:
  const double* heights;
  Index rows, columns;
  double origin_x, origin_y, cell, per_metre;

  // Of the bilinear surface, NaN off the map and next to unknown cells.
  [[nodiscard]] double height(double x, double y) const noexcept {
    const double u = (x - origin_x) * per_metre, v = (y - origin_y) * per_metre;
    if (!(u >= 0.0 && v >= 0.0 && u <= static_cast<double>(columns - 1) &&
          v <= static_cast<double>(rows - 1))) {
      return std::nan("");
    }
    const Index j = std::min(static_cast<Index>(u), columns - 2);
    const Index i = std::min(static_cast<Index>(v), rows - 2);
    const double p = u - static_cast<double>(j), q = v - static_cast<double>(i);
    const double* z = heights + i * columns + j;
    const double south = z[0] + p * (z[1] - z[0]);
    return south + q * (z[columns] + p * (z[columns + 1] - z[columns]) - south);
  }

  // Of the plane of the cell at a place, which rises by the gentler of the slopes to both of its
  // neighbours: level where they are both higher, both lower or one is unknown. NaN where the cell
  // is unknown; less than a cell beyond the outermost centres that at the rim counts.
  [[nodiscard]] double facet(double x, double y) const noexcept {
    const double u = (x - origin_x) * per_metre, v = (y - origin_y) * per_metre;
    if (!(u > -1.0 && v > -1.0 && u < static_cast<double>(columns) &&
          v < static_cast<double>(rows))) {
      return std::nan("");
    }
    const Index j = std::clamp(static_cast<Index>(u + 0.5), Index{0}, columns - 1);
    const Index i = std::clamp(static_cast<Index>(v + 0.5), Index{0}, rows - 1);
    const double* z = heights + i * columns + j;
    // At the rim a cell is its own neighbour, and level.
    const Index west = j > 0 ? 1 : 0, right = j + 1 < columns ? 1 : 0;
    const Index south = i > 0 ? columns : 0, up = i + 1 < rows ? columns : 0;
    const double east = gentler(z[0] - z[-west], z[right] - z[0]);
    const double north = gentler(z[0] - z[-south], z[up] - z[0]);
    return z[0] + east * (u - static_cast<double>(j)) + north * (v - static_cast<double>(i));
  }

 private:
  [[nodiscard]] static double gentler(double before, double after) noexcept {
    const double least = std::abs(before) < std::abs(after) ? before : after;
    return before * after > 0.0 ? least : 0.0;
  }
};

// Sizes of body and wheels [m].
struct BodySizes {
  double wheelbase, track_width, wheel_radius, wheel_width;
  double front, rear, width;  // ends of the body from the middle of the wheelbase
  double clearance, max_step, wheel_travel;
  double centre_offset, body_offset;  // of the steering, as of SteeringGeometry
};

// The line of a candidate, (N,) each: the reference point [m], along the ground [m].
struct PlannedLine {
  Index stations;
  const double *x, *y, *station;
};

[[nodiscard]] inline double length_of(double x, double y) noexcept { return std::sqrt(x * x + y * y); }

// A pose of the body: middle of the wheelbase [m], unit vector ahead; station [m], the segment and
// the share of it.
struct BodyPose {
  double x, y, heading_x, heading_y;
  double station;
  Index segment;
  double share;
};

inline constexpr std::size_t wheel_count = 4;  // front left, front right, rear left, rear right
inline constexpr double samples_per_radius = 6.0;
inline constexpr double coarse_step = 0.1;  // between poses on cells larger than a wheel [m]
// Share of the width of a tyre that is sampled [1]: poses between stations are as exact as what is
// left, and the ground beside a tyre is not under it.
inline constexpr double tread_share = 0.8;

inline constexpr double unsupported = -1e12;  // below any height, where the highest counts [m]

// Longest step between two poses [m]: a cell, and no more than shows the rim of a wheel where cells
// show what it feels.
[[nodiscard]] inline double pose_step(const MapView& map, const BodySizes& sizes) noexcept {
  const bool fine = map.cell <= sizes.wheel_radius;
  return fine ? min_of(map.cell, sizes.wheel_radius / samples_per_radius) : coarse_step;
}

[[nodiscard]] inline Index poses_between(const PlannedLine& line, Index k, double step) noexcept {
  const double length = length_of(line.x[k + 1] - line.x[k], line.y[k + 1] - line.y[k]);
  return std::max<Index>(static_cast<Index>(std::ceil(length / step)), 1);
}

[[nodiscard]] inline Index count_poses(const PlannedLine& line, double step) noexcept {
  Index count = 1;
  for (Index k = 0; k + 1 < line.stations; ++k) count += poses_between(line, k, step);
  return count;
}

namespace detail {

inline constexpr double one_turn = 2.0 * std::numbers::pi;

[[nodiscard]] inline double nearest_turn(double angle, double to) noexcept {
  return angle - one_turn * std::nearbyint((angle - to) / one_turn);
}

// Heading of the line at its stations, without jumps (N,) [rad].
inline void headings_of(const PlannedLine& line, double* heading) noexcept {
  double before = 0.0;
  for (Index k = 0; k < line.stations; ++k) {
    const Index i = std::max<Index>(k - 1, 0), j = std::min(k + 1, line.stations - 1);
    const double angle = std::atan2(line.y[j] - line.y[i], line.x[j] - line.x[i]);
    before = k == 0 ? angle : nearest_turn(angle, before);
    heading[k] = before;
  }
}

// Angle of a body that trails at the first station: of a steady turn, with the mean curvature of the
// first `rod` of the line.
[[nodiscard]] inline double first_trailing(const PlannedLine& line, const double* heading,
                                           double rod) noexcept {
  double driven = 0.0;
  Index k = 0;
  while (k + 1 < line.stations && driven < rod) {
    driven += length_of(line.x[k + 1] - line.x[k], line.y[k + 1] - line.y[k]);
    ++k;
  }
  const double turned = driven > 0.0 ? (heading[k] - heading[0]) * rod / driven : 0.0;
  return heading[0] - std::asin(std::clamp(turned, -1.0, 1.0));
}

// dψ/ds = sin(ψ_p − ψ) / e over one step, the heading of the line linear in it: by the midpoint.
[[nodiscard]] inline double trailed(double body, double line_before, double line_after, double step,
                                    double rod) noexcept {
  const double half = body + 0.5 * step * std::sin(line_before - body) / rod;
  return body + step * std::sin(0.5 * (line_before + line_after) - half) / rod;
}

}  // namespace detail

// Poses of the body at stations and between, count_poses of them; `heading` is room for (N,).
inline void poses_along(const PlannedLine& line, const BodySizes& sizes, double step,
                        double* heading, BodyPose* out) noexcept {
  detail::headings_of(line, heading);
  const double rod = sizes.centre_offset, ahead = sizes.body_offset;
  double body = rod > 0.0 ? detail::first_trailing(line, heading, rod) : heading[0];
  double before = heading[0], last_x = line.x[0], last_y = line.y[0];
  for (Index k = 0; k < line.stations; ++k) {
    const bool ends = k + 1 == line.stations;
    const Index i = ends ? k - 1 : k, parts = ends ? 1 : poses_between(line, k, step);
    for (Index part = 0; part < parts; ++part) {
      const double u = ends ? 1.0 : static_cast<double>(part) / static_cast<double>(parts);
      const double x = at(line.x, i, u), y = at(line.y, i, u), angle = at(heading, i, u);
      const double driven = length_of(x - last_x, y - last_y);
      body = rod > 0.0 ? detail::trailed(body, before, angle, driven, rod) : angle;
      const double cosine = std::cos(body), sine = std::sin(body);
      // Only a body that follows the line without trailing has its middle ahead of it.
      *out++ = {x + ahead * cosine, y + ahead * sine, cosine, sine, at(line.station, i, u), i, u};
      before = angle;
      last_x = x;
      last_y = y;
    }
  }
}

// What one wheel meets along all poses, (P,) each.
struct WheelTrack {
  double* way;      // along the plan view [m]
  double* contact;  // height of the wheel's lowest point, NaN where the ground is unknown [m]
};

namespace detail {

// The tyre as it rests: half the length that may carry [m], and the lines across it.
struct Tyre {
  double half_length, radius;
  bool rolls;    // cells show what a wheel feels
  int lines;     // across it, no farther apart than cells
  double apart;  // [m]

  Tyre(const MapView& map, const BodySizes& sizes) noexcept
      : radius(sizes.wheel_radius), rolls(map.cell <= radius) {
    const double over = max_of(radius - sizes.max_step, 0.0);
    half_length = rolls ? std::sqrt(radius * radius - over * over) : 0.0;
    const double width = rolls ? tread_share * sizes.wheel_width : 0.0;
    lines = 1 + static_cast<int>(std::ceil(width / map.cell));
    apart = lines > 1 ? width / (lines - 1) : 0.0;
  }
};

// Raise the contact of P poses to what lies ahead of or behind each under the rim of the wheel.
inline void raise_to_rim(const double* ground, const double* way, const Tyre& tyre, Index poses,
                         Index reach, double* contact) noexcept {
  const double per_diameter = 0.5 / tyre.radius, per_radius_sq = 0.25 / (tyre.radius * tyre.radius);
  const double most = tyre.half_length * tyre.half_length * (1.0 + 1e-9);
  for (Index away = -reach; away <= reach; ++away) {
    const Index first = std::max<Index>(-away, 0), end = poses - std::max<Index>(away, 0);
    SLOPEWISE_INDEPENDENT
    for (Index i = first; i < end; ++i) {
      const double d = way[i + away] - way[i], square = d * d;
      // Rim above the lowest point, R − √(R² − d²), by its series.
      const double drop = square * per_diameter * (1.0 + square * per_radius_sq);
      const double rests = square <= most ? ground[i + away] - drop : unsupported;
      contact[i] = max_of(contact[i], rests);
    }
  }
}

}  // namespace detail

// Follow a wheel at (ahead, aside) of the body; `ground` is room for (P,) numbers.
inline void follow_wheel(const MapView& map, const BodySizes& sizes, const BodyPose* poses,
                         Index count, double step, double ahead, double aside, double* ground,
                         const WheelTrack& out) noexcept {
  const detail::Tyre tyre(map, sizes);
  const double edge = 0.5 * tyre.apart * (tyre.lines - 1);
  double before_x = 0.0, before_y = 0.0;
  for (Index i = 0; i < count; ++i) {
    const BodyPose& p = poses[i];
    const double x = p.x + ahead * p.heading_x - aside * p.heading_y;
    const double y = p.y + ahead * p.heading_y + aside * p.heading_x;
    out.way[i] = i == 0 ? 0.0 : out.way[i - 1] + length_of(x - before_x, y - before_y);
    before_x = x;
    before_y = y;
    const double middle = tyre.rolls ? map.facet(x, y) : map.height(x, y);
    double highest = unsupported;
    for (int line = 0; line < tyre.lines; ++line) {
      const double shift = line * tyre.apart - edge;
      const double z = tyre.rolls ? map.facet(x - shift * p.heading_y, y + shift * p.heading_x)
                                  : middle;
      highest = max_of(highest, z);  // what is unknown supports nothing
    }
    ground[i] = highest;
    out.contact[i] = middle == middle ? highest : middle;
  }
  const auto reach = static_cast<Index>(std::ceil(tyre.half_length / step));
  detail::raise_to_rim(ground, out.way, tyre, count, reach, out.contact);
}

}  // namespace slopewise::verify
