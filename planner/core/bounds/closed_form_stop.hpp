// Highest speed from which the vehicle can still stop, where the stopping path has a closed form.
//
// Where nothing but the grade acts, the energy that the brakes take out from onset to the target is
// an integral, summed once from the target back. The onset lies a dead time behind the command, so
// each station looks for the place where the speed that the distance up to it allows and the speed
// that the brakes take out from there on are one. Source: Braking (7), (8), (12).
#pragma once

#include "bounds/bound_problem.hpp"
#include "profile/time_optimal.hpp"

namespace slopewise {

// By how much v² must be free of the stopping path to be called free [1].
inline constexpr double clearly = 1.0 + 1e-6;

// Integrals over a stretch: of the slope of F_b/W over the speed at onset [s], and of its intercept
// plus sin θ [m].
struct StopSum {
  double slope, intercept;
};

// Highest speed at onset that the brakes take out over a stretch [m/s]: v with
// v²/2 = g (max(v, slowest) * slope + intercept), 0 where there is none; below `slowest` the
// coefficients no longer change.
[[nodiscard]] inline double onset_speed(const StopSum& sum, double slowest) noexcept {
  const double half = gravity * sum.slope;
  const double root = half * half + 2.0 * gravity * sum.intercept;
  const double fast = root > 0.0 ? half + std::sqrt(max_of(root, 0.0)) : 0.0;
  const double energy = 2.0 * gravity * (slowest * sum.slope + sum.intercept);
  const double slow = energy > 0.0 ? min_of(std::sqrt(max_of(energy, 0.0)), slowest) : 0.0;
  return fast < slowest ? slow : fast;
}

// Stops of candidate j of a batch: terrain, the lower bound of the force that crests leave.
struct StopLane {
  const BoundProblem& problem;
  const Bounds& bounds;
  Index j;
  double target;  // the vehicle must stand here [m]

  [[nodiscard]] double station(Index k) const noexcept {
    return problem.terrain.station.at(k)[j];
  }
  [[nodiscard]] double dead_time(Index k) const noexcept {
    return problem.forces.dead_time.at(k)[j] + problem.errors.latency;
  }
  [[nodiscard]] double& speed_sq_max(Index k) const noexcept {
    return bounds.speed_sq_max.at(k)[j];
  }
};

class ClosedFormStops {
 public:
  static Index memory(Index stations) noexcept { return 3 * stations; }

  ClosedFormStops(const StopLane& lane, double* memory) noexcept
      : lane_(lane), terrain_(lane.problem.terrain), j_(lane.j),
        end_(std::min<Index>(lane.bounds.barrier_station[j_], terrain_.counts[j_])),
        last_(std::max<Index>(end_ - 1, 0)), slope_(memory),
        intercept_(slope_ + terrain_.stations), onset_(intercept_ + terrain_.stations) {
    while (last_ > 0 && lane.station(last_) > lane.target) --last_;
    sum_up();
  }

  // Stations beyond the target are no place to drive over: v² is −1.
  void end_at_target() const noexcept {
    for (Index k = end_ - 1; k >= 0 && (k > last_ || lane_.target <= lane_.station(k)); --k) {
      lane_.speed_sq_max(k) = -1.0;
      lane_.bounds.limiting.at(k)[j_] = lane_.bounds.barrier[j_];
    }
  }

  // Lower the bounds of the others so that every stop ends before the target.
  void lower() const noexcept {
    Index segment = last_;
    for (Index k = std::min(last_, end_ - 1); k >= 0; --k) {
      double& bound = lane_.speed_sq_max(k);
      if (lane_.target <= lane_.station(k) || is_free(k, bound)) continue;
      const double speed = lane_.dead_time(k) > 0.0 ? meet(k, segment) : onset_[k];
      if (!(speed * speed < bound)) continue;
      bound = speed * speed;
      lane_.bounds.limiting.at(k)[j_] = limiting::stopping_path;
    }
  }

 private:
  // From each station up to the target, and the speed at onset that leaves nothing of either sum.
  void sum_up() noexcept {
    const auto [slope, intercept] = to_target();
    slope_[last_] = slope;
    intercept_[last_] = intercept;
    for (Index k = last_ - 1; k >= 0; --k) {
      const double half = 0.5 * (lane_.station(k + 1) - lane_.station(k));
      const double turn = of(terrain_.grade, k + 1) - of(terrain_.grade, k);
      const auto both = [&](const auto& rows) { return of(rows, k) + of(rows, k + 1); };
      // sin of a linear grade: trapezoid, with the next term of its expansion.
      const double falls =
          half * both(terrain_.sin_grade) * (1.0 + turn * turn * (1.0 / 12.0));
      slope_[k] = slope_[k + 1] + half * both(lane_.bounds.lower_slope);
      intercept_[k] = intercept_[k + 1] + half * both(lane_.bounds.lower_intercept) + falls;
    }
    for (Index k = 0; k <= last_; ++k) {
      onset_[k] = onset_speed({slope_[k], intercept_[k]}, of(lane_.problem.forces.slowest, k));
    }
  }

  template <class T>
  [[nodiscard]] double of(const Rows<T>& rows, Index k) const noexcept {
    return rows.at(k)[j_];
  }

  [[nodiscard]] Index after(Index k) const noexcept {
    return std::min<Index>(k + 1, terrain_.counts[j_] - 1);
  }

  // Over the segment in which the target lies. Unknown ground goes on as it is at its station.
  [[nodiscard]] StopSum to_target() const noexcept {
    const Index k = last_, next = after(k);
    const double ds = max_of(min_of(lane_.target - lane_.station(k), 1e9), 0.0);
    const double length = lane_.station(next) - lane_.station(k);
    const double u = length > 0.0 ? min_of(ds / length, 1.0) : 0.0;
    const double seen = terrain_.known.at(next)[j_] ? u : 0.0;
    const double turn = u * (of(terrain_.grade, next) - of(terrain_.grade, k));
    const auto summed = [&](const auto& rows) {
      return 0.5 * ds * (2.0 * of(rows, k) + seen * (of(rows, next) - of(rows, k)));
    };
    const double falls = summed(terrain_.sin_grade) * (1.0 + turn * turn / 12.0);
    return {summed(lane_.bounds.lower_slope),
            summed(lane_.bounds.lower_intercept) + (falls - lane_.problem.errors.height)};
  }

  // Speed at onset that the brakes take out from a place in segment i to the target.
  [[nodiscard]] double onset_at(Index i, double place) const noexcept {
    const Index next = after(i);
    const double length = lane_.station(next) - lane_.station(i);
    const double back = place - lane_.station(i), w = back * (length > 0.0 ? 1.0 / length : 0.0);
    const auto passed = [&](double here, double ahead) {
      return 0.5 * back * (2.0 * here + w * (terrain_.known.at(next)[j_] ? ahead - here : 0.0));
    };
    const auto acting = [&](Index k) {
      return of(lane_.bounds.lower_intercept, k) + of(terrain_.sin_grade, k);
    };
    const auto& slope = lane_.bounds.lower_slope;
    const StopSum sum{slope_[i] - passed(of(slope, i), of(slope, next)),
                      intercept_[i] - passed(acting(i), acting(next))};
    return onset_speed(sum, of(lane_.problem.forces.slowest, i));
  }

  // Does a stop from v² at station k end before the target? Most do.
  [[nodiscard]] bool is_free(Index k, double speed_sq) const noexcept {
    const double onset =
        lane_.station(k) + lane_.dead_time(k) * std::sqrt(max_of(speed_sq, 0.0));
    if (onset > lane_.target) return false;
    Index i = k;
    while (i < last_ && lane_.station(i + 1) < onset) ++i;
    const double speed = onset_at(i, onset);
    return speed * speed > clearly * speed_sq;
  }

  // Regula falsi on the place of onset from station k; each iterate is itself a safe speed. `segment`
  // is where its last search ended and this one ends.
  [[nodiscard]] double meet(Index k, Index& segment) const noexcept {
    const double here = lane_.station(k), dead = lane_.dead_time(k);
    const auto onset = [&](Index i) { return here + dead * onset_[i]; };
    const auto reaches = [&](Index i) { return onset(i) > lane_.station(i); };
    Index& i = segment;
    while (i > k && !reaches(i)) --i;
    while (i < last_ && reaches(i + 1)) ++i;
    double a = lane_.station(i), b = i < last_ ? lane_.station(i + 1) : lane_.target, best = 0.0;
    double short_a = onset(i) - a, short_b = (i < last_ ? onset(i + 1) : here) - b;
    for (int step = 0; step < 3; ++step) {
      const double share = short_a / (short_a - short_b);
      const double p = a + (short_a > short_b ? share : 0.0) * (b - a);
      const double v = onset_at(i, p);
      best = max_of(best, min_of(v, (p - here) / dead));
      const double residual = here + dead * v - p;
      (residual > 0.0 ? a : b) = p;
      (residual > 0.0 ? short_a : short_b) = residual;
    }
    return best;
  }

  const StopLane& lane_;
  const TerrainRows& terrain_;
  Index j_, end_, last_;  // before the barrier; last station up to the target, 0 if all are beyond
  double *slope_, *intercept_, *onset_;  // (N,) sums, and speeds [m/s]
};

}  // namespace slopewise
