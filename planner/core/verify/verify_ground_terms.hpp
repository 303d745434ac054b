// What the ground below a candidate is judged by, and what the verifier finds of it.
#pragma once

#include <cstdint>
#include <numbers>

#include "verify/wheel_tracks.hpp"

namespace slopewise::verify {

// Kinds of places, in the order of `GroundKind` in Python.
enum class GroundKind : std::int64_t {
  none, unknown, untrained, holding, step, twist, clearance, body
};

// What the vehicle may stand on.
struct GroundLimits {
  double grade_low, grade_high, roll_low, roll_high;  // trained [rad]
  double across, across_per_curvature;                // lateral error [m], [m²]
  double turned;                                      // sine of the heading error [1]
};

// By how much limits are passed before it counts. Slopes: a hundredth of a wheelbase, by which contact
// heights may differ, and the same as a share of the weight. Heights between cells are those of other
// samples than the planner's; a twist depends on four of them, and is greatest between stations.
struct GroundTolerance {
  double slope = 0.6 * std::numbers::pi / 180.0;  // at stations [rad]
  double holds = 0.01;   // share of the weight, at stations [1]
  double height = 0.1;   // share of a limit of height, of steps and under the body [1]
  double twist = 0.25;   // share of a limit of height under a wheel in the air [1]
};

// Between stations slopes count if they pass limits by so many tolerances [1]: plans take grade and
// roll as linear there, and on cells of the size of a wheel the ground is not.
inline constexpr double between_tolerances = 5.0;

// What holds a vehicle at rest, how it turns, and how far off the line it may be; (N,) each.
struct RestingGround {
  const double* force;      // F_b/W at standstill [1]
  const double* friction;   // inf where it is not known [1]
  const double* curvature;  // [1/m]
  const double* offset;     // of a vehicle on the path that was given [m]
};

// Stations from and to which a candidate is looked at: the vehicle stands at the first [m].
struct GroundRange {
  double begin, end;
};

// The first place that blocks the path.
struct GroundFinding {
  GroundKind kind = GroundKind::none;
  double station = infinite;  // where the middle of the wheelbase then is [m]
  double value = 0.0;         // of what is passed: [m], [rad], [1]
  double x = 0.0, y = 0.0;    // where it is [m]
};

// Way between two looks below body and wheels, in wheel radii: within that a wheel climbs little.
inline constexpr double look_radii = 0.5;

// Heights between two stations are not known better than that [cells]: they are of one cell or of the
// next.
inline constexpr double blurred_cells = 0.1;
// The same where cells are larger than the radius of a wheel, so that ground under one may be that of
// half a cell farther [cells].
inline constexpr double coarsely_blurred_cells = 0.5;

// Length of ground before and after a step that tells how steep it is without it, in wheel radii.
inline constexpr double trend_radii = 2.5;

// Length within which ground that rises by a step does so: of a wheel radius, and of a cell, over
// which heights between cells are a ramp.
inline constexpr double step_radii = 0.5, step_cells = 1.5;

}  // namespace slopewise::verify
