// Vehicle, terrain and limits as plain numbers, and what acts on the motion of a stop.
#pragma once

#include <array>
#include <cstddef>

namespace slopewise {

// The scalars of a model; SI. Loads and forces are shares of the weight.
#define SLOPEWISE_VEHICLE(NUMBER) \
  NUMBER(rear_lever)      /* cg_z / (L − cg_x) [1] */ \
  NUMBER(front_lever)     /* cg_z / cg_x [1] */ \
  NUMBER(side_lever)      /* 2 cg_z / B [1] */ \
  NUMBER(min_load)        /* share of its static load that every axle, side and wheel keeps [1] */ \
  NUMBER(resistance)      /* f_r that the drive has to overcome [1] */ \
  NUMBER(rolling)         /* f_r that slows the vehicle with its drive cut [1] */ \
  NUMBER(turning_drag)    /* μ_t L / 2 of a skid-steer vehicle, else 0 [m] */ \
  NUMBER(half_slip_track) /* B_s / 2 of a skid-steer vehicle, else B / 2 [m] */ \
  NUMBER(max_wheel_speed) /* [m/s] */ \
  NUMBER(specific_force)  /* highest drive force over weight [1] */ \
  NUMBER(specific_power)  /* drive power over weight [m/s] */ \
  NUMBER(speed)           /* [m/s] */ \
  NUMBER(accel)           /* [m/s²] */ \
  NUMBER(decel)           /* [m/s²], inf to brake as hard as the model allows */ \
  NUMBER(lateral_accel)   /* [m/s²] */ \
  NUMBER(vertical_accel)  /* [m/s²] */ \
  NUMBER(ahead)           /* cg_x / L [1] */ \
  NUMBER(high)            /* cg_z / L [1] */ \
  NUMBER(brake_share)     /* of the front axle [1], -1 where none locks alone */ \
  NUMBER(crest_share)     /* of the load lost over a crest, which the force loses as well [1] */ \
  NUMBER(holding)         /* share of the slope that brakes and friction hold at rest [1] */

struct Vehicle {
#define SLOPEWISE_MEMBER(name) double name;
  SLOPEWISE_VEHICLE(SLOPEWISE_MEMBER)
#undef SLOPEWISE_MEMBER
};

// As of planner/planning_limits.py.
inline constexpr auto vehicle_names = std::to_array<const char*>({
#define SLOPEWISE_NAME(name) #name,
    SLOPEWISE_VEHICLE(SLOPEWISE_NAME)
#undef SLOPEWISE_NAME
});

// Room for the parameters of all motion laws.
inline constexpr std::size_t most_motion_values = 16;

// What acts while the vehicle brakes, beside the force of planner/ground.
struct MotionTerms {
  std::array<double, most_motion_values> values{};  // of all motion laws, one after the other
  bool moves = false;                               // any of these laws is there
  double lag = 0.0;                                 // time constant of the build-up, 0 without [s]
  double fade = 0.0;                                // k of F/(1 + k q) [kg/J]
  double fade_tau = 1.0;                            // time constant of cooling [s]
  double heat = 0.0;                                // q at the stop command [J/kg]
  double friction = 0.0;                            // cap of F_b/W on level ground, inf without [1]
};

// What makes a stop longer than the model says, beside its force and dead time.
struct StopErrors {
  double speed;        // the vehicle may be faster than planned by this [m/s]
  bool drive_cut;      // the drive may be cut in the dead time, so that a slope speeds it up
  double height;       // the stop may fall by this much further than the map says [m]
  double along_track;  // it may begin so much farther along than planned [m]
  double latency;      // it may be commanded so much later than planned [s]
};

}  // namespace slopewise
