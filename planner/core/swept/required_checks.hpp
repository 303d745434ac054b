// What a pose has to be checked for, as the broad phase of the map has it.
#pragma once

#include <array>

#include "swept/broad_phase.hpp"
#include "swept/wheel_sweep.hpp"

namespace slopewise {

// Up to `wide` poses of a station; how far the ground under the middles of the wheels twists [m].
struct PoseRow {
  Index lanes;
  const double *x, *y, *heading_x, *heading_y;
  const float* twist;
};

// Bits of checks of the lanes, in 32 bits as the blocks are counted, so that loops vectorise.
using Checks = std::array<std::int32_t, wide>;

namespace detail {

using Blocks = std::array<std::int32_t, wide>;
using Shifts = std::array<double, wide>;  // by how much wheels are farther to the left [m]

inline void locate_wheel(const PoseRow& row, const BroadPhase& grid, int wheel,
                         const Shifts& shift, Blocks& out) noexcept {
  const Place at = wheel_at(wheel, grid.sizes());
  SLOPEWISE_INDEPENDENT
  for (Index j = 0; j < row.lanes; ++j) {
    const double aside = at.y + shift[static_cast<std::size_t>(j)];
    const double x = row.x[j] + at.x * row.heading_x[j] - aside * row.heading_y[j];
    const double y = row.y[j] + at.x * row.heading_y[j] + aside * row.heading_x[j];
    out[static_cast<std::size_t>(j)] = grid.block_at(x, y);
  }
}

// Where the ground around a wheel climbs by more than what is cleared, its lane needs a check.
inline void require_wheel(const BroadPhase& grid, int wheel, const Blocks& blocks, Index lanes,
                          const Checks& open, Checks& required) noexcept {
  const float* relief = grid.blocks().relief.data();
  const float cleared = grid.limits().cleared;
  for (Index j = 0; j < lanes; ++j) {
    const auto n = static_cast<std::size_t>(j);
    required[n] |= relief[blocks[n]] > cleared ? (check_wheel << wheel) & open[n] : 0;
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
  const std::uint8_t* bits = grid.blocks().bits.data();
  for (Index j = 0; j < row.lanes; ++j) {
    const auto n = static_cast<std::size_t>(j);
    open[n] = known[j] ? open[n] : 0;
    required[n] = bits[blocks[n]] & open[n];
  }
}

// Of the wheels. A wheel stands as high as the ground under its middle, or higher by its lift; and
// by what a slope lifts each by, which it lacks at most by its lift. So wheels twist by no more
// than the ground under their middles does and all four lifts. Next to unknown ground a wheel may
// lack more: see look_closer. The rear wheels count where they roll on ground that the front ones
// have not seen.
inline void require_wheels(const PoseRow& row, const BroadPhase& grid, bool rear,
                           const Checks& open, Checks& required) noexcept {
  const float* lift = grid.blocks().lift.data();
  std::array<float, wide> hangs;
  for (Index j = 0; j < row.lanes; ++j) hangs[static_cast<std::size_t>(j)] = std::abs(row.twist[j]);
  for (int wheel = 0; wheel < wheel_count; ++wheel) {
    detail::Blocks blocks;
    detail::locate_wheel(row, grid, wheel, {}, blocks);
    for (std::size_t n = 0; n < static_cast<std::size_t>(row.lanes); ++n) {
      hangs[n] += lift[blocks[n]];
    }
    if (wheel < 2 || rear) detail::require_wheel(grid, wheel, blocks, row.lanes, open, required);
  }
  for (std::size_t n = 0; n < static_cast<std::size_t>(row.lanes); ++n) {
    required[n] |= hangs[n] > grid.limits().travel ? check_twist & open[n] : 0;
  }
}

// Of wheels that are by a share of their band to the left, where the reference point may be so much
// off its line [m].
inline void require_wheels_beside(const PoseRow& row, const BroadPhase& grid, double share,
                                  const double* across, bool rear, const Checks& open,
                                  Checks& required) noexcept {
  detail::Shifts shift{};
  for (Index j = 0; j < row.lanes; ++j) {
    shift[static_cast<std::size_t>(j)] = share * grid.band().of_wheels(across[j]);
  }
  for (int wheel = 0; wheel < (rear ? wheel_count : 2); ++wheel) {
    detail::Blocks blocks;
    detail::locate_wheel(row, grid, wheel, shift, blocks);
    detail::require_wheel(grid, wheel, blocks, row.lanes, open, required);
  }
}

// Slopes of the ground around a wheel.
inline WheelSlopes slopes_at(const Pose2d& pose, int wheel, const BroadPhase& grid) noexcept {
  const Place offset = wheel_at(wheel, grid.sizes()), at = pose.at(offset.x, offset.y);
  const auto block = static_cast<std::size_t>(grid.block_at(at.x, at.y));
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
