// Quadratic surfaces taken off a map around each block of a row, and what is left of the ground
// against the limits of body and wheels.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "swept/map_blocks.hpp"
#include "swept/screen_reach.hpp"

namespace slopewise {

// Bits of what a pose has to be checked for: something in reach is unknown; the body may strike.
// More bits than blocks have: the heights of the wheels themselves; each of the four wheels, the
// front left one first, may meet a step.
inline constexpr std::uint8_t check_unknown = 1, check_body = 2, check_twist = 8, check_wheel = 16;

// Up to `wide` blocks of a row, as lanes. Comparisons with unknown heights are false: what is known
// decides.
class ResidualGround {
 public:
  using Floats = std::array<float, wide>;

  // From a block of the map on. The surface has the heights of nine points around it.
  ResidualGround(const MapBlocks& ground, Index first, Index lanes,
                 const ScreenLimits& limits) noexcept
      : ground_(ground), limits_(limits), first_(first), lanes_(lanes) {
    const Index across = limits.fit, along = limits.fit * ground.columns;
    const float* here = ground.mean.data() + first;
    const float distance = static_cast<float>(limits.fit) * limits.edge, per = 1.0F / distance;
    const float share = 0.25F / (distance * distance);
    SLOPEWISE_INDEPENDENT
    for (Index j = 0; j < lanes; ++j) {
      const auto n = static_cast<std::size_t>(j);
      const float east = here[j + across], west = here[j - across];
      const float north = here[j + along], south = here[j - along];
      level_[n] = here[j];
      east_[n] = (east - west) * 0.5F * per;
      north_[n] = (north - south) * 0.5F * per;
      curvature_xx_[n] = (east + west - 2.0F * here[j]) * per * per;
      curvature_yy_[n] = (north + south - 2.0F * here[j]) * per * per;
      curvature_xy_[n] = (here[j + along + across] - here[j + along - across] -
                          here[j - along + across] + here[j - along - across]) *
                         share;
    }
  }

  // Highest and lowest of what is left within reach of the body. None of the functions that visit
  // blocks is inlined: within its caller gcc does not vectorise all of its loops.
  [[gnu::noinline]] void visit_body(const std::vector<BlockOffset>& offsets) noexcept {
    Floats highest, lowest;  // what is written lies here, apart from all that is read
    highest.fill(-infinity);
    lowest.fill(infinity);
    std::size_t visited = 0;
    for (const BlockOffset& offset : offsets) {
      const Offset at(*this, offset);
      const float *top = ground_.top.data() + at.first, *low = ground_.low.data() + at.first;
      SLOPEWISE_INDEPENDENT
      for (Index j = 0; j < lanes_; ++j) {
        const auto n = static_cast<std::size_t>(j);
        const float surface = at.height(*this, n);
        highest[n] = max_of(highest[n], top[j] - surface);
        lowest[n] = min_of(lowest[n], low[j] - surface);
      }
      // The nearest come first, this block and those beside it; on a map that shows what wheels
      // feel the body reaches farther.
      if (++visited == 9) floor_ = lowest;
    }
    highest_ = highest;
    lowest_ = lowest;
  }

  // What a wheel feels around each block, its rim taken off; what it stands on; and what it may
  // touch where it stands, lowered by as much as its rim is above what a slope lifts there.
  [[gnu::noinline]] void visit_wheel(const std::vector<WheelOffset>& offsets) noexcept {
    Floats near, under, base, slope, uphill;
    near.fill(-infinity);
    under.fill(-infinity);
    base.fill(infinity);
    for (std::size_t n = 0; n < static_cast<std::size_t>(lanes_); ++n) {
      slope[n] = slope_near(n);
      uphill[n] = uphill_lift(slope[n]);
    }
    for (const WheelOffset& offset : offsets) {
      const Offset at(*this, offset.block);
      const float *middle = ground_.middle.data() + at.first;
      const float* above = ground_.above.data() + at.first;
      const float* below = ground_.below.data() + at.first;
      const float *east = ground_.east.data() + at.first, *north = ground_.north.data() + at.first;
      const float rim = offset.rim, no_base = offset.no_base, drop = offset.drop;
      const float ahead = offset.ahead, steepness = offset.steepness, left = limits_.radius - ahead;
      SLOPEWISE_INDEPENDENT
      for (Index j = 0; j < lanes_; ++j) {
        const auto n = static_cast<std::size_t>(j);
        const float level = at.height(*this, n), tilt = at.tilt(*this, n, east[j], north[j]);
        const float felt = middle[j] + above[j] + tilt - level;
        const float stands = middle[j] - below[j] - tilt - level + no_base;
        // From its nearest point on, the rim is above its tangent there.
        const float beyond = max_of(slope[n] - steepness, 0.0F) * left;
        const float lowered = min_of(slope[n] * ahead + beyond - uphill[n] - drop, 0.0F);
        near[n] = max_of(near[n], felt - rim);
        under[n] = max_of(under[n], felt + lowered);
        base[n] = min_of(base[n], stands);
      }
    }
    near_ = near;
    under_ = under;
    base_ = base;
  }

  // What the surface costs at most, and the range of what is left, against the clearance.
  void judge_body(std::uint8_t* bits) const noexcept {
    const ScreenLimits& b = limits_;
    const float reach = std::sqrt(b.body_sq);
    SLOPEWISE_INDEPENDENT
    for (Index j = 0; j < lanes_; ++j) {
      const auto n = static_cast<std::size_t>(j);
      const float bowl = 0.5F * (curvature_xx_[n] + curvature_yy_[n]), bends = std::abs(bowl);
      const float saddle = saddle_at(n), slope = slope_at(n) + reach * (bends + saddle);
      // Heights of a block count at its middle.
      const float spread = highest_[n] - lowest_[n] + 2.0F * slope * b.corner;
      const float body =
          0.5F * (bowl * (b.body_sq - b.wheel_sq) + saddle * (b.body_sq + b.saddle_sq));
      const float middle = 0.5F * (saddle * b.saddle_sq - bowl * b.wheel_sq);
      const float struck = max_of(body, middle) + b.between * (bends + saddle) +
                           b.spread * (spread + uphill_lift(slope));
      // Where nothing could be taken off, nothing is known to be clear.
      const bool is_clear = (spread >= 0.0F) & (struck <= b.clearance);
      bits[j] = is_clear ? std::uint8_t{0} : check_body;
    }
  }

  // How far a wheel around a block may climb, and how far it may stand above the ground under its
  // middle, beyond the slope there; below which height it stands in the middle of the block, as it
  // does elsewhere in it on the slope there. Inf where unknown.
  void judge_wheel(float* relief, float* lift, float* stand) const noexcept {
    const ScreenLimits& b = limits_;
    SLOPEWISE_INDEPENDENT
    for (Index j = 0; j < lanes_; ++j) {
      const auto n = static_cast<std::size_t>(j);
      const float bend = bend_at(n);
      const float slope = slope_near(n);
      // The surface bends within a block, here and there, and on the way to the climb.
      const float bends = 0.5F * bend * b.edge * b.edge;
      const float rise =
          near_[n] - base_[n] + uphill_lift(slope) + bends + bend * b.chord * b.apart;
      // Its middle stands between cells, not on their facets; heights count at a block's middle.
      const float stands = under_[n] - floor_[n] + slope * b.corner + bends;
      relief[j] = near_[n] >= base_[n] ? rise : infinity;
      lift[j] = under_[n] >= floor_[n] ? stands : infinity;
      // A slope lifts the rim uphill, and a tyre by its upper edge.
      const float lifted = uphill_lift(slope) + slope * b.half_tyre;
      const float highest = level_[n] + under_[n] + lifted + bends;
      stand[j] = under_[n] >= floor_[n] ? highest : infinity;
    }
  }

  void give_slopes(float* east, float* north) const noexcept {
    std::copy_n(east_.begin(), lanes_, east);
    std::copy_n(north_.begin(), lanes_, north);
  }

  // Unknown ground limits what is seen; within reach it has to be looked for.
  [[gnu::noinline]] void find_unknown(const std::vector<NearBlock>& offsets, float reach,
                                      float* seen, std::uint8_t* bits) const noexcept {
    std::fill_n(seen, lanes_, reach);
    if (all_known(offsets)) return;
    for (const NearBlock& offset : offsets) {
      const std::uint8_t* hidden = ground_.hidden.data() + Offset(*this, offset.block).first;
      const auto distance = static_cast<float>(offset.distance);
      SLOPEWISE_INDEPENDENT
      for (Index j = 0; j < lanes_; ++j) {
        const float there = hidden[j] > 0 ? distance : reach;
        seen[j] = min_of(seen[j], there);
      }
    }
    for (Index j = 0; j < lanes_; ++j) {
      bits[j] = static_cast<std::uint8_t>(bits[j] | (seen[j] < reach ? check_unknown : 0));
    }
  }

 private:
  static constexpr float infinity = std::numeric_limits<float>::infinity();

  // Another block, seen from each of the lanes.
  struct Offset {
    Index first;
    float x, y, edge;                      // to the east and to the north, edge of a block [m]
    float half_xx, half_yy, product;  // of the lengths, for the surface [m²]

    Offset(const ResidualGround& of, const BlockOffset& o) noexcept
        : first(of.first_ + o.row * of.ground_.columns + o.column),
          x(static_cast<float>(o.column) * of.limits_.edge),
          y(static_cast<float>(o.row) * of.limits_.edge), edge(of.limits_.edge),
          half_xx(0.5F * x * x), half_yy(0.5F * y * y), product(x * y) {}

    // Height of the surface there.
    [[nodiscard]] float height(const ResidualGround& of, std::size_t n) const noexcept {
      const float plane = of.level_[n] + of.east_[n] * x + of.north_[n] * y;
      return plane + (of.curvature_xx_[n] * half_xx + of.curvature_yy_[n] * half_yy +
                      of.curvature_xy_[n] * product);
    }

    // How far the corner of the plane of a block is off the surface, by its rise across a block.
    [[nodiscard]] float tilt(const ResidualGround& of, std::size_t n, float rise_east,
                             float rise_north) const noexcept {
      const float slope_x = of.east_[n] + of.curvature_xx_[n] * x + of.curvature_xy_[n] * y;
      const float slope_y = of.north_[n] + of.curvature_yy_[n] * y + of.curvature_xy_[n] * x;
      return 0.5F * (std::abs(rise_east - slope_x * edge) + std::abs(rise_north - slope_y * edge));
    }
  };

  // Is all known around the lanes, as far as any of these blocks is?
  [[nodiscard]] bool all_known(const std::vector<NearBlock>& offsets) const noexcept {
    Index far = 0;
    for (const NearBlock& offset : offsets) far = std::max(far, offset.block.row);
    for (Index row = -far; row <= far; ++row) {
      const std::uint8_t* hidden = ground_.hidden.data() + first_ + row * ground_.columns - far;
      const std::uint8_t* end = hidden + lanes_ + 2 * far;
      if (std::find(hidden, end, 1) != end) return false;
    }
    return true;
  }

  [[nodiscard]] float saddle_at(std::size_t n) const noexcept {
    const float across = 0.5F * (curvature_xx_[n] - curvature_yy_[n]);
    return std::sqrt(across * across + curvature_xy_[n] * curvature_xy_[n]);
  }

  // The largest curvature of any direction, up or down.
  [[nodiscard]] float bend_at(std::size_t n) const noexcept {
    return std::abs(0.5F * (curvature_xx_[n] + curvature_yy_[n])) + saddle_at(n);
  }

  [[nodiscard]] float slope_at(std::size_t n) const noexcept {
    return std::sqrt(east_[n] * east_[n] + north_[n] * north_[n]);
  }

  // The steepest around a wheel in the block.
  [[nodiscard]] float slope_near(std::size_t n) const noexcept {
    return slope_at(n) + limits_.near * bend_at(n);
  }

  // On a slope a wheel touches the ground a little uphill.
  [[nodiscard]] float uphill_lift(float slope) const noexcept {
    return limits_.radius * (std::sqrt(1.0F + slope * slope) - 1.0F);
  }

  const MapBlocks& ground_;
  const ScreenLimits& limits_;
  Index first_, lanes_;
  // The surface, for lengths in [m]; the range of what is left; for the wheels: highest that is
  // felt on the way, highest that may be touched standing, lowest that is stood on, lowest in this
  // and the next blocks.
  Floats level_, east_, north_, curvature_xx_, curvature_yy_, curvature_xy_;
  Floats highest_, lowest_, near_, under_, base_, floor_{};
};

}  // namespace slopewise
