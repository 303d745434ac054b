// Heading of a body whose steering centre trails behind the reference point.
//
// It moves straight ahead, like the end of a rod of length e: along each straight piece between
// stations exactly as a tractrix, tan(β/2) falling by exp(−d/e) over a distance d, with β the
// angle between the rod and the piece.
#pragma once

#include <cmath>

#include "batch.hpp"

namespace slopewise {

// Stations so close are one: the padding behind the last one of a candidate [m].
inline constexpr double same_place = 1e-9;

struct Direction {
  double x, y;

  [[nodiscard]] double dot(const Direction& other) const noexcept {
    return x * other.x + y * other.y;
  }
  [[nodiscard]] double cross(const Direction& other) const noexcept {
    return x * other.y - y * other.x;
  }
  // Turned to the right by the angle whose half has this tangent.
  [[nodiscard]] Direction turned_back(double half) const noexcept {
    const double per = 1.0 / (1.0 + half * half);
    const double cosine = (1.0 - half * half) * per, sine = 2.0 * half * per;
    return {x * cosine + y * sine, y * cosine - x * sine};
  }
};

// Reference points of M candidates, (N, M) each, padded with the last one [m].
struct ReferenceRows {
  Index stations, candidates;
  const double *x, *y;

  struct Piece {
    Direction along;
    double length;  // [m]
  };
  // From station k to the next; its direction is that of the difference where both are one place.
  [[nodiscard]] Piece piece(Index k, Index j) const noexcept {
    const Index at = k * candidates + j, next = at + candidates;
    const double dx = x[next] - x[at], dy = y[next] - y[at];
    const double length = std::sqrt(dx * dx + dy * dy), least = max_of(length, same_place);
    return {{dx / least, dy / least}, length};
  }
};

namespace detail {

// At the first station, of a body that has long driven the turn that the path begins with: that of
// the mean curvature of its first e.
inline Direction steady_heading(const ReferenceRows& path, Index j, double rod) noexcept {
  const ReferenceRows::Piece first = path.piece(0, j);
  ReferenceRows::Piece before{first.along, max_of(first.length, same_place)};
  double arc = 0.0, turn = 0.0;
  for (Index k = 1; arc < rod && k + 1 < path.stations; ++k) {
    const ReferenceRows::Piece next = path.piece(k, j);
    if (next.length <= same_place) break;
    turn += std::atan2(before.along.cross(next.along), before.along.dot(next.along));
    arc += 0.5 * (before.length + next.length);
    before = next;
  }
  const double sine = arc > 0.0 ? std::clamp(rod * turn / arc, -1.0, 1.0) : 0.0;
  return first.along.turned_back(sine / (1.0 + std::sqrt(1.0 - sine * sine)));
}

}  // namespace detail

// Unit vectors of the body's heading, (N, M) each, for a rod of this length [m].
inline void trail(const ReferenceRows& path, double rod, double* heading_x,
                  double* heading_y) noexcept {
  const Index stride = path.candidates;
  for (Index j = 0; j < path.candidates; ++j) {
    Direction heading = detail::steady_heading(path, j, rod);
    for (Index k = 0; k < path.stations; ++k) {
      heading_x[k * stride + j] = heading.x;
      heading_y[k * stride + j] = heading.y;
      if (k + 1 == path.stations) break;
      const ReferenceRows::Piece piece = path.piece(k, j);
      if (piece.length <= same_place) continue;
      const double cosine = heading.dot(piece.along), sine = heading.cross(piece.along);
      const double half = sine / max_of(1.0 + cosine, same_place) * std::exp(-piece.length / rod);
      heading = piece.along.turned_back(half);
    }
  }
}

}  // namespace slopewise
