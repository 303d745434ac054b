// One candidate as the verifier walks it: its stations, and what stops meet there.
// Loads and sums are those of the laws of `models`, of angles, at every station; the planner's
// shortcuts in sines have no place here.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "candidate_rows.hpp"
#include "generated/laws.hpp"

namespace slopewise::verify {

inline constexpr double infinite = std::numeric_limits<double>::infinity();

// One candidate; arrays of N >= 2 stations.
struct Track {
  Index stations;
  const double* station;                          // along the ground, increasing [m]
  const double *grade, *roll;                     // [rad]
  const double* curvature;                        // in the plan view [1/m]
  const double* yaw;                              // without jumps [rad]
  const double *lower_slope, *lower_intercept;    // of the lower bound of F_b/W [s/m], [1]
  const double *upper_slope, *upper_intercept;    // of its upper bound
  const double *dead_time, *shortest_dead_time;   // of the surfaces there [s]
  const double* slowest;                          // below it the force does not change [m/s]
  const double* speed_limit;                      // of path, trained range and rough ground [m/s]
  const double* vertical_curvature;               // negative over a crest [1/m]
  const double* friction;                         // of the ground, inf where it is not known [1]

  [[nodiscard]] Index last() const noexcept { return stations - 1; }
};

inline constexpr Index track_columns = 15;
inline constexpr Index speed_limit_column = 12;

[[nodiscard]] inline Track track_at(Index stations,
                                    const std::array<const double*, track_columns>& c) noexcept {
  return {stations, c[0], c[1], c[2], c[3], c[4],  c[5],  c[6],
          c[7],     c[8], c[9], c[10], c[11], c[12], c[13], c[14]};
}

// M candidates that the columns of tracks come from.
struct TrackRows {
  TerrainRows terrain;
  ForceRows forces;
  Numbers speed_limit;  // of path, trained range and rough ground [m/s]
  Numbers friction;     // null where it is not known [1]
};

// Stations of candidate j from `first` on, in the order of Track; `stride` doubles a column.
// Without `turns` the yaw stays at 0, where nothing asks for it.
inline void copy_columns(const TrackRows& rows, Index j, Index first, bool turns, double* out,
                         Index stride) noexcept {
  const TerrainRows& t = rows.terrain;
  const ForceRows& f = rows.forces;
  double before = 0.0;
  for (Index k = first; k < static_cast<Index>(t.counts[j]); ++k) {
    const Index i = k - first;
    const double yaw = turns ? std::atan2(t.heading_y.at(k)[j], t.heading_x.at(k)[j]) : 0.0;
    if (i == 0) before = yaw;
    constexpr double full = 2.0 * std::numbers::pi;
    before = yaw - full * std::nearbyint((yaw - before) / full);
    const std::array<double, track_columns> column{
        t.station.at(k)[j] - t.station.at(first)[j],
        t.grade.at(k)[j],
        std::asin(t.sin_roll.at(k)[j]),
        t.curvature.at(k)[j],
        before,
        f.lower_slope.at(k)[j],
        f.lower_intercept.at(k)[j],
        f.upper_slope.at(k)[j],
        f.upper_intercept.at(k)[j],
        f.dead_time.at(k)[j],
        f.shortest_dead_time.at(k)[j],
        f.slowest.at(k)[j],
        rows.speed_limit.at(k)[j],
        t.vertical_curvature.at(k)[j],
        rows.friction.data != nullptr ? rows.friction.at(k)[j] : infinite};
    for (std::size_t c = 0; c < column.size(); ++c) {
      out[static_cast<Index>(c) * stride + i] = column[c];
    }
  }
}

// The vehicle as the verifier weighs it [m].
struct Body {
  double wheelbase, track_width, cg_x, cg_z, slip_track;
};

// What stops meet at the stations; arrays are (N,).
struct Survey {
  double* sine;                                  // of the grade
  double *slope_work, *intercept_work;           // of the lower force from the first station on
  double *front, *rear, *left, *right;           // shares of the level static loads at rest
  double* lean;                                  // lateral acceleration for each unit of v² [1/m]
  double per_accel, per_decel, per_lateral;      // unloads the front, the rear, a side [s²/m]
};

inline constexpr Index survey_columns = 8;

// Linear between stations i and i + 1.
[[nodiscard]] inline double at(const double* values, Index i, double u) noexcept {
  return values[i] + u * (values[i + 1] - values[i]);
}

// Index of the segment that holds s, walking from i.
[[nodiscard]] inline Index segment_of(const Track& track, double s, Index i) noexcept {
  while (i > 0 && track.station[i] > s) --i;
  while (i + 2 < track.stations && track.station[i + 1] <= s) ++i;
  return i;
}

namespace detail {

inline void add_work(const Track& track, Survey& survey) noexcept {
  survey.slope_work[0] = survey.intercept_work[0] = 0.0;
  for (Index k = 0; k < track.last(); ++k) {
    const double ds = track.station[k + 1] - track.station[k];
    const double turn = 0.5 * (track.grade[k + 1] - track.grade[k]), t = turn * turn;
    // The mean of sin θ over a linear grade is that of its ends times tan(turn) / turn.
    const double mean =
        0.5 * (survey.sine[k] + survey.sine[k + 1]) * (1.0 + t / 3.0 + t * t * 2.0 / 15.0);
    const double slope = 0.5 * (track.lower_slope[k] + track.lower_slope[k + 1]);
    const double intercept = 0.5 * (track.lower_intercept[k] + track.lower_intercept[k + 1]) + mean;
    survey.slope_work[k + 1] = survey.slope_work[k] + ds * slope;
    survey.intercept_work[k + 1] = survey.intercept_work[k] + ds * intercept;
  }
}

}  // namespace detail

// Walk a track once; `memory` is survey_columns times N doubles.
[[nodiscard]] inline Survey survey_of(const Track& track, const Body& b, double* memory) noexcept {
  const auto front = [&b](double grade, double roll, double decel) {
    return laws::front_load_share(grade, roll, decel, b.wheelbase, b.cg_x, b.cg_z);
  };
  const auto rear = [&b](double grade, double roll, double decel) {
    return laws::rear_load_share(grade, roll, decel, b.wheelbase, b.cg_x, b.cg_z);
  };
  const auto left = [&b](double grade, double roll, double lateral) {
    return laws::left_load_share(grade, roll, lateral, b.track_width, b.cg_z);
  };
  const Index n = track.stations;
  Survey survey{memory,         memory + n,     memory + 2 * n, memory + 3 * n,
                memory + 4 * n, memory + 5 * n, memory + 6 * n, memory + 7 * n,
                front(0.0, 0.0, 0.0) - front(0.0, 0.0, -1.0),
                rear(0.0, 0.0, 0.0) - rear(0.0, 0.0, 1.0),
                left(0.0, 0.0, 0.0) - left(0.0, 0.0, 1.0)};
  for (Index k = 0; k < n; ++k) {
    const double grade = track.grade[k], roll = track.roll[k];
    survey.sine[k] = std::sin(grade);
    survey.front[k] = front(grade, roll, 0.0);
    survey.rear[k] = rear(grade, roll, 0.0);
    survey.left[k] = left(grade, roll, 0.0);
    survey.right[k] = laws::right_load_share(grade, roll, 0.0, b.track_width, b.cg_z);
    survey.lean[k] = track.curvature[k] / std::cos(roll);
  }
  detail::add_work(track, survey);
  return survey;
}

}  // namespace slopewise::verify
