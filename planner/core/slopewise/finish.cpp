// One candidate, from its time-optimal profile to its plan: smoothed, verified, labelled.
//
// Nothing leaves without the word of the verifier: a profile that fails is repaired, then slowed,
// and if nothing passes the vehicle stays where it is or brakes fully at once.
#include <algorithm>

#include "profile/smoothing.hpp"
#include "profile/time_optimal.hpp"
#include "slopewise/candidates.hpp"
#include "verify/labels.hpp"
#include "verify/verify.hpp"
#include "verify/verify_ground.hpp"

namespace slopewise {
namespace {

// Repairs before the whole plan is slowed, and v² that one keeps [1]; as in Python.
constexpr int repairs = 12, slowings = 40;
constexpr double repair_share = 0.96, slowing_share = 0.9;
// v² at the start may exceed what service braking can bring down by rounding [m²/s²].
constexpr double start_rounding = 1e-9;
// So far before the end of its path a plan may rest, beside what stops keep free [m].
constexpr double hardly_short = 1.0;
// And beside their offset alone: errors of map and place may keep free what is no end any more [m].
constexpr double farthest_end = 2.9;
// Of the integrator in time [s], and points inside each segment from which a stop is tried.
constexpr double time_step = 0.02;
constexpr Index points_between = 3;

using Numbers1 = std::vector<double>;

class Finisher {
 public:
  Finisher(const PlanningModel& model, Index stations)
      : model_(model), n_(stations), told_(room(3)), memory_(static_cast<std::size_t>(verify::verify_memory(n_))), bad_(size()),
        terms_{model.weighed, model.limits, model.motion, model.errors, model.steering, false, points_between, time_step, true} {}

  // Columns of the candidate, (N,) each.
  Numbers1 track, even, sine, bound, accel_max, lift, lift_per_speed_sq, demand, start_bound, accel, decel;
  std::vector<Label> label;
  double clear = 0.0, offset = 0.0, start_sq = 0.0;

  [[nodiscard]] verify::Track columns_of(const Numbers1& rows) const {
    std::array<const double*, verify::track_columns> column{};
    for (std::size_t i = 0; i < column.size(); ++i) column[i] = rows.data() + i * size();
    return verify::track_at(n_, column);
  }
  [[nodiscard]] const Numbers1& told() const noexcept { return told_; }

  // No constraint is breached by v² (N,).
  bool verified(const Numbers1& speed_sq) {
    const verify::Track on = columns_of(track), on_even = columns_of(even);
    Numbers1 worst(verify::breach_count, 0.0);
    std::fill(bad_.begin(), bad_.end(), limiting::none);
    double* told = told_.data();
    verify::verify_plan({on, on_even, speed_sq.data(), clear, offset}, terms_,
                        {told, told + n_, told + 2 * n_, worst.data(), bad_.data()},
                        memory_.data());
    return *std::max_element(worst.begin(), worst.end()) <= 0.0;
  }

  // Of the fastest profile under the bound, v² (N,).
  [[nodiscard]] ProfileProblem problem(double* speed_sq) const {
    const verify::Track on = columns_of(track);
    return {n_, 1, {on.station, 1}, {bound.data(), 1}, {sine.data(), 1}, {on.lower_slope, 1},
            {on.lower_intercept, 1}, {on.slowest, 1}, {accel_max.data(), 1}, {demand.data(), 1},
            {lift.data(), 1}, {lift_per_speed_sq.data(), 1}, model_.limits.decel,
            model_.limits.specific_power, {speed_sq, 1}};
  }

  // That profile; false if service braking cannot bring the start down to it.
  bool fastest(Numbers1& speed_sq) {
    double reachable = 0.0;
    solve_time_optimal(problem(speed_sq.data()), &start_sq, &reachable);
    return reachable >= start_sq - start_rounding;
  }

  // A profile that the verifier passes, from one that it may not; false: none but standing still.
  bool repair(Numbers1& speed_sq, bool& slowed) {
    bool valid = verified(speed_sq);
    for (int i = 0; i < repairs && !valid; ++i) {
      lower_where_bad(speed_sq);
      Numbers1 lower(size());
      if (!fastest(lower)) break;
      speed_sq = lower;
      valid = verified(speed_sq);
    }
    for (int i = 0; i < slowings && !valid; ++i) {
      slowed = true;
      for (std::size_t k = 1; k < size(); ++k) speed_sq[k] *= slowing_share;
      speed_sq[0] = start_sq;
      rest_for_good(speed_sq.data(), n_);
      valid = verified(speed_sq);
    }
    return valid;
  }

  void limit_changes(const Numbers1& speed_sq) {
    accel.resize(size());
    decel.resize(size());
    verify::limit_segments(columns_of(track), speed_sq.data(), problem(nullptr), model_.limits,
                           accel.data(), decel.data());
  }

  // Replace a profile by a smooth one below it, if there is one that the verifier passes.
  bool smooth_below(Numbers1& speed_sq) {
    const std::size_t moving = static_cast<std::size_t>(
        std::find_if(speed_sq.rbegin(), speed_sq.rend(),
                     [](double v) { return v > standstill_sq; }).base() - speed_sq.begin());
    if (moving == 0) return true;
    limit_changes(speed_sq);
    // Of the stations of rest at the end only the first takes part.
    const auto part = std::max(std::min(moving + 1, size()), static_cast<std::size_t>(min_stations));
    const verify::Track on = columns_of(track);
    Numbers1 ds(part - 1), answer(size(), 0.0), solved(part),
        memory(static_cast<std::size_t>(smoothing_memory(static_cast<Index>(part))));
    for (std::size_t k = 0; k + 1 < part; ++k) ds[k] = on.station[k + 1] - on.station[k];
    const SmoothingProblem problem{static_cast<Index>(part), ds.data(), speed_sq.data(),
                                   accel.data(), decel.data(), model_.jerk,
                                   std::numeric_limits<double>::quiet_NaN()};
    if (smooth(problem, memory.data(), solved.data()) <= 0) return false;
    keep_inside(solved.data(), speed_sq.data(), static_cast<Index>(part), answer.data());
    const Numbers1 told = told_;
    if (verified(answer)) {
      speed_sq = answer;
      return true;
    }
    told_ = told;
    return false;
  }

  // End the clear distance before ground that the verifier alone found; bounds before it become stops
  // with the weakest brakes of the way there.
  void stop_before(double station) {
    const verify::Track on = columns_of(track);
    clear = station;
    const double fast = std::sqrt(max_of(*std::max_element(bound.begin(), bound.end()), 0.0));
    double weakest = no_limit, dead_time = 0.0;
    for (Index k = 0; k < n_; ++k) {
      dead_time = max_of(dead_time, on.dead_time[k]);
      if (k > 0 && on.station[k - 1] >= station) continue;
      const double slow = on.slowest[k], slope = on.lower_slope[k];
      const double force = min_of(slow * slope, max_of(fast, slow) * slope);
      weakest = min_of(weakest, gravity * (force + on.lower_intercept[k] + std::sin(on.grade[k])));
    }
    weakest = max_of(weakest, 0.0);
    const double lost = weakest * (dead_time + model_.errors.latency);
    for (Index k = 0; k < n_; ++k) {
      // From the next station, so that v² linear in between stops in time as well.
      const double ahead = k + 1 < n_ ? on.station[k + 1] : no_limit;
      const double left = max_of(clear - offset - model_.errors.along_track - ahead, 0.0);
      const double v = std::sqrt(lost * lost + 2.0 * weakest * left) - lost - model_.errors.speed;
      const auto i = static_cast<std::size_t>(k);
      if (max_of(v, 0.0) * max_of(v, 0.0) >= bound[i]) continue;
      bound[i] = max_of(v, 0.0) * max_of(v, 0.0);
      label[i] = limiting::stopping_path;
    }
  }

  void label_stations(const Numbers1& speed_sq, const Numbers1& accelerations, bool smoothed,
                      Label* out) const {
    verify::label_stations({n_, speed_sq.data(), accelerations.data(), bound.data(), label.data(),
                            accel.data(), decel.data(), model_.limits.accel, smoothed},
                           out);
  }

 private:
  [[nodiscard]] std::size_t size() const noexcept { return static_cast<std::size_t>(n_); }
  [[nodiscard]] Numbers1 room(std::size_t columns) const { return Numbers1(columns * size()); }

  void lower_where_bad(const Numbers1& speed_sq) {
    for (std::size_t k = 0; k + 1 < size(); ++k) {
      if (bad_[k] == limiting::none) continue;
      for (const std::size_t end : {k, k + 1}) {
        if (bad_[k] != limiting::speed_limit) label[end] = bad_[k];
        bound[end] = repair_share * min_of(bound[end], speed_sq[end]);
      }
    }
  }

  const PlanningModel& model_;
  Index n_;
  Numbers1 told_, memory_;
  std::vector<Label> bad_;
  verify::VerifyTerms terms_;
};

// Candidate j of the batch.
Finisher finisher_of(const Planner::Candidates& c, Index j) {
  const auto n = static_cast<Index>(c.count[static_cast<std::size_t>(j)]);
  const auto column = [&](const OwnRows& rows) {
    Numbers1 out;
    for (Index k = 0; k < n; ++k) out.push_back(rows.at(k, j));
    return out;
  };
  OwnRows limit = c.fastest;
  for (Index k = 0; k < n; ++k) {
    limit.rows().at(k)[j] = min_of(limit.at(k, j), c.rough_speed.at(k, j));
  }
  const auto columns_with = [&](const OwnRows& slope, const OwnRows& intercept) {
    Numbers1 out(static_cast<std::size_t>(verify::track_columns * n));
    const verify::TrackRows rows{c.terrain(), c.forces(slope, intercept), limit.read(),
                                 c.sliding_friction()};
    verify::copy_columns(rows, j, 0, true, out.data(), n);
    return out;
  };
  Finisher f(c.model, n);
  f.track = columns_with(c.slope_left, c.force_left);
  f.even = columns_with(c.force_lower_slope, c.force_lower);
  for (Index k = 0; k < n; ++k) f.sine.push_back(std::sin(f.columns_of(f.track).grade[k]));
  f.bound = column(c.speed_sq_max);
  f.accel_max = column(c.accel_max);
  f.lift = column(c.lift);
  f.lift_per_speed_sq = column(c.lift_per_speed_sq);
  f.demand = column(c.demand);
  for (Index k = 0; k < n; ++k) {
    f.label.push_back(c.limiting[static_cast<std::size_t>(k * c.candidates + j)]);
  }
  f.clear = c.clear_distance[static_cast<std::size_t>(j)];
  f.offset = c.distance_offset[static_cast<std::size_t>(j)];
  f.start_sq = c.start_sq;
  return f;
}

// The first place before the end of the clear distance that the verifier finds on the map by itself.
verify::GroundFinding blocked_by(const Planner::Candidates& c, Index j, const Finisher& f) {
  const verify::Track on = f.columns_of(f.even);
  const Index n = on.stations;
  Numbers1 x, y, force;
  for (Index k = 0; k < n; ++k) {
    x.push_back(c.x.at(k, j));
    y.push_back(c.y.at(k, j));
    force.push_back(on.lower_intercept[k] + on.slowest[k] * on.lower_slope[k]);
  }
  const HeightMap& of = c.ground->map;
  const verify::MapView map{c.ground->heights.data(), of.rows, of.columns, of.origin_x,
                            of.origin_y, of.resolution, 1.0 / of.resolution};
  const verify::PlannedLine line{n, x.data(), y.data(), on.station};
  const Index poses = verify::count_poses(line, verify::pose_step(map, c.model.body));
  Numbers1 memory(static_cast<std::size_t>(verify::ground_memory(line, poses, map.columns)));
  const Numbers1 on_line(static_cast<std::size_t>(n), 0.0);  // the planned line is the one followed
  return verify::first_blocked(
      map, c.model.body, line, {force.data(), on.friction, on.curvature, on_line.data()},
      c.model.ground, c.model.tolerance, {on.station[1], f.clear}, memory.data());
}

// What even the slowest stop keeps free before the station k where it rests [m].
[[nodiscard]] bool rests_at_end(const PlanningModel& model, const Finisher& f, std::size_t k) {
  const verify::Track on = f.columns_of(f.track);
  const double braking = gravity * (on.lower_intercept[k] + on.slowest[k] * on.lower_slope[k] +
                                    std::sin(on.grade[k]));
  const double fall = braking > 0.0 ? gravity * model.errors.height / braking : 0.0;
  const double free_ahead = f.offset + model.errors.along_track + fall;
  const double at_end = min_of(free_ahead + hardly_short, f.offset + farthest_end);
  // Where brakes cannot hold, say, it rests for that, however near the end.
  for (std::size_t i = k; i + 1 < f.bound.size(); ++i) {
    if (f.bound[i] <= 0.0 && f.label[i] != limiting::stopping_path) return false;
  }
  return on.station[on.last()] - on.station[k] <= at_end;
}

// The station behind the last at which v² (N,) moves: a plan may begin at rest.
std::size_t resting(const Numbers1& speed_sq) {
  const auto moving = std::find_if(speed_sq.rbegin(), speed_sq.rend(), [](double v) { return v > 0.0; });
  return std::min(static_cast<std::size_t>(moving.base() - speed_sq.begin()), speed_sq.size() - 1);
}

// Lower the bounds of candidate j to those of the ground at both sides of its band.
void lower_by_sides(const Planner::Candidates& c, Index j, Finisher& f) {
  Planner::Candidates sides(c.model, c.ground);
  sides.lay_beside(c, j);
  sides.bound(std::vector<double>(2, c.clear_distance[static_cast<std::size_t>(j)]));
  double* speed_limit = f.track.data() + verify::speed_limit_column * sides.stations;
  for (Index k = 0; k < sides.stations; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const Index side = sides.speed_sq_max.at(k, 1) < sides.speed_sq_max.at(k, 0) ? 1 : 0;
    if (sides.speed_sq_max.at(k, side) < f.bound[i]) {
      f.bound[i] = sides.speed_sq_max.at(k, side);
      f.label[i] = sides.limiting[static_cast<std::size_t>(2 * k + side)];
    }
    speed_limit[i] = min_of(speed_limit[i], std::sqrt(f.bound[i]));
  }
}

Plan plan_of(Finisher& f, const Numbers1& speed_sq, Status status, bool smoothed) {
  const verify::Track on = f.columns_of(f.track);
  const auto n = static_cast<std::size_t>(on.stations);
  Plan plan{status, Numbers1(on.station, on.station + n), {}, Numbers1(n),
            Numbers1(f.told().begin(), f.told().begin() + on.stations), std::vector<Label>(n),
            f.clear};
  for (const double v : speed_sq) plan.speed.push_back(std::sqrt(v));
  Numbers1 accel(n);
  verify::move_along(on.station, speed_sq.data(), on.stations, accel.data(), plan.time.data());
  f.limit_changes(speed_sq);
  f.label_stations(speed_sq, accel, smoothed, plan.limiting.data());
  return plan;
}

}  // namespace

Plan Planner::finish(std::size_t candidate) {
  const Candidates& c = *candidates_;
  expect(c.solved, "finish: expected solve before");
  expect(candidate < c.count.size(), "candidate: expected one of those sampled");
  const auto j = static_cast<Index>(candidate);
  Finisher f = finisher_of(c, j);
  const std::size_t n = f.bound.size();
  bool reaches = c.barrier_station[candidate] >= static_cast<std::int64_t>(n) &&
                 f.clear >= c.station.at(static_cast<Index>(n) - 1, j);
  const verify::GroundFinding found = blocked_by(c, j, f);
  if (found.kind != verify::GroundKind::none) {
    reaches = false;
    f.stop_before(found.station);
  }
  if (c.has_band()) lower_by_sides(c, j, f);
  Numbers1 speed_sq(n);
  bool slowed = false;
  if (!f.fastest(speed_sq) || !f.repair(speed_sq, slowed)) {
    // Standing still, or braking fully at once.
    std::fill(speed_sq.begin() + 1, speed_sq.end(), 0.0);
    speed_sq[0] = c.start_sq;
    f.verified(speed_sq);
    return plan_of(f, speed_sq, c.start_sq > 0.0 ? Status::infeasible : Status::degraded, false);
  }
  const bool smoothed = f.smooth_below(speed_sq);
  if (!rests_at_end(c.model, f, resting(speed_sq))) reaches = false;
  const Status status = !smoothed || slowed ? Status::degraded
                        : reaches           ? Status::ok
                                            : Status::blocked;
  return plan_of(f, speed_sq, status, smoothed);
}

}  // namespace slopewise
