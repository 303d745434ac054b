// Poses that the broad phase does not clear, one by one; each candidate up to its first hazard.
#pragma once

#include <array>

#include "swept/body_sweep.hpp"
#include "swept/required_checks.hpp"
#include "swept/swept_paths.hpp"
#include "swept/wheel_band.hpp"
#include "swept/wheel_sweep.hpp"

namespace slopewise {

// What blocks them.
struct HazardTable {
  const std::int64_t* code_of_kind;  // (hazard_kinds,) 0 for what blocks nothing
  std::int64_t* code;                // (N, M) out, 0 where nothing blocks
  double* found;                     // (M, 4) out, the numbers of a Hazard where something does
};

// Exact checks of poses.
class NarrowPhase {
 public:
  static Index memory_size(const BroadPhase& grid, double spacing) noexcept {
    return 2 * (WheelBuffers::samples_of(grid.vehicle(), spacing) + lanes_abreast) +
           Rim::padded_size(Rim::strides_of(grid.vehicle())) + grid.band().lines;
  }

  // Of poses at most so far apart [m].
  NarrowPhase(const BroadPhase& grid, double spacing, const std::int64_t* code_of_kind,
              double* memory) noexcept
      : grid_(grid), sizes_(grid.vehicle()), middle_(sizes_.middle_of_tyre()), band_(grid.band()),
        code_of_kind_(code_of_kind),
        buffers_{memory, nullptr, WheelBuffers::samples_of(sizes_, spacing)} {
    buffers_.path = memory + buffers_.samples + lanes_abreast;
    double* rim = buffers_.path + buffers_.samples + lanes_abreast;
    rim_ = {rim, Rim::strides_of(sizes_)};
    const Index padded = Rim::padded_size(rim_.strides);
    for (Index n = 0; n < padded; ++n) {
      const auto away = static_cast<double>(std::min(n - rim_.strides, rim_.strides));
      rim[n] = drop_of_rim(sizes_.radius, sizes_.stride * away);
    }
    heights_ = rim + padded;
  }

  [[nodiscard]] bool blocks(HazardKind kind) const noexcept {
    return code_of_kind_[static_cast<Index>(kind)] > 0;
  }
  [[nodiscard]] Index checked() const noexcept { return checked_; }

  // What blocks a pose, and all poses since the one so far back [m]; `across` is how far it may be
  // off its line [m].
  Hazard check(const Pose2d& pose, double back, std::int32_t required, double across) noexcept {
    required = look_closer(pose, required, grid_);
    // The body needs the heights of the wheels anyway.
    const bool only_twist = (required & (check_body | check_twist)) == check_twist;
    if (only_twist && cannot_twist(pose)) required &= ~check_twist;
    if (required == 0) return {};
    ++checked_;
    const Hazard found = check_line(pose, back, required, across);
    if (found.before > 0.0) return found;
    const Hazard beside = check_beside(pose, back, required, band_.of_wheels(across));
    return !blocks(found.kind) || beside.before > 0.0 ? beside : found;
  }

  // A drop ahead of the last pose, which is as far ahead of any pose that it blocks as others are.
  // The last step of a path may be of any length, those beyond it are no shorter than samples.
  Hazard check_beyond(const Pose2d& last, double back, double across) noexcept {
    const double step = max_of(back, sizes_.stride);
    for (double ahead = step; back > 0.0 && ahead < sizes_.radius + step; ahead += step) {
      const Place at = last.at(ahead, 0.0);
      const Pose2d pose{at.x, at.y, last.heading_x, last.heading_y};
      std::int32_t uneven = 0;
      for (int wheel = 0; wheel < wheel_count; ++wheel) {
        if (!is_even(pose, wheel_at(wheel, sizes_))) uneven |= check_wheel << wheel;
      }
      Hazard found = check(pose, step, uneven, across);
      if (found.before <= ahead) continue;
      found.before -= ahead;
      found.ahead += ahead;
      return found;
    }
    return {};
  }

  // What bars the way from the pose in which the vehicle rests: a step that a wheel touches.
  Hazard check_start(const Pose2d& pose, std::int32_t required, double across) noexcept {
    ++checked_;
    const BandLines lines(band_.of_wheels(across), band_.stride);
    for (int wheel = 0; wheel < wheel_count; ++wheel) {
      if (!(required & (check_wheel << wheel))) continue;
      const Place at = wheel_at(wheel, sizes_);
      for (Index line = -lines.side; line <= lines.side; ++line) {
        const Place moved = line == 0 ? at : lines.move(at, line);
        if (is_even(pose, moved)) continue;
        const Hazard step = way_of(pose, moved, sizes_.radius).find_touched_step();
        if (step.any()) return step;
      }
    }
    return {};
  }

 private:
  Hazard check_line(const Pose2d& pose, double back, std::int32_t required,
                    double across) noexcept {
    const bool unknown_blocks = blocks(HazardKind::unknown_ground);
    const auto contact = contact_heights(pose, required, unknown_blocks);
    Hazard body, found;
    if (required & (check_unknown | check_body)) {
      const VehicleEnvelope area = band_.area(sizes_, across);
      body = BodySweep(grid_.map(), pose, contact, area).find(unknown_blocks);
      if (body.kind == HazardKind::unknown_ground) found = body;
    }
    for (int wheel = 0; wheel < wheel_count; ++wheel) {
      if (!(required & (check_wheel << wheel))) continue;
      const Hazard step = find_step(pose, wheel_at(wheel, sizes_), back);
      if (blocks(step.kind)) found = earlier_of(found, step);
    }
    if (found.any()) return found;
    if (required & check_twist) {
      const Hazard twist = find_twist(contact, sizes_);
      if (twist.any()) return twist;
    }
    return body;
  }

  // Do the wheels stand too even for a twist? By bounds of their heights, then by those themselves,
  // one after the other while that is not certain; above the level of the facets [m].
  [[nodiscard]] bool cannot_twist(const Pose2d& pose) const noexcept {
    auto low = heights_under_axles(grid_.facets(), pose, sizes_, rim_.strides);
    std::array<double, wheel_count> high;
    for (int wheel = 0; wheel < wheel_count; ++wheel) {
      const Place at = wheel_at(wheel, sizes_);
      high[static_cast<std::size_t>(wheel)] = grid_.stands_below(pose.at(at.x, at.y));
    }
    const auto travel = static_cast<double>(grid_.limits().travel);
    const auto is_even = [&] {
      return high[0] + high[3] - low[1] - low[2] <= travel &&
             high[1] + high[2] - low[0] - low[3] <= travel;
    };
    for (int wheel = 0; wheel < wheel_count && !is_even(); ++wheel) {
      const double height = standing_height(grid_.facets(), pose, wheel_at(wheel, sizes_), sizes_,
                                            rim_, blocks(HazardKind::unknown_ground));
      const auto n = static_cast<std::size_t>(wheel);
      low[n] = high[n] = height - grid_.facets().level;
    }
    return is_even();
  }

  // Heights of the wheels, NaN where they do not matter. On a map coarser than a wheel it stands on
  // the bilinear surface.
  [[nodiscard]] std::array<double, wheel_count> contact_heights(
      const Pose2d& pose, std::int32_t required, bool unknown_blocks) const noexcept {
    std::array<double, wheel_count> out;
    out.fill(std::numeric_limits<double>::quiet_NaN());
    if (!(required & (check_body | check_twist))) return out;
    for (int wheel = 0; wheel < wheel_count; ++wheel) {
      const Place at = wheel_at(wheel, sizes_);
      out[static_cast<std::size_t>(wheel)] =
          sizes_.fine
              ? standing_height(grid_.facets(), pose, at, sizes_, rim_, unknown_blocks)
              : grid_.map().height_at(pose.at(at.x, at.y));
    }
    return out;
  }

  // A tyre narrower than a cell has no support on the cells next to its middle: a ditch may be wider
  // than its cells by as much.
  [[nodiscard]] bool is_narrow() const noexcept { return sizes_.half_tyre < sizes_.margin; }

  // On the line of a wheel, unless the ground around it is cleared.
  Hazard find_step(const Pose2d& pose, Place wheel, double back) const noexcept {
    if (is_even(pose, wheel)) return {};
    const Hazard step = way_of(pose, wheel, back).find_step();
    // What is one cell wide on the map may be nearly two.
    if (step.any() || sizes_.half_tyre >= 2.0 * sizes_.margin) return step;
    return WheelWay{grid_.facets(), pose, wheel, back, middle_, slopes_around(pose, wheel), buffers_}
        .find_step();
  }

  // Is the ground around a wheel cleared?
  [[nodiscard]] bool is_even(const Pose2d& pose, Place wheel) const noexcept {
    return grid_.blocks().relief[block_under(pose, wheel, grid_)] <= grid_.limits().cleared;
  }

  [[nodiscard]] WheelWay way_of(const Pose2d& pose, Place wheel, double back) const noexcept {
    return {grid_.facets(), pose, wheel, back, sizes_, slopes_around(pose, wheel), buffers_};
  }

  [[nodiscard]] WheelSlopes slopes_around(const Pose2d& pose, Place wheel) const noexcept {
    return slopes_in(block_under(pose, wheel, grid_), pose, grid_);
  }

  // Steps on the lines of the wheels within the band, without the planned one, and edges next to
  // all of them, though the band has no width.
  Hazard check_beside(const Pose2d& pose, double back, std::int32_t required,
                      double band) const noexcept {
    const BandLines lines(band, band_.stride);
    Hazard found;
    for (int wheel = 0; wheel < wheel_count; ++wheel) {
      if (!(required & (check_wheel << wheel))) continue;
      const Place at = wheel_at(wheel, sizes_);
      for (Index line = -lines.side; line <= lines.side; ++line) {
        if (line != 0) found = earlier_of(found, find_step(pose, lines.move(at, line), back));
      }
      found = earlier_of(found, check_edges({pose, at, band, sizes_}));
    }
    return found;
  }

  Hazard check_edges(const WheelBand& of) const noexcept {
    const std::size_t block = block_under(of.pose, of.wheel, grid_);
    const double slope = explained_slope(slopes_in(block, of.pose, grid_).across);
    // Half a tyre beyond the band, too, and half a cell, in which an edge may be anywhere.
    const BandLines lines(of.band, band_.stride, band_.beyond);
    const VehicleEnvelope& tyre = is_narrow() ? middle_ : sizes_;
    for (Index line = -lines.side; line <= lines.side; ++line) {
      const Place at = lines.move(of.wheel, line);
      heights_[line + lines.side] =
          has_no_edge(of.pose, at, slope)
              ? std::numeric_limits<double>::quiet_NaN()
              : standing_height(grid_.facets(), of.pose, at, tyre, rim_, true);
    }
    return find_edge(of, lines, slope, heights_);
  }

  // Does the ground around a wheel change by less than a step, beyond what a slope explains?
  [[nodiscard]] bool has_no_edge(const Pose2d& pose, Place wheel, double slope) const noexcept {
    const std::size_t block = block_under(pose, wheel, grid_);
    const double left =
        sizes_.max_step - screen_rounding - static_cast<double>(grid_.blocks().relief[block]);
    if (!(left >= 0.0)) return false;
    const double steeper = max_of(std::abs(slopes_in(block, pose, grid_).across) - slope, 0.0);
    return steeper * sizes_.chord <= left;
  }

  const BroadPhase& grid_;
  const VehicleEnvelope& sizes_;
  const VehicleEnvelope middle_;
  const TrackingBand& band_;
  const std::int64_t* code_of_kind_;
  WheelBuffers buffers_;
  Rim rim_{};
  double* heights_;
  Index checked_ = 0;
};

namespace detail {

constexpr std::int32_t all_wheels = check_wheel * ((1 << wheel_count) - 1);

// The checks that up to `wide` poses of station k require.
inline void require_checks(const BroadPhase& grid, const SweptPaths& paths, Index k, Index first,
                           FrontStations& front, Checks& open, Checks& required) noexcept {
  const Index at = k * paths.candidates + first;
  const PoseRow row{std::min<Index>(wide, paths.candidates - first),
                    paths.x + at,
                    paths.y + at,
                    paths.heading_x + at,
                    paths.heading_y + at,
                    paths.twist + at,
                    paths.across != nullptr ? paths.across + at : nullptr};
  require_body(row, grid, paths.known + at, open, required);
  if (!grid.sizes().fine) return;
  const VehicleEnvelope& vehicle = grid.vehicle();
  Checks rear{};
  for (Index j = 0; j < row.lanes; ++j) {
    const auto n = static_cast<std::size_t>(j);
    const double* station = paths.station + first + j;
    const double rolled = station[k * paths.candidates] - 2.0 * vehicle.half_length;
    while (front[n] + 1 < k && station[(front[n] + 1) * paths.candidates] <= rolled) ++front[n];
    const Index before = front[n] * paths.candidates + first + j;
    const bool follows = paths.station[before] + 0.5 * vehicle.half_length >= rolled &&
                         rolled >= 0.5 * vehicle.half_length &&
                         follows_front(paths, at + j, before, vehicle);
    rear[n] = follows ? 0 : open[n];
  }
  require_wheels(row, grid, rear, open, required);
}

}  // namespace detail

// Hazards of all candidates, up to the first of each; the first stations are where they stand: what
// is there blocks nothing but the way into a step that a wheel touches.
// Returns the number of exact checks.
inline Index sweep(const BroadPhase& grid, const SweptPaths& paths, const HazardTable& out,
                   double* memory) noexcept {
  NarrowPhase narrow_phase(grid, paths.spacing, out.code_of_kind, memory);
  std::fill_n(out.code, paths.stations * paths.candidates, 0);
  for (Index first = 0; first < paths.candidates; first += wide) {
    const Index lanes = std::min<Index>(wide, paths.candidates - first);
    Checks required, open;
    open.fill(255);
    detail::FrontStations front{}, blocked;
    blocked.fill(paths.stations);
    std::array<double, wide> last;
    last.fill(std::numeric_limits<double>::infinity());
    const auto note = [&](Index k, Index j, const Hazard& found) {
      const auto n = static_cast<std::size_t>(j - first);
      if (!narrow_phase.blocks(found.kind)) return;
      const Index at = detail::station_before(paths, k, j, found.before);
      if (at >= blocked[n]) return;
      // A drop ahead blocks poses before it: it may block one before what was found first.
      if (blocked[n] < paths.stations) out.code[blocked[n] * paths.candidates + j] = 0;
      const double here = paths.station[k * paths.candidates + j];
      if (open[n] > detail::all_wheels) last[n] = here + grid.vehicle().radius;
      open[n] &= detail::all_wheels;
      blocked[n] = at;
      const double back = here - paths.station[at * paths.candidates + j];
      out.code[at * paths.candidates + j] = out.code_of_kind[static_cast<Index>(found.kind)];
      const std::array<double, 4> numbers{static_cast<double>(found.kind), found.height,
                                          found.ahead + back, found.aside};
      std::copy_n(numbers.begin(), 4, out.found + 4 * j);
    };
    for (Index k = 0; k < paths.stations; ++k) {
      Checks at_start = open;  // unknown ground under a standing vehicle ends no candidate
      detail::require_checks(grid, paths, k, first, front, k == 0 ? at_start : open, required);
      for (Index lane = 0; lane < lanes; ++lane) {
        const auto n = static_cast<std::size_t>(lane);
        const Index j = first + lane;
        const auto count = static_cast<Index>(paths.count[j]);
        if (std::max<Index>(k, 1) >= count) continue;
        if (paths.station[k * paths.candidates + j] > last[n]) open[n] = 0;
        if (const std::int32_t checks = required[n] & open[n]; checks != 0) {
          const detail::PoseOnPath at(paths, k, j);
          note(k, j, k == 0 ? narrow_phase.check_start(at.pose, checks, at.across)
                            : narrow_phase.check(at.pose, at.back, checks, at.across));
        }
        if (k > 0 && k + 1 == count && open[n] != 0 && grid.sizes().fine) {
          const detail::PoseOnPath end(paths, k, j);
          note(k, j, narrow_phase.check_beyond(end.pose, end.back, end.across));
        }
      }
    }
  }
  return narrow_phase.checked();
}

}  // namespace slopewise
