// Speeds from up to which no stop slides, and none unloads anything: there brakes and grade decide.
//
// A stop is nowhere faster than where it is commanded, so its own speed says where it needs no look.
#pragma once

#include "verify/stop_in_time.hpp"

namespace slopewise::verify {

namespace detail {

// Speeds that are tried, up to the fastest [1].
inline constexpr int speed_rungs = 8;

// The highest of them at which this holds, which does at all lower ones as well; inf if all.
template <class Holds>
[[nodiscard]] double highest_rung(double fastest, const Holds& holds) noexcept {
  if (holds(fastest)) return infinite;
  int low = 0, high = speed_rungs;
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    (holds(fastest * middle / speed_rungs) ? low : high) = middle;
  }
  return fastest * low / speed_rungs;
}

// Does every stop from up to a speed lose speed at station k?
[[nodiscard]] inline bool slows(const Surveyed& on, Index k, double speed) noexcept {
  const double slow = on.track.slowest[k];
  return min_of(on.force(k, slow), on.force(k, max_of(speed, slow))) > 0.0;
}

// Does none of them unload an axle, side or wheel too much there?
[[nodiscard]] inline bool stays_loaded(const Surveyed& on, Index k, double speed,
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
class CarefreeSpeeds {
 public:
  CarefreeSpeeds(const Surveyed& on, const Vehicle& limits, double fastest, double* memory) noexcept
      : track_(on.track), sticks_(memory), loaded_(memory + track_.stations) {
    for (Index k = 0; k < track_.stations; ++k) {
      sticks_[k] = detail::highest_rung(fastest, [&](double speed) {
        return detail::slows(on, k, speed) && !may_slide(track_, limits, k, speed);
      });
      loaded_[k] = detail::highest_rung(fastest, [&](double speed) {
        return detail::stays_loaded(on, k, speed, limits.min_load);
      });
      if (!(sticks_[k] == infinite && loaded_[k] == infinite)) from_ = k + 1;
    }
  }

  // No stop from this segment on, from any speed, slides or unloads anything.
  [[nodiscard]] Index from() const noexcept { return from_; }
  // Do brakes and grade alone decide a stop from a speed in segment i up to where it ends?
  [[nodiscard]] bool sticks(Index i, double speed, double end) const noexcept {
    return stays_below(sticks_, i, speed, end);
  }
  // Are loads enough on it?
  [[nodiscard]] bool stays_loaded(Index i, double speed, double end) const noexcept {
    return stays_below(loaded_, i, speed, end);
  }

 private:
  [[nodiscard]] bool stays_below(const double* speeds, Index i, double speed,
                                 double end) const noexcept {
    // What changes at a station does so from the one before on.
    for (Index m = i; m < track_.stations && (m == i || track_.station[m - 1] < end); ++m) {
      if (!(speed <= speeds[m])) return false;
    }
    return true;
  }

  const Track& track_;
  double *sticks_, *loaded_;  // (N,) [m/s]
  Index from_ = 0;
};

}  // namespace slopewise::verify
