// Braking force of the surfaces that each station may be on: its lower and its upper bound.
#pragma once

#include "ground/grade_between.hpp"

namespace slopewise {

namespace detail {

// What is known of row k of a tile, and what the force is made of there.
struct ForceRow {
  std::size_t lanes;
  const double *grade, *sin_grade, *sin_roll;
  double *lower_slope, *lower_intercept, *upper_slope, *upper_intercept;
  double *dead_time, *shortest_dead_time, *slowest, *fastest;
  bool* trained;
  double* distance_offset;

  ForceRow(const ForceProblem& p, const ForceBounds& out, Index k, std::size_t count) noexcept
      : lanes(count), grade(p.grade.at(k)), sin_grade(p.sin_grade.at(k)),
        sin_roll(p.sin_roll.at(k)), lower_slope(out.lower_slope.at(k)),
        lower_intercept(out.lower_intercept.at(k)), upper_slope(out.upper_slope.at(k)),
        upper_intercept(out.upper_intercept.at(k)), dead_time(out.dead_time.at(k)),
        shortest_dead_time(out.shortest_dead_time.at(k)), slowest(out.slowest.at(k)),
        fastest(out.fastest.at(k)), trained(out.trained.at(k)), distance_offset(out.distance_offset) {}
};

// Surfaces that each station of row k may be on, of a map with several classes. A surface may begin
// anywhere between two stations: it counts for both.
inline void surfaces_of(const ForceProblem& p, Index k, std::size_t lanes,
                        LaneLabels& bits) noexcept {
  const std::int64_t *here = p.classes.at(k), *before = p.classes.at(std::max<Index>(k - 1, 0)),
                     *after = p.classes.at(std::min(k + 1, p.stations - 1));
  LaneLabels classes;
  for (std::size_t j = 0; j < lanes; ++j) {
    const std::int64_t behind = k - 1 < p.counts[j] ? before[j] : 0;
    classes[j] = here[j] | behind | (k + 1 < p.counts[j] ? after[j] : 0);
    bits[j] = 0;
  }
  for (std::size_t c = 0; c < p.class_bits.size(); ++c) {
    const std::int64_t own = p.class_bits[c];
    for (std::size_t j = 0; j < lanes; ++j) bits[j] |= (classes[j] >> c) & 1 ? own : 0;
  }
  for (std::size_t j = 0; j < lanes; ++j) bits[j] = bits[j] == 0 ? 1 : bits[j];
}

struct Line {
  double slope, intercept;
};

// Force on a surface at a grade.
[[nodiscard]] inline Line force_on(const Surface& s, double grade) noexcept {
  return {(grade > 0.0 ? s.up_m_m : s.m_m) * grade + s.m_b,
          (grade > 0.0 ? s.up_b_m : s.b_m) * grade + s.b_b};
}

// Whether grade or roll lie beyond what was trained on, 0 or 1.
[[nodiscard]] inline std::int64_t beyond(const Surface& s, double lowest, double highest,
                                         double sin_roll) noexcept {
  const bool grade = (lowest < s.steepest_down) | (highest > s.steepest_up);
  const bool roll = (sin_roll < s.least_sin_roll) | (sin_roll > s.most_sin_roll);
  return grade | roll ? 1 : 0;
}

// Whether a station beyond its training is on some surface: at itself, or on the way to a
// neighbour.
struct Beyond {
  LaneLabels here{}, around{};
};

inline void start(const ForceRow& row, double slowest) noexcept {
  std::fill_n(row.lower_slope, row.lanes, no_limit);
  std::fill_n(row.lower_intercept, row.lanes, no_limit);
  std::fill_n(row.upper_slope, row.lanes, -no_limit);
  std::fill_n(row.upper_intercept, row.lanes, -no_limit);
  std::fill_n(row.dead_time, row.lanes, 0.0);
  std::fill_n(row.shortest_dead_time, row.lanes, no_limit);
  std::fill_n(row.slowest, row.lanes, slowest);
  std::fill_n(row.fastest, row.lanes, no_limit);
}

// Take a surface into both bounds of the stations that may be on it. Where the grade changes sign
// on the way to a neighbour, the force on level ground counts as well.
//
// A stop leads over several, and one speed at its onset counts for all: below the trained range of
// a surface the force is taken on as if it changed down to the slowest trained speed of any, as far
// as that is the safe side.
inline void take_surface(const ForceRow& row, const Surface s, double slowest,
                         const GradeAround& around, const LaneLabels& bits, std::size_t index,
                         Beyond& outside) noexcept {
  const double flat = s.slowest - slowest, kink = s.kinked() ? 1.0 : 0.0;
  const double level_least = s.b_b + min_of(s.m_b, 0.0) * flat;
  const double level_most = s.b_b + max_of(s.m_b, 0.0) * flat;
  SLOPEWISE_INDEPENDENT
  for (std::size_t j = 0; j < row.lanes; ++j) {
    const bool on = (bits[j] >> index) & 1;
    const double grade = row.grade[j], low = around.lowest[j], high = around.highest[j];
    const Line line = force_on(s, grade);
    const bool bends = (kink > 0.0) & (low < 0.0) & (high > 0.0);
    const double least = line.intercept + min_of(line.slope, 0.0) * flat;
    const double most = line.intercept + max_of(line.slope, 0.0) * flat;
    const double low_slope = bends ? min_of(line.slope, s.m_b) : line.slope;
    const double high_slope = bends ? max_of(line.slope, s.m_b) : line.slope;
    const double low_intercept = bends ? min_of(least, level_least) : least;
    const double high_intercept = bends ? max_of(most, level_most) : most;
    row.lower_slope[j] = min_of(row.lower_slope[j], on ? low_slope : no_limit);
    row.lower_intercept[j] = min_of(row.lower_intercept[j], on ? low_intercept : no_limit);
    row.upper_slope[j] = max_of(row.upper_slope[j], on ? high_slope : -no_limit);
    row.upper_intercept[j] = max_of(row.upper_intercept[j], on ? high_intercept : -no_limit);
    row.dead_time[j] = max_of(row.dead_time[j], on ? s.dead_time : 0.0);
    row.shortest_dead_time[j] = min_of(row.shortest_dead_time[j], on ? s.dead_time : no_limit);
    row.fastest[j] = min_of(row.fastest[j], on ? s.fastest : no_limit);
    row.distance_offset[j] = max_of(row.distance_offset[j], on ? s.distance_offset : 0.0);
  }
  for (std::size_t j = 0; j < row.lanes; ++j) {
    const double grade = row.grade[j], sin_roll = row.sin_roll[j];
    const std::int64_t on = (bits[j] >> index) & 1;
    outside.here[j] |= on & beyond(s, grade, grade, sin_roll);
    outside.around[j] |= on & beyond(s, around.lowest[j], around.highest[j], sin_roll);
  }
}

// Where a bound extrapolates, also on the way to a neighbour, it counts with an extra share of
// itself.
inline void extrapolate(const ForceRow& row, double margin, const Beyond& outside) noexcept {
  SLOPEWISE_INDEPENDENT
  for (std::size_t j = 0; j < row.lanes; ++j) {
    const double share = outside.around[j] != 0 ? max_of(margin, 0.0) : 0.0;
    row.lower_slope[j] -= share * std::fabs(row.lower_slope[j]);
    row.lower_intercept[j] -= share * std::fabs(row.lower_intercept[j]);
    row.upper_slope[j] += share * std::fabs(row.upper_slope[j]);
    row.upper_intercept[j] += share * std::fabs(row.upper_intercept[j]);
  }
  for (std::size_t j = 0; j < row.lanes; ++j) {
    row.trained[j] = (outside.here[j] == 0) | (margin >= 0.0);
  }
}

// Both bounds of the force over all surfaces that a station may be on.
inline void find_force(const ForceRow& row, std::span<const Surface> surfaces, double margin,
                       const GradeAround& around, const LaneLabels& bits) noexcept {
  double slowest = no_limit;
  for (const Surface& s : surfaces) slowest = min_of(slowest, s.slowest);
  Beyond outside;
  start(row, slowest);
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    take_surface(row, surfaces[i], slowest, around, bits, i, outside);
  }
  extrapolate(row, margin, outside);
}

}  // namespace detail

}  // namespace slopewise
