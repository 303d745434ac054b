// The band around the planned line in which body and wheels may be, with the errors of tracking.
//
// The body becomes wider by the band of its outermost corner; wheels are checked on lines to either
// side of the planned one, no farther from each other than a cell or half a tyre.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "swept/vehicle_envelope.hpp"

namespace slopewise {

// How far the body may be off its line.
struct BandWidth {
  double widest;       // by how much the reference point may be off the line, at most [m]
  double turned;       // sine of the heading error [1]
  double body_offset;  // from the reference point ahead to the middle of the wheelbase [m]
};

// Lines of a wheel within a width to either side, the planned one in the middle is number 0, and
// beyond it; the width itself is one of them.
struct BandLines {
  Index within, side;     // to either side [1]
  double stride, beyond;  // between two, within and beyond the width [m]

  BandLines(double width, double max_stride, double further = 0.0) noexcept
      : within(static_cast<Index>(std::ceil(width / max_stride))),
        side(within + static_cast<Index>(std::ceil(further / max_stride))),
        stride(width / static_cast<double>(std::max<Index>(within, 1))),
        beyond(further / static_cast<double>(std::max<Index>(side - within, 1))) {}

  // How far it is to the left of the planned one [m].
  [[nodiscard]] double offset(Index line) const noexcept {
    const Index inner = std::clamp(line, -within, within);
    return static_cast<double>(inner) * stride + static_cast<double>(line - inner) * beyond;
  }
  [[nodiscard]] Place move(Place wheel, Index line) const noexcept {
    return {wheel.x, wheel.y + offset(line)};
  }
};

struct TrackingBand {
  bool has_width;
  double widest = 0.0, turned = 0.0;
  double arm = 0.0, wheel_arm = 0.0;  // farthest ends of body and wheels from the reference [m]
  double stride = 1.0;                // largest distance between two lines of a wheel [m]
  double beyond = 0.0;                // the band, where the ground must not fall [m]
  Index lines = 1;                    // of a wheel at most, with those beyond the band [1]

  // Without a width the body is exactly on its line.
  TrackingBand(const std::optional<BandWidth>& width, const VehicleEnvelope& sizes,
               double resolution) noexcept
      : has_width(width.has_value()), stride(max_of(resolution, sizes.half_tyre)) {
    if (width) {
      widest = width->widest;
      turned = width->turned;
      arm = max_of(sizes.front, sizes.rear) + width->body_offset;
      wheel_arm = sizes.half_length + width->body_offset;
    }
    beyond = sizes.half_tyre + 0.5 * resolution;
    lines = 2 * BandLines(of_wheels(widest), stride, beyond).side + 1;
  }

  [[nodiscard]] BandLines lines_at(double across) const noexcept {
    return {of_wheels(across), stride};
  }
  // By how much a wheel may be off where the reference point may be so much [m].
  [[nodiscard]] double of_wheels(double across) const noexcept {
    return across + wheel_arm * turned;
  }
  // The area in which the body may be there.
  [[nodiscard]] VehicleEnvelope area(const VehicleEnvelope& sizes, double across) const noexcept {
    return sizes.widened(across + arm * turned, turned);
  }
  // For the broad phase, which covers the widest place.
  [[nodiscard]] VehicleEnvelope widest_area(const VehicleEnvelope& sizes) const noexcept {
    return has_width ? area(sizes, widest) : sizes;
  }
};

}  // namespace slopewise
