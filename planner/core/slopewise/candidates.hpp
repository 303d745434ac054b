// What a Planner keeps of its candidates between its calls.
#pragma once

#include <initializer_list>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "slopewise/core.hpp"

namespace slopewise {

inline void expect(bool holds, const char* message) {
  if (!holds) throw std::invalid_argument(message);
}

// No ground is farther from the level that heights are counted from [m]; what is, is unknown.
inline constexpr double highest_ground = 1e5;

// (N, M) numbers in memory of their own.
class OwnRows {
 public:
  OwnRows() = default;
  OwnRows(Index stations, Index candidates, double value = 0.0)
      : numbers_(static_cast<std::size_t>(stations * candidates), value), stride_(candidates) {}

  [[nodiscard]] double* data() noexcept { return numbers_.data(); }
  [[nodiscard]] Rows<double> rows() noexcept { return {data(), stride_}; }
  [[nodiscard]] Numbers read() const noexcept { return {numbers_.data(), stride_}; }
  [[nodiscard]] double at(Index k, Index j) const noexcept {
    return numbers_[static_cast<std::size_t>(k * stride_ + j)];
  }

 private:
  std::vector<double> numbers_;
  Index stride_ = 0;
};

// Heights of a map, those that are none made unknown, and what wheels feel of them.
struct MapGround {
  HeightMap map;
  std::vector<double> heights;
  HeightGrid grid;

  MapGround(const Footprint& tyre, const HeightMap& on)
      : map(on), heights(on.heights, on.heights + on.rows * on.columns),
        grid(heights.data(), on.rows, on.columns, on.origin_x, on.origin_y, on.resolution, tyre) {
    for (double& height : heights) {
      if (!(std::abs(height) <= highest_ground)) height = std::numeric_limits<double>::quiet_NaN();
    }
  }
};

struct Planner::Candidates {
  PlanningModel model;
  std::shared_ptr<MapGround> ground;  // also of the candidates beside these

  Index stations = 0, candidates = 0;  // N, M
  std::vector<std::int64_t> count;     // (M,)
  OwnRows x, y, body_x, body_y, body_heading_x, body_heading_y;
  OwnRows z, station, heading_x, heading_y, curvature, grade, sin_grade, sin_roll, bends;
  std::unique_ptr<bool[]> known, trained;
  std::vector<float> twist, front;     // (N, M), (N, 2, M)
  OwnRows force_lower_slope, force_lower, force_upper_slope, force_upper;
  OwnRows dead_time, shortest_dead_time, slowest, fastest, friction;
  std::vector<double> distance_offset;
  std::vector<std::int64_t> hazard;
  OwnRows rough_speed, steering_speed;

  bool solved = false;
  double start_sq = 0.0;
  OwnRows speed_sq_max, accel_max, lift, lift_per_speed_sq, demand, slope_left, force_left, speed_sq;
  std::vector<Label> limiting, barrier;
  std::vector<std::int64_t> barrier_station;
  std::vector<double> clear_distance, reachable;

  Candidates(const PlanningModel& of, std::shared_ptr<MapGround> on)
      : model(of), ground(std::move(on)) {}

  void allocate(std::initializer_list<OwnRows*> all) const {
    for (OwnRows* rows : all) *rows = OwnRows(stations, candidates);
  }
  void lay(const std::vector<EvenPath>& paths);
  // Both sides of the band of tracking errors of candidate j of a batch, as two candidates.
  void lay_beside(const Candidates& batch, Index j);
  [[nodiscard]] bool has_band() const noexcept {
    return model.ground.across > 0.0 || model.ground.across_per_curvature > 0.0;
  }
  // With the headings of the body, or those of the lines.
  void sample_ground(const OwnRows* turned_x = nullptr, const OwnRows* turned_y = nullptr);
  void find_braking_forces();
  void sweep_body();
  void limit_by_rough_ground();
  void limit_by_steering();
  // Bounds up to the station of each candidate up to which the reference point may come [m].
  void bound(const std::vector<double>& free);
  [[nodiscard]] TerrainRows terrain() const noexcept;
  [[nodiscard]] PoseRows poses() noexcept {
    return {stations, candidates, body_x.data(), body_y.data(), body_heading_x.data(),
            body_heading_y.data()};
  }
  // With this lower bound.
  [[nodiscard]] ForceRows forces(const OwnRows& slope, const OwnRows& intercept) const noexcept;
  [[nodiscard]] Numbers sliding_friction() const noexcept {
    return model.slides ? friction.read() : Numbers{};
  }
  [[nodiscard]] Flags flags(const std::unique_ptr<bool[]>& of) const noexcept {
    return {of.get(), candidates};
  }
  // Farthest apart that two stations are at the start of a candidate, where they are even [m].
  [[nodiscard]] double spacing_of(Index j) const noexcept;
};

}  // namespace slopewise
