// The body of one pose against the ground under and beside it, and unknown ground.
#pragma once

#include <array>

#include "swept/vehicle_envelope.hpp"

namespace slopewise {

// The body is a plate at its clearance above the plane of the wheels. Every cell that it touches
// has to be known. Every one whose middle is within its margin counts with its height, and so does
// the ground between cells at its outline, which may be that of a cell next to it. Off the map
// nothing is known.
class BodySweep {
 public:
  // Heights of the wheels at a pose, NaN where they do not matter [m].
  BodySweep(const MapView& map, const Pose2d& pose,
            const std::array<double, wheel_count>& contact, const VehicleEnvelope& sizes) noexcept
      : map_(map), pose_(pose), sizes_(sizes), cell_(1.0 / map.per_metre),
        level_(0.25 * (contact[0] + contact[1] + contact[2] + contact[3])),
        rise_((contact[0] + contact[1] - contact[2] - contact[3]) * 0.25 / sizes.half_length),
        cross_slope_((contact[0] - contact[1] + contact[2] - contact[3]) * 0.25 /
                     sizes.half_width) {}

  // Unknown cells first, if they block, else the ground that is highest in the body.
  Hazard find(bool unknown_blocks) noexcept {
    if (const Hazard found = visit_cells(unknown_blocks); found.any()) return found;
    if (rises_at_outline_ && max_of(under_.height, beside_.height) <= sizes_.clearance) {
      visit_outline();
    }
    if (under_.height > sizes_.clearance) {
      return {part_at(under_.ahead), under_.height, under_.ahead, under_.aside};
    }
    if (beside_.height > sizes_.clearance) return beside_;
    return {};
  }

 private:
  // Points of the outline to a cell [1], its corners among them.
  static constexpr double points_per_cell = 10.0;

  // Lowest and highest coordinate of the body [m], with this coordinate of the vectors ahead and to
  // the left.
  [[nodiscard]] std::array<double, 2> extent(double centre, double along,
                                             double across) const noexcept {
    const double ahead = sizes_.front * along, behind = -sizes_.rear * along;
    const double half = sizes_.side * std::abs(across);
    return {centre + min_of(ahead, behind) - half, centre + max_of(ahead, behind) + half};
  }

  Hazard visit_cells(bool unknown_blocks) noexcept {
    // A cell reaches farther along its diagonal.
    const double touched = 0.5 * cell_ * (std::abs(pose_.heading_x) + std::abs(pose_.heading_y));
    // Ground between cells is not higher than the four around it.
    const double farthest = max_of(sizes_.margin, diagonal * cell_);
    const auto [x_min, x_max] = extent(pose_.x, pose_.heading_x, -pose_.heading_y);
    const auto [y_min, y_max] = extent(pose_.y, pose_.heading_y, pose_.heading_x);
    const Cells cells{static_cast<std::int32_t>(std::ceil(map_.u(x_min - farthest))),
                      static_cast<std::int32_t>(std::floor(map_.u(x_max + farthest))), farthest,
                      touched, unknown_blocks};
    const auto top = static_cast<Index>(std::floor(map_.v(y_max + farthest)));
    for (auto i = static_cast<Index>(std::ceil(map_.v(y_min - farthest))); i <= top; ++i) {
      if (is_clear(i, cells)) continue;
      for (std::int32_t j = cells.left; j <= cells.right; ++j) {
        if (const Hazard found = visit(i, j, cells); found.any()) return found;
      }
    }
    return {};
  }

  // Columns of cells that are looked at, how far from the body they count, how far they are touched
  // [m].
  struct Cells {
    std::int32_t left, right;
    double farthest, touched;
    bool unknown_blocks;
  };

  // A cell, from the middle of the wheelbase, and how far outside of the body it is [m].
  struct Cell {
    double ahead, aside, away;
  };

  [[nodiscard]] Cell cell_at(double dy, std::int32_t j) const noexcept {
    const double dx = map_.origin_x + static_cast<double>(j) * cell_ - pose_.x;
    const double ahead = dx * pose_.heading_x + dy * pose_.heading_y;
    const double aside = dy * pose_.heading_x - dx * pose_.heading_y;
    return {ahead, aside,
            max_of(max_of(ahead - sizes_.front, -sizes_.rear - ahead),
                   std::abs(aside) - sizes_.side)};
  }

  [[nodiscard]] double across_row(Index i) const noexcept {
    return map_.origin_y + static_cast<double>(i) * cell_ - pose_.y;
  }

  // Is all of a row of cells on the map, known and below the underside? Most are.
  [[nodiscard]] bool is_clear(Index i, const Cells& cells) const noexcept {
    if (i < 0 || i >= map_.rows || cells.left < 0 || cells.right >= map_.columns) return false;
    const double* heights = map_.heights + i * map_.columns;
    const double dy = across_row(i);
    std::int64_t suspect = 0;
    for (std::int32_t j = cells.left; j <= cells.right; ++j) {
      const Cell at = cell_at(dy, j);
      const double over = above_plane(heights[j], at.ahead, at.aside);
      const std::int64_t outside = at.away > cells.farthest ? 1 : 0;
      const std::int64_t below = over <= sizes_.clearance ? 1 : 0;
      suspect |= 1 - (outside | below);
    }
    return suspect == 0;
  }

  Hazard visit(Index i, std::int32_t j, const Cells& cells) noexcept {
    const auto [ahead, aside, away] = cell_at(across_row(i), j);
    if (away > cells.farthest) return {};
    const bool on_map = i >= 0 && j >= 0 && i < map_.rows && j < map_.columns;
    const double height =
        on_map ? map_.heights[i * map_.columns + j] : std::numeric_limits<double>::quiet_NaN();
    const bool is_unknown = away <= cells.touched && std::isnan(height);
    if (cells.unknown_blocks && is_unknown) return {HazardKind::unknown_ground, 0.0, ahead, aside};
    if (!on_map) return {};
    const double over = above_plane(height, ahead, aside);
    if (away > sizes_.margin) {
      rises_at_outline_ |= over > sizes_.clearance;
    } else {
      take_in(over, ahead, aside);
    }
    return {};
  }

  // The ground along the outline of the body, bilinear between cells.
  void visit_outline() noexcept {
    const double step = 1.0 / (points_per_cell * map_.per_metre);
    const double length = sizes_.front + sizes_.rear, width = 2.0 * sizes_.side;
    const auto along = static_cast<Index>(std::ceil(length / step));
    const auto across = static_cast<Index>(std::ceil(width / step));
    for (Index n = 0; n <= along; ++n) {
      const double share = static_cast<double>(n) * length / static_cast<double>(along);
      for (const double aside : {sizes_.side, -sizes_.side}) {
        take_in_between(share - sizes_.rear, aside);
      }
    }
    for (Index n = 1; n < across; ++n) {
      const double share = static_cast<double>(n) * width / static_cast<double>(across);
      for (const double ahead : {sizes_.front, -sizes_.rear}) {
        take_in_between(ahead, share - sizes_.side);
      }
    }
  }

  void take_in_between(double ahead, double aside) noexcept {
    take_in(above_plane(map_.height_at(pose_.at(ahead, aside)), ahead, aside), ahead, aside);
  }

  [[nodiscard]] double above_plane(double height, double ahead, double aside) const noexcept {
    return height - (level_ + rise_ * ahead + cross_slope_ * aside);
  }

  // Ground so far above the plane of the wheels. What is outside of the wheels counts last: much of
  // it continues under the body.
  void take_in(double over, double ahead, double aside) noexcept {
    const bool is_beside = std::abs(aside) > sizes_.half_width + sizes_.half_tyre;
    Hazard& highest = is_beside ? beside_ : under_;
    if (over > highest.height) highest = {highest.kind, over, ahead, aside};
  }

  // Which part of the body is above a point between the outer edges of the wheels.
  [[nodiscard]] HazardKind part_at(double ahead) const noexcept {
    const double axle = sizes_.half_length + sizes_.margin;
    if (ahead > axle) return HazardKind::front;
    return ahead < -axle ? HazardKind::rear : HazardKind::underside;
  }

  const MapView& map_;
  const Pose2d& pose_;
  const VehicleEnvelope& sizes_;
  double cell_;
  double level_, rise_, cross_slope_;  // plane of the wheels: [m], rise ahead and to the left [1]
  // The highest ground above it between the outer edges of the wheels, and outside of those.
  Hazard under_{HazardKind::underside}, beside_{HazardKind::side};
  bool rises_at_outline_ = false;
};

}  // namespace slopewise
