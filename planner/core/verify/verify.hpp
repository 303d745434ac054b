// The verifier of a finished plan: is every constraint kept, at the stations and between them?
//
// It shares no approximation with what made the plan: bounds work with tangents and chords of v² and
// with sums of sines, the verifier follows every emergency stop to its end, on the laws of `models`.
#pragma once

#include "verify/safe_stop_speeds.hpp"
#include "verify/verify_terms.hpp"

namespace slopewise::verify {

[[nodiscard]] inline Index verify_memory(Index stations) noexcept {
  return (2 * survey_columns + 4) * stations;
}

namespace detail {

[[nodiscard]] inline double largest(const double* values, Index n, double sign) noexcept {
  double out = sign * values[0];
  for (Index k = 0; k < n; ++k) {
    if (std::isnan(values[k])) return values[k];
    out = max_of(out, sign * values[k]);
  }
  return out;
}

class Verifier {
 public:
  Verifier(const VerifiedPlan& plan, const VerifyTerms& terms, const VerifyNotes& notes,
           double* memory) noexcept
      : plan_(plan), terms_(terms), notes_(notes), n_(plan.track.stations),
        survey_(survey_of(plan.track, terms.body, memory)),
        even_survey_(&plan.even == &plan.track
                         ? survey_
                         : survey_of(plan.even, terms.body, memory + survey_columns * n_)),
        on_{plan.track, survey_}, even_on_{plan.even, even_survey_},
        excess_(memory + 2 * survey_columns * n_), steering_speed_(excess_ + n_),
        safe_(on_, terms.limits, fastest_stop(), steering_speed_ + n_),
        brakes_early_(-largest(plan.track.shortest_dead_time, n_, -1.0) <
                      largest(plan.track.dead_time, n_, 1.0)) {
    follow_steering(plan.track, terms.steering, excess_, steering_speed_);
    const double end = plan.clear_distance - plan.distance_offset - terms.errors.along_track;
    target_ = target_at(on_, end);
    limit_ = max_of(plan.clear_distance, plan.track.station[0]) + 5.0;
  }

  void run() noexcept {
    const double* speed_sq = plan_.speed_sq;
    for (Index k = 0; k < n_; ++k) {
      const Index i = std::min(k, n_ - 2);
      notes_.stop_distance[k] = 0.0;
      notes_.rear_load[k] = survey_.rear[k];
      notes_.side_load[k] = min_of(survey_.left[k], survey_.right[k]);
      const Index points = k + 1 < n_ ? terms_.between + 1 : 1;
      for (Index point = 0; point < points; ++point) {
        const double u = point == 0 ? static_cast<double>(k - i)
                                    : static_cast<double>(point) / static_cast<double>(points);
        if (at(speed_sq, i, u) <= 0.0) continue;
        if (try_stop(k, i, u, point > 0)) mark(i);
      }
      if (terms_.changes && k + 1 < n_ && (speed_sq[k] > 0.0 || speed_sq[k + 1] > 0.0)) {
        const bool changes = judge_change(k), steers = judge_steering(k);
        if (changes || steers) mark(k);
      }
    }
  }

  // From the v² of the plan (N,) to the highest up to which held speeds pass, in so many steps up to
  // `bound`; `profile` holds the v² that are tried. What breaks the first step is in `bad`, of
  // stations.
  void raise(const double* speed_sq, const double* bound, Index steps, double* profile,
             double* highest) noexcept {
    for (Index k = 0; k < n_; ++k) {
      const Index i = std::min(k, n_ - 2);
      highest[k] = speed_sq[k];
      const double above = bound[k] - speed_sq[k];
      for (Index step = 1; above > 0.0 && step <= steps; ++step) {
        profile[k] = speed_sq[k] + static_cast<double>(step) / static_cast<double>(steps) * above;
        const bool is_broken = try_stop(k, i, static_cast<double>(k - i), false);
        if (is_broken && step == 1) mark(k);
        if (is_broken) break;
        highest[k] = profile[k];
      }
    }
  }

 private:
  // Note a breach; what is not a number is one as well.
  bool breaks(Breach kind, double breach) noexcept {
    if (breach <= breach_tolerance) return false;
    double& worst = notes_.worst[static_cast<std::size_t>(kind)];
    worst = max_of(worst, std::isfinite(breach) ? breach : infinite);
    broken_ = broken_bound[static_cast<std::size_t>(kind)];
    return true;
  }

  void mark(Index segment) noexcept {
    if (notes_.bad != nullptr) notes_.bad[segment] = broken_;
  }

  // Highest speed of any stop, with its errors, from up to a planned speed [m/s].
  [[nodiscard]] double fastest_stop() const noexcept {
    const StopErrors& errors = terms_.errors;
    const double least_sine = -largest(survey_.sine, n_, -1.0);
    const double rolls_on =
        errors.drive_cut ? -gravity * (least_sine + terms_.limits.rolling) : 0.0;
    const double onset = std::sqrt(largest(plan_.speed_sq, n_, 1.0)) + errors.speed +
                         max_of(rolls_on, 0.0) * largest(plan_.track.dead_time, n_, 1.0);
    return std::sqrt(onset * onset + 2.0 * gravity * errors.height);
  }

  // The stop of a vehicle that is faster than planned, late, and rolls on in its dead time.
  [[nodiscard]] StopCommand as_it_may_be(const StopCommand& command, Index i) const noexcept {
    const Track& track = plan_.track;
    const StopErrors& errors = terms_.errors;
    const double dead = command.dead_time, speed = command.speed + errors.speed;
    const double late = speed * errors.latency;
    double gain = 0.0;
    if (errors.drive_cut && dead > 0.0) {
      for (Index m = i;; ++m) {
        gain = max_of(gain, -gravity * (survey_.sine[m] + terms_.limits.rolling));
        const double reached = command.station + late + (speed + 0.5 * gain * dead) * dead;
        if (m >= n_ - 1 || (m > i && track.station[m] > reached)) break;
      }
    }
    if (gain <= 0.0) return {command.station, speed, dead + errors.latency, command.slowest};
    const double distance = late + (speed + 0.5 * gain * dead) * dead;
    const double onset = speed + gain * dead;
    return {command.station, onset, distance / onset, command.slowest};
  }

  // Where a stop from segment i ends, and the least loads on it. One that is told as planned needs
  // more than a yes or no, and the map counts as exact.
  double follow(const StopCommand& command, Index i, bool told, StopEnd& stop,
                Shares& least) const noexcept {
    const Surveyed& on = told ? even_on_ : on_;
    const double height = told ? 0.0 : terms_.errors.height;
    if (!terms_.in_time && !told && i >= safe_.first_safe_segment() &&
        ends_before(on, command, target_, height, stop.onset_in)) {
      return min_of(command.station, target_.station);
    }
    const double v_i = command.force_speed();
    const double fastest = std::sqrt(v_i * v_i + 2.0 * gravity * height);
    if (!terms_.in_time && (told || safe_.has_grip(i, fastest, command.station))) {
      StopEnd found = stop;
      stop_by_energy(on, command, height, found);
      if (told || safe_.has_grip(i, fastest, found.station)) {
        stop = found;
        if (told || !safe_.is_loaded(i, fastest, found.station)) {
          least = loads_by_energy(on, command, i, found);
        }
        return found.station;
      }
    }
    const StopModel model{on.track, terms_.limits, terms_.motion, terms_.body, terms_.time_step};
    return stop_in_time(model, command, i, {limit_, height, !told}, least);
  }

  // Where the brakes may take hold first: on any ground ahead whose dead time is over by then [m].
  [[nodiscard]] double earliest_onset(StopCommand command, Index i, double latest) const noexcept {
    const Track& track = plan_.track;
    for (Index m = i; m < n_ && track.station[m] < latest; ++m) {
      command.dead_time = track.shortest_dead_time[m];
      latest = min_of(latest, max_of(as_it_may_be(command, i).onset(), track.station[m]));
    }
    return latest;
  }

  // Least loads where brakes take hold earlier, from an onset on: loads are concave in v².
  void lower_to_early(const StopCommand& late, double onset, Index i, Shares& least) const noexcept {
    const double dead = (onset - late.station) / late.speed;
    const StopCommand early{late.station, late.speed, dead, late.slowest};
    StopEnd stop{0.0, 0.0, 0.0, i, i};
    Shares shares;
    follow(early, i, false, stop, shares);
    const StopModel model{on_.track, terms_.limits, terms_.motion, terms_.body, terms_.time_step};
    const StopInTime held{model, late.force_speed(), true, i};
    for (Index m = i; m < n_ && (m == i || on_.track.station[m] < late.onset()); ++m) {
      shares.lower_to(held.shares(max_of(on_.track.station[m], onset), late.speed, true));
    }
    least.lower_to(shares);
  }

  // The stop from share u of segment i, which belongs to station k: is anything breached there?
  bool try_stop(Index k, Index i, double u, bool inside) noexcept {
    const Track& track = plan_.track;
    const double energy = at(plan_.speed_sq, i, u);
    double dead = track.dead_time[k], top = track.speed_limit[k];
    if (inside) {
      // A surface that begins in a segment counts at both of its ends.
      dead = min_of(dead, track.dead_time[k + 1]);
      top = max_of(top, track.speed_limit[k + 1]);
    }
    const StopCommand command{at(track.station, i, u), std::sqrt(energy), dead, track.slowest[k]};
    Shares shares;
    const StopCommand late = as_it_may_be(command, i);
    const double end = follow(late, i, false, stop_, shares);
    if (brakes_early_ && i < safe_.first_safe_segment()) {
      const double earliest = earliest_onset(command, i, late.onset());
      if (earliest < late.onset()) lower_to_early(late, earliest, i, shares);
    }
    if (terms_.all_loads && !inside) tell_stop(k, i, command);
    const double over =
        end + plan_.distance_offset + terms_.errors.along_track - plan_.clear_distance;
    const bool overruns = breaks(plan_.beyond, over), unloads = judge_loads(shares);
    return judge_point(i, u, energy, top) || overruns || unloads;
  }

  void tell_stop(Index k, Index i, const StopCommand& command) noexcept {
    StopEnd stop{0.0, 0.0, 0.0, i, i};
    Shares least;
    const double end = follow(command, i, true, stop, least);
    notes_.stop_distance[k] = end - command.station + plan_.distance_offset;
    notes_.rear_load[k] = least.axle;
    notes_.side_load[k] = least.side;
  }

  bool judge_loads(const Shares& shares) noexcept {
    const double needed = terms_.limits.min_load;
    bool bad = breaks(Breach::side_load, needed - shares.side);
    bad |= breaks(Breach::wheel_load, needed - shares.wheel);
    // Last, which names the bound: where an axle lifts, its wheels lack load as well.
    bad |= breaks(Breach::axle_load, needed - shares.axle);
    return bad;
  }

  // Is a held speed breached at share u of segment i, at this v²? `top` is the highest speed there.
  bool judge_point(Index i, double u, double energy, double top) noexcept {
    const Vehicle& limits = terms_.limits;
    const double speed = std::sqrt(energy), lean = at(survey_.lean, i, u);
    const double rim = speed * laws::outer_wheel_speed_ratio(at(plan_.track.curvature, i, u),
                                                       terms_.body.slip_track);
    // Half the difference of the sides' shares at rest is the bank, for each lateral g.
    double bank = at(survey_.right, i, u) - at(survey_.left, i, u);
    bank /= 2.0 * survey_.per_lateral;
    const double outward = lean > 0.0 ? bank : -bank;
    const double allowed = max_of(limits.lateral_accel - max_of(outward, 0.0),
                                  least_turn_share * limits.lateral_accel);
    const double vertical = energy * at(plan_.track.vertical_curvature, i, u);
    bool bad = breaks(Breach::speed, speed - min_of(limits.speed, top));
    bad |= breaks(Breach::lateral, energy * std::abs(lean) - allowed);
    bad |= breaks(Breach::vertical, vertical - limits.vertical_accel);
    bad |= breaks(Breach::wheel_speed, rim - limits.max_wheel_speed);
    return bad;
  }

  // Does the change of speed from station k on exceed what either of its ends allows?
  bool judge_change(Index k) noexcept {
    const double* speed_sq = plan_.speed_sq;
    const double* station = plan_.track.station;
    const double accel = 0.5 * (speed_sq[k + 1] - speed_sq[k]) / (station[k + 1] - station[k]);
    const double first = std::sqrt(speed_sq[k]), second = std::sqrt(speed_sq[k + 1]);
    bool bad = false;
    for (const Index m : {k, k + 1}) {
      bad |= judge_change_at(m, accel, min_of(first, second), max_of(first, second));
    }
    return bad;
  }

  bool judge_change_at(Index m, double accel, double slow, double fast) noexcept {
    const Track& track = plan_.track;
    const Vehicle& limits = terms_.limits;
    const double sine = survey_.sine[m], part = track.lower_slope[m];
    const double lower =
        min_of(max_of(slow, track.slowest[m]) * part, max_of(fast, track.slowest[m]) * part);
    // Drag and turning help to slow down, which is not counted on; wind may push.
    const double* values = terms_.motion.values.data();
    const double pushed =
        min_of(laws::motion_deceleration(slow, track.curvature[m], track.yaw[m], values),
               laws::motion_deceleration(fast, track.curvature[m], track.yaw[m], values));
    const double braking =
        gravity * (lower + track.lower_intercept[m] + sine) + min_of(pushed, 0.0);
    const double resistance = limits.resistance + limits.turning_drag * std::abs(track.curvature[m]);
    const double holding = sine + std::sqrt(1.0 - sine * sine) * resistance;
    const double thrust =
        gravity *
        (min_of(limits.specific_force, limits.specific_power / max_of(fast, 1e-9)) - holding);
    const double front = survey_.front[m] - survey_.per_accel * max_of(accel, 0.0);
    bool bad = breaks(Breach::axle_load, limits.min_load - front);
    // Drive and turn take load from the same front wheel; brakes and turn from the same rear one,
    // from the start on, where stops still hold their speed.
    const double outward = survey_.per_lateral * fast * fast * survey_.lean[m];
    const double side = min_of(survey_.left[m] - outward, survey_.right[m] + outward);
    const double turned = side - 0.5 * (survey_.left[m] + survey_.right[m]);
    bad |= accel > 0.0 && breaks(Breach::side_load, limits.min_load - (front + turned));
    const double rear = survey_.rear[m] - survey_.per_decel * min_of(-accel, max_of(braking, 0.0));
    bad |= accel < 0.0 && breaks(Breach::wheel_load, limits.min_load - (rear + turned));
    bad |= breaks(Breach::decel, -accel - min_of(limits.decel, braking));
    if (!(accel <= 0.0) || thrust < 0.0) {
      bad |= breaks(Breach::accel, accel - min_of(limits.accel, thrust));
    }
    if (track.friction[m] < infinite) {
      const double driven = max_of(accel / gravity + holding, -(accel / gravity + sine));
      bad |= breaks(Breach::friction, slides_by(m, driven, plan_.speed_sq[m]));
    }
    return bad;
  }

  // By how much the force at station m, a share of the weight, exceeds friction there.
  [[nodiscard]] double slides_by(Index m, double along, double energy) const noexcept {
    const Track& track = plan_.track;
    const double grade = track.grade[m], roll = track.roll[m];
    const double normal = std::cos(grade) * std::cos(roll) +
                          min_of(track.vertical_curvature[m], 0.0) * energy / gravity;
    const double across =
        std::sin(roll) * std::cos(grade) + track.curvature[m] * energy / gravity;
    return std::hypot(along, across) - track.friction[m] * normal;
  }

  // Does the segment from station k on turn too tightly, or too quickly?
  bool judge_steering(Index k) noexcept {
    const double fast = std::sqrt(max_of(plan_.speed_sq[k], plan_.speed_sq[k + 1]));
    const bool tight = breaks(Breach::turning, excess_[k + 1]);
    return breaks(Breach::steering_rate, fast - steering_speed_[k]) || tight;
  }

  const VerifiedPlan& plan_;
  const VerifyTerms& terms_;
  const VerifyNotes& notes_;
  Index n_;
  Survey survey_, even_survey_;
  Surveyed on_, even_on_;
  double *excess_, *steering_speed_;  // (N,)
  SafeStopSpeeds safe_;
  bool brakes_early_;     // surfaces have different dead times
  Target target_{};       // where stops have to end
  double limit_ = 0.0;    // stops that get here are not followed further [m]
  StopEnd stop_{};        // the last one: the next begins where it did, or later
  Label broken_ = limiting::none;  // the last bound that was
};

}  // namespace detail

// Follow the stops from every station and from points between; note every breach. A v² that is not a
// number, or a stop that does not end, is a breach by infinity. `memory` is verify_memory(N).
inline void verify_plan(const VerifiedPlan& plan, const VerifyTerms& terms, const VerifyNotes& notes,
                        double* memory) noexcept {
  detail::Verifier(plan, terms, notes, memory).run();
}

// Highest held speeds (N,) from those of a plan on; `plan.speed_sq` is `profile`, at first the bounds.
// See Verifier::raise; `memory` is verify_memory(N).
inline void raise_speeds(const VerifiedPlan& plan, const VerifyTerms& terms,
                         const VerifyNotes& notes, const double* speed_sq, const double* bound,
                         Index steps, double* profile, double* highest, double* memory) noexcept {
  detail::Verifier(plan, terms, notes, memory)
      .raise(speed_sq, bound, steps, profile, highest);
}

}  // namespace slopewise::verify
