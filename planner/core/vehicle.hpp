// Vehicle, terrain and limits as plain numbers, and what acts on the motion of a stop.
#pragma once

#include <array>
#include <cstddef>

namespace slopewise {

// The scalars of a model; SI. Loads and forces are shares of the weight.
struct Vehicle {
  double rear_lever;       // cg_z / (L − cg_x) [1]
  double front_lever;      // cg_z / cg_x [1]
  double side_lever;       // 2 cg_z / B [1]
  double min_load;         // share of its static load that every axle, side and wheel keeps [1]
  double resistance;       // f_r [1]
  double turning_drag;     // μ_t L / 2 of a skid-steer vehicle, else 0 [m]
  double half_slip_track;  // B_s / 2 of a skid-steer vehicle, else B / 2 [m]
  double max_wheel_speed;  // [m/s]
  double specific_force;   // highest drive force over weight [1]
  double specific_power;   // drive power over weight [m/s]
  double speed;            // [m/s]
  double accel;            // [m/s²]
  double decel;            // [m/s²], inf to brake as hard as the model allows
  double lateral_accel;    // [m/s²]
  double vertical_accel;   // [m/s²]
  double ahead;            // cg_x / L [1]
  double high;             // cg_z / L [1]
  double brake_share;      // of the front axle [1], -1 where none locks alone
  double crest_share;      // of the load lost over a crest, which the force loses as well [1]
  double holding;          // share of the slope that brakes and friction hold at rest [1]
};

struct VehicleField {
  const char* name;
  double Vehicle::* member;
};

// By the names of planner/planning_limits.py.
inline constexpr auto vehicle_fields = std::to_array<VehicleField>({
    {"rear_lever", &Vehicle::rear_lever},
    {"front_lever", &Vehicle::front_lever},
    {"side_lever", &Vehicle::side_lever},
    {"min_load", &Vehicle::min_load},
    {"resistance", &Vehicle::resistance},
    {"turning_drag", &Vehicle::turning_drag},
    {"half_slip_track", &Vehicle::half_slip_track},
    {"max_wheel_speed", &Vehicle::max_wheel_speed},
    {"specific_force", &Vehicle::specific_force},
    {"specific_power", &Vehicle::specific_power},
    {"speed", &Vehicle::speed},
    {"accel", &Vehicle::accel},
    {"decel", &Vehicle::decel},
    {"lateral_accel", &Vehicle::lateral_accel},
    {"vertical_accel", &Vehicle::vertical_accel},
    {"ahead", &Vehicle::ahead},
    {"high", &Vehicle::high},
    {"brake_share", &Vehicle::brake_share},
    {"crest_share", &Vehicle::crest_share},
    {"holding", &Vehicle::holding},
});
static_assert(sizeof(Vehicle) == vehicle_fields.size() * sizeof(double));

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
