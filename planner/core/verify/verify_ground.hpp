// Ground on which a vehicle must neither drive nor rest, judged once more from the map alone: unknown
// ground, slopes beyond the trained ones or on which it is not held, steps, and what underside or
// body strike. A clear distance ends before the first of these places.
#pragma once

#include "generated/laws.hpp"
#include "verify/verify_ground_terms.hpp"

namespace slopewise::verify {

[[nodiscard]] inline Index ground_memory(const PlannedLine& line, Index poses,
                                         Index columns) noexcept {
  constexpr auto per_pose = static_cast<Index>(sizeof(BodyPose) / sizeof(double));
  return line.stations + poses * (per_pose + 2 * static_cast<Index>(wheel_count) + 1) + columns;
}

namespace detail {

class GroundVerifier {
 public:
  GroundVerifier(const MapView& map, const BodySizes& sizes, const PlannedLine& line,
                 const RestingGround& resting, const GroundLimits& limits,
                 const GroundTolerance& tolerance, const GroundRange& range, double* memory) noexcept
      : map_(map), sizes_(sizes), resting_(resting), limits_(limits), tolerance_(tolerance),
        range_(range), step_(pose_step(map, sizes)), count_(count_poses(line, step_)),
        fine_(map.cell <= sizes.wheel_radius),
        blur_((fine_ ? blurred_cells : coarsely_blurred_cells) * map.cell) {
    double *heading = memory, *room = memory + line.stations;
    ramp_ = room;
    room += map.columns;
    for (WheelTrack& wheel : wheels_) {
      wheel = {room, room + count_};
      room += 2 * count_;
    }
    double* ground = room;
    poses_ = new (ground + count_) BodyPose[static_cast<std::size_t>(count_)];
    poses_along(line, sizes, step_, heading, poses_);
    for (std::size_t w = 0; w < wheel_count; ++w) {
      follow_wheel(map, sizes, poses_, count_, step_, ahead_of(w), aside_of(w), ground, wheels_[w]);
    }
  }

  [[nodiscard]] GroundFinding find() noexcept {
    if (fine_) {
      for (std::size_t w = 0; w < wheel_count; ++w) find_step(w);
    }
    const double spacing = look_radii * sizes_.wheel_radius;
    double looked = range_.begin - spacing;
    for (Index i = 0; i < count_; ++i) {
      const double s = poses_[i].station;
      if (s > range_.end || s >= found_.station) break;
      if (s < range_.begin) continue;
      const bool looks = s - looked >= spacing;
      if (looks) looked = s;
      if (looks || is_station(i)) look_at(i, looks);
    }
    return found_;
  }

 private:
  // Plane of the wheels: height in the middle [m], rise ahead and to the left [1].
  struct Plane {
    double level, rise, lean;
  };

  [[nodiscard]] double ahead_of(std::size_t wheel) const noexcept {
    return wheel < 2 ? 0.5 * sizes_.wheelbase : -0.5 * sizes_.wheelbase;
  }
  [[nodiscard]] double aside_of(std::size_t wheel) const noexcept {
    return wheel % 2 == 0 ? 0.5 * sizes_.track_width : -0.5 * sizes_.track_width;
  }

  void note(GroundKind kind, double station, double value, double x, double y) noexcept {
    if (station < found_.station) found_ = {kind, station, value, x, y};
  }

  // A place of a pose in the frame of its body.
  void note_at(GroundKind kind, const BodyPose& p, double value, double ahead,
               double aside) noexcept {
    note(kind, p.station, value, p.x + ahead * p.heading_x - aside * p.heading_y,
         p.y + ahead * p.heading_y + aside * p.heading_x);
  }

  // Ground that a wheel cannot climb or fall: what its lowest point rises within a short length,
  // beyond what the ground before or after it does. It blocks the pose that has all of it behind it.
  void find_step(std::size_t w) noexcept {
    const double *way = wheels_[w].way, *z = wheels_[w].contact;
    const double length = max_of(step_radii * sizes_.wheel_radius, step_cells * map_.cell);
    const auto within = static_cast<Index>(std::ceil(length / step_));
    const auto far = static_cast<Index>(std::ceil(trend_radii * sizes_.wheel_radius / step_));
    const double most = (1.0 + tolerance_.height) * sizes_.max_step;
    for (Index i = 0; i + within < count_; ++i) {
      const Index k = i + within;
      if (poses_[k].station > range_.end || poses_[k].station >= found_.station) break;
      if (poses_[i].station < range_.begin) continue;
      const double rise = z[k] - z[i];
      if (!(std::abs(rise) > most)) continue;
      const double sign = rise > 0.0 ? 1.0 : -1.0, gone = way[k] - way[i];
      double slope = 0.0;
      for (const Index reach : {within, far}) {
        const Index back = std::max<Index>(i - reach, 0), on = std::min(k + reach, count_ - 1);
        slope = max_of(slope, sign * slope_between(way, z, back, on));
        slope = max_of(slope, sign * slope_between(way, z, back, i));
        slope = max_of(slope, sign * slope_between(way, z, k, on));
      }
      const double step = std::abs(rise) - slope * gone;
      if (step > most) note_at(GroundKind::step, poses_[k], step, ahead_of(w), aside_of(w));
    }
  }

  [[nodiscard]] static double slope_between(const double* way, const double* z, Index i,
                                            Index k) noexcept {
    const double length = way[k] - way[i], slope = length > 1e-6 ? (z[k] - z[i]) / length : 0.0;
    return slope == slope ? slope : 0.0;
  }

  [[nodiscard]] bool is_station(Index i) const noexcept {
    return poses_[i].share == 0.0 || poses_[i].share == 1.0;
  }

  // Slopes below a pose, and if asked what is below its wheels and body.
  void look_at(Index i, bool closely) noexcept {
    const BodyPose& p = poses_[i];
    std::array<double, wheel_count> z{};
    for (std::size_t w = 0; w < wheel_count; ++w) z[w] = wheels_[w].contact[i];
    const Plane plane{0.25 * (z[0] + z[1] + z[2] + z[3]),
                      0.5 * (z[0] + z[1] - z[2] - z[3]) / sizes_.wheelbase,
                      0.5 * (z[0] - z[1] + z[2] - z[3]) / sizes_.track_width};
    if (closely && !look_for_unknown(p)) return;
    // Next to unknown cells wheels have no height; whether these cells bar was asked above.
    if (!std::isfinite(plane.level)) return;
    look_at_slopes(p, plane, is_station(i) ? 1.0 : between_tolerances);
    if (!closely) return;
    const double twist = std::abs(z[0] - z[1] - z[2] + z[3]);
    const double hangs = (1.0 + tolerance_.twist) * sizes_.wheel_travel + blur_;
    if (fine_ && twist > hangs) {
      note_at(GroundKind::twist, p, twist, 0.5 * sizes_.wheelbase, 0.0);
    }
    look_under_body(p, plane);
  }

  [[nodiscard]] bool look_for_unknown(const BodyPose& p) noexcept {
    for (std::size_t w = 0; w < wheel_count; ++w) {
      const double ahead = ahead_of(w), aside = aside_of(w);
      const double x = p.x + ahead * p.heading_x - aside * p.heading_y;
      const double y = p.y + ahead * p.heading_y + aside * p.heading_x;
      if (const double z = map_.facet(x, y); z == z) continue;
      note(GroundKind::unknown, p.station, 0.0, x, y);
      return false;
    }
    return true;
  }

  void look_at_slopes(const BodyPose& p, const Plane& plane, double tolerances) noexcept {
    const double grade = std::atan(plane.rise);
    const double roll = std::atan(plane.lean * std::cos(grade));
    const double beyond_grade = max_of(limits_.grade_low - grade, grade - limits_.grade_high);
    const double beyond_roll = max_of(limits_.roll_low - roll, roll - limits_.roll_high);
    if (max_of(beyond_grade, beyond_roll) > tolerances * tolerance_.slope) {
      note(GroundKind::untrained, p.station, beyond_grade > beyond_roll ? grade : roll, p.x, p.y);
    }
    const double force = at(resting_.force, p.segment, p.share);
    const double friction =
        min_of(resting_.friction[p.segment], resting_.friction[p.segment + 1]);
    double held = laws::brakes_hold(force, grade);
    if (friction < infinite) held = min_of(held, laws::friction_holds(friction, grade, roll));
    if (held < -tolerances * tolerance_.holds) note(GroundKind::holding, p.station, -held, p.x, p.y);
  }

  // Cells whose middle is under the body, with its band: all are known, and none reaches it.
  void look_under_body(const BodyPose& p, const Plane& plane) noexcept {
    const double bend = std::abs(at(resting_.curvature, p.segment, p.share));
    const double arm = max_of(sizes_.front, sizes_.rear) + sizes_.body_offset;
    const double band = limits_.across + limits_.across_per_curvature * bend +
                        arm * limits_.turned + at(resting_.offset, p.segment, p.share);
    const double half = 0.5 * sizes_.width + band, longer = 0.5 * sizes_.width * limits_.turned;
    const double front = sizes_.front + longer, rear = sizes_.rear + longer;
    const double up = front * p.heading_y, down = -rear * p.heading_y;
    const double tall = half * std::abs(p.heading_x);
    const Index first = row_of(p.y + min_of(up, down) - tall) + 1;
    const Index last = row_of(p.y + max_of(up, down) + tall);
    // Below the body the vertical is longer than the clearance by the slope.
    const double secant = std::sqrt(1.0 + plane.rise * plane.rise + plane.lean * plane.lean);
    const double most =
        (1.0 + tolerance_.height) * sizes_.clearance * secant + blur_;
    const double reach = std::hypot(max_of(front, rear), half);
    lay_ramp(p, plane, reach);
    for (Index i = std::max<Index>(first, 0); i <= std::min(last, map_.rows - 1); ++i) {
      const double dy = map_.origin_y + static_cast<double>(i) * map_.cell - p.y;
      // From the middle of the wheelbase to the east: where the row enters and leaves the body.
      double low = -infinite, high = infinite;
      cut_row(p.heading_x, -rear - dy * p.heading_y, front - dy * p.heading_y, low, high);
      cut_row(-p.heading_y, -half - dy * p.heading_x, half - dy * p.heading_x, low, high);
      if (!(low <= high)) continue;
      look_along_row(p, plane, i, dy, low, high, most);
    }
  }

  // The plane of the wheels along a row, relative to the middle of the wheelbase, so far to its west
  // and to its east [m].
  void lay_ramp(const BodyPose& p, const Plane& plane, double reach) noexcept {
    const double per_x = plane.rise * p.heading_x - plane.lean * p.heading_y;
    const double middle = (p.x - map_.origin_x) * map_.per_metre;
    const double around = reach * map_.per_metre + 1.0;
    const auto first = static_cast<Index>(max_of(middle - around, 0.0));
    const auto end = static_cast<Index>(
        min_of(max_of(middle + around, 0.0), static_cast<double>(map_.columns - 1))) + 1;
    for (Index j = first; j < end; ++j) {
      ramp_[j] = per_x * (static_cast<double>(j) - middle) * map_.cell;
    }
  }

  // The row below a coordinate.
  [[nodiscard]] Index row_of(double y) const noexcept {
    return static_cast<Index>(std::floor((y - map_.origin_y) / map_.cell));
  }

  // Keep what of [low, high] has `below` <= slope x <= `above`.
  static void cut_row(double slope, double below, double above, double& low, double& high) noexcept {
    if (std::abs(slope) < 1e-12) {
      if (below > 0.0 || above < 0.0) high = -infinite;
      return;
    }
    const double a = below / slope, b = above / slope;
    low = max_of(low, min_of(a, b));
    high = min_of(high, max_of(a, b));
  }

  void look_along_row(const BodyPose& p, const Plane& plane, Index i, double dy, double low,
                      double high, double most) noexcept {
    const double west = map_.origin_x - p.x;
    const Index first = static_cast<Index>(std::ceil((low - west) / map_.cell));
    const Index end = static_cast<Index>(std::floor((high - west) / map_.cell)) + 1;
    const Index from = std::max<Index>(first, 0), to = std::min(end, map_.columns);
    const double* z = map_.heights + i * map_.columns;
    const double base = plane.level + (plane.rise * p.heading_y + plane.lean * p.heading_x) * dy;
    const double* ramp = ramp_;
    std::int64_t struck = 0;  // what is unknown is not below the body
    for (Index j = from; j < to; ++j) struck += z[j] - base - ramp[j] <= most ? 0 : 1;
    if (struck == 0) return;
    for (Index j = from; j < to; ++j) {
      const double over = z[j] - base - ramp[j];
      if (over <= most) continue;
      const double dx = west + static_cast<double>(j) * map_.cell;
      const double ahead = dx * p.heading_x + dy * p.heading_y;
      const double aside = dy * p.heading_x - dx * p.heading_y;
      const bool between = std::abs(ahead) <= 0.5 * sizes_.wheelbase &&
                           std::abs(aside) <= 0.5 * (sizes_.track_width + sizes_.wheel_width);
      const GroundKind kind = !(over == over) ? GroundKind::unknown
                              : between       ? GroundKind::clearance
                                              : GroundKind::body;
      note_at(kind, p, over == over ? over : 0.0, ahead, aside);
      return;
    }
  }

  const MapView& map_;
  const BodySizes& sizes_;
  const RestingGround& resting_;
  const GroundLimits& limits_;
  const GroundTolerance& tolerance_;
  const GroundRange& range_;
  double step_;
  Index count_;
  bool fine_;    // cells show what a wheel feels
  double blur_;  // of heights between stations [m]
  double* ramp_ = nullptr;  // (columns,) rise of the plane of the wheels along a row [m]
  BodyPose* poses_ = nullptr;
  std::array<WheelTrack, wheel_count> wheels_{};
  GroundFinding found_;
};

}  // namespace detail

// Stations of a line up to where the ground ahead of its range still tells what a step is.
[[nodiscard]] inline PlannedLine up_to_range(PlannedLine line, const MapView& map,
                                             const BodySizes& sizes,
                                             const GroundRange& range) noexcept {
  const double ahead = (trend_radii + step_radii) * sizes.wheel_radius + step_cells * map.cell;
  const double* end = std::upper_bound(line.station, line.station + line.stations,
                                       range.end + ahead);
  line.stations = std::min(std::max<Index>(end - line.station + 1, 2), line.stations);
  return line;
}

// The first place of a candidate within a range that blocks the path; `memory` is ground_memory.
[[nodiscard]] inline GroundFinding first_blocked(const MapView& map, const BodySizes& sizes,
                                                const PlannedLine& line,
                                                const RestingGround& resting,
                                                const GroundLimits& limits,
                                                const GroundTolerance& tolerance,
                                                const GroundRange& range, double* memory) noexcept {
  if (!(range.end > range.begin)) return {};
  const PlannedLine part = up_to_range(line, map, sizes, range);
  return detail::GroundVerifier(map, sizes, part, resting, limits, tolerance, range, memory).find();
}

}  // namespace slopewise::verify
