// A wheel on all lines within its band: edges across.
#pragma once

#include "swept/tracking_band.hpp"
#include "swept/wheel_sweep.hpp"

namespace slopewise {

// One wheel of one pose, which may be off by a band to either side [m].
struct WheelBand {
  const Pose2d& pose;
  Place wheel;
  double band;
  const VehicleEnvelope& sizes;
};

// Slope that explains a change from line to line where the ground has such a slope to the left [1].
inline double explained_slope(double across) noexcept {
  const bool is_known = across == across;
  return (is_known ? min_of(std::abs(across), steepest_ground) : 0.0) + slope_margin;
}

// An edge along the way that the wheel would cross sideways within the band, from what it stands on
// on each line, NaN where none is. That may rise or fall from line to line as the slope around does;
// within the chord that distinguishes a step from a ramp, what remains is at most a step. On lines
// beyond the band only ground that falls from a line within counts: with its middle beyond an edge a
// wheel no longer stands safely on it.
inline Hazard find_edge(const WheelBand& of, const BandLines& lines, double slope,
                        const double* heights) noexcept {
  constexpr double same_line = 1e-9;  // rounding of distances between lines [m]
  const VehicleEnvelope& sizes = of.sizes;
  const double widest = of.band + same_line, end = static_cast<double>(lines.side) * lines.stride;
  const double length = max_of(sizes.chord, end - of.band + lines.stride);
  const auto window = static_cast<Index>(std::ceil(length / lines.stride));
  for (Index i = -lines.side; i <= lines.side; ++i) {
    for (Index k = i + 1; k <= std::min(i + window, lines.side); ++k) {
      const double change = heights[k + lines.side] - heights[i + lines.side];
      const double explained = slope * static_cast<double>(k - i) * lines.stride;
      if (!(std::abs(change) - explained > sizes.max_step)) continue;
      const Index outer = k + i >= 0 ? k : i, inner = k + i - outer;
      const bool rises = outer == k ? change > 0.0 : change < 0.0;
      const Index within = rises ? outer : inner;
      if (static_cast<double>(std::abs(within)) * lines.stride > widest) continue;
      return hazard_of_edge(rises ? HazardKind::rise : HazardKind::drop, std::abs(change),
                            lines.move(of.wheel, outer), sizes);
    }
  }
  return {};
}

}  // namespace slopewise
