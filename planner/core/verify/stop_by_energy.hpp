// Emergency stops of which brakes and grade alone decide: where they end, and the least loads.
//
// What the brakes take out is summed once along the path, exactly for a grade that is linear between
// stations; a stop ends where the sum has taken all of its energy. This is the verifier's own writing
// of a stop: sums of sines of angles from the first station on, and the end of a given stop, where
// the bound sums backwards and looks for a speed. For plans on which no effect acts on the motion;
// stop_in_time.hpp is for the others.
//
// Source: Braking (7), (8), (12), with v dv = −a(θ(s), v_i) ds; the dead time at held speed first.
#pragma once

#include "verify/candidate.hpp"
#include "profile/time_optimal.hpp"

namespace slopewise::verify {

inline constexpr double longest_stop = 1e3;  // a stop longer than this is called no stop [m]

// An emergency stop as it is commanded.
struct StopCommand {
  double station, speed;  // [m], [m/s]
  double dead_time;       // from command to onset [s]
  double slowest;         // below this speed the force no longer changes [m/s]

  [[nodiscard]] double force_speed() const noexcept { return max_of(speed, slowest); }
  [[nodiscard]] double onset() const noexcept { return station + speed * dead_time; }
};

// Of the level static loads: rear axle, lighter side, lightest wheel.
struct Shares {
  double axle = infinite, side = infinite, wheel = infinite;

  void lower_to(const Shares& other) noexcept {
    axle = min_of(axle, other.axle);
    side = min_of(side, other.side);
    wheel = min_of(wheel, other.wheel);
  }
};

// Where stops have to end [m], and the sums up to there.
struct Target {
  double station, slope_work, intercept_work;
};

// How a stop goes on.
struct StopEnd {
  double station;  // where it ends [m]
  double onset;    // where braking begins [m]
  double needed;   // the sum that has to be reached at its end [m]
  Index onset_in, end_in;
};

// A track, and what its stops meet.
struct Surveyed {
  const Track& track;
  const Survey& survey;

  [[nodiscard]] double force(Index k, double v_i) const noexcept {
    return v_i * track.lower_slope[k] + track.lower_intercept[k] + survey.sine[k];
  }
  [[nodiscard]] double work(Index k, double v_i) const noexcept {
    return v_i * survey.slope_work[k] + survey.intercept_work[k];
  }
};

// What full braking takes out from the first station to s in segment i, over m g [m]. Beyond the
// last station the ground stays as it was there.
[[nodiscard]] inline double work_up_to(const Surveyed& on, double s, Index i, double v_i) noexcept {
  const double* station = on.track.station;
  const double ds = station[i + 1] - station[i], u = (s - station[i]) / ds;
  const double after = on.work(i + 1, v_i);
  if (u > 1.0) return after + (s - station[i + 1]) * on.force(i + 1, v_i);
  // The cubic with the sums and the forces of both stations.
  const double before = on.work(i, v_i), gain = after - before;
  const double first = ds * on.force(i, v_i), second = ds * on.force(i + 1, v_i);
  const double rise = first + second - 2.0 * gain;
  return before + u * (first + u * (3.0 * gain - 2.0 * first - second + u * rise));
}

[[nodiscard]] inline Target target_at(const Surveyed& on, double station) noexcept {
  const Index last = segment_of(on.track, station, on.track.stations - 2);
  const double intercept_work = work_up_to(on, station, last, 0.0);
  return {station, work_up_to(on, station, last, 1.0) - intercept_work, intercept_work};
}

// Does a stop end before the target? The same as asking `stop_by_energy` where. `onset_in` is the
// segment to look for the onset from, and receives it; the stop may fall by `height` more than the
// track [m].
[[nodiscard]] inline bool ends_before(const Surveyed& on, const StopCommand& command,
                                      const Target& target, double height,
                                      Index& onset_in) noexcept {
  const double v_i = command.force_speed(), onset = command.onset();
  onset_in = segment_of(on.track, onset, onset_in);
  double needed = work_up_to(on, onset, onset_in, v_i);
  needed += 0.5 * command.speed * command.speed / gravity + height;
  const bool enough = v_i * target.slope_work + target.intercept_work >= needed;
  return (onset <= target.station) & enough;
}

namespace detail {

// Regula falsi on what is as good as linear.
[[nodiscard]] inline double end_between(const Surveyed& on, StopEnd& stop, double v_i, double low,
                                        double high) noexcept {
  double at_low = work_up_to(on, low, stop.end_in, v_i) - stop.needed;
  double at_high = on.work(stop.end_in + 1, v_i) - stop.needed, end = high;
  for (int step = 0; step < 4; ++step) {
    end = at_high > at_low ? low - at_low * (high - low) / (at_high - at_low) : high;
    const double left = work_up_to(on, end, stop.end_in, v_i) - stop.needed;
    if (std::abs(left) < 1e-12) break;
    if (left < 0.0) {
      low = end;
      at_low = left;
    } else {
      high = end;
      at_high = left;
    }
  }
  return end;
}

}  // namespace detail

// Where a stop ends of which nothing but brakes and grade decide; `stop` holds the segments to look
// for onset and end from, and receives the answer.
inline void stop_by_energy(const Surveyed& on, const StopCommand& command, double height,
                           StopEnd& stop) noexcept {
  const double s = command.station, v = command.speed, v_i = command.force_speed();
  const double* station = on.track.station;
  stop.onset = command.onset();
  stop.onset_in = segment_of(on.track, stop.onset, stop.onset_in);
  stop.needed = work_up_to(on, stop.onset, stop.onset_in, v_i) + 0.5 * v * v / gravity + height;
  Index j = std::max(stop.end_in, stop.onset_in);
  while (j > stop.onset_in && on.work(j, v_i) >= stop.needed) --j;
  while (j < on.track.stations - 2 && on.work(j + 1, v_i) < stop.needed) ++j;
  stop.end_in = j;
  const double high = station[j + 1];
  if (on.work(j + 1, v_i) - stop.needed < 0.0 || stop.onset >= high) {
    // Off the end of the path.
    const double low = max_of(stop.onset, high), force = on.force(j + 1, v_i);
    const double at_low = work_up_to(on, low, j, v_i) - stop.needed;
    stop.station = min_of(force > 0.0 ? low - at_low / force : infinite, s + longest_stop);
    return;
  }
  stop.station = detail::end_between(on, stop, v_i, max_of(stop.onset, station[j]), high);
}

namespace detail {

// Shares of rear, lighter side and lightest wheel between i and i + 1 at v² = `energy`.
[[nodiscard]] inline Shares shares_at(const Surveyed& on, Index i, double u, double energy,
                                      double v_i, bool braking) noexcept {
  const auto& [track, survey] = on;
  // Angles are linear in between: sines and cosines bulge above their chords.
  const double pitched = track.grade[i + 1] - track.grade[i];
  const double rolled = track.roll[i + 1] - track.roll[i];
  const double bulge = 1.0 + 0.5 * u * (1.0 - u) * (pitched * pitched + rolled * rolled);
  const double normal = max_of(-at(track.vertical_curvature, i, u), 0.0) * energy / gravity;
  double rear = bulge * at(survey.rear, i, u) - normal;
  double front = bulge * at(survey.front, i, u) - normal;
  if (braking) {
    const double upper = v_i * at(track.upper_slope, i, u) + at(track.upper_intercept, i, u);
    const double decel = gravity * (upper + bulge * at(survey.sine, i, u));
    rear -= survey.per_decel * decel;
    front += survey.per_accel * decel;
  }
  const double lateral = survey.per_lateral * energy * at(survey.lean, i, u);
  const double left = bulge * at(survey.left, i, u), right = bulge * at(survey.right, i, u);
  const double side = min_of(left - lateral, right + lateral) - normal;
  const double upright = 0.5 * (left + right) - normal;
  return {rear, side, min_of(rear, front) + side - upright};
}

}  // namespace detail

// Least shares on a stop of `stop_by_energy` that is commanded in segment k.
[[nodiscard]] inline Shares loads_by_energy(const Surveyed& on, const StopCommand& command, Index k,
                                            const StopEnd& stop) noexcept {
  using detail::shares_at;
  const double* station = on.track.station;
  const Index i = stop.onset_in, j = stop.end_in;
  const double v_i = command.force_speed(), held = command.speed * command.speed;
  const auto share = [&](double s, Index n) {
    return (s - station[n]) / (station[n + 1] - station[n]);
  };
  const auto energy = [&](Index m) {
    return 2.0 * gravity * max_of(stop.needed - v_i * on.survey.slope_work[m] -
                                      on.survey.intercept_work[m], 0.0);
  };
  Shares least = shares_at(on, k, share(command.station, k), held, v_i, false);
  for (Index m = k + 1; m <= i; ++m) least.lower_to(shares_at(on, m, 0.0, held, v_i, false));
  least.lower_to(shares_at(on, i, min_of(share(stop.onset, i), 1.0), held, v_i, true));
  for (Index m = i + 1; m <= j; ++m) least.lower_to(shares_at(on, m, 0.0, energy(m), v_i, true));
  // It may run off the end of the path.
  if (stop.station > station[j + 1]) {
    least.lower_to(shares_at(on, j, 1.0, energy(j + 1), v_i, true));
  }
  least.lower_to(shares_at(on, j, min_of(share(stop.station, j), 1.0), 0.0, v_i, true));
  return least;
}

}  // namespace slopewise::verify
