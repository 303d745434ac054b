// Turns of a path against the steering, from the curvature along it alone, in separate steps.
//
// The angle β between path and body obeys dβ/ds = κ − sin β / e; the wheels stand at
// tan δ = (arm / e) tan β, and where the reference point is the steering centre, at tan δ = arm κ.
#pragma once

#include "verify/candidate.hpp"

namespace slopewise::verify {

// Share by which curvature and rate may be exceeded [1]: curvature at stations, linear between them,
// against the turns of a polyline.
inline constexpr double steering_tolerance = 0.05;

// Of the integrator between two stations [1]: 0.25 m are then a tenth of e of a vehicle with a
// wheelbase of 1.2 m.
inline constexpr int steering_substeps = 4;

// Limits of the steering, as of slopewise.models.steering.SteeringGeometry.
struct SteeringTerms {
  double centre_offset, arm;  // [m]
  double max_curvature;       // [1/m], or inf
  double max_rate;            // of the steering angle [rad/s], or inf
};

namespace detail {

// Of a steady turn with the mean curvature of the first e of the path.
[[nodiscard]] inline double first_angle(const Track& track, double rod) noexcept {
  double total = 0.0, count = 0.0;
  for (Index k = 0; k < track.stations; ++k) {
    total += track.curvature[k];
    count += 1.0;
    if (track.station[k] - track.station[0] >= rod) break;
  }
  return std::asin(min_of(max_of(rod * total / count, -1.0), 1.0));
}

// β a step further, by Heun's method, the curvature linear in between.
[[nodiscard]] inline double next_angle(double beta, double first, double second, double step,
                                       double rod) noexcept {
  if (rod == 0.0) return 0.0;
  const double h = step / steering_substeps;
  for (int n = 0; n < steering_substeps; ++n) {
    const double u = static_cast<double>(n) / steering_substeps;
    const double w = static_cast<double>(n + 1) / steering_substeps;
    const double here = first + u * (second - first) - std::sin(beta) / rod;
    const double there = first + w * (second - first) - std::sin(beta + h * here) / rod;
    beta += 0.5 * h * (here + there);
  }
  return min_of(max_of(beta, -1.5), 1.5);
}

}  // namespace detail

// Walk a track once: `excess` (N,) receives the curvature beyond the largest one, <= 0 within it
// [1/m], `max_speed` (N,) what the rate of the steering angle allows up to the next station [m/s].
// Near the first station the heading of the body is an assumption, which decays like exp(−s/e): the
// tolerance is wider there by that.
inline void follow_steering(const Track& track, const SteeringTerms& terms, double* excess,
                            double* max_speed) noexcept {
  std::fill_n(excess, track.stations, -infinite);
  std::fill_n(max_speed, track.stations, infinite);
  if (std::isinf(terms.max_curvature) && std::isinf(terms.max_rate)) return;
  const double rod = terms.centre_offset;
  double beta = detail::first_angle(track, rod), before = 0.0, driven = 0.0, step = 0.0;
  for (Index k = 0; k < track.stations; ++k) {
    if (k > 0) {
      step = track.station[k] - track.station[k - 1];
      step *= std::cos(0.5 * (track.grade[k] + track.grade[k - 1]));
      driven += step;
      beta = detail::next_angle(beta, track.curvature[k - 1], track.curvature[k], step, rod);
    }
    const double curvature = rod == 0.0 ? track.curvature[k] : std::sin(beta) / rod;
    const double slack =
        rod == 0.0 ? steering_tolerance : steering_tolerance + std::exp(-driven / rod);
    // κ of the steering centre is that of the path over the cosine of β.
    const double angle = std::atan(terms.arm * curvature / max_of(std::cos(beta), 1e-6));
    if (k > 0) {
      excess[k] = std::abs(curvature) - (1.0 + slack) * terms.max_curvature;
      const double turned = std::abs(angle - before);
      if (turned > 0.0) max_speed[k - 1] = (1.0 + slack) * terms.max_rate * step / turned;
    }
    before = angle;
  }
}

}  // namespace slopewise::verify
