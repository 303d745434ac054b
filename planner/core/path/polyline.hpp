// Paths of stations in the plan view: where points lie on them, and what is left of them.
// Paths of M candidates are (N, M), stations behind one another.
#pragma once

#include <cstdint>
#include <numbers>

#include "path/path_deviation.hpp"

namespace slopewise {

struct Paths {
  Index stations, candidates;
  const double *x, *y;        // (N, M) [m]
  const std::int64_t* count;  // (M,) stations of each, N at most

  [[nodiscard]] Index at(Index i, Index j) const noexcept { return i * candidates + j; }
};

// Of n points the nearest of the segments from `low` to below `high` of a line, the share of it and
// the distance [m]; (n,) each.
inline void feet_on_line(const double* line_x, const double* line_y, Index low, Index high,
                         const double* x, const double* y, Index n, std::int64_t* segment,
                         double* share, double* distance) noexcept {
  for (Index j = 0; j < n; ++j) {
    double least = HUGE_VAL;
    segment[j] = low;
    share[j] = 0.0;
    for (Index i = low; i < high; ++i) {
      const Foot foot =
          foot_on({line_x[i], line_y[i]}, {line_x[i + 1], line_y[i + 1]}, {x[j], y[j]});
      if (!(foot.away_sq < least)) continue;
      segment[j] = i;
      share[j] = foot.share;
      least = foot.away_sq;
    }
    distance[j] = std::sqrt(least);
  }
}

// The vehicle is looked for on this much of a path at first: it may cross itself later [m]. Where
// the vehicle is farther from that, or beyond its end, all of the path is searched [m].
inline constexpr double early_search = 15.0, early_enough = 1.0;

// A segment that points elsewhere counts as farther off than any that does not [m]: the cosine of
// the largest angle between the heading and a segment that goes the same way is that below.
inline constexpr double far_aside = 1e6, its_way = 0.36;

// Columns of the answer of `locate_on_paths`, (M,) each, as of PathProjection in Python.
struct Located {
  std::int64_t* segment;
  double *x, *y, *along, *remaining, *beside, *turned;
};

namespace detail {

// A segment of a path with the point nearest to the vehicle so far.
struct NearestSegment {
  Index segment = 0;
  double off = HUGE_VAL, share = 0.0, along = 0.0;

  void take(Index i, double distance, double u, double begin) noexcept {
    if (distance < off) *this = {i, distance, u, begin};
  }
};

}  // namespace detail

// Find a vehicle at a place with a heading [rad] on each path, where it crosses itself on the branch
// that goes its way.
inline void locate_on_paths(const Paths& paths, Point vehicle, double heading,
                            const Located& out) noexcept {
  const double cosine = std::cos(heading), sine = std::sin(heading);
  for (Index j = 0; j < paths.candidates; ++j) {
    const auto point = [&paths, j](Index i) noexcept {
      return Point{paths.x[paths.at(i, j)], paths.y[paths.at(i, j)]};
    };
    detail::NearestSegment nearest, early;
    double begin = 0.0;
    for (Index i = 0; i + 1 < static_cast<Index>(paths.count[j]); ++i) {
      const Point p = point(i), q = point(i + 1);
      const Foot foot = foot_on(p, q, vehicle);
      const double dx = q.x - p.x, dy = q.y - p.y, length = std::sqrt(dx * dx + dy * dy);
      double off = std::sqrt(foot.away_sq);
      if (dx * cosine + dy * sine < its_way * length) off += far_aside;
      nearest.take(i, off, foot.share, begin);
      if (begin <= early_search) early.take(i, off, foot.share, begin);
      begin += length;
    }
    const auto [i, off, share, before] =
        early.off <= early_enough && early.share <= 1.0 ? early : nearest;
    const Point p = point(i), q = point(i + 1);
    const double dx = q.x - p.x, dy = q.y - p.y, to_x = vehicle.x - p.x, to_y = vehicle.y - p.y;
    const double step = max_of(std::sqrt(dx * dx + dy * dy), 1e-9);
    const double inside = min_of(max_of(share, 0.0), 1.0);
    const double along = before + (i == 0 && share < 0.0 ? share : inside) * step;
    constexpr double full = 2.0 * std::numbers::pi;
    const double turned = std::fmod(std::abs(std::atan2(dy, dx) - heading), full);
    out.segment[j] = i;
    out.x[j] = p.x + inside * dx;
    out.y[j] = p.y + inside * dy;
    out.along[j] = along;
    out.remaining[j] = begin - along;
    out.beside[j] = std::hypot((to_x * dy - to_y * dx) / step, max_of(share - 1.0, 0.0) * step);
    out.turned[j] = min_of(turned, full - turned);
  }
}

}  // namespace slopewise
