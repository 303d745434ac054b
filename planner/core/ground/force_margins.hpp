// What lowers, widens or caps the force of the surfaces: hulls of driven speeds, effects of the
// ground, uncertainty, friction, and dips between stations.
#pragma once

#include <cmath>

#include "ground/surface_forces.hpp"

namespace slopewise {

namespace detail {

// Mean depth of a dip over the second difference of the grades around it [1]: of a kink in the
// middle of a segment that neither end shows.
inline constexpr double dip_share = 1.0 / 8.0;
// Share of what slows the vehicle that a dip may take without a word [1]: of a stop, 1 % of its
// length.
inline constexpr double small_dip = 0.01;

// Lower the highest trained speeds to what was driven on the grade. A station counts with the
// grades of its neighbours as well, so that nothing in between is faster than the hull, which is
// concave.
inline void hold_below(const ForceRow& row, const Neighbours& grade, std::span<const HullLine> hull,
                       std::size_t surfaces, const LaneLabels& bits) noexcept {
  const std::size_t lines = hull.size() / surfaces;
  for (std::size_t n = 0; n < hull.size(); ++n) {
    const HullLine line = hull[n];
    const std::size_t surface = n / lines;
    SLOPEWISE_INDEPENDENT
    for (std::size_t j = 0; j < row.lanes; ++j) {
      const double low = line.intercept + line.slope * grade.lowest(j);
      const double high = line.intercept + line.slope * grade.highest(j);
      const double driven = max_of(min_of(low, high), 0.0);
      row.fastest[j] = min_of(row.fastest[j], (bits[j] >> surface) & 1 ? driven : no_limit);
    }
  }
}

// Give up √(φᵀ S φ) with φ = (v θ, θ, v, 1), which is convex in the speed at onset: its chord over
// the trained speeds is above it. Of the surfaces the least certain counts. Beyond a hull, where
// none was driven, the chord is that over all trained speeds.
inline void widen(const ForceRow& row, const double* matrices, std::span<const Surface> surfaces,
                  const LaneLabels& bits) noexcept {
  Lane at_slow{}, at_fast{}, top{};
  double trained = 0.0;
  for (const Surface& s : surfaces) trained = max_of(trained, s.fastest);
  for (std::size_t j = 0; j < row.lanes; ++j) {
    top[j] = row.fastest[j] > row.slowest[j] ? row.fastest[j] : trained;
  }
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const double* s = matrices + 16 * i;
    const double vv_2 = s[0], vv_1 = 2.0 * s[2], vv_0 = s[10], v_2 = s[1], v_1 = s[3] + s[6],
                 v_0 = s[11], one_2 = s[5], one_1 = 2.0 * s[7], one_0 = s[15];
    SLOPEWISE_INDEPENDENT
    for (std::size_t j = 0; j < row.lanes; ++j) {
      const double theta = row.grade[j], slow = row.slowest[j], fast = top[j];
      const double vv = (vv_2 * theta + vv_1) * theta + vv_0;
      const double v = (v_2 * theta + v_1) * theta + v_0;
      const double one = (one_2 * theta + one_1) * theta + one_0;
      const bool on = (bits[j] >> i) & 1;
      at_slow[j] = max_of(at_slow[j], on ? (vv * slow + 2.0 * v) * slow + one : 0.0);
      at_fast[j] = max_of(at_fast[j], on ? (vv * fast + 2.0 * v) * fast + one : 0.0);
    }
  }
  SLOPEWISE_INDEPENDENT
  for (std::size_t j = 0; j < row.lanes; ++j) {
    const double slow = std::sqrt(at_slow[j]), fast = std::sqrt(at_fast[j]);
    const double rise = (fast - slow) / max_of(top[j] - row.slowest[j], 1e-6);
    const double intercept = slow - rise * row.slowest[j];
    row.lower_slope[j] -= rise;
    row.lower_intercept[j] -= intercept;
    row.upper_slope[j] += rise;
    row.upper_intercept[j] += intercept;
  }
}

// Least and most friction of the surfaces that a station may be on.
struct Frictions {
  Lane least{}, most{};
};

inline void find_frictions(std::span<const Surface> surfaces, const LaneLabels& bits,
                           std::size_t lanes, Frictions& mu) noexcept {
  mu.least.fill(no_limit);
  mu.most.fill(0.0);
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const double least = surfaces[i].friction, most = surfaces[i].most_friction;
    for (std::size_t j = 0; j < lanes; ++j) {
      const bool on = (bits[j] >> i) & 1;
      mu.least[j] = min_of(mu.least[j], on ? least : no_limit);
      mu.most[j] = max_of(mu.most[j], on ? most : 0.0);
    }
  }
}

// Cosine of a slope, but of level ground where it changes sign on the way to a neighbour: over a
// crest the ground is more upright between two stations than at either.
[[nodiscard]] inline double upmost(const Neighbours& slope, double sine, std::size_t j) noexcept {
  const bool levels = (slope.lowest(j) < 0.0) & (slope.highest(j) > 0.0);
  return levels ? 1.0 : std::sqrt(1.0 - sine * sine);
}

// Cap both bounds by friction times the share of the weight that presses on the ground. Where
// friction caps the force at some trained speed, the slope is 0 and the intercept the least, or the
// most, that it can then be. What turns and banks take of it: contact_bound.hpp.
inline void cap_by_friction(const ForceRow& row, const Frictions& mu, const Neighbours& grade,
                            const Neighbours& sin_roll) noexcept {
  SLOPEWISE_INDEPENDENT
  for (std::size_t j = 0; j < row.lanes; ++j) {
    const double sine = row.sin_grade[j], lean = row.sin_roll[j];
    const double upright = std::sqrt((1.0 - sine * sine) * (1.0 - lean * lean));
    const double slow = row.slowest[j], fast = row.fastest[j];
    const double slope = row.lower_slope[j], intercept = row.lower_intercept[j];
    const double at_slow = slow * slope + intercept, at_fast = fast * slope + intercept;
    const bool slides = max_of(at_slow, at_fast) > mu.least[j] * upright;
    const double least = min_of(min_of(at_slow, at_fast), mu.least[j] * upright);
    row.lower_slope[j] = slides ? 0.0 : slope;
    row.lower_intercept[j] = slides ? least : intercept;
    const double up_slope = row.upper_slope[j], up_intercept = row.upper_intercept[j];
    const double highest = max_of(slow * up_slope + up_intercept, fast * up_slope + up_intercept);
    const bool may_slide = highest > mu.most[j] * upright;
    const double most =
        min_of(highest, mu.most[j] * (upmost(grade, sine, j) * upmost(sin_roll, lean, j)));
    row.upper_slope[j] = may_slide ? 0.0 : up_slope;
    row.upper_intercept[j] = may_slide ? most : up_intercept;
  }
}

// Weak brakes where the grade dips between stations.
//
// Stops take the grade to be linear between stations. Where an axle crosses an edge of the map it
// kinks, and may be steeper downhill in between. Where brakes and slope nearly balance, that
// decides how long a stop is: there the force is lowered by what the dip may add on average.
class Dips {
 public:
  Dips(const ForceProblem& problem, std::size_t lanes) noexcept
      : problem_(problem), lanes_(lanes) {}

  void take_from(const ForceRow& row, Index k) noexcept {
    find(k + 1);
    const Lane &before = of_row(k + 2), &here = of_row(k), &ahead = of_row(k + 1);
    SLOPEWISE_INDEPENDENT
    for (std::size_t j = 0; j < row.lanes; ++j) {
      const double slope = row.lower_slope[j], intercept = row.lower_intercept[j];
      const double force = intercept + min_of(row.slowest[j] * slope, row.fastest[j] * slope);
      const double dip = dip_share * max_of(before[j], max_of(here[j], ahead[j]));
      const double kept = small_dip * max_of(force + row.sin_grade[j], 0.0);
      row.lower_intercept[j] = intercept - max_of(dip - kept, 0.0);
    }
  }

 private:
  // Second difference of row k where the grade dips, 0 where it does not, or is unknown.
  void find(Index k) noexcept {
    Lane& dip = of_row(k);
    if (k < 1 || k + 1 >= problem_.stations) {
      dip.fill(0.0);
      return;
    }
    const double *before = problem_.grade.at(k - 1), *here = problem_.grade.at(k),
                 *ahead = problem_.grade.at(k + 1);
    // As bytes: gcc widens no bools.
    const auto* known = reinterpret_cast<const unsigned char*>(problem_.known.at(k - 1));
    const auto* known_ahead = reinterpret_cast<const unsigned char*>(problem_.known.at(k + 1));
    for (std::size_t j = 0; j < lanes_; ++j) {
      const double second = before[j] - 2.0 * here[j] + ahead[j];
      const std::int64_t seen = known[j] & known_ahead[j];
      dip[j] = seen != 0 ? max_of(second, 0.0) : 0.0;
    }
  }

  // Three rows are kept: that before a row is in the place of the second one after it.
  [[nodiscard]] Lane& of_row(Index k) noexcept { return rows_[static_cast<std::size_t>(k % 3)]; }

  const ForceProblem& problem_;
  std::size_t lanes_;
  std::array<Lane, 3> rows_{};
};

}  // namespace detail

}  // namespace slopewise
