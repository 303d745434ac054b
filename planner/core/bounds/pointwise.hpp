// What each station says by itself: may the vehicle stand there, and how fast may it pass?
//
// Passes run along rows, a lane for each candidate, without branches: they vectorise. The laws
// stand in `models` with their sources; they are written out here in sines and cosines that the
// terrain already has, and tests hold both against each other.
#pragma once

#include "bounds/bound_problem.hpp"
#include "bounds/contact_bound.hpp"

namespace slopewise {

// Share of the lateral acceleration that any bank leaves to a turn [1]: standing there is allowed.
inline constexpr double least_turn = 0.1;

// Lateral acceleration that the limit leaves to a turn on a bank [m/s²]. A bank that falls away
// from the turn is felt as well; of what it leaves, never nothing.
[[nodiscard]] inline double lateral_reach(const Stance& stance, const Vehicle& v) noexcept {
  const double felt = v.lateral_accel - gravity * max_of(stance.outward(), 0.0);
  return max_of(felt, least_turn * v.lateral_accel);
}

// Highest v² |κ| that keeps both sides and every wheel loaded at a held speed [m/s²].
[[nodiscard]] inline double side_reach(const Stance& stance, const Vehicle& v) noexcept {
  const double spare = (axle_share(stance, v) - v.min_load) * (1.0 / v.side_lever);
  return max_of(gravity * (spare - stance.outward()), 0.0) * stance.cos_lean;
}

namespace detail {

// What the passes over a row leave for the next ones.
struct PointLanes {
  Lane cosine, cos_lean, crest_sq, friction_sq, grip, holds;
  LaneLabels known, trained, barred;
};

// Row k of a tile: terrain, forces, limits; and what the passes make of it.
struct PointRow {
  const double *sine, *sin_roll, *bend, *vertical;                // terrain
  const double *dead_time, *slowest, *fastest;                    // brakes
  const double *lower_slope, *lower_intercept, *upper_slope, *upper_intercept;
  const double *path_speed, *rough_speed, *steering_speed, *excess, *friction, *top;
  const std::int64_t* hazard;
  const unsigned char *known, *trained;  // as bytes: gcc widens no bools
  double *left_slope, *left_intercept, *speed_sq_max, *accel_max, *lift, *lift_per_speed_sq, *demand;
  Label *limiting, *barrier;
  std::int64_t* barrier_station;
  PointLanes* passed;

  PointRow(const BoundProblem& p, const Bounds& out, Index k, PointLanes& lanes) noexcept
      : sine(p.terrain.sin_grade.at(k)), sin_roll(p.terrain.sin_roll.at(k)),
        bend(p.terrain.curvature.at(k)), vertical(p.terrain.vertical_curvature.at(k)),
        dead_time(p.forces.dead_time.at(k)), slowest(p.forces.slowest.at(k)),
        fastest(p.forces.fastest.at(k)), lower_slope(p.forces.lower_slope.at(k)),
        lower_intercept(p.forces.lower_intercept.at(k)), upper_slope(p.forces.upper_slope.at(k)),
        upper_intercept(p.forces.upper_intercept.at(k)), path_speed(p.path_speed.at(k)),
        rough_speed(p.rough_speed.at(k)), steering_speed(p.steering_speed.at(k)),
        excess(p.excess.at(k)), friction(alike_infinite.unless(p.friction).at(k)),
        top(p.top),
        hazard(p.hazard.at(k)),
        known(reinterpret_cast<const unsigned char*>(p.terrain.known.at(k))),
        trained(reinterpret_cast<const unsigned char*>(p.forces.trained.at(k))),
        left_slope(out.lower_slope.at(k)), left_intercept(out.lower_intercept.at(k)),
        speed_sq_max(out.speed_sq_max.at(k)), accel_max(out.accel_max.at(k)),
        lift(out.lift.at(k)), lift_per_speed_sq(out.lift_per_speed_sq.at(k)),
        demand(out.demand.at(k)), limiting(out.limiting.at(k)), barrier(out.barrier),
        barrier_station(out.barrier_station), passed(&lanes) {}

  [[nodiscard]] Stance stance(std::size_t j) const noexcept {
    const double cosine = passed->cosine[j], cos_lean = passed->cos_lean[j];
    return {sine[j],           cosine,  cos_lean,   cosine * sin_roll[j],
            cosine * cos_lean, bend[j], vertical[j]};
  }
  [[nodiscard]] SpeedRange speeds(std::size_t j) const noexcept {
    return {min_of(min_of(top[j], path_speed[j]), fastest[j]), slowest[j]};
  }
  [[nodiscard]] ForceLine lower(std::size_t j) const noexcept {
    return {left_slope[j], left_intercept[j]};
  }
  [[nodiscard]] ForceLine upper(std::size_t j) const noexcept {
    return {upper_slope[j], upper_intercept[j]};
  }
};

inline void prepare(const PointRow& row, std::size_t lanes) noexcept {
  for (std::size_t j = 0; j < lanes; ++j) {
    row.passed->cosine[j] = std::sqrt(1.0 - row.sine[j] * row.sine[j]);
    row.passed->cos_lean[j] = std::sqrt(1.0 - row.sin_roll[j] * row.sin_roll[j]);
  }
  for (std::size_t j = 0; j < lanes; ++j) {
    row.passed->known[j] = row.known[j];
    row.passed->trained[j] = row.trained[j];
  }
}

// Speed over crests and through dips, and with friction on banks and in turns.
template <bool slips>
void press(const PointRow& row, const Vehicle v, std::size_t lanes) noexcept {
  SLOPEWISE_INDEPENDENT
  for (std::size_t j = 0; j < lanes; ++j) {
    const Stance stance = row.stance(j);
    const SpeedRange speeds = row.speeds(j);
    ForceLine lower{row.lower_slope[j], row.lower_intercept[j]};
    row.passed->holds[j] =
        speeds.slow * lower.slope + lower.intercept - v.holding * std::fabs(stance.sine);
    const double reached = row.excess[j] + v.decel * row.dead_time[j];
    const double crest_sq = crest_speed_sq(stance, speeds, lower, reached, v);
    row.passed->crest_sq[j] = crest_sq;
    if constexpr (slips) {
      const double mu = row.friction[j], friction_sq = friction_speed_sq(stance, mu, v);
      const double top = min_of(min_of(speeds.cap * speeds.cap, crest_sq), friction_sq);
      const Grip grip = grip_at(stance, mu, top, v);
      lower = capped(lower, speeds, grip.braking);
      row.passed->friction_sq[j] = friction_sq;
      row.passed->grip[j] = grip.force;
    }
    row.left_slope[j] = lower.slope;
    row.left_intercept[j] = lower.intercept;
  }
}

// Thrust that holds the speed, and acceleration that thrust and front axle allow.
inline void drive(const PointRow& row, const Vehicle v, std::size_t lanes) noexcept {
  const double per_lever = 1.0 / v.front_lever;
  SLOPEWISE_INDEPENDENT
  for (std::size_t j = 0; j < lanes; ++j) {
    const Stance stance = row.stance(j);
    const double resistance = v.resistance + v.turning_drag * stance.bend();
    const double held = stance.sine + resistance * stance.cosine;
    const double thrust = gravity * (min_of(v.specific_force, row.passed->grip[j]) - held);
    // Bank, turn and drive take load from the same front wheel.
    const double level = gravity * ((stance.upright - v.min_load) * per_lever - stance.sine);
    const double across = v.side_lever * per_lever;
    const double lifting = level - gravity * across * std::fabs(stance.bank);
    row.accel_max[j] = max_of(min_of(v.accel, min_of(thrust, lifting)), 0.0);
    row.lift[j] = level - gravity * across * stance.outward();
    row.lift_per_speed_sq[j] = across * stance.bend() / stance.cos_lean;
    row.demand[j] = held;
  }
}

// Why brakes, drive or friction do not let the vehicle stand there; the last reason counts.
inline void hold(const PointRow& row, const Vehicle v, std::size_t lanes) noexcept {
  SLOPEWISE_INDEPENDENT
  for (std::size_t j = 0; j < lanes; ++j) {
    const Stance stance = row.stance(j);
    const double least = row.lower(j).least(row.speeds(j)), demand = row.demand[j];
    const double sticks = row.friction[j] * stance.upright;
    const double climbs = std::sqrt(max_of(sticks * sticks - stance.bank * stance.bank, 0.0));
    const double holds =
        min_of(row.passed->holds[j], climbs - v.holding * std::fabs(stance.sine));
    const bool slips = (std::fabs(stance.bank) >= sticks) | (demand > climbs);
    Label why = row.path_speed[j] <= 0.0 ? limiting::speed_limit : limiting::none;
    why = demand > v.specific_force ? limiting::traction : why;
    why = least + stance.sine < least_slowing ? limiting::stopping_path : why;
    why = holds < 0.0 ? limiting::holding : why;
    row.passed->barred[j] = slips ? limiting::friction : why;
  }
}

// Why its loads, what is in its way or what is not known do not.
inline void stand(const PointRow& row, const Vehicle v, std::size_t lanes) noexcept {
  SLOPEWISE_INDEPENDENT
  for (std::size_t j = 0; j < lanes; ++j) {
    const Stance stance = row.stance(j);
    const double braking = row.upper_intercept[j] + row.slowest[j] * row.upper_slope[j];
    const double rear = stance.upright + v.rear_lever * min_of(stance.sine, -braking);
    const double axle = min_of(rear, stance.upright - v.front_lever * stance.sine);
    const double side = stance.upright - v.side_lever * std::fabs(stance.bank);
    // A wheel carries what is left of its axle's share and of its side's.
    const double wheel = axle + side - stance.upright;
    Label why = min_of(side, wheel) < v.min_load ? limiting::rollover : row.passed->barred[j];
    why = axle < v.min_load ? limiting::tip_over : why;
    why = row.hazard[j] == 0 ? why : row.hazard[j];
    why = row.passed->trained[j] != 0 ? why : limiting::model_validity;
    row.passed->barred[j] = row.passed->known[j] != 0 ? why : limiting::unknown_terrain;
  }
}

// v² by limits, curvature, wheels, power, roughness, steering and contact, one after the other.
template <class Take>
void speeds_of(const PointRow& row, const Vehicle& v, std::size_t j, const Take& take) noexcept {
  const Stance stance = row.stance(j);
  const double bend = stance.bend(), per_bend = 1.0 / bend;
  const auto take_speed = [&take](double speed, Label why) noexcept { take(speed * speed, why); };
  take_speed(min_of(row.top[j], row.path_speed[j]), limiting::speed_limit);
  take_speed(row.fastest[j], limiting::model_validity);
  take(lateral_reach(stance, v) * stance.cos_lean * per_bend, limiting::lateral);
  take(side_reach(stance, v) * per_bend, limiting::rollover);
  take_speed(v.max_wheel_speed / (1.0 + bend * v.half_slip_track), limiting::wheel_speed);
  take_speed(v.specific_power / max_of(row.demand[j], 0.0), limiting::traction);
  take_speed(row.rough_speed[j], limiting::roughness);
  take_speed(row.steering_speed[j], limiting::steering);
  take(row.passed->crest_sq[j], limiting::crest);
  take(row.passed->friction_sq[j], limiting::friction);
}

// The lowest of them; earlier names win ties, and NaN (0 over 0) never does.
inline void bound_speed(const PointRow& row, const Vehicle v, std::size_t lanes) noexcept {
  SLOPEWISE_INDEPENDENT
  for (std::size_t j = 0; j < lanes; ++j) {
    double lowest = no_limit;
    Label why = limiting::speed_limit;
    speeds_of(row, v, j, [&](double speed_sq, Label other) noexcept {
      why = speed_sq < lowest ? other : why;
      lowest = min_of(lowest, speed_sq);
    });
    row.speed_sq_max[j] = lowest;
    row.limiting[j] = why;
  }
}

// The first station that is barred closes the way for good.
inline void close(const PointRow& row, Index k, std::size_t lanes) noexcept {
  SLOPEWISE_INDEPENDENT
  for (std::size_t j = 0; j < lanes; ++j) {
    const Label why = row.passed->barred[j];
    const bool before = k < row.barrier_station[j];
    const bool closes = before & (why != limiting::none), passed = before & (why == limiting::none);
    const Label end = closes ? why : row.barrier[j];
    row.barrier[j] = end;
    row.barrier_station[j] = closes ? k : row.barrier_station[j];
    row.speed_sq_max[j] = passed ? row.speed_sq_max[j] : 0.0;
    row.limiting[j] = passed ? row.limiting[j] : end;
    row.accel_max[j] = before ? row.accel_max[j] : 0.0;
    row.demand[j] = before ? row.demand[j] : 0.0;
  }
}

// Could an axle, side or wheel become too light during a stop, at the highest speed that any
// candidate has here? Notes the last such station.
inline void look_for_risks(const PointRow& row, const Vehicle v, Index k, std::size_t lanes,
                           LaneLabels& last_risk) noexcept {
  SLOPEWISE_INDEPENDENT
  for (std::size_t j = 0; j < lanes; ++j) {
    const Stance stance = row.stance(j);
    const SpeedRange speeds = row.speeds(j);
    const double cap = speeds.cap, braking = row.upper(j).most(speeds);
    const double up = stance.upright - stance.crest() * cap * cap * (1.0 / gravity);
    const double turn = stance.bend() * cap * cap / (gravity * stance.cos_lean);
    const double side =
        up - v.side_lever * max_of(std::fabs(stance.bank), std::fabs(stance.outward() + turn));
    const double held = min_of(v.rear_lever * stance.sine, -v.front_lever * stance.sine);
    const double axle = up + min_of(held, -v.rear_lever * braking);
    const bool light = (min_of(axle, side) < v.min_load) | (axle + side - up < v.min_load);
    last_risk[j] = light & (k < row.barrier_station[j]) ? k : last_risk[j];
  }
}

// Lower a row until v² linear to its neighbours stays below the bounds between them.
//
// Curvature and slopes are linear there, so a bound on v² falls like a hyperbola towards a lower
// neighbour: it stays above its tangent there. That costs second order in the spacing.
inline void lower_between(const Bounds& out, Index k, Index lanes, Lane& before,
                          LaneLabels& why_before) noexcept {
  double *bound = out.speed_sq_max.at(k), *ahead = out.speed_sq_max.at(k + 1);
  Label *label = out.limiting.at(k), *label_ahead = out.limiting.at(k + 1);
  const std::int64_t* barrier_station = out.barrier_station;
  SLOPEWISE_INDEPENDENT
  for (Index j = 0; j < lanes; ++j) {
    const auto n = static_cast<std::size_t>(j);
    const double here = bound[j], last = before[n], next = ahead[j];
    const Label why = label[j], why_last = why_before[n];
    const double from_last = last * (2.0 - last / here), from_next = next * (2.0 - next / here);
    const bool behind = (last < here) & (from_last < here);
    const double least = behind ? from_last : here;
    const Label why_least = behind ? why_last : why;
    const bool lower = (next < here) & (from_next < least) & (k + 1 < barrier_station[j]);
    bound[j] = lower ? from_next : least;
    label[j] = lower ? label_ahead[j] : why_least;
    before[n] = here;
    why_before[n] = why;
  }
}

}  // namespace detail

// Bounds of each station of a tile by itself, and the first one that bars the way; `last_risk` is
// the last station at which a load may run short during a stop, -1 where none may.
inline void bound_points(const BoundProblem& problem, Index lanes, const Bounds& out,
                         LaneLabels& last_risk) noexcept {
  const Index stations = problem.terrain.stations;
  last_risk.fill(-1);
  std::fill_n(out.barrier, lanes, limiting::stopping_path);
  std::copy_n(problem.terrain.counts, lanes, out.barrier_station);
  const Vehicle& vehicle = problem.vehicle;
  const auto count = static_cast<std::size_t>(lanes);
  detail::PointLanes passed{};
  passed.friction_sq.fill(no_limit);
  passed.grip.fill(no_limit);
  for (Index k = 0; k < stations; ++k) {
    const detail::PointRow row(problem, out, k, passed);
    detail::prepare(row, count);
    if (problem.friction.data != nullptr) {
      detail::press<true>(row, vehicle, count);
    } else {
      detail::press<false>(row, vehicle, count);
    }
    detail::drive(row, vehicle, count);
    detail::hold(row, vehicle, count);
    detail::stand(row, vehicle, count);
    detail::bound_speed(row, vehicle, count);
    if (problem.curves != nullptr) {
      detail::speeds_of(row, vehicle, 0, [&](double speed_sq, Label why) noexcept {
        if (speed_sq >= 0.0) problem.curves[why * stations + k] = speed_sq;
      });
    }
    detail::close(row, k, count);
    detail::look_for_risks(row, vehicle, k, count, last_risk);
  }
  Lane before{};
  LaneLabels why_before{};
  std::copy_n(out.speed_sq_max.at(0), lanes, before.begin());
  std::copy_n(out.limiting.at(0), lanes, why_before.begin());
  for (Index k = 0; k + 1 < stations; ++k) {
    detail::lower_between(out, k, lanes, before, why_before);
  }
}

}  // namespace slopewise
