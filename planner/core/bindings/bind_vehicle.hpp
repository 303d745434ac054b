// Structs of the core from the named tuples of Python: fields are read by name.
#pragma once

#include <array>
#include <bit>

#include "bindings/bindings.hpp"
#include "vehicle.hpp"

namespace slopewise {

// A struct of doubles from the attributes of these names, which are those of its members in turn.
template <class T, std::size_t N>
T numbers_of(const nb::handle& object, const std::array<const char*, N>& names) {
  static_assert(sizeof(T) == N * sizeof(double));
  std::array<double, N> numbers;
  for (std::size_t n = 0; n < N; ++n) numbers[n] = nb::cast<double>(object.attr(names[n]));
  return std::bit_cast<T>(numbers);
}

template <class T, std::size_t N>
T numbers_of(const nb::handle& object, const char* const (&names)[N]) {
  return numbers_of<T>(object, std::to_array(names));
}

// Of a `PlanningLimits`.
inline Vehicle vehicle_of(const nb::handle& limits) {
  return numbers_of<Vehicle>(limits, vehicle_names);
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
