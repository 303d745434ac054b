// How far two polylines lie apart, either way round, where places are matched in order: a path may
// cross itself or come back along itself. No place of either line is farther from the other than
// what is found and `exact`; where the order of places is lost, what is found is larger.
#pragma once

#include <cmath>
#include <limits>

#include "batch.hpp"

namespace slopewise {

// So far along the planned line from where it is expected a place is looked for [m]: less than a
// turn to a neighbouring lane takes, more than rounding a corner shifts places.
inline constexpr double match_reach = 1.0;
// The same as a share of the distance to it [1], where only part of a path is planned.
inline constexpr double match_drift = 0.1;
// Shortest step between two places that are examined on one segment [m].
inline constexpr double exact = 5e-4;

// A point of a polyline [m].
struct Point {
  double x, y;
};

inline double distance_of(Point a, Point b) noexcept { return std::hypot(b.x - a.x, b.y - a.y); }

inline Point between(Point a, Point b, double share) noexcept {
  return {a.x + share * (b.x - a.x), a.y + share * (b.y - a.y)};
}

// Where a point lies along a segment from p to q, < 0 before and > 1 behind it; squared distance to
// the segment [m²].
struct Foot {
  double share, away_sq;

  [[nodiscard]] double inside() const noexcept { return min_of(max_of(share, 0.0), 1.0); }
};

[[nodiscard]] inline Foot foot_on(Point p, Point q, Point point) noexcept {
  const double dx = q.x - p.x, dy = q.y - p.y, to_x = point.x - p.x, to_y = point.y - p.y;
  Foot foot{(to_x * dx + to_y * dy) / max_of(dx * dx + dy * dy, 1e-18), 0.0};
  const double off_x = foot.inside() * dx - to_x, off_y = foot.inside() * dy - to_y;
  foot.away_sq = off_x * off_x + off_y * off_y;
  return foot;
}

// A place of a polyline: its segment, the share of that, and how far off it is [m].
struct NearestPoint {
  Index segment;
  double share, away;

  [[nodiscard]] double number() const noexcept { return static_cast<double>(segment) + share; }
};

// Vertices of a polyline, 2 at least.
struct Line {
  const double* xy;  // (count, 2) [m]
  Index count;

  [[nodiscard]] Point operator[](Index k) const noexcept { return {xy[2 * k], xy[2 * k + 1]}; }

  // The nearest place on segments `low` to `high` − 1.
  [[nodiscard]] NearestPoint nearest(Index low, Index high, Point p) const noexcept {
    NearestPoint found{low, 0.0, std::numeric_limits<double>::infinity()};
    for (Index k = low; k < high; ++k) {
      const Foot foot = foot_on((*this)[k], (*this)[k + 1], p);
      if (foot.away_sq < found.away) found = {k, foot.inside(), foot.away_sq};
    }
    found.away = std::sqrt(found.away);
    return found;
  }

  // Largest distance of points `low` to `high` − 1 from segment k; 0 without any. Matched in order
  // with these points, no place of the segment is farther from their line.
  [[nodiscard]] double farthest(Index k, Line points, Index low, Index high) const noexcept {
    double away = 0.0;
    for (Index i = low; i < high; ++i) {
      away = max_of(away, foot_on((*this)[k], (*this)[k + 1], points[i]).away_sq);
    }
    return std::sqrt(away);
  }

  // A place by its number, a vertex and a share.
  [[nodiscard]] Point place(double number) const noexcept {
    const Index k = std::min(static_cast<Index>(number), count - 2);
    return between((*this)[k], (*this)[k + 1], number - static_cast<double>(k));
  }

  // Distance of each vertex from the first along the line [m].
  void measure(double* along) const noexcept {
    along[0] = 0.0;
    for (Index i = 1; i < count; ++i) along[i] = along[i - 1] + distance_of((*this)[i - 1], (*this)[i]);
  }
};

// A range of segments, without its end.
struct Segments {
  Index low, high;
};

// The comparison of a given line and a planned one.
class Deviation {
 public:
  // Doubles that it needs beside the lines.
  static Index memory(Index given, Index line) noexcept { return 4 * given + 4 * line; }

  // `distance`: (line.count,) largest distance around each station so far [m].
  Deviation(Line given, Line line, double* distance, double* memory) noexcept
      : given_(given), line_(line), distance_(distance) {
    for (double** part : {&feet_, &away_, &latest_, &earliest_}) {
      *part = memory;
      memory += given.count;
    }
    for (double** part : {&along_, &back_, &low_, &high_}) {
      *part = memory;
      memory += line.count;
    }
  }

  void compare() noexcept {
    line_.measure(along_);
    find_feet_on_line();
    find_feet_on_given();
    for (Index i = 0; i < given_.count; ++i) note(static_cast<Index>(feet_[i] + 0.5), away_[i]);
    walk_given();
    walk_line();
  }

 private:
  void note(Index k, double away) noexcept { distance_[k] = max_of(distance_[k], away); }

  // For each given point the place on the line, as number of a station with a share, and [m].
  void find_feet_on_line() noexcept {
    double at = 0.0;
    Index low = 0, high = 1;
    const Index last = line_.count - 1;
    for (Index i = 0; i < given_.count; ++i) {
      double ahead = at + match_reach;
      if (i > 0) ahead += distance_of(given_[i - 1], given_[i]);
      while (low > 0 && along_[low] > at - match_reach) --low;
      while (low < last - 1 && along_[low + 1] < at - match_reach) ++low;
      high = std::max(high, low + 1);
      while (high > low + 1 && along_[high - 1] > ahead) --high;
      while (high < last && along_[high] <= ahead) ++high;
      const NearestPoint foot = line_.nearest(low, high, given_[i]);
      away_[i] = foot.away;
      feet_[i] = foot.number();
      at = along_[foot.segment] +
           foot.share * (along_[foot.segment + 1] - along_[foot.segment]);
    }
  }

  // For each station the given segments around it, the place on them, and its distance [m].
  void find_feet_on_given() noexcept {
    const Index n = given_.count, last = line_.count - 1;
    std::copy_n(feet_, n, latest_);
    std::copy_n(feet_, n, earliest_);
    for (Index i = 1; i < n; ++i) {
      latest_[i] = max_of(latest_[i], latest_[i - 1]);
      earliest_[n - 1 - i] = min_of(earliest_[n - 1 - i], earliest_[n - i]);
    }
    Index low = 0, high = 1, first = 0, beyond = 0;
    for (Index k = 0; k < line_.count; ++k) {
      while (along_[k] - along_[first] > match_reach) ++first;
      while (beyond < last && along_[beyond] - along_[k] <= match_reach) ++beyond;
      while (low < n - 2 && latest_[low + 1] < static_cast<double>(first)) ++low;
      while (high < n - 1 && earliest_[high] <= static_cast<double>(beyond)) ++high;
      const Segments part{low, std::max(high, low + 1)};
      low_[k] = static_cast<double>(part.low);
      high_[k] = static_cast<double>(part.high);
      const NearestPoint foot = given_.nearest(part.low, part.high, line_[k]);
      distance_[k] = foot.away;
      back_[k] = foot.number();
    }
  }

  [[nodiscard]] double largest() const noexcept {
    return *std::max_element(distance_, distance_ + line_.count);
  }

  // Places between given points. A distance grows no faster than its place moves: before that none
  // can be larger.
  void walk_given() noexcept {
    double most = largest();
    const Index last = line_.count - 1;
    for (Index i = 0; i + 1 < given_.count; ++i) {
      const double low = min_of(feet_[i], feet_[i + 1]), high = max_of(feet_[i], feet_[i + 1]);
      const auto from = static_cast<Index>(low), to = static_cast<Index>(high);
      const auto inner = static_cast<Index>(std::ceil(low));
      if (given_.farthest(i, line_, inner, to + 1) <= most + exact) continue;
      Index first = from, beyond = std::min(to + 1, last);
      while (first > 0 && along_[from] - along_[first] < match_reach) --first;
      while (beyond < last && along_[beyond] - along_[to] < match_reach) ++beyond;
      walk(given_, i, line_, {first, beyond}, most, [](double, const NearestPoint& foot) {
        return static_cast<Index>(foot.number() + 0.5);
      });
    }
  }

  // Places between stations.
  void walk_line() noexcept {
    double most = largest();
    for (Index k = 0; k + 1 < line_.count; ++k) {
      const double low = min_of(back_[k], back_[k + 1]), high = max_of(back_[k], back_[k + 1]);
      const auto inner = static_cast<Index>(std::ceil(low));
      if (line_.farthest(k, given_, inner, static_cast<Index>(high) + 1) <= most + exact) {
        continue;
      }
      const auto first = static_cast<Index>(min_of(low_[k], low_[k + 1]));
      const auto beyond = static_cast<Index>(max_of(high_[k], high_[k + 1]));
      walk(line_, k, given_, {first, beyond}, most, [k](double share, const NearestPoint&) {
        return k + static_cast<Index>(share + 0.5);
      });
    }
  }

  // Places of segment i of one line against segments of the other; `station_of` tells for each
  // place, by its share of the segment, which station its distance is noted at.
  template <class StationOf>
  void walk(Line one, Index i, Line other, Segments part, double& most,
            const StationOf& station_of) noexcept {
    const Point a = one[i], b = one[i + 1];
    const double length = distance_of(a, b);
    for (double at = 0.0; at < length;) {
      const double share = at / length;
      const NearestPoint foot = other.nearest(part.low, part.high, between(a, b, share));
      note(station_of(share, foot), foot.away);
      most = max_of(most, foot.away);
      at += max_of(most - foot.away, exact);
    }
  }

  Line given_, line_;
  double* distance_;
  double *feet_, *away_, *latest_, *earliest_;  // (given.count,)
  double *along_, *back_, *low_, *high_;        // (line.count,)
};

// The comparison of a whole path that was given with a line along part of it.
class PartDeviation {
 public:
  static Index memory(Index given, Index line) noexcept {
    return given + 2 * line + 2 * (given + line) + Deviation::memory(given + 2, line + 2) + 16;
  }

  // `passed`: where the line begins on the whole path, < 0 before it; `length`: of that path [m].
  // Noise makes the given polyline longer than the stations along it.
  PartDeviation(Line given, Line line, double passed, double length, double* memory) noexcept
      : given_(given), line_(line), passed_(passed), at_(memory), along_(at_ + given.count) {
    given_.measure(at_);
    stretch_ = at_[given.count - 1] / max_of(length, 1e-9);
    drop_common_end();
    line_.measure(along_);
    rest_ = along_ + line.count;
  }

  // Between the later beginning and the earlier end of both lines, into (line.count,) [m].
  void compare(double* distance) noexcept {
    double begin = 0.0, first = 0.0;
    if (passed_ > 0.0) {
      begin = place(given_, at_, passed_ * stretch_, line_[0]);
    } else {
      first = place(line_, along_, -passed_, given_[0]);
    }
    const Index n = given_.count, rows = line_.count;
    const double gone = arc_at(at_, n, begin), before = arc_at(along_, rows, first);
    const double expected = gone + (along_[rows - 1] - before) * stretch_;
    const double end = place(given_, at_, expected, line_[rows - 1]);
    double last = static_cast<double>(rows - 1);
    if (end >= static_cast<double>(n - 1) - 1e-6) {
      const double left = (at_[n - 1] - gone) / stretch_;
      last = place(line_, along_, before + left, given_[n - 1]);
    }
    double* memory = rest_;
    const Line line = part(line_, first, max_of(last, first), memory);
    const Line given = part(given_, begin, max_of(end, begin), memory);
    double* around = memory;
    std::fill_n(around, line.count, 0.0);
    Deviation(given, line, around, around + line.count).compare();
    for (Index k = 0; k < line.count; ++k) {
      const Index row = std::min(static_cast<Index>(first) + k, rows - 1);
      distance[row] = max_of(distance[row], around[k]);
    }
  }

 private:
  // Where both are one from a vertex on, as the rest of a path mostly is, nothing is apart.
  void drop_common_end() noexcept {
    Index same = 0;
    const Index most = std::min(given_.count, line_.count) - 1;
    while (same < most) {
      const Point a = given_[given_.count - 1 - same], b = line_[line_.count - 1 - same];
      if (a.x != b.x || a.y != b.y) break;
      ++same;
    }
    given_.count -= std::max<Index>(same - 1, 0);
    line_.count -= std::max<Index>(same - 1, 0);
  }

  // Number of the place nearest to a point, around an arc [m].
  static double place(Line line, const double* along, double expected, Point p) noexcept {
    const double around = match_reach + match_drift * std::abs(expected);
    Index low = 0, high = line.count - 1;
    while (low < high - 1 && along[low + 1] < expected - around) ++low;
    while (high > low + 1 && along[high - 1] > expected + around) --high;
    return line.nearest(low, high, p).number();
  }

  static double arc_at(const double* along, Index count, double number) noexcept {
    const Index k = std::min(static_cast<Index>(number), count - 2);
    return along[k] + (number - static_cast<double>(k)) * (along[k + 1] - along[k]);
  }

  // The polyline between two of its places: both of them, and the vertices in between.
  static Line part(Line line, double begin, double end, double*& memory) noexcept {
    const Index first = static_cast<Index>(begin) + 1;
    const Index inner = std::max<Index>(static_cast<Index>(std::ceil(end)) - first, 0);
    double* out = memory;
    memory += 2 * (inner + 2);
    const Point start = line.place(begin), stop = line.place(end);
    out[0] = start.x;
    out[1] = start.y;
    std::copy_n(line.xy + 2 * first, 2 * inner, out + 2);
    out[2 * inner + 2] = stop.x;
    out[2 * inner + 3] = stop.y;
    return {out, inner + 2};
  }

  Line given_, line_;
  double passed_, stretch_ = 1.0;
  double *at_, *along_, *rest_ = nullptr;
};

}  // namespace slopewise
