// Structs of the core from the named tuples of Python: fields are read by name.
#pragma once

#include "bindings/bindings.hpp"
#include "vehicle.hpp"

namespace slopewise {

// Of a `PlanningLimits`.
inline Vehicle vehicle_of(const nb::handle& limits) {
  Vehicle vehicle{};
  for (const VehicleField& field : vehicle_fields) {
    vehicle.*field.member = nb::cast<double>(limits.attr(field.name));
  }
  return vehicle;
}

// Of a `MotionTerms`.
inline MotionTerms motion_of(const nb::handle& motion) {
  MotionTerms terms;
  const nb::tuple values(motion.attr("values"));
  if (values.size() > terms.values.size()) {
    throw nb::value_error("values: expected those of all motion laws, got more");
  }
  for (std::size_t n = 0; n < values.size(); ++n) terms.values[n] = nb::cast<double>(values[n]);
  terms.moves = nb::cast<bool>(motion.attr("moves"));
  terms.lag = nb::cast<double>(motion.attr("lag"));
  terms.fade = nb::cast<double>(motion.attr("fade"));
  terms.fade_tau = nb::cast<double>(motion.attr("fade_tau"));
  terms.heat = nb::cast<double>(motion.attr("heat"));
  terms.friction = nb::cast<double>(motion.attr("friction"));
  return terms;
}

// Of a `StopErrors`.
inline StopErrors errors_of(const nb::handle& errors) {
  return {nb::cast<double>(errors.attr("speed")), nb::cast<bool>(errors.attr("drive_cut")),
          nb::cast<double>(errors.attr("height")), nb::cast<double>(errors.attr("along_track")),
          nb::cast<double>(errors.attr("latency"))};
}

}  // namespace slopewise
