// How fast rough ground may be driven along candidates, from the map on.
#pragma once

#include <vector>

#include "ground/ground_behind.hpp"
#include "swept/roughness.hpp"

namespace slopewise {

// Frequency of the bounce [Hz] and its damping [1]; highest vertical acceleration [m/s²] and speed
// [m/s]; noise of the map that is not averaged away, and edge of its cells [m].
struct RideLimits {
  double frequency, damping, vertical_accel, speed, noise = 0.0, cell = 1.0;
};

// M candidates on the ground: at their first stations middle of the wheelbase [m], heading, height
// [m]; distance between stations [m]; the rest as of RoughPaths.
struct RiddenPaths {
  Index stations, candidates;
  const double *x, *y, *heading_x, *heading_y, *level, *spacing;
  const std::int64_t* count;
  const float* front;
  double* held;
};

// What roughness allows along candidates, and what lies behind them. Memory is kept by the thread.
inline void limit_ride_speeds(const HeightGrid& grid, const VehicleEnvelope& vehicle,
                              const RideLimits& limits, const RiddenPaths& on) {
  thread_local std::vector<float> memory;
  thread_local std::vector<QuarterCar> cars;
  thread_local std::vector<Index> order;
  cars.clear();
  order.resize(static_cast<std::size_t>(on.candidates));
  Index pre_roll = 0;
  for (Index j = 0; j < on.candidates; ++j) {
    cars.emplace_back(vehicle, limits.frequency, limits.damping, limits.vertical_accel,
                      limits.speed, on.spacing[j]);
    cars.back().noise = limits.noise;
    cars.back().cell = limits.cell;
    pre_roll = std::max(pre_roll, cars.back().pre_roll);
  }
  RoughPaths paths{pre_roll, on.stations, on.candidates, nullptr,
                   on.front, on.count,    cars.data(),   on.held};
  const Index behind_size = 2 * pre_roll * on.candidates;
  const auto needed = static_cast<std::size_t>(behind_size + roughness_memory(paths));
  if (memory.size() < needed) memory.resize(needed);
  paths.behind = memory.data();
  sample_behind(grid,
                {pre_roll, on.candidates, on.x, on.y, on.heading_x, on.heading_y, on.spacing,
                 on.level, on.front, memory.data()},
                2.0 * vehicle.half_length, 2.0 * vehicle.half_width);
  limit_by_roughness(paths, order, memory.data() + behind_size);
}

}  // namespace slopewise
