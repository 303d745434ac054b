// The body on its springs over one wheel: y'' = ω² (h − y) + 2 ζ ω (h' − y'), with h the path of
// the centre of the wheel, ω and ζ the frequency and damping of the bounce. Source: Gillespie,
// Fundamentals of Vehicle Dynamics (1992), Ch. 5.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <compare>
#include <numbers>

#include "swept/tyre_profile.hpp"

namespace slopewise {

// Speeds tried, and the ratio of each to the next.
inline constexpr int speed_levels = 4;
inline constexpr double speed_ratio = 0.7;

// Stations: that the rim reaches, that the tyre touches on each side of the middle, that the rear
// wheels are behind, that a speed is held before; behind the first one that the body has come over.
struct RideStations {
  Index rim, patch, rear, ahead, pre_roll;

  auto operator<=>(const RideStations&) const = default;
};

// Frequency of the bounce [Hz], its share of the critical damping [1]; highest amplitude of the
// vertical acceleration [m/s²] and speed [m/s]; noise of the heights of cells that is not averaged
// away, independent of each other, and edge of one [m].
struct RideLimits {
  double frequency, damping, vertical_accel, speed, noise = 0.0, cell = 1.0;
};

// The quarter car on stations a spacing apart, and how its wheel rolls over them.
struct QuarterCar : RideStations {
  double frequency, damping;  // of the bounce [rad/s], share of the critical one [1]
  double limit;               // highest amplitude of the vertical acceleration [m/s²]
  double slowest;             // of the speeds that are tried [m/s]
  double spacing;             // [m]
  double radius;              // of the wheel [m]
  double noise, cell;         // as of RideLimits

  QuarterCar(const VehicleEnvelope& sizes, const RideLimits& ride, double station_spacing) noexcept
      : RideStations{static_cast<Index>(contact_of(sizes) / station_spacing),
                     static_cast<Index>(0.5 * patch_radii * sizes.radius / station_spacing),
                     static_cast<Index>(std::ceil(2.0 * sizes.half_length / station_spacing)),
                     std::max<Index>(
                         static_cast<Index>(std::ceil(sizes.radius / station_spacing)), 1),
                     static_cast<Index>(std::ceil(pre_roll_wheelbases * 2.0 * sizes.half_length /
                                                  station_spacing))},
        frequency(2.0 * std::numbers::pi * ride.frequency), damping(ride.damping),
        limit(ride.vertical_accel), slowest(ride.speed * std::pow(speed_ratio, speed_levels - 1)),
        spacing(station_spacing), radius(sizes.radius), noise(ride.noise), cell(ride.cell) {}

 private:
  // Length of the tyre's contact, over which it evens the ground out, in wheel radii.
  static constexpr double patch_radii = 0.5;
  static constexpr double pre_roll_wheelbases = 2.0;

  // Where the rim is higher than any step that may be climbed, it touches nothing.
  static double contact_of(const VehicleEnvelope& sizes) noexcept {
    const double above = max_of(sizes.radius - sizes.max_step, 0.0);
    return std::sqrt(sizes.radius * sizes.radius - above * above);
  }
};

// One station at one speed: y and q = y' − 2 ζ ω h follow from y, q, h and the next h.
class BounceStep {
 public:
  // Exact for heights that are linear in between: the exponential of [y, q / ω, h, h' Δt].
  BounceStep(const QuarterCar& car, double time) noexcept
      : drag(static_cast<float>(2.0 * car.damping * car.frequency)),
        per_time(static_cast<float>(1.0 / time)),
        keep(static_cast<float>(
            std::exp(-0.5 * car.frequency * time / (std::numbers::pi * memory_periods)))) {
    const double w = car.frequency, z = car.damping;
    int halvings = 0;
    while (w * time > 0.5 * std::exp2(halvings)) ++halvings;
    const double t = time / std::exp2(halvings);
    Matrix m{};
    m[0] = {0.0, w * t, 2.0 * z * w * t, 0.0};
    m[1] = {-w * t, -2.0 * z * w * t, (1.0 - 4.0 * z * z) * w * t, 0.0};
    m[2][3] = t / time;
    Matrix e = exponential(m);
    for (int n = 0; n < halvings; ++n) e = product(e, e);
    yy = static_cast<float>(e[0][0]);
    yq = static_cast<float>(e[0][1] / w);
    yh = static_cast<float>(e[0][2] - e[0][3]);
    yn = static_cast<float>(e[0][3]);
    qy = static_cast<float>(e[1][0] * w);
    qq = static_cast<float>(e[1][1]);
    qh = static_cast<float>((e[1][2] - e[1][3]) * w);
    qn = static_cast<float>(e[1][3] * w);
  }

  // Mean square of the acceleration on flat ground whose cells have this noise [m²/s⁴]: the squares
  // of the answer to one cell, a hat of that height, summed over the stations, for each cell.
  [[nodiscard]] float noise_power(const QuarterCar& car) const noexcept {
    if (car.noise == 0.0) return 0.0F;
    const auto reach = static_cast<Index>(std::ceil(car.cell / car.spacing));
    const double settled = settled_periods * 2.0 * std::numbers::pi / car.frequency;
    const Index end = reach + static_cast<Index>(settled * per_time);
    const auto hat = [&](Index k) {
      return max_of(1.0 - std::abs(static_cast<double>(k)) * car.spacing / car.cell, 0.0);
    };
    double y = 0.0, q = 0.0, squares = 0.0;
    for (Index k = -reach; k < end; ++k) {
      const double h = hat(k), n = hat(k + 1);
      const double next_q = qy * y + qq * q + qh * h + qn * n;
      y = yy * y + yq * q + yh * h + yn * n;
      const double accel = (next_q - q + drag * (n - h)) * per_time;
      q = next_q;
      squares += accel * accel;
    }
    const double of_cells = car.noise * car.noise * between_cells * car.spacing / car.cell;
    return static_cast<float>(of_cells * squares);
  }

  float yy, yq, yh, yn, qy, qq, qh, qn;
  float drag, per_time;  // 2 ζ ω, 1 / Δt [1/s]
  float keep;            // what the mean square keeps [1]

 private:
  static constexpr double settled_periods = 4.0;  // of the bounce, after which little is left
  // Variance of a height between two rows of cells, in that of a cell: the mean of w² + (1 − w)².
  static constexpr double between_cells = 2.0 / 3.0;

  using Matrix = std::array<std::array<double, 4>, 4>;

  // Time over which the mean square is taken, in periods: about as long as a bounce lasts.
  static constexpr double memory_periods = 1.0 / 3.0;

  static Matrix product(const Matrix& a, const Matrix& b) noexcept {
    Matrix out{};
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j < 4; ++j) {
        for (std::size_t k = 0; k < 4; ++k) out[i][j] += a[i][k] * b[k][j];
      }
    }
    return out;
  }

  // Taylor's series, of a matrix whose entries are at most 1/2.
  static Matrix exponential(const Matrix& m) noexcept {
    Matrix sum{}, term{};
    for (std::size_t i = 0; i < 4; ++i) sum[i][i] = term[i][i] = 1.0;
    for (int n = 1; n < 16; ++n) {
      term = product(term, m);
      for (std::size_t i = 0; i < 4; ++i) {
        for (std::size_t j = 0; j < 4; ++j) sum[i][j] += term[i][j] /= n;
      }
    }
    return sum;
  }
};

// One station of W lanes, each of a separate spacing, at one speed.
template <int W>
struct BounceSteps {
  std::array<float, W> yy, yq, yh, yn, qy, qq, qh, qn, per_time, keep;
  std::array<float, W> noise;  // mean square that is no more than noise of the map [m²/s⁴]
  float drag;  // depends on no spacing

  void set(std::size_t lane, const BounceStep& step, float noise_power) noexcept {
    yy[lane] = step.yy;
    yq[lane] = step.yq;
    yh[lane] = step.yh;
    yn[lane] = step.yn;
    qy[lane] = step.qy;
    qq[lane] = step.qq;
    qh[lane] = step.qh;
    qn[lane] = step.qn;
    per_time[lane] = step.per_time;
    keep[lane] = step.keep;
    drag = step.drag;
    noise[lane] = noise_powers * noise_power;
  }

 private:
  // Power that counts as noise, in the mean power of noise [1]: running means over a third of a
  // period reach it seldom, so that flat ground keeps 95 % of its speed under 3 to 6 cm of noise.
  static constexpr float noise_powers = 12.0F;
};

}  // namespace slopewise
