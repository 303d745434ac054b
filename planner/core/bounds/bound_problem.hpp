// What the speed bounds of a batch are asked, and where they are answered.
#pragma once

#include "candidate_rows.hpp"
#include "bounds/limiting.hpp"
#include "vehicle.hpp"

namespace slopewise {

// Kept free between stopping path and clear distance, above all errors of integration [m].
inline constexpr double stop_guard = 2e-3;

struct BoundProblem {
  TerrainRows terrain;
  ForceRows forces;
  Labels hazard;           // what bars a pose, 0 where nothing does
  Numbers rough_speed;     // highest speeds by roughness, by steering, of the path itself [m/s]
  Numbers steering_speed, path_speed;
  Numbers friction;        // least friction [1], null where it is not known
  const double* clear;     // (M,) station up to which the vehicle may come, inf if unlimited [m]
  StopErrors errors;
  Vehicle vehicle;
  MotionTerms motion;
  bool closed_form;        // nothing acts on the motion: the stopping path has a closed form
  Numbers excess{};        // by how much stops may begin faster than planned [m/s]; found here
  double* curves = nullptr;  // receives v² of the first candidate, a row of N for each code, if wanted
  bool exceeds = false;    // it is not zero everywhere
  // (M,) found here: the speed limit, raised to the highest trained speed of the candidate, and the
  // speed at which any stop of it may begin [m/s].
  const double *top = nullptr, *fastest = nullptr;

  [[nodiscard]] BoundProblem from(Index first) const noexcept;
};

// The answers, (N, M) and (M,).
struct Bounds {
  Rows<double> speed_sq_max;                 // v² [m²/s²]
  Rows<Label> limiting;                      // which bound that is
  Rows<double> accel_max;                    // by comfort, thrust and front axle load [m/s²]
  // In a turn the wheel that bank and turn unload allows lift − lift_per_speed_sq v² [m/s²], [1/m].
  Rows<double> lift, lift_per_speed_sq;
  Rows<double> demand;                       // thrust that holds the speed, over the weight
  Rows<double> lower_slope, lower_intercept; // what friction and crests leave of the lower bound
  Label* barrier;                            // what ends the clear distance
  std::int64_t* barrier_station;             // first station that is barred
  double* clear_distance;                    // station up to which the vehicle may stop [m]

  [[nodiscard]] Bounds from(Index first) const noexcept {
    return {speed_sq_max.from(first), limiting.from(first),        accel_max.from(first),
            lift.from(first),         lift_per_speed_sq.from(first), demand.from(first),
            lower_slope.from(first),  lower_intercept.from(first),
            barrier + first,          barrier_station + first,     clear_distance + first};
  }
};

inline BoundProblem BoundProblem::from(Index first) const noexcept {
  BoundProblem out = *this;
  if (first > 0) out.curves = nullptr;
  out.terrain.counts += first;
  out.forces.distance_offset += first;
  out.clear += first;
  out.top += first;
  out.fastest += first;
  TerrainRows& t = out.terrain;
  ForceRows& f = out.forces;
  for (Numbers* rows :
       {&t.station, &t.heading_x, &t.heading_y, &t.curvature, &t.grade, &t.sin_grade, &t.sin_roll,
        &t.vertical_curvature, &f.lower_slope, &f.lower_intercept, &f.upper_slope,
        &f.upper_intercept, &f.dead_time, &f.shortest_dead_time, &f.slowest, &f.fastest, &out.rough_speed,
        &out.steering_speed, &out.path_speed, &out.friction, &out.excess}) {
    *rows = rows->from(first);
  }
  out.hazard = hazard.from(first);
  t.known = t.known.from(first);
  f.trained = f.trained.from(first);
  return out;
}

}  // namespace slopewise
