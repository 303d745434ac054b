// Ground behind the first station of candidates, for the ride model.
#pragma once

#include "ground/terrain.hpp"

namespace slopewise {

// Ground that the front wheels rolled over on a straight way to the first station, farthest first.
struct WayBehind {
  Index stations, candidates;
  const double *x, *y, *heading_x, *heading_y, *spacing, *level;  // (M,) of the first station
  const float* front;                                             // (2, M)
  float* behind;                                                  // (N, 2, M)
};

inline void sample_behind(const HeightGrid& grid, const WayBehind& way, double length,
                          double width) noexcept {
  detail::Places places;
  detail::Lanes back_x, back_y, height;
  for (Index first = 0; first < way.candidates; first += wide) {
    const Index lanes = std::min<Index>(wide, way.candidates - first);
    const double *heading_x = way.heading_x + first, *heading_y = way.heading_y + first;
    for (Index k = way.stations - 1; k >= 0; --k) {
      for (Index j = 0; j < lanes; ++j) {
        const auto n = static_cast<std::size_t>(j);
        const double back = static_cast<double>(way.stations - k) * way.spacing[first + j];
        back_x[n] = way.x[first + j] - back * heading_x[j];
        back_y[n] = way.y[first + j] - back * heading_y[j];
      }
      for (Index side = 0; side < 2; ++side) {
        detail::locate(grid, back_x.data(), back_y.data(), heading_x, heading_y, 0.5 * length,
                       (side == 0 ? 0.5 : -0.5) * width, lanes, places);
        detail::interpolate(grid, places, lanes, height);
        float* out = way.behind + (2 * k + side) * way.candidates + first;
        const float* later = k == way.stations - 1 ? way.front + side * way.candidates + first
                                                   : out + 2 * way.candidates;
        detail::above_first(height, way.level + first, later, lanes, out);
      }
    }
  }
}

}  // namespace slopewise
