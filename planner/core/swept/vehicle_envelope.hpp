// Sizes of body and wheels, where they are, and what may block them.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "batch.hpp"

namespace slopewise {

// Diagonal of a square over its edge, rounded up [1]: the four cells around a point are nearer.
inline constexpr double diagonal = 1.42;

// Lengths [m] unless said otherwise; heights above or below the plane of the wheels.
struct VehicleEnvelope {
  double half_length, half_width;  // of the rectangle of the wheels
  double front, rear, side;        // ends of the body from the middle of the wheelbase
  double margin;                   // by which the body is wider: a cell that it touches counts
  double touch;                    // half the diagonal of a cell: no farther one is touched
  double clearance, wheel_travel;  // of the underside; of a wheel
  double radius, half_tyre;        // of a wheel: its radius, half its width
  double max_step;                 // that a wheel may climb or drop
  double stride;                   // between samples of the ground under a wheel
  double chord;                    // how far ahead the climb of a wheel is looked at
  double steepest;                 // highest climb within that distance that is no step
  double cleared;                  // so high a climb, beyond the slope, needs no exact check
  double trend;                    // ground before and after a step that tells its slope
  Index tyres;                     // samples across a tyre [1]
  bool fine;                       // cells are no larger than the radius of a wheel

  // Radius around the middle of the wheelbase within which the body is.
  [[nodiscard]] double reach() const noexcept {
    return std::hypot(max_of(front, rear) + margin, side + margin);
  }
  // Likewise, within which body and tyres touch cells.
  [[nodiscard]] double sight() const noexcept {
    return std::hypot(max_of(max_of(front, rear), half_length + radius) + touch,
                      max_of(side, half_width + half_tyre) + touch);
  }
  // Likewise, on which the wheels are.
  [[nodiscard]] double wheel_reach() const noexcept { return std::hypot(half_length, half_width); }
  // Length of ground along its way that tells whether a wheel meets a step there.
  [[nodiscard]] double wheel_look() const noexcept {
    return 2.0 * trend + 3.0 * radius + chord;
  }
  // Of a vehicle on tyres without width.
  [[nodiscard]] VehicleEnvelope middle_of_tyre() const noexcept {
    VehicleEnvelope out = *this;
    out.half_tyre = 0.0;
    return out;
  }
  // Of the area in which the body may be: wider by a band [m], longer as its corners turn [1].
  [[nodiscard]] VehicleEnvelope widened(double band, double turned) const noexcept {
    VehicleEnvelope out = *this;
    out.front += side * turned;
    out.rear += side * turned;
    out.side += band;
    return out;
  }
};

struct Place {
  double x, y;  // [m], ahead and to the left where it is seen from a vehicle
};

// Middle of the wheelbase [m], unit vector of travel.
struct Pose2d {
  double x, y, heading_x, heading_y;

  // On the map, what is so far ahead and to the left [m].
  [[nodiscard]] Place at(double ahead, double aside) const noexcept {
    return {x + ahead * heading_x - aside * heading_y, y + ahead * heading_y + aside * heading_x};
  }
};

inline constexpr int wheel_count = 4;

// Front left, front right, rear left, rear right; from the middle of the wheelbase [m].
inline Place wheel_at(int wheel, const VehicleEnvelope& sizes) noexcept {
  return {wheel < 2 ? sizes.half_length : -sizes.half_length,
          wheel % 2 == 0 ? sizes.half_width : -sizes.half_width};
}

// As planner/swept/sentences.py names them.
enum class HazardKind : std::int64_t {
  none, unknown_ground, rise, drop, twist, underside, front, rear, side
};
inline constexpr Index hazard_kinds = 9;

// What blocks a pose: its height [m], and where, from the middle of the wheelbase [m]; poses so far
// before are blocked, too [m].
struct Hazard {
  HazardKind kind = HazardKind::none;
  double height = 0.0, ahead = 0.0, aside = 0.0, before = 0.0;

  [[nodiscard]] bool any() const noexcept { return kind != HazardKind::none; }
};

// Of two hazards of a pose the one that blocks the most poses before it.
inline const Hazard& earlier_of(const Hazard& one, const Hazard& other) noexcept {
  return other.any() && (!one.any() || other.before > one.before) ? other : one;
}

// A map in the memory of the caller: centre of cell [0, 0] [m], cells a metre.
struct MapView {
  const double* heights;
  Index rows, columns;
  double origin_x, origin_y, per_metre;

  [[nodiscard]] double u(double x) const noexcept { return (x - origin_x) * per_metre; }
  [[nodiscard]] double v(double y) const noexcept { return (y - origin_y) * per_metre; }

  // Bilinear height [m]; NaN off the map or beside unknown cells.
  [[nodiscard]] double height_at(const Place& at) const noexcept {
    const double column = u(at.x), row = v(at.y);
    const bool inside = column >= 0.0 && row >= 0.0 && column <= static_cast<double>(columns - 1) &&
                        row <= static_cast<double>(rows - 1);
    if (!inside) return std::numeric_limits<double>::quiet_NaN();
    const Index j = std::min(static_cast<Index>(column), columns - 2);
    const Index i = std::min(static_cast<Index>(row), rows - 2);
    const double along = column - static_cast<double>(j), across = row - static_cast<double>(i);
    const double *z = heights + i * columns + j, *above = z + columns;
    const double lower = z[0] + along * (z[1] - z[0]);
    const double upper = above[0] + along * (above[1] - above[0]);
    return lower + across * (upper - lower);
  }
};

}  // namespace slopewise
