// What is around FITPACK: the places that its spline is drawn through, and even stations on it.
#pragma once

#include <array>
#include <cmath>

#include "path/path_deviation.hpp"

namespace slopewise {

inline constexpr double corner_rounding = 0.03;  // [m] of a corner between distant vertices
inline constexpr double rounding_share = 0.02;   // the same as a share of their distance [1]
inline constexpr double sharp_turn = 0.5;        // [rad] corners that turn less are rounded less
inline constexpr double finest = 2e-4;  // [m] a polyline is never taken to be more exact than this
inline constexpr double dense_step = 0.5;  // [m] between distant vertices it counts at least so often
inline constexpr Index pieces_per_station = 4;  // of the curve, whose lengths are added up [1]
inline constexpr double end_weight = 100.0;  // the ends count so much more than what is between [1]
inline constexpr Index max_degree = 3;

// Places along a polyline, (count,) each and (count, 2).
struct DensePlaces {
  double *along, *places, *weights;
};

inline double turn_between(Point a, Point b, Point c) noexcept {
  const double ax = b.x - a.x, ay = b.y - a.y, bx = c.x - b.x, by = c.y - b.y;
  return std::abs(std::atan2(ax * by - ay * bx, ax * bx + ay * by));
}

// At most so many places.
inline Index dense_count(Index points, double length) noexcept {
  return points + static_cast<Index>(length / dense_step) + 1;
}

// Distances along, places and weights of what the spline is drawn through; how many there are.
//
// Between distant vertices a spline would swing out: it is pinned to the polyline in between. The
// farther apart and the sharper its corners, the less a polyline says how they are meant.
inline Index between_vertices(Line line, const double* along, double stray,
                              const DensePlaces& out) noexcept {
  Index m = 0, step = 0;
  double turn = 0.0;
  for (Index i = 0; i + 1 < line.count; ++i) {
    const double length = along[i + 1] - along[i];
    const double next = i + 2 < line.count ? turn_between(line[i], line[i + 1], line[i + 2]) : 0.0;
    const double sharpness = min_of(max_of(turn, next) / sharp_turn, 1.0);
    const double rounding = min_of(rounding_share * length * sharpness, corner_rounding);
    const double tolerance = max_of(max_of(stray, rounding), finest);
    // Half way between its vertices a chord of an arc is off by an eighth of length and turn; half
    // of that is allowed where the line hardly turns, or a spline would bend to its chords.
    const double gentle = (1.0 - sharpness) * (1.0 - sharpness);
    const double sag = gentle * length * max_of(turn, next) / 16.0;
    turn = next;
    for (double at = along[i]; at < along[i + 1]; ++m) {
      const Point p = between(line[i], line[i + 1], (at - along[i]) / length);
      out.along[m] = at;
      out.weights[m] = 1.0 / (at > along[i] ? max_of(tolerance, sag) : tolerance);
      out.places[2 * m] = p.x;
      out.places[2 * m + 1] = p.y;
      while (static_cast<double>(step) * dense_step <= at) ++step;
      at = static_cast<double>(step) * dense_step;
    }
  }
  out.along[m] = along[line.count - 1];
  out.weights[m] = out.weights[m - 1];
  std::copy_n(line.xy + 2 * (line.count - 1), 2, out.places + 2 * m);
  out.weights[0] *= end_weight;
  out.weights[m] *= end_weight;
  return m + 1;
}

// A plane spline whose parameter runs from 0 to `length`.
class Spline {
 public:
  Spline(const double* knots, const double* x, const double* y, Index coefficients, Index degree,
         double length) noexcept
      : knots_(knots), x_(x), y_(y), count_(coefficients), degree_(degree), length_(length) {}

  static Index memory(Index stations) noexcept { return pieces_per_station * stations + 1; }

  // Stations (count, 2) equally far apart along the curve; the ends are those of a polyline. The
  // curve's length differs a little from the polyline's that its parameter is.
  void stations(Index count, Point first, Point last, double* even, double* memory) const noexcept {
    const Index pieces = pieces_per_station * count;
    double* arc = memory;
    Index span = degree_;
    Point before = at(0.0, span);
    arc[0] = 0.0;
    for (Index i = 1; i <= pieces; ++i) {
      const Point here = at(length_ * static_cast<double>(i) / static_cast<double>(pieces), span);
      arc[i] = arc[i - 1] + distance_of(before, here);
      before = here;
    }
    span = degree_;
    for (Index j = 1, i = 0; j + 1 < count; ++j) {
      const double wanted = arc[pieces] * static_cast<double>(j) / static_cast<double>(count - 1);
      while (arc[i + 1] < wanted) ++i;
      const double share = (wanted - arc[i]) / (arc[i + 1] - arc[i]);
      const double parameter =
          length_ * (static_cast<double>(i) + share) / static_cast<double>(pieces);
      const Point p = at(parameter, span);
      even[2 * j] = p.x;
      even[2 * j + 1] = p.y;
    }
    even[0] = first.x;
    even[1] = first.y;
    even[2 * count - 2] = last.x;
    even[2 * count - 1] = last.y;
  }

 private:
  // A place by de Boor's rule; the knot before it is looked for from `span` on.
  Point at(double parameter, Index& span) const noexcept {
    while (span + 1 < count_ && knots_[span + 1] <= parameter) ++span;
    std::array<Point, max_degree + 1> local{};
    for (Index i = 0; i <= degree_; ++i) {
      local[static_cast<std::size_t>(i)] = {x_[span - degree_ + i], y_[span - degree_ + i]};
    }
    for (Index level = 1; level <= degree_; ++level) {
      for (Index i = degree_; i >= level; --i) {
        const double low = knots_[span - degree_ + i], high = knots_[span + 1 + i - level];
        const double share = (parameter - low) / (high - low), rest = 1.0 - share;
        Point& p = local[static_cast<std::size_t>(i)];
        const Point& q = local[static_cast<std::size_t>(i - 1)];
        p = {rest * q.x + share * p.x, rest * q.y + share * p.y};
      }
    }
    return local[static_cast<std::size_t>(degree_)];
  }

  const double *knots_, *x_, *y_;
  Index count_, degree_;
  double length_;
};

}  // namespace slopewise
