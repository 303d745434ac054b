// Speeds up to which no stop slides, and none unloads an axle, side or wheel: brakes and grade decide.
//
// A stop is nowhere faster than where it is commanded, but for the error of heights that it falls by:
// this speed says where friction and loads need no check.
#pragma once

#include "verify/stop_in_time.hpp"

namespace slopewise::verify {

namespace detail {

// Speeds that are tried, up to the fastest [1].
inline constexpr int speed_steps = 8;

// The highest of them at which this holds, which does at all lower ones as well; inf if all.
template <class Holds>
[[nodiscard]] double highest_safe_step(double fastest, const Holds& holds) noexcept {
  if (holds(fastest)) return infinite;
  int low = 0, high = speed_steps;
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    (holds(fastest * middle / speed_steps) ? low : high) = middle;
  }
  return fastest * low / speed_steps;
}

// Does every stop from up to a speed lose speed at station k?
[[nodiscard]] inline bool is_slowing(const Surveyed& on, Index k, double speed) noexcept {
  const double slow = on.track.slowest[k];
  return min_of(on.force(k, slow), on.force(k, max_of(speed, slow))) > 0.0;
}

// Does none of them unload an axle, side or wheel too much there?
[[nodiscard]] inline bool is_loaded(const Surveyed& on, Index k, double speed,
                                    double min_load) noexcept {
  const auto& [track, survey] = on;
  const double slow = track.slowest[k], slope = track.upper_slope[k], energy = speed * speed;
  const double part = max_of(slow * slope, max_of(speed, slow) * slope);
  const double decel = gravity * max_of(part + track.upper_intercept[k] + survey.sine[k], 0.0);
  const double lost = max_of(-track.vertical_curvature[k], 0.0) * energy / gravity;
  const double rolling = survey.per_lateral * energy * std::abs(survey.lean[k]);
  const double side = min_of(survey.left[k], survey.right[k]) - rolling;
  const double axle = min_of(survey.rear[k] - survey.per_decel * decel, survey.front[k]);
  const double upright = 0.5 * (survey.left[k] + survey.right[k]);
  return min_of(min_of(axle, side), axle + side - upright) - lost >= min_load;
}

}  // namespace detail

// Of the stations of a track; `memory` is 2 N doubles.
class SafeStopSpeeds {
 public:
  SafeStopSpeeds(const Surveyed& on, const Vehicle& limits, double fastest, double* memory) noexcept
      : track_(on.track), grip_(memory), loaded_(memory + track_.stations) {
    for (Index k = 0; k < track_.stations; ++k) {
      grip_[k] = detail::highest_safe_step(fastest, [&](double speed) {
        return detail::is_slowing(on, k, speed) && !may_slide(track_, limits, k, speed);
      });
      loaded_[k] = detail::highest_safe_step(fastest, [&](double speed) {
        return detail::is_loaded(on, k, speed, limits.min_load);
      });
      if (!(grip_[k] == infinite && loaded_[k] == infinite)) first_safe_ = k + 1;
    }
  }

  // No stop from this segment on, from any speed, slides or unloads anything.
  [[nodiscard]] Index first_safe_segment() const noexcept { return first_safe_; }
  // Do brakes and grade alone decide a stop from a speed in segment i up to where it ends?
  [[nodiscard]] bool has_grip(Index i, double speed, double end) const noexcept {
    return is_below(grip_, i, speed, end);
  }
  // Are loads enough on it?
  [[nodiscard]] bool is_loaded(Index i, double speed, double end) const noexcept {
    return is_below(loaded_, i, speed, end);
  }

 private:
  [[nodiscard]] bool is_below(const double* speeds, Index i, double speed,
                              double end) const noexcept {
    // What changes at a station does so from the one before on.
    for (Index m = i; m < track_.stations && (m == i || track_.station[m - 1] < end); ++m) {
      if (!(speed <= speeds[m])) return false;
    }
    return true;
  }

  const Track& track_;
  double *grip_, *loaded_;  // (N,) [m/s]
  Index first_safe_ = 0;
};

}  // namespace slopewise::verify
