// What a pose has to be checked for, as the broad phase of the map has it.
#pragma once

#include <array>

#include "swept/broad_phase.hpp"
#include "swept/wheel_sweep.hpp"

namespace slopewise {

// Up to `wide` poses of a station; how far the ground under the middles of the wheels twists [m]; by
// how much the reference point may be off its line [m], null: by nothing.
struct PoseRow {
  Index lanes;
  const double *x, *y, *heading_x, *heading_y;
  const float* twist;
  const double* across;
};

// Bits of checks of the lanes, in 32 bits as the blocks are counted, so that loops vectorise.
using Checks = std::array<std::int32_t, wide>;

namespace detail {

using Blocks = std::array<std::int32_t, wide>;

inline void locate_wheel(const PoseRow& row, const BroadPhase& grid, Place at,
                         Blocks& out) noexcept {
  SLOPEWISE_INDEPENDENT
  for (Index j = 0; j < row.lanes; ++j) {
    const double x = row.x[j] + at.x * row.heading_x[j] - at.y * row.heading_y[j];
    const double y = row.y[j] + at.x * row.heading_y[j] + at.y * row.heading_x[j];
    out[static_cast<std::size_t>(j)] = grid.block_at(x, y);
  }
}

// Where the ground around a wheel climbs by more than what is cleared, its lane needs a check.
inline void require_wheel(const std::vector<float>& relief, float cleared, int wheel,
                          const Blocks& blocks, Index lanes, const Checks& open,
                          Checks& required) noexcept {
  const float* climbs = relief.data();
  for (Index j = 0; j < lanes; ++j) {
    const auto n = static_cast<std::size_t>(j);
    required[n] |= climbs[blocks[n]] > cleared ? (check_wheel << wheel) & open[n] : 0;
  }
}

// On any line of the band.
inline void require_wheel_beside(const PoseRow& row, const BroadPhase& grid, int wheel,
                                 const Checks& open, Checks& required) noexcept {
  const Place at = wheel_at(wheel, grid.sizes());
  const auto lanes = static_cast<std::size_t>(row.lanes);
  std::array<double, wide> side, stride;
  Index most = 0;
  for (std::size_t n = 0; n < lanes; ++n) {
    const BandLines lines = grid.band().lines_at(row.across[n]);
    side[n] = static_cast<double>(lines.side);
    stride[n] = lines.stride;
    most = std::max(most, lines.side);
  }
  for (Index line = -most; line <= most; ++line) {
    Blocks blocks;
    SLOPEWISE_INDEPENDENT
    for (std::size_t n = 0; n < lanes; ++n) {
      const double shift = min_of(max_of(static_cast<double>(line), -side[n]), side[n]) * stride[n];
      const double left = at.y + shift;
      blocks[n] = grid.block_at(row.x[n] + at.x * row.heading_x[n] - left * row.heading_y[n],
                                row.y[n] + at.x * row.heading_y[n] + left * row.heading_x[n]);
    }
    require_wheel(grid.blocks().relief, grid.limits().cleared, wheel, blocks, row.lanes, open,
                  required);
  }
}

}  // namespace detail

// Of the blocks under the middles of the wheelbase. Ground that is unknown under the wheels ends a
// candidate as a hazard does: `open` keeps the bits of those that go on.
inline void require_body(const PoseRow& row, const BroadPhase& grid, const bool* known,
                         Checks& open, Checks& required) noexcept {
  detail::Blocks blocks;
  SLOPEWISE_INDEPENDENT
  for (Index j = 0; j < row.lanes; ++j) {
    blocks[static_cast<std::size_t>(j)] = grid.block_at(row.x[j], row.y[j]);
  }
  for (Index j = 0; j < row.lanes; ++j) {
    const auto n = static_cast<std::size_t>(j);
    open[n] = known[j] ? open[n] : 0;
    required[n] = grid.bits_of(blocks[n]) & open[n];
  }
}

// Of the wheels. A wheel stands as high as the ground under its middle, or higher by its lift; and
// by what a slope lifts each by, which it lacks at most by its lift. So wheels twist by no more
// than the ground under their middles does and all four lifts. Next to unknown ground a wheel may
// lack more: see look_closer. The rear wheels count where `rear` keeps their bits.
inline void require_wheels(const PoseRow& row, const BroadPhase& grid, const Checks& rear,
                           const Checks& open, Checks& required) noexcept {
  const float* lift = grid.blocks().lift.data();
  std::array<float, wide> hangs;
  for (Index j = 0; j < row.lanes; ++j) hangs[static_cast<std::size_t>(j)] = std::abs(row.twist[j]);
  for (int wheel = 0; wheel < wheel_count; ++wheel) {
    detail::Blocks blocks;
    detail::locate_wheel(row, grid, wheel_at(wheel, grid.sizes()), blocks);
    for (std::size_t n = 0; n < static_cast<std::size_t>(row.lanes); ++n) {
      hangs[n] += lift[blocks[n]];
    }
    const Checks& counts = wheel < 2 ? open : rear;
    if (row.across != nullptr) {
      detail::require_wheel_beside(row, grid, wheel, counts, required);
    } else {
      detail::require_wheel(grid.blocks().relief, grid.limits().cleared, wheel, blocks, row.lanes,
                            counts, required);
    }
  }
  for (std::size_t n = 0; n < static_cast<std::size_t>(row.lanes); ++n) {
    required[n] |= hangs[n] > grid.limits().travel ? check_twist & open[n] : 0;
  }
}

// The block under a place of a pose.
inline std::size_t block_under(const Pose2d& pose, Place place, const BroadPhase& grid) noexcept {
  const Place at = pose.at(place.x, place.y);
  return static_cast<std::size_t>(grid.block_at(at.x, at.y));
}

// Slopes of the ground around a wheel in a block.
inline WheelSlopes slopes_in(std::size_t block, const Pose2d& pose,
                             const BroadPhase& grid) noexcept {
  const double east = static_cast<double>(grid.blocks().east[block]);
  const double north = static_cast<double>(grid.blocks().north[block]);
  return {east * pose.heading_x + north * pose.heading_y,
          north * pose.heading_x - east * pose.heading_y};
}

// The checks that remain: with the heading known, circles along body and tyres can be told apart.
// Where what a tyre touches may be unknown, so is how much of its lift a wheel lacks.
inline std::int32_t look_closer(const Pose2d& pose, std::int32_t required,
                                const BroadPhase& grid) noexcept {
  if (!(required & check_unknown)) return required;
  const VehicleEnvelope& sizes = grid.sizes();
  const double wheels = sizes.half_length + sizes.radius;
  const double rear = max_of(sizes.rear, wheels) + sizes.touch;
  const double third = (max_of(sizes.front, wheels) + sizes.touch + rear) / 3.0;
  const double side = max_of(sizes.side, sizes.half_width + sizes.half_tyre) + sizes.touch;
  const double radius = std::sqrt(0.25 * third * third + side * side);
  bool all_known = true;
  for (int n = 0; n < 3; ++n) {  // three circles in a row cover them
    const Place at = pose.at((n + 0.5) * third - rear, 0.0);
    const auto block = static_cast<std::size_t>(grid.block_at(at.x, at.y));
    all_known = all_known && static_cast<double>(grid.blocks().seen[block]) >= radius;
  }
  if (all_known) return required & ~check_unknown;
  return required | (sizes.fine ? check_twist : 0);
}

}  // namespace slopewise
