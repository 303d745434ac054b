// How hard the wheels press, and what friction then gives: crests, dips, banks and turns.
//
// A crest takes load from every wheel and force from the brakes, more of both the faster it is
// passed: it bounds the speed (what it takes of the force: crest_force.hpp). Where friction is
// known, slope, turn, brakes and drive share it.
//
// Laws: models/laws/crest, friction_ellipse, holding and wheel_lockup; written out here in sines
// and cosines that the terrain already has, and held against those by tests.
#pragma once

#include <cmath>

#include "profile/time_optimal.hpp"
#include "vehicle.hpp"

namespace slopewise {

// Least F_b/W + sin θ [1]: below it the brakes hardly slow the vehicle, let alone stop it.
inline constexpr double least_slowing = 0.02;
// Share of what the brakes have beyond it that a crest may take [1].
inline constexpr double crest_spent = 0.8;
// Highest share of friction that a turn may take, as of models/laws/friction_ellipse [1].
inline constexpr double turning_share = 0.8;
// In place of a curvature or a force of zero.
inline constexpr double nearly_zero = 1e-12;

// How the vehicle stands at a station.
struct Stance {
  double sine, cosine;        // of the grade, uphill positive
  double cos_lean;            // cosine of the roll
  double bank;                // cos(grade) sin(roll), left side up positive
  double upright;             // share of the weight that presses on the ground
  double curvature;           // [1/m]
  double vertical_curvature;  // negative over a crest [1/m]

  [[nodiscard]] double bend() const noexcept { return std::fabs(curvature); }
  // Bank that falls away from the turn.
  [[nodiscard]] double outward() const noexcept { return curvature > 0.0 ? bank : -bank; }
  [[nodiscard]] double crest() const noexcept { return max_of(-vertical_curvature, 0.0); }
};

// Speeds that a station may be passed at [m/s].
struct SpeedRange {
  double cap;         // by model, path and training
  double slow, fast;  // between which the force changes with the speed

  SpeedRange(double highest, double slowest) noexcept
      : cap(highest), slow(slowest), fast(max_of(highest, slowest)) {}
};

// A bound of F_b/W.
struct ForceLine {
  double slope, intercept;  // [s/m], [1]

  [[nodiscard]] double least(const SpeedRange& v) const noexcept {
    return intercept + min_of(v.slow * slope, v.fast * slope);
  }
  [[nodiscard]] double most(const SpeedRange& v) const noexcept {
    return intercept + max_of(v.slow * slope, v.fast * slope);
  }
};

// Load of the lighter axle at a held speed, share of the weight.
[[nodiscard]] inline double axle_share(const Stance& stance, const Vehicle& v) noexcept {
  return stance.upright + min_of(v.rear_lever * stance.sine, -v.front_lever * stance.sine);
}

// Highest v² at which wheels and brakes keep enough load over a crest, and the body is not pressed
// too much in a dip [m²/s²]. A stop that was commanded before the crest passes it faster than the
// plan would, by what is reached beyond it [m/s].
[[nodiscard]] inline double crest_speed_sq(const Stance& stance, const SpeedRange& speeds,
                                           const ForceLine& lower, double reached,
                                           const Vehicle& v) noexcept {
  const double axle = axle_share(stance, v), up = stance.upright;
  const double side = up - v.side_lever * std::fabs(stance.bank);
  // A wheel carries what is left of its axle's share and of its side's.
  const double carried = max_of(axle + side - up - v.min_load, 0.0);
  const double force = lower.least(speeds);
  const double spare = crest_spent * max_of(force + stance.sine - least_slowing, 0.0) /
                       max_of(force * v.crest_share, nearly_zero);
  const double falls = max_of(-stance.vertical_curvature, nearly_zero);
  const double passed = std::sqrt(gravity * min_of(carried, up * spare) / falls);
  const double kept = max_of(passed - reached, 0.5 * passed);
  return min_of(kept * kept, v.vertical_accel / max_of(stance.vertical_curvature, nearly_zero));
}

// Highest v² that friction allows on banks, in turns and over crests [m²/s²].
[[nodiscard]] inline double friction_speed_sq(const Stance& stance, double mu,
                                              const Vehicle& v) noexcept {
  const double up = stance.upright, bend = stance.bend(), outward = stance.outward();
  const double falls = stance.crest();
  const double resistance = v.resistance + v.turning_drag * bend;
  const double along =
      max_of(std::fabs(stance.sine), stance.sine + resistance * stance.cosine) / up;
  const double taken = std::fabs(stance.bank) / up;
  // Half of what holding the speed leaves stays for speeding up, or it would never start.
  const double kept = along + 0.5 * max_of(mu - along, 0.0);
  double share = turning_share * mu + (1.0 - turning_share) * taken;
  share = min_of(share, std::sqrt(max_of(mu * mu - kept * kept, 0.0)));
  share = max_of(share, taken);
  // Both ways of sliding: out of the turn, and down a bank that the turn leans into.
  const double out =
      gravity * max_of(share * up - outward, 0.0) / max_of(bend + share * falls, nearly_zero);
  const double down =
      gravity * max_of(share * up + outward, 0.0) / max_of(share * falls - bend, nearly_zero);
  // And over a crest enough load for the same.
  const double held = along + 0.25 * max_of(mu - along, 0.0);
  const double over = gravity * up * max_of(1.0 - held / max_of(kept, nearly_zero), 0.0) /
                      max_of(falls, nearly_zero);
  return min_of(over, min_of(out, down));
}

// What friction leaves along the path at the highest speed, over the weight.
struct Grip {
  double force;    // of all wheels together
  double braking;  // of the brakes: where an axle may lock alone, less
};

[[nodiscard]] inline Grip grip_at(const Stance& stance, double mu, double speed_sq,
                                  const Vehicle& v) noexcept {
  const double normal = max_of(stance.upright - stance.crest() * speed_sq / gravity, nearly_zero);
  const double sideways = max_of(std::fabs(stance.bank),
                                 std::fabs(stance.outward() + stance.bend() * speed_sq / gravity));
  const double grip = std::sqrt(max_of(mu * mu * normal * normal - sideways * sideways, 0.0));
  const double left = grip / normal;
  const double rear = left * (1.0 - v.ahead) / (1.0 - v.brake_share + left * v.high);
  const double front = left * v.ahead / max_of(v.brake_share - left * v.high, nearly_zero);
  const double alone = normal * min_of(left, min_of(rear, front));
  return {grip, v.brake_share < 0.0 ? grip : alone};
}

// The lower bound of the force where wheels cannot brake harder than this, over the weight.
[[nodiscard]] inline ForceLine capped(const ForceLine& line, const SpeedRange& v,
                                      double most) noexcept {
  const bool slides = line.most(v) > most;
  return {slides ? 0.0 : line.slope, slides ? min_of(line.least(v), most) : line.intercept};
}

}  // namespace slopewise
