// How fast rough ground may be driven along candidates, from the map on.
#pragma once

#include <vector>

#include "ground/terrain.hpp"
#include "swept/roughness.hpp"

namespace slopewise {

// The ground behind the first stations, on a straight way to them.
inline void sample_behind(const HeightGrid& grid, const RiddenPaths& on, double length,
                          double width) noexcept {
  detail::Places places;
  detail::Lanes back_x, back_y, height;
  for (Index first = 0; first < on.candidates; first += wide) {
    const Index lanes = std::min<Index>(wide, on.candidates - first);
    const double *heading_x = on.heading_x + first, *heading_y = on.heading_y + first;
    for (Index k = on.behind_stations - 1; k >= 0; --k) {
      for (Index j = 0; j < lanes; ++j) {
        const auto n = static_cast<std::size_t>(j);
        const double back = static_cast<double>(on.behind_stations - k) * on.spacing[first + j];
        back_x[n] = on.x[first + j] - back * heading_x[j];
        back_y[n] = on.y[first + j] - back * heading_y[j];
      }
      for (Index side = 0; side < 2; ++side) {
        detail::locate(grid, back_x.data(), back_y.data(), heading_x, heading_y, 0.5 * length,
                       (side == 0 ? 0.5 : -0.5) * width, lanes, places);
        detail::interpolate(grid, places, lanes, height);
        float* out = on.behind + (2 * k + side) * on.candidates + first;
        const float* later = k == on.behind_stations - 1
                                 ? on.front + side * on.candidates + first
                                 : out + 2 * on.candidates;
        detail::above_first(height, on.level + first, later, lanes, out);
      }
    }
  }
}

// What roughness allows along candidates, and what lies behind them. Memory is kept by the thread.
inline void limit_ride_speeds(const HeightGrid& grid, const VehicleEnvelope& vehicle,
                              const RideLimits& limits, RiddenPaths on) {
  thread_local std::vector<float> memory;
  thread_local std::vector<QuarterCar> cars;
  cars.clear();
  for (Index j = 0; j < on.candidates; ++j) {
    cars.emplace_back(vehicle, limits, on.spacing[j]);
    on.behind_stations = std::max(on.behind_stations, cars.back().pre_roll);
  }
  on.cars = cars.data();
  const Index behind_size = 2 * on.behind_stations * on.candidates;
  const auto needed =
      static_cast<std::size_t>(behind_size + RoughnessTile<wide>::memory_size(on));
  if (memory.size() < needed) memory.resize(needed);
  on.behind = memory.data();
  sample_behind(grid, on, 2.0 * vehicle.half_length, 2.0 * vehicle.half_width);
  limit_by_roughness(on, memory.data() + behind_size);
}

}  // namespace slopewise
