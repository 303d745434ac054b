// Laws of models/laws and of motion effects. Written by generate_laws.py: do not edit.
// Arguments, units and sources are those of the Python functions of the same names.
#pragma once

#include <cmath>

namespace slopewise::laws {

[[nodiscard]] constexpr double square(double x) noexcept { return x * x; }
[[nodiscard]] constexpr double sign(double x) noexcept {
  return x > 0.0 ? 1.0 : (x < 0.0 ? -1.0 : x);
}

[[nodiscard]] inline double front_load_share(double grade, double roll, double deceleration,
                                             double wheelbase, double cg_x, double cg_z) noexcept {
  return ((((cg_x * std::cos(grade)) * std::cos(roll)) + (cg_z * ((deceleration / 9.80665) -
      std::sin(grade)))) / wheelbase) / (cg_x / wheelbase);
}

[[nodiscard]] inline double rear_load_share(double grade, double roll, double deceleration,
                                            double wheelbase, double cg_x, double cg_z) noexcept {
  const double part0 = (wheelbase - cg_x) * std::sqrt(sign(wheelbase - cg_x));
  return (((part0 * std::cos(grade)) * std::cos(roll)) - (cg_z * ((deceleration / 9.80665) -
      std::sin(grade)))) / part0;
}

[[nodiscard]] inline double left_load_share(double grade, double roll, double lateral_accel,
                                            double track_width, double cg_z) noexcept {
  return (std::cos(roll) * std::cos(grade)) - (((2.0 * cg_z) / track_width) * ((std::cos(grade) *
      std::sin(roll)) + (lateral_accel / 9.80665)));
}

[[nodiscard]] inline double right_load_share(double grade, double roll, double lateral_accel,
                                             double track_width, double cg_z) noexcept {
  return (std::cos(roll) * std::cos(grade)) + (((2.0 * cg_z) / track_width) * ((std::cos(grade) *
      std::sin(roll)) + (lateral_accel / 9.80665)));
}

[[nodiscard]] inline double side_force_ratio(double grade, double roll, double curvature,
                                             double speed_sq) noexcept {
  return (std::sin(roll) * std::cos(grade)) + ((curvature * speed_sq) / 9.80665);
}

[[nodiscard]] inline double normal_ratio(double grade, double roll, double vertical_curvature,
                                         double speed_sq) noexcept {
  const double part0 = (std::cos(grade) * std::cos(roll)) + ((vertical_curvature * speed_sq) /
      9.80665);
  return 0.5 * (part0 + std::fabs(part0));
}

[[nodiscard]] inline double braking_left(double friction, double normal,
                                         double side_force) noexcept {
  const double part0 = (friction * std::sqrt(sign(friction + 1e-300))) * normal;
  const double part1 = (part0 - side_force) * (part0 + side_force);
  return std::sqrt(0.5 * (part1 + std::fabs(part1)));
}

[[nodiscard]] inline double outer_wheel_speed_ratio(double curvature, double slip_track) noexcept {
  return 1.0 + ((0.5 * std::fabs(curvature)) * slip_track);
}

[[nodiscard]] inline double brakes_hold(double force_ratio, double grade) noexcept {
  return force_ratio - std::fabs(std::sin(grade));
}

[[nodiscard]] inline double friction_holds(double friction, double grade, double roll) noexcept {
  return ((friction * std::cos(grade)) * std::cos(roll)) - std::sqrt(square(std::sin(grade)) +
      square(std::sin(roll) * std::cos(grade)));
}

[[nodiscard]] inline double aerodynamic_drag(double speed, double, double, double c) noexcept {
  return (c * speed) * speed;
}

[[nodiscard]] inline double headwind(double speed, double, double yaw, double c, double wind,
                                     double direction) noexcept {
  const double part0 = speed + (wind * std::cos(yaw - direction));
  return c * ((std::fabs(part0) * part0) - square(speed));
}

[[nodiscard]] inline double viscous_resistance(double speed, double, double, double c) noexcept {
  return (9.80665 * c) * speed;
}

[[nodiscard]] inline double turning_resistance(double speed, double curvature, double,
                                               double k) noexcept {
  return (9.80665 * (k * std::fabs(curvature))) * speed;
}

inline constexpr int motion_value_count = 6;
inline constexpr const char* motion_laws = "aerodynamic_drag headwind viscous_resistance turning_resistance";

// Sum of all motion laws [m/s²]; (motion_value_count,) values, 0 of absent effects.
[[nodiscard]] inline double motion_deceleration(double speed, double curvature, double yaw,
                                                const double* values) noexcept {
  return aerodynamic_drag(speed, curvature, yaw, values[0]) +
         headwind(speed, curvature, yaw, values[1], values[2], values[3]) +
         viscous_resistance(speed, curvature, yaw, values[4]) +
         turning_resistance(speed, curvature, yaw, values[5]);
}

}  // namespace slopewise::laws
