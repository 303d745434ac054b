// What the braking force along candidates is made of, and where it is noted.
#pragma once

#include <span>

#include "candidate_rows.hpp"

namespace slopewise {

// What the model knows of a surface; the columns of planner/ground/surfaces.py.
struct Surface {
  // F_b/W = (m_m v + b_m) grade + (m_b v + b_b), v at brake onset; uphill other m_m and b_m.
  double m_m, b_m, m_b, b_b, up_m_m, up_b_m;
  double dead_time, distance_offset;     // [s], [m]
  double slowest, fastest;               // trained speeds [m/s]
  double steepest_down, steepest_up;     // trained grades [rad]
  double least_sin_roll, most_sin_roll;  // of trained rolls [1]
  double friction, most_friction;        // that cap the force, least and most [1], inf: none does

  // Other coefficients uphill: the force bends where the grade changes sign.
  [[nodiscard]] bool kinked() const noexcept { return up_m_m != m_m || up_b_m != b_m; }
};
inline constexpr std::size_t surface_columns = sizeof(Surface) / sizeof(double);
static_assert(surface_columns == 16);

// Lines that no driven speed is above: intercept [m/s] and slope over the grade [m/s per rad].
struct HullLine {
  double intercept, slope;
};

struct ForceProblem {
  Index stations, candidates;
  const std::int64_t* counts;            // (M,) stations that each candidate has
  Numbers grade, sin_grade, sin_roll;    // [rad], [1], [1]
  Flags known;
  Labels classes;                        // bits of the map's classes, null where it has one
  std::span<const std::int64_t> class_bits;  // of each class, surfaces that it may be
  std::span<const Surface> surfaces;
  double margin;                         // share of the force that counts as uncertain where it
                                         // extrapolates; < 0: it must not
  std::span<const HullLine> hull;        // of each surface as many, none where no model has one
  Numbers least_term, most_term;         // of ground effects around each station [1], or null
  const double* uncertainty;             // (S, 4, 4) of the coefficients, or null
  Numbers drag;                          // that may unload the rear axle further [1], or null
  bool slides;                           // friction caps the force of some surface
};

// Bounds of the force; the upper one decides whether the vehicle tips, the lower where it stops.
struct ForceBounds {
  Rows<double> lower_slope, lower_intercept, upper_slope, upper_intercept;
  Rows<double> dead_time, shortest_dead_time, slowest, fastest;
  Rows<double> friction;    // least of the ground, where it slides
  Rows<bool> trained;       // grade and roll lie in the trained range, or extrapolation is allowed
  double* distance_offset;  // (M,) [m]
};

}  // namespace slopewise
