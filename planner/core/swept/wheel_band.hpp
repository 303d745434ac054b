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

// An edge along the way that the wheel would cross sideways, from what it stands on on each line,
// NaN where none is. That may fall from line to line as the slope around does; within the chord that
// distinguishes a step from a ramp, what remains is at most a step. From lines beyond the band the
// ground may fall: with its middle beyond an edge, though, a wheel no longer stands safely on it.
inline Hazard find_edge(const WheelBand& of, const BandLines& lines, double slope,
                        const double* heights) noexcept {
  const VehicleEnvelope& sizes = of.sizes;
  const Index side = lines.side, beyond = lines.side - lines.within;
  const double length = max_of(sizes.chord, static_cast<double>(beyond + 1) * lines.beyond);
  for (Index i = -side; i <= side; ++i) {
    for (Index k = i + 1; k <= side && lines.offset(k - 1) - lines.offset(i) < length; ++k) {
      const double change = heights[k + side] - heights[i + side];
      const double explained = slope * (lines.offset(k) - lines.offset(i));
      if (!(std::abs(change) - explained > sizes.max_step)) continue;
      const Index higher = change > 0.0 ? k : i;
      if (std::abs(higher) > lines.within) continue;
      return hazard_of_edge(HazardKind::drop, std::abs(change),
                            lines.move(of.wheel, i + k - higher), sizes);
    }
  }
  return {};
}

}  // namespace slopewise
