// What a vehicle stands on along each candidate: grade, roll and station.
// Where cells are not larger than the wheel's radius, wheels stand on contact heights; elsewhere on
// the bilinear surface between the centres of cells. Articulation and the ground under the front
// wheels, over which roughness rolls its own wheel, are those of the bilinear surface on all maps.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <mutex>
#include <numbers>

#include "ground/height_grid.hpp"

namespace slopewise {

// Rows of M candidates in the memory of the caller, (N, M) each unless stated otherwise.
struct TerrainTable {
  Index stations, candidates;
  const double *x, *y;
  const std::int64_t* count;  // (M,) stations of each candidate, at least 3
  // Heading of the body: of a vehicle that follows the path exactly, the rows written below.
  const double *body_x, *body_y;
  double body_offset;  // middle of the wheelbase ahead of the point on the path [m]
  double *z, *station, *heading_x, *heading_y, *curvature, *grade, *sin_grade, *sin_roll,
      *vertical_curvature;
  bool* known;
  float *twist, *front;  // front: (N, 2, M)
};

inline constexpr std::size_t footprint_points = 5;  // the wheels, and the point on the path
inline constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

namespace detail {

using Lanes = std::array<double, wide>;

// Places of up to `wide` candidates: the cell to the south-west, and how far from it.
struct Places {
  std::array<Index, wide> row, column;
  Lanes u, v;
};

// Places ahead of and to the left of poses [m]; u is NaN off the map.
inline void locate(const HeightGrid& grid, const double* x, const double* y, const double* heading_x,
                   const double* heading_y, double ahead, double aside, Index lanes,
                   Places& out) noexcept {
  const double right = static_cast<double>(grid.columns() - 1);
  const double top = static_cast<double>(grid.rows() - 1), per_metre = grid.per_metre();
  for (Index j = 0; j < lanes; ++j) {
    const auto n = static_cast<std::size_t>(j);
    const double ahead_u = heading_x[j] * per_metre, ahead_v = heading_y[j] * per_metre;
    double u = (x[j] - grid.origin_x()) * per_metre + ahead * ahead_u - aside * ahead_v;
    double v = (y[j] - grid.origin_y()) * per_metre + ahead * ahead_v + aside * ahead_u;
    const bool inside = (u >= 0.0) & (v >= 0.0) & (u <= right) & (v <= top);
    u = inside ? u : 0.0;
    v = inside ? v : 0.0;
    const double column = min_of(std::floor(u), right - 1.0), row = min_of(std::floor(v), top - 1.0);
    out.column[n] = static_cast<Index>(column);
    out.row[n] = static_cast<Index>(row);
    out.u[n] = inside ? u - column : unknown;
    out.v[n] = v - row;
  }
}

// Heights of the bilinear surface, NaN next to unknown cells and off the map.
inline void interpolate(const HeightGrid& grid, const Places& at, Index lanes,
                        Lanes& height) noexcept {
  const Index columns = grid.columns();
  for (Index j = 0; j < lanes; ++j) {
    const auto n = static_cast<std::size_t>(j);
    const double* z = grid.heights() + at.row[n] * columns + at.column[n];
    const double lower = z[0] + at.u[n] * (z[1] - z[0]);
    const double upper = z[columns] + at.u[n] * (z[columns + 1] - z[columns]);
    height[n] = lower + at.v[n] * (upper - lower);
  }
}

// Add the lift of a tyre where the height is known.
inline void lift_tyre(HeightGrid& grid, const Places& at, const std::array<Index, wide>& heading,
                      Index lanes, Lanes& height) {
  for (Index j = 0; j < lanes; ++j) {
    const auto n = static_cast<std::size_t>(j);
    if (std::isfinite(height[n])) {
      height[n] += grid.lift(heading[n], at.row[n], at.column[n], at.u[n], at.v[n]);
    }
  }
}

// arctan(tangent) with secant = √(1 + tangent²), to 1e-13, without a branch or a call: the tangent
// of a quarter of the angle, below √2 − 1, then 16 terms of Taylor's series.
inline double arctan_of(double tangent, double secant) noexcept {
  const double half = tangent / (1.0 + secant);
  const double quarter = half / (1.0 + std::sqrt(1.0 + half * half));
  const double square = quarter * quarter;
  double series = 0.0;
  for (int n = 15; n >= 0; --n) series = 1.0 / (2.0 * n + 1.0) - square * series;
  return 4.0 * quarter * series;
}

// Steps of up to `wide` candidates, from station to station: the one before the present station.
class Steps {
 public:
  Steps(const double* x, const double* y, Index stride, Index lanes) noexcept : lanes_(lanes) {
    for (Index j = 0; j < lanes; ++j) {
      const auto n = static_cast<std::size_t>(j);
      x_[n] = x[j + stride] - x[j];
      y_[n] = y[j + stride] - y[j];
      length_[n] = std::sqrt(x_[n] * x_[n] + y_[n] * y_[n]);
    }
  }

  // Heading and curvature from the steps before and after station k. Beyond the last station of a
  // candidate the step repeats; its curvature there is that before it.
  void turn(Index k, const std::int64_t* count, const double* x, const double* y,
            const double* next_x, const double* next_y, const double* curvature_before,
            double* heading_x, double* heading_y, double* curvature) noexcept {
    for (Index j = 0; j < lanes_; ++j) {
      const auto n = static_cast<std::size_t>(j);
      const auto last = static_cast<Index>(count[j]) - 1;
      const bool inside = k < last;
      const double ax = x_[n], ay = y_[n], a = length_[n];
      const double bx = inside ? next_x[j] - x[j] : ax, by = inside ? next_y[j] - y[j] : ay;
      const double b = std::sqrt(bx * bx + by * by), cx = ax + bx, cy = ay + by;
      const double per_chord = 1.0 / std::sqrt(cx * cx + cy * cy);
      heading_x[j] = cx * per_chord;
      heading_y[j] = cy * per_chord;
      const double here = 2.0 * (ax * by - ay * bx) / (a * b) * per_chord;
      curvature[j] = inside ? here : (k == last ? curvature_before[j] : 0.0);
      x_[n] = bx;
      y_[n] = by;
      length_[n] = b;
    }
  }

 private:
  Index lanes_;
  Lanes x_, y_, length_;
};

// Station k from the one before. From a height that was never known there is no rise.
inline void advance(Index k, const std::int64_t* count, Index stride, Index lanes, const double* x,
                    const double* y, const double* z_before, const double* z,
                    double* station) noexcept {
  for (Index j = 0; j < lanes; ++j) {
    const double dx = x[j] - x[j - stride], dy = y[j] - y[j - stride];
    const double rise = z[j] - z_before[j], dz = std::isfinite(rise) ? rise : 0.0;
    const double step = std::sqrt(dx * dx + dy * dy + dz * dz);
    station[j] = station[j - stride] + (k < static_cast<Index>(count[j]) ? step : 0.0);
  }
}

// The headings of a height grid nearest to unit vectors: forwards or backwards is the same.
inline void nearest_headings(const double* x, const double* y, Index lanes,
                             std::array<Index, wide>& out) noexcept {
  for (Index j = 0; j < lanes; ++j) {
    const double sign = x[j] < 0.0 ? -1.0 : 1.0;
    // The tangent of a quarter of the angle, at most √2 − 1, and six terms of Taylor's series.
    const double half = sign * y[j] / (1.0 + sign * x[j]);
    const double quarter = half / (1.0 + std::sqrt(1.0 + half * half)), square = quarter * quarter;
    double series = 0.0;
    for (int n = 5; n >= 0; --n) series = 1.0 / (2.0 * n + 1.0) - square * series;
    const double turn = 4.0 / std::numbers::pi * heading_count * quarter * series;
    // Two stations in one place have no heading.
    const auto nearest = static_cast<std::int32_t>(turn == turn ? std::floor(turn + 0.5) : 0.0);
    out[static_cast<std::size_t>(j)] = nearest & (heading_count - 1);
  }
}

// Heights above those of the middle of the first station; what is unknown repeats `other`, or is 0.
inline void above_first(const Lanes& height, const double* first, const float* other, Index lanes,
                        float* out) noexcept {
  for (Index j = 0; j < lanes; ++j) {
    const double here = height[static_cast<std::size_t>(j)];
    const double base = std::isfinite(first[j]) ? first[j] : 0.0;
    const float repeated = other != nullptr ? other[j] : 0.0F;
    out[j] = std::isfinite(here) ? static_cast<float>(here - base) : repeated;
  }
}

// Grade and roll of the plane nearest to the wheels.
inline void tilt(const std::array<Lanes, footprint_points>& heights, double length, double width,
                 Index lanes, const bool* known, double* grade, double* sin_grade,
                 double* sin_roll) noexcept {
  const double per_length = 0.5 / length, per_width = 0.5 / width;
  for (Index j = 0; j < lanes; ++j) {
    const auto n = static_cast<std::size_t>(j);
    const double fl = heights[0][n], fr = heights[1][n], rl = heights[2][n], rr = heights[3][n];
    const double rise = known[j] ? (fl + fr - rl - rr) * per_length : 0.0;
    const double lean = known[j] ? (fl + rl - fr - rr) * per_width : 0.0;
    // tan(roll) = lean cos(grade): roll turns about the body's own, inclined x axis.
    const double secant = std::sqrt(1.0 + rise * rise), cosine = 1.0 / secant;
    const double tan_roll = lean * cosine;
    grade[j] = arctan_of(rise, secant);
    sin_grade[j] = rise * cosine;
    sin_roll[j] = tan_roll / std::sqrt(1.0 + tan_roll * tan_roll);
  }
}

// dθ/ds of the sharper crest of the segments around each station; where neither falls away, of the
// sharper dip. The grade is linear between stations; unknown ground has no curvature.
inline void curve_vertically(const TerrainTable& t, Index first, Index lanes) noexcept {
  Lanes before{};
  for (Index k = 0; k < t.stations; ++k) {
    const Index here = k * t.candidates + first;
    const Index ahead = std::min(k + 1, t.stations - 1) * t.candidates + first;
    for (Index j = 0; j < lanes; ++j) {
      const auto n = static_cast<std::size_t>(j);
      const double length = t.station[ahead + j] - t.station[here + j];
      const bool there = t.known[here + j] & t.known[ahead + j] & (length > 1e-9);
      const double after = there ? (t.grade[ahead + j] - t.grade[here + j]) / length : 0.0;
      const double crest = min_of(before[n], after);
      t.vertical_curvature[here + j] = crest < 0.0 ? crest : max_of(before[n], after);
      before[n] = after;
    }
  }
}

// What up to `wide` candidates stand on at one station: on the bilinear surface, and on tyres.
struct Ground {
  std::array<Lanes, footprint_points> surface, contact;
};

// Of the wheels, with the heading of the body, and of the point on the path, with that of the path.
inline void stand(HeightGrid& grid, const TerrainTable& t, Index at, double length, double width,
                  Index lanes, Ground& out) {
  Places places;
  std::array<Index, wide> heading{}, path_heading{};
  if (grid.resolves_wheels()) {
    nearest_headings(t.heading_x + at, t.heading_y + at, lanes, path_heading);
    heading = path_heading;
    if (t.body_x != t.heading_x) nearest_headings(t.body_x + at, t.body_y + at, lanes, heading);
  }
  for (std::size_t point = 0; point < footprint_points; ++point) {
    const bool is_wheel = point < 4, is_front = point < 2, is_left = point % 2 == 0;
    const double ahead = is_wheel ? t.body_offset + (is_front ? 0.5 : -0.5) * length : 0.0;
    const double aside = is_wheel ? (is_left ? 0.5 : -0.5) * width : 0.0;
    locate(grid, t.x + at, t.y + at, t.body_x + at, t.body_y + at, ahead, aside, lanes, places);
    interpolate(grid, places, lanes, out.surface[point]);
    out.contact[point] = out.surface[point];
    if (!grid.resolves_wheels()) continue;
    lift_tyre(grid, places, is_wheel ? heading : path_heading, lanes, out.contact[point]);
  }
}

// What is known of station k, its height, articulation and the ground under the front wheels.
inline void note_ground(const TerrainTable& t, Index k, Index first, Index lanes,
                        const Ground& ground) noexcept {
  const Index stride = t.candidates, at = k * stride + first;
  const auto& [fl, fr, rl, rr, middle] = ground.surface;
  for (Index j = 0; j < lanes; ++j) {
    const auto n = static_cast<std::size_t>(j);
    const bool inside = k < static_cast<Index>(t.count[first + j]);
    const double rise = fl[n] + fr[n] - rl[n] - rr[n];
    t.twist[at + j] = static_cast<float>(fl[n] - fr[n] - rl[n] + rr[n]);
    t.known[at + j] = std::isfinite(rise) & std::isfinite(middle[n]) & inside;
    const double z_before = k > 0 ? t.z[at + j - stride] : unknown;
    t.z[at + j] = inside & std::isfinite(middle[n]) ? ground.contact[4][n] : z_before;
  }
  for (Index side = 0; side < 2; ++side) {
    float* front = t.front + (2 * k + side) * stride + first;
    above_first(ground.surface[static_cast<std::size_t>(side)], t.z + first,
                k > 0 ? front - 2 * stride : nullptr, lanes, front);
  }
}

inline void sample_lanes(HeightGrid& grid, const TerrainTable& t, double length, double width,
                         Index first, Index lanes) {
  const Index stride = t.candidates;
  const std::int64_t* count = t.count + first;
  Steps steps(t.x + first, t.y + first, stride, lanes);
  Ground ground;
  for (Index k = 0; k < t.stations; ++k) {
    const Index at = k * stride + first, back = k > 0 ? at - stride : at;
    const Index next = k + 1 < t.stations ? at + stride : at;
    double *heading_x = t.heading_x + at, *heading_y = t.heading_y + at;
    steps.turn(k, count, t.x + at, t.y + at, t.x + next, t.y + next, t.curvature + back, heading_x,
               heading_y, t.curvature + at);
    stand(grid, t, at, length, width, lanes, ground);
    note_ground(t, k, first, lanes, ground);
    tilt(ground.contact, length, width, lanes, t.known + at, t.grade + at, t.sin_grade + at,
         t.sin_roll + at);
    if (k == 0) {
      std::fill_n(t.station + at, lanes, 0.0);
    } else {
      advance(k, count, stride, lanes, t.x + at, t.y + at, t.z + back, t.z + at, t.station + at);
    }
  }
  // The first station has no step before it: it has the circle of the second.
  std::copy_n(t.curvature + stride + first, lanes, t.curvature + first);
  curve_vertically(t, first, lanes);
}

}  // namespace detail

// Fill in all rows of a table, for wheels on a rectangle of this length and width [m].
inline void sample_terrain(HeightGrid& grid, const TerrainTable& table, double length,
                           double width) {
  const std::scoped_lock lock(grid.mutex());
  for (Index first = 0; first < table.candidates; first += wide) {
    detail::sample_lanes(grid, table, length, width, first,
                         std::min<Index>(wide, table.candidates - first));
  }
}

}  // namespace slopewise
