// What a finished plan is judged by, and what the verifier notes of it.
#pragma once

#include <array>

#include "bounds/limiting.hpp"
#include "verify/follow_steering.hpp"
#include "verify/stop_in_time.hpp"

namespace slopewise::verify {

// Kinds of breaches, in the order of `Violations` in Python.
enum class Breach : std::size_t {
  overrun, axle_load, side_load, speed, lateral, wheel_speed, accel, decel, vertical, friction,
  wheel_load, turning, steering_rate, unknown_terrain, model_validity, holding, step, clearance,
  body,
};
inline constexpr std::size_t breach_count = 19;

// The bound that each of them breaks; of a speed that is its limit, whatever that comes from.
inline constexpr std::array<Label, breach_count> broken_bound{
    limiting::stopping_path, limiting::tip_over, limiting::rollover, limiting::speed_limit,
    limiting::lateral, limiting::wheel_speed, limiting::accel, limiting::decel, limiting::crest,
    limiting::friction, limiting::rollover, limiting::steering, limiting::steering,
    limiting::unknown_terrain, limiting::model_validity, limiting::holding, limiting::step,
    limiting::clearance, limiting::body};

// Smallest violation [SI unit of the limit]: rounding of sums along a path.
inline constexpr double breach_tolerance = 1e-6;

// Share of the lateral acceleration that any bank leaves to a turn.
inline constexpr double least_turn_share = 0.1;

// What plans are judged by.
struct VerifyTerms {
  Body body;
  Vehicle limits;
  MotionTerms motion;
  StopErrors errors;
  SteeringTerms steering;
  bool in_time;      // something acts on the motion: stops are integrated in time
  Index between;     // points inside each segment from which a stop is tried as well
  double time_step;  // of the integrator [s]
  bool all_loads;    // the loads of every stop are wanted, not only those that may run short
  bool changes = true;  // of speed and steering angle are judged, too
};

// One plan as it is judged. A plan tells its stops with the braking force as it is learned, on even
// ground, and survives those of the others.
struct VerifiedPlan {
  const Track &track, &even;
  const double* speed_sq;  // (N,) v², linear between stations [m²/s²]
  double clear_distance;   // station before which every stop must end [m]
  double distance_offset;  // safety offset of the model, added to every stop [m]
  Breach beyond = Breach::overrun;  // as what it counts if a stop ends beyond the clear distance
};

// What the verifier fills in.
struct VerifyNotes {
  double* stop_distance;  // (N,) told stop, with its offset; 0 where the plan stands [m]
  double* rear_load;      // (N,) least rear axle load on that stop, of its level static load
  double* side_load;      // (N,) least side load on that stop, of half the weight
  double* worst;          // (breach_count,) worst breach of each kind; only raised
  Label* bad;             // (N - 1,) a bound that is broken in or at the start of a segment; only
                          // set; nullptr where nobody asks
};

}  // namespace slopewise::verify
