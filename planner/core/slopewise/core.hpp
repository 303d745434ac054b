// The planner for C++ programs, without Python: ground, profiles, plans, in three calls.
// docs/from-cpp.md says what a program has to know; examples/cpp plans over a hill.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "bounds/bound_problem.hpp"
#include "ground/force_problem.hpp"
#include "ground/height_grid.hpp"
#include "swept/vehicle_envelope.hpp"
#include "verify/verify_ground_terms.hpp"
#include "verify/verify_terms.hpp"

namespace slopewise {

// A vehicle on maps of one resolution, as `slopewise export --cpp` writes it. SI.
struct PlanningModel {
  double resolution;            // edge of a cell of the maps that the numbers hold for [m]
  double spacing;               // largest distance between two stations [m]
  double front;                 // of the vehicle, ahead of the reference point [m]
  double jerk;                  // of smoothed profiles [m/s³]
  double ride_frequency, ride_damping;  // of the body on its springs [Hz], [1]
  double extrapolation_margin;  // of ForceProblem
  bool slides;                  // friction caps the force of some surface
  Vehicle limits;
  VehicleEnvelope envelope;
  Footprint tyre;
  verify::BodySizes body;
  verify::Body weighed;
  verify::SteeringTerms steering;
  verify::GroundLimits ground;
  verify::GroundTolerance tolerance{};
  StopErrors errors;            // at the quantile that plans survive
  MotionTerms motion;
  std::array<std::int64_t, static_cast<std::size_t>(hazard_kinds)> code_of_hazard;
  std::vector<Surface> surfaces;
  std::int64_t surface_bits;    // of the surfaces that ground may be
  std::vector<HullLine> hull;   // of each surface as many, or none
  std::vector<double> uncertainty;  // (surfaces, 4, 4), or none
};

// Heights (rows, columns) [m], row 0 at least y, NaN where unknown; they are copied.
struct HeightMap {
  const double* heights;
  Index rows, columns;
  double origin_x, origin_y;  // centre of cell [0, 0] [m]
  double resolution;          // [m]
};

// Positions at even distances, at most `spacing` apart [m].
struct EvenPath {
  std::vector<double> x, y;
};

enum class Status { ok, blocked, infeasible, degraded };

// Columns of N stations.
struct Plan {
  Status status;                        // as of slopewise.planner.plan.Status
  std::vector<double> station;          // along the ground [m]
  std::vector<double> speed;            // [m/s]; linear in v² between stations
  std::vector<double> time;             // [s]
  std::vector<double> stop_distance;    // of an emergency stop from each station [m]
  std::vector<Label> limiting;          // of slopewise.planner.limiting.Limiting
  double clear_distance;                // station before which every stop ends [m]
};

// Plans along candidates on one map; of one thread at a time. A wrong argument throws
// std::invalid_argument, which names it.
class Planner {
 public:
  struct Candidates;

  Planner(const PlanningModel& model, const HeightMap& map);
  ~Planner();
  Planner(const Planner&) = delete;
  Planner& operator=(const Planner&) = delete;

  // Ground, braking force and hazards along candidates.
  void sample_terrain(const std::vector<EvenPath>& paths);
  // Bounds and fastest profiles; `clear`: station up to which the way is known free [m].
  void solve(double start_speed = 0.0, double clear = no_limit);
  // One candidate smoothed, verified and labelled.
  Plan finish(std::size_t candidate);

 private:
  std::unique_ptr<Candidates> candidates_;
};

}  // namespace slopewise
