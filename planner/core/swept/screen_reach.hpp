// Which blocks around a block decide what is met there, and the numbers that they are judged by.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "swept/block_window.hpp"
#include "swept/tyre_profile.hpp"

namespace slopewise {

// Taken off every limit of the broad phase [m]: it works with float32 heights above one of the
// window, of which some 16 roundings of 2⁻²⁴ meet in a difference: 1 mm on a relief of 1 km.
inline constexpr double screen_rounding = 1e-3;
// The surface is taken off points at this share of the distance to the wheels [1].
inline constexpr double fitted_share = 1.1;

// Limits of a vehicle on blocks of one size [m], [m²].
struct ScreenLimits {
  Index fit;    // distance of the points that a surface is taken off [blocks]
  float edge;   // of a block
  float corner;  // from the middle of a block to that of its outermost cell
  float body_sq, wheel_sq, saddle_sq;  // of body and wheels; by how much more the saddle counts
  float spread;     // share of the range that counts for the body [1]
  float clearance;  // of the vehicle
  float cleared;    // climb that is no step, beyond the slope around, over a chord
  float chord, apart;  // of the climb from the middle of the block at most
  float radius, near;  // of the wheel, 0 if the map does not show what it feels; of its climb
  float half_tyre;  // half the width of one
  // By how much ground between cells is off what bends by 1/m, for body and wheels together [m²];
  // 0 where the margin of the body is more.
  float between;
  float travel;  // of a wheel

  ScreenLimits(const VehicleEnvelope& sizes, Index cells, double resolution) noexcept {
    const auto f = [](double value) { return static_cast<float>(value); };
    const double block = static_cast<double>(cells) * resolution;
    // Weights of the wheels in the height of their plane under the corner of the body.
    const double u = (max_of(sizes.front, sizes.rear) + sizes.margin) / sizes.half_length;
    const double v = (sizes.side + sizes.margin) / sizes.half_width;
    const double negative = 0.25 * (max_of(u + v - 1.0, 0.0) + max_of(u - v - 1.0, 0.0) +
                                    max_of(v - u - 1.0, 0.0));
    fit = std::max<Index>(
        static_cast<Index>(std::nearbyint(fitted_share * sizes.wheel_reach() / block)), 1);
    edge = f(block);
    corner = f(0.5 * diagonal * (block - resolution));
    body_sq = f(sizes.reach() * sizes.reach());
    wheel_sq = f(sizes.wheel_reach() * sizes.wheel_reach());
    saddle_sq = f(std::abs(sizes.half_length * sizes.half_length -
                           sizes.half_width * sizes.half_width));
    spread = f(1.0 + negative);
    clearance = f(sizes.clearance - screen_rounding);
    cleared = f(sizes.cleared - screen_rounding);
    chord = f(sizes.chord);
    apart = f(0.5 * diagonal * block + max_of(sizes.chord, resolution) + 0.5 * sizes.chord);
    radius = f(sizes.fine ? sizes.radius : 0.0);
    near = f(sizes.chord + sizes.radius + sizes.half_tyre + block);
    half_tyre = f(sizes.half_tyre);
    between = f(sizes.fine ? 0.0 : 0.5 * resolution * resolution);
    travel = f(sizes.wheel_travel - screen_rounding);
  }
};

// A block, rows and columns from another one.
struct BlockOffset {
  Index row, column;
};

// One that a wheel feels when it climbs or falls: how far its rim is above it at least [m]; infinity
// where a climb cannot begin or end in it, else 0. Of a wheel that stands: how far ahead or behind
// the nearest point of its rim is [m], its height, infinity where the wheel cannot touch it [m], and
// slope of the rim there [1].
struct WheelOffset {
  BlockOffset block;
  float rim, no_base, ahead, drop, steepness;
};

// One so far away [m].
struct NearBlock {
  BlockOffset block;
  double distance;
};

// Blocks around a block that decide: for the body and wheels, nearest first; for a climb of a
// wheel; and for what is known.
struct ScreenOffsets {
  std::vector<BlockOffset> body;
  std::vector<WheelOffset> wheel;
  std::vector<NearBlock> sight;
  Index widest = 0;  // rows or columns to any of them

  ScreenOffsets(const VehicleEnvelope& sizes, Index cells, double resolution) {
    const double edge = static_cast<double>(cells) * resolution, half = 0.5 * diagonal * edge;
    for (const NearBlock& other : blocks_within(body_reach(sizes, edge, resolution), edge)) {
      body.push_back(other.block);
    }
    if (sizes.fine) add_wheel_offsets(sizes, edge, resolution);
    for (const NearBlock& other : blocks_within(sizes.sight() + 2.0 * half, edge)) {
      sight.push_back({other.block, other.distance - 2.0 * half});
    }
  }

 private:
  // By the distance of their middles, nearest first.
  std::vector<NearBlock> blocks_within(double reach, double edge) {
    const auto far = static_cast<Index>(std::floor(reach / edge));
    widest = std::max(widest, far);
    std::vector<NearBlock> out;
    for (Index row = -far; row <= far; ++row) {
      for (Index column = -far; column <= far; ++column) {
        const double distance =
            edge * std::hypot(static_cast<double>(row), static_cast<double>(column));
        if (distance <= reach) out.push_back({{row, column}, distance});
      }
    }
    std::stable_sort(out.begin(), out.end(),
                     [](const auto& a, const auto& b) { return a.distance < b.distance; });
    return out;
  }

  // How far from a block body and wheels may touch the ground.
  static double body_reach(const VehicleEnvelope& sizes, double edge, double resolution) noexcept {
    // Facets lean on the cell beside them.
    double wheels = sizes.wheel_reach();
    if (sizes.fine) wheels += sizes.radius + sizes.half_tyre + resolution;
    // Ground between cells counts where the body ends.
    if (!sizes.fine) wheels += diagonal * resolution;
    const double outline = std::hypot(max_of(sizes.front, sizes.rear), sizes.side);
    const double half = 0.5 * diagonal * edge, corner = 0.5 * diagonal * (edge - resolution);
    return max_of(max_of(sizes.reach(), outline + diagonal * resolution), wheels) + half + corner;
  }

  void add_wheel_offsets(const VehicleEnvelope& sizes, double edge, double resolution) {
    // A climb begins or ends at most so far from where the wheel is.
    const double swept = max_of(sizes.chord, resolution);
    const double reach = swept + sizes.radius + sizes.half_tyre + diagonal * edge;
    for (const NearBlock& other : blocks_within(reach, edge)) {
      // From somewhere in a block to somewhere in another; a tyre is wider than its middle.
      const auto apart = [](Index blocks) {
        return max_of(static_cast<double>(std::abs(blocks)) - 1.0, 0.0);
      };
      const double gap =
          edge * std::hypot(apart(other.block.row), apart(other.block.column));
      const double along =
          std::sqrt(max_of(gap * gap - sizes.half_tyre * sizes.half_tyre, 0.0));
      const double away = max_of(along - swept, 0.0);
      if (!(away < sizes.radius)) continue;
      const double ahead = min_of(along, sizes.radius), drop = drop_of_rim(sizes.radius, ahead);
      const bool touches = ahead < sizes.radius;
      constexpr float infinity = std::numeric_limits<float>::infinity();
      const auto f = [](double value) { return static_cast<float>(value); };
      wheel.push_back({other.block, f(drop_of_rim(sizes.radius, away)),
                       gap < swept ? 0.0F : infinity, f(ahead), touches ? f(drop) : infinity,
                       touches ? f(ahead / (sizes.radius - drop)) : 0.0F});
    }
  }
};

}  // namespace slopewise
