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

// Where paths begin anew, (M,) each: the station behind the vehicle, −1 where the path begins ahead
// of it; the first station [m].
struct PathStart {
  const std::int64_t* segment;
  const double *x, *y;
};

// What `cut_paths` fills in: paths (N + 1, M) [m]; (M,) the first station that is kept, whether one
// before it was left out because it is too near, and the number of stations.
struct CutPaths {
  double *x, *y;
  std::int64_t* kept;
  bool* near;
  std::int64_t* count;
};

// Share of the spacing within which a first step would be too short to have a direction [1].
inline constexpr double too_near = 0.3;

// Paths from their starts on, `fewest` stations at least.
inline void cut_paths(const Paths& paths, const PathStart& start, Index fewest,
                      const CutPaths& out) noexcept {
  const Index m = paths.candidates;
  for (Index j = 0; j < m; ++j) {
    const Index last = static_cast<Index>(paths.count[j]) - 1;
    const Index first = static_cast<Index>(start.segment[j]) + 1;
    const double spacing = std::hypot(paths.x[m + j] - paths.x[j], paths.y[m + j] - paths.y[j]);
    const Index next = paths.at(first, j);
    out.near[j] =
        std::hypot(paths.x[next] - start.x[j], paths.y[next] - start.y[j]) < too_near * spacing;
    const Index kept = std::min(first + (out.near[j] ? 1 : 0), last);
    out.kept[j] = kept;
    out.count[j] = std::max(last - kept + 2, fewest);
    out.x[j] = start.x[j];
    out.y[j] = start.y[j];
    for (Index i = 1; i <= paths.stations; ++i) {
      const Index from = paths.at(std::min(kept + i - 1, last), j);
      out.x[paths.at(i, j)] = paths.x[from];
      out.y[paths.at(i, j)] = paths.y[from];
    }
    if (kept == last) {
      // Only its end is left of it.
      out.x[m + j] = 0.5 * (start.x[j] + out.x[2 * m + j]);
      out.y[m + j] = 0.5 * (start.y[j] + out.y[2 * m + j]);
    }
  }
}

// Stations closer than that are one place [m].
inline constexpr double one_place = 1e-4;

// Which paths have numbers at all of their stations, and no two of these in one place; (M,) each.
inline void find_sound(const Paths& paths, bool* finite, bool* moving) noexcept {
  std::fill_n(finite, paths.candidates, true);
  std::fill_n(moving, paths.candidates, true);
  for (Index i = 0; i < paths.stations; ++i) {
    const double *x = paths.x + paths.at(i, 0), *y = paths.y + paths.at(i, 0);
    const Index back = i > 0 ? paths.candidates : 0;
    for (Index j = 0; j < paths.candidates; ++j) {
      const double dx = x[j] - x[j - back], dy = y[j] - y[j - back];
      const bool inside = i < static_cast<Index>(paths.count[j]);
      const bool stays = (i > 0) & (dx * dx + dy * dy < one_place * one_place);
      finite[j] &= !inside | std::isfinite(x[j] + y[j]);
      moving[j] &= !(inside & stays);
    }
  }
}

}  // namespace slopewise
