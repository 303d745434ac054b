// Steps, drops and holes under the wheels of one pose, and a wheel in the air.
#pragma once

#include <array>

#include "swept/tyre_profile.hpp"

namespace slopewise {

// Slope that explains a climb or a fall at most, 31° [1].
inline constexpr double steepest_ground = 0.6;
// So much of the slope around a wheel explains no climb [1]: a step at the limit adds as much.
inline constexpr double slope_margin = 0.055;

// Of the ground around a wheel, along its way and to the left [1], NaN where unknown.
struct WheelSlopes {
  double along, across;
};

// A wheel that hangs farther below the plane of the other three than it travels; heights of the
// wheels [m].
inline Hazard find_twist(const std::array<double, wheel_count>& contact,
                         const VehicleEnvelope& sizes) noexcept {
  const double twist = contact[0] - contact[1] - contact[2] + contact[3];
  if (!(std::abs(twist) > sizes.wheel_travel)) return {};
  // Of the two wheels that the ground leaves, the front one is named.
  return {HazardKind::twist, std::abs(twist), sizes.half_length,
          twist > 0.0 ? -sizes.half_width : sizes.half_width};
}

// An edge under a wheel, up or down. A wheel that rolls over one falls once its centre is up to a
// radius beyond: it has to stop before.
inline Hazard hazard_of_edge(HazardKind kind, double height, Place at,
                             const VehicleEnvelope& sizes) noexcept {
  return {kind, height, at.x, at.y, kind == HazardKind::drop ? sizes.radius : 0.0};
}

// Room for the ground under a wheel and the path of its centre, of so many samples.
struct WheelBuffers {
  double *profile, *path;  // with room for as many lanes behind
  Index samples;

  static Index samples_of(const VehicleEnvelope& sizes, double spacing) noexcept {
    const double back = max_of(spacing, sizes.radius);
    return static_cast<Index>(std::ceil((sizes.wheel_look() + back) / sizes.stride)) + 8;
  }
};

// The last piece of the way of a wheel. Its centre runs on the upper envelope of circles over the
// ground. Where it climbs or falls faster than the ground before and after explains, there is a
// step.
class WheelWay {
 public:
  // `slopes` explain a climb, and what one edge of the tyre is above the other, but for
  // slope_margin, which a step itself may add to them; `back` to the pose before [m].
  WheelWay(const FacetGrid& ground, const Pose2d& pose, Place wheel, double back,
           const VehicleEnvelope& sizes, WheelSlopes slopes, WheelBuffers buffers) noexcept
      : ground_(ground), pose_(pose), sizes_(sizes), around_(explaining(slopes.along)),
        wheel_(wheel), profile_(buffers.profile), path_(buffers.path),
        rim_(Rim::strides_of(sizes)), far_(in_strides(sizes.trend)),
        chord_(in_strides(sizes.chord)), first_(rim_ + far_) {
    const auto behind = static_cast<Index>(std::ceil(back / sizes.stride));
    last_ = std::min(first_ + behind, buffers.samples - (chord_ + 2 * rim_ + far_) - 1);
    const double begin = wheel.x - static_cast<double>(behind + first_) * sizes.stride;
    line_ = {begin, wheel.y, certain_part(explaining(slopes.across))};
  }

  // The first drop on it, else the first step up.
  Hazard find_step() noexcept {
    sample(first_ - rim_, last_ + chord_ + rim_ + 1);
    if (is_even()) return {};
    roll(first_, last_ + chord_);
    double least = infinity, most = -infinity;
    for (Index n = first_; n <= last_; ++n) {
      const double rise = path_[n + chord_] - path_[n];
      least = min_of(least, rise);
      most = max_of(most, rise);
    }
    const double climbs = most - (around_ - slope_margin) * sizes_.chord;
    const double falls = (around_ + slope_margin) * sizes_.chord - least;
    if (max_of(climbs, falls) <= sizes_.steepest) return {};
    const Index end = last_ + chord_ + 2 * rim_ + far_;
    sample(0, first_ - rim_);
    sample(last_ + chord_ + rim_ + 1, end + 1);
    roll(rim_, end - rim_);
    Hazard found;
    for (Index n = first_; n <= last_ && found.kind != HazardKind::drop; ++n) {
      if (const Hazard step = step_at(n); step.any()) found = earlier_of(found, edge_of(step, n));
    }
    return found;
  }

  // The step up that the wheel touches already where it stands, at the end of its way: it climbs as
  // it would had it rolled there, and ahead of its axle is what lifts it. What is behind the axle
  // does not count, and ground that is unknown there is as high as what is known before it.
  Hazard find_touched_step() noexcept {
    const Index end = last_ + chord_ + 2 * rim_ + far_;
    sample(0, end + 1);
    for (Index n = last_ - 1; n >= 0; --n) {
      if (profile_[n] < abyss) profile_[n] = profile_[n + 1];
    }
    roll(rim_, end - rim_);
    for (Index n = first_; n <= last_; ++n) {
      const Hazard found = step_at(n);
      if (found.kind != HazardKind::rise) continue;
      if (path_[n + chord_] - carried_to(n + chord_) > sizes_.steepest) return edge_of(found, n);
    }
    return {};
  }

 private:
  static constexpr double infinity = std::numeric_limits<double>::infinity();
  static constexpr double unknown_slope = std::numeric_limits<double>::quiet_NaN();

  // What of a slope explains a climb, NaN where it is unknown: a cliff next to a step makes no ramp
  // of both.
  static double explaining(double slope) noexcept {
    return slope == slope ? std::clamp(slope, -steepest_ground, steepest_ground) : slope;
  }

  [[nodiscard]] Index in_strides(double length) const noexcept {
    return static_cast<Index>(length / sizes_.stride + 0.5);
  }

  // What of a slope no step can have added; 0 where it is unknown.
  static double certain_part(double slope) noexcept {
    return slope == slope ? std::copysign(max_of(std::abs(slope) - slope_margin, 0.0), slope) : 0.0;
  }

  void sample(Index first, Index end) noexcept {
    sample_tyre(ground_, pose_, line_, first, end, sizes_, profile_);
  }

  // Is the ground too even for any step? The rim of a wheel on a slope a reaches
  // max(a x − drop(x)) = R (√(1 + a²) − 1) above its lowest point, so what is left of the ground
  // without its slope bounds every climb.
  [[nodiscard]] bool is_even() const noexcept {
    const Index last = last_ + chord_;
    double least = infinity, most = -infinity;
    for (Index n = first_ - rim_; n <= last + rim_; ++n) {
      const double left = profile_[n] - around_ * static_cast<double>(n) * sizes_.stride;
      most = max_of(most, left);
      least = n >= first_ && n <= last ? min_of(least, left) : least;
    }
    const double lift = sizes_.radius * (std::sqrt(1.0 + around_ * around_) - 1.0);
    return most - least + lift <= sizes_.cleared;
  }

  // Height of the lowest point of the wheel along its profile, from a first to a last sample.
  void roll(Index first, Index last) noexcept {
    std::copy(profile_ + first, profile_ + std::max(first, last + 1), path_ + first);
    for (Index away = 1; away <= rim_; ++away) {
      const double drop = drop_of_rim(sizes_.radius, static_cast<double>(away) * sizes_.stride);
      SLOPEWISE_INDEPENDENT
      for (Index n = first; n <= last; ++n) {
        path_[n] = max_of(path_[n], max_of(profile_[n - away], profile_[n + away]) - drop);
      }
    }
    // Into unknown ground a wheel does not fall.
    SLOPEWISE_INDEPENDENT
    for (Index n = first; n <= last; ++n) {
      path_[n] = profile_[n] > abyss ? path_[n] : unknown_height;
    }
  }

  // Between two heights, NaN where one is unknown; nothing steeper is the ground's own slope.
  [[nodiscard]] double slope(Index start, Index end) const noexcept {
    if (min_of(path_[start], path_[end]) < abyss) return unknown_slope;
    const double length = static_cast<double>(far_) * sizes_.stride;
    const double between = (path_[end] - path_[start]) / length;
    return min_of(max_of(between, -steepest_ground), steepest_ground);
  }

  // Is what begins at sample n a step? Where the ground beside it is unknown, there is none. What
  // comes after counts from a wheel radius on: until then a wheel may still be falling.
  [[nodiscard]] Hazard step_at(Index n) const noexcept {
    const Index end = n + chord_ + rim_;
    double before = slope(n - far_, n), after = slope(end, end + far_);
    before = std::isnan(before) ? after : before;
    after = std::isnan(after) ? before : after;
    if (std::isnan(before)) before = after = around_;
    if (std::isnan(before) || min_of(path_[n], path_[n + chord_]) < abyss) return {};
    const double rise = path_[n + chord_] - path_[n];
    double uphill = max_of(before, after), downhill = min_of(before, after);
    if (!std::isnan(around_)) {
      uphill = max_of(uphill, around_ - slope_margin);
      downhill = min_of(downhill, around_ + slope_margin);
    }
    if (rise - uphill * sizes_.chord > sizes_.steepest) {
      return {HazardKind::rise, step_height(n, uphill)};
    }
    if (downhill * sizes_.chord - rise > sizes_.steepest) {
      return {HazardKind::drop, -step_height(n, downhill)};
    }
    return {};
  }

  // Where the ground up to the axle of a standing wheel alone carries it to, at a sample ahead of the
  // axle: on along the slope around [m].
  [[nodiscard]] double carried_to(Index sample) const noexcept {
    double highest = profile_[last_];
    for (Index away = 1; away <= rim_; ++away) {
      const double drop = drop_of_rim(sizes_.radius, static_cast<double>(away) * sizes_.stride);
      highest = max_of(highest, profile_[last_ - away] - drop);
    }
    const double ahead = static_cast<double>(sample - last_) * sizes_.stride;
    return highest + certain_part(around_) * ahead;
  }

  [[nodiscard]] Hazard edge_of(const Hazard& step, Index n) const noexcept {
    const double ahead = line_.begin + static_cast<double>(n + chord_) * sizes_.stride;
    return hazard_of_edge(step.kind, step.height, {ahead, wheel_.y}, sizes_);
  }

  // All of a step that begins at sample n, up to a wheel radius on: rising or falling [m].
  [[nodiscard]] double step_height(Index n, double slope) const noexcept {
    double height = 0.0;
    for (Index ahead = chord_; ahead < rim_ + chord_; ++ahead) {
      const double explained = slope * static_cast<double>(ahead) * sizes_.stride;
      const double risen = path_[n + ahead] - path_[n] - explained;
      if (std::abs(risen) > std::abs(height)) height = risen;
    }
    return height;
  }

  const FacetGrid& ground_;
  const Pose2d& pose_;
  const VehicleEnvelope& sizes_;
  double around_;
  Place wheel_;
  double *profile_, *path_;
  // Samples: of the rim and the trend to either side, of the chord; where its last piece begins and
  // ends, behind the trend before it.
  Index rim_, far_, chord_, first_, last_ = 0;
  TyreLine line_{};
};

}  // namespace slopewise
