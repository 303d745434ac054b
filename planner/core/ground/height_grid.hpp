// Heights of a map, and contact heights: where the lowest point of a tyre comes to rest.
//
// A tyre that stands at a cell with its heading ψ touches what is under its rim. The contact height
//   c(cell, ψ) = max over the footprint of (height of the facet there − drop of the rim)
// is tabulated above the cell's own height, as the lift of the tyre: 0 on level ground, so that a
// bridged gap has a high one. 16 headings over 180°, tiles of 32 × 32 cells, on first use.
//
// A facet is a plane through the height of its cell with the gentler of the slopes to the
// neighbours. Each cell counts with one point: that of cell and footprint nearest to the axle.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <limits>
#include <memory>
#include <mutex>
#include <numbers>
#include <utility>
#include <vector>

#include "batch.hpp"

namespace slopewise {

inline constexpr Index heading_count = 16;  // over 180°: forwards and backwards are the same
inline constexpr Index tile_cells = 32;     // along an edge of a tile
inline constexpr Index tile_edge = tile_cells + 1;  // with the first cells of the next tiles
// A cell that the footprint touches by less than that does not count [m].
inline constexpr double grazed = 1e-6;
// Below any height [m], where the highest counts.
inline constexpr double no_ground = -1e12;

// Rectangle under a tyre that it may rest on [m]: half its length, half its width, radius of the
// wheel. A radius of 0: wheels stand on points of the surface.
struct Footprint {
  double half_length = 0.0, half_width = 0.0, radius = 0.0;
};

// Point of a cell that a tyre may rest on: offset of the cell, of the point in it [cells], height of
// the rim above the tyre's lowest point [m].
struct ContactPoint {
  Index row, column;
  double u, v, drop;
};

namespace detail {

struct Point {
  double s, t;  // along the heading and across it [m]
};

// The part of a convex polygon where a s + b t <= c.
inline std::vector<Point> clipped(const std::vector<Point>& polygon, double a, double b, double c) {
  std::vector<Point> out;
  for (std::size_t n = 0; n < polygon.size(); ++n) {
    const Point p = polygon[n], q = polygon[(n + 1) % polygon.size()];
    const double before = c - a * p.s - b * p.t, after = c - a * q.s - b * q.t;
    if (before >= 0.0) out.push_back(p);
    if ((before > 0.0 && after < 0.0) || (before < 0.0 && after > 0.0)) {
      const double share = before / (before - after);
      out.push_back({p.s + share * (q.s - p.s), p.t + share * (q.t - p.t)});
    }
  }
  return out;
}

// The point of a convex polygon with the least |s|, of these that with the least |t|.
inline Point nearest_to_axle(const std::vector<Point>& polygon) {
  double low = polygon[0].s, high = low;
  for (const Point& p : polygon) {
    low = min_of(low, p.s);
    high = max_of(high, p.s);
  }
  const double s = low > 0.0 ? low : (high < 0.0 ? high : 0.0);
  double left = no_ground, right = -no_ground;  // extent across, at s
  for (std::size_t n = 0; n < polygon.size(); ++n) {
    const Point p = polygon[n], q = polygon[(n + 1) % polygon.size()];
    for (const auto& [here, there] : {std::pair{p, q}, std::pair{q, p}}) {
      if (std::abs(here.s - s) < 1e-12) {
        left = max_of(left, here.t);
        right = min_of(right, here.t);
      } else if ((here.s - s) * (there.s - s) < 0.0) {
        const double t = here.t + (s - here.s) / (there.s - here.s) * (there.t - here.t);
        left = max_of(left, t);
        right = min_of(right, t);
      }
    }
  }
  return {s, right > 0.0 ? right : (left < 0.0 ? left : 0.0)};
}

// The smaller of two slopes, 0 where they differ in sign or one is unknown.
inline double gentler(double before, double after) noexcept {
  const double least = std::copysign(min_of(std::abs(before), std::abs(after)), before);
  return before * after > 0.0 ? least : 0.0;
}

}  // namespace detail

// Points of all cells under a footprint with one of the headings, on cells of this size [m].
inline std::vector<ContactPoint> contact_points(const Footprint& tyre, double cell, Index heading) {
  const double angle = std::numbers::pi * static_cast<double>(heading) / heading_count;
  const double cos = std::cos(angle), sin = std::sin(angle);
  const double length = max_of(tyre.half_length - grazed, grazed);
  const double width = max_of(tyre.half_width - grazed, grazed);
  const auto reach = static_cast<Index>(std::ceil(std::hypot(length, width) / cell + 0.5));
  std::vector<ContactPoint> out;
  for (Index row = -reach; row <= reach; ++row) {
    for (Index column = -reach; column <= reach; ++column) {
      const double x = cell * static_cast<double>(column), y = cell * static_cast<double>(row);
      std::vector<detail::Point> part;
      for (const auto& [i, j] : {std::pair{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}}) {
        const double east = x + i * cell, north = y + j * cell;
        part.push_back({cos * east + sin * north, cos * north - sin * east});
      }
      for (const auto& [a, b, c] :
           {std::array{1.0, 0.0, length}, {-1.0, 0.0, length}, {0.0, 1.0, width},
            {0.0, -1.0, width}}) {
        if (!part.empty()) part = detail::clipped(part, a, b, c);
      }
      if (part.empty()) continue;
      const detail::Point p = detail::nearest_to_axle(part);
      const double rest = tyre.radius * tyre.radius - p.s * p.s;
      out.push_back({row, column, (cos * p.s - sin * p.t - x) / cell,
                     (sin * p.s + cos * p.t - y) / cell,
                     tyre.radius - std::sqrt(max_of(rest, 0.0))});
    }
  }
  return out;
}

// A map in the memory of the caller, who keeps it unchanged, with its lifts.
class HeightGrid {
 public:
  // Memory of the lifts [bytes]; where more is needed, all are dropped and made again.
  static constexpr std::size_t memory_limit = 256u << 20;
  static constexpr std::size_t tile_memory = sizeof(float) * tile_edge * tile_edge;

  HeightGrid(const double* heights, Index rows, Index columns, double origin_x, double origin_y,
             double cell, const Footprint& tyre)
      : heights_(heights), rows_(rows), columns_(columns), origin_x_(origin_x),
        origin_y_(origin_y), cell_(cell), per_metre_(1.0 / cell), tyre_(tyre),
        tile_columns_((columns + tile_cells - 1) / tile_cells),
        tiles_(tyre.radius > 0.0
                   ? static_cast<std::size_t>(heading_count * tile_columns_ *
                                              ((rows + tile_cells - 1) / tile_cells))
                   : 0) {}

  [[nodiscard]] Index rows() const noexcept { return rows_; }
  [[nodiscard]] Index columns() const noexcept { return columns_; }
  [[nodiscard]] double origin_x() const noexcept { return origin_x_; }
  [[nodiscard]] double origin_y() const noexcept { return origin_y_; }
  [[nodiscard]] double per_metre() const noexcept { return per_metre_; }
  [[nodiscard]] const double* heights() const noexcept { return heights_; }
  [[nodiscard]] bool resolves_wheels() const noexcept { return tyre_.radius > 0.0; }

  // Held while lifts are read: they are made, and dropped, in between.
  [[nodiscard]] std::mutex& mutex() noexcept { return mutex_; }
  [[nodiscard]] std::size_t memory() const noexcept { return tile_count_ * tile_memory; }

  // Lift between four cells [m]: `row` and `column` of the first, `u` and `v` from it to the others.
  double lift(Index heading, Index row, Index column, double u, double v) {
    const float* at = tile(heading, row / tile_cells, column / tile_cells) +
                      (row % tile_cells) * tile_edge + column % tile_cells;
    const double lower = static_cast<double>(at[0]) + u * (static_cast<double>(at[1]) - at[0]);
    const double upper = static_cast<double>(at[tile_edge]) +
                         u * (static_cast<double>(at[tile_edge + 1]) - at[tile_edge]);
    return lower + v * (upper - lower);
  }

 private:
  const float* tile(Index heading, Index tile_row, Index tile_column) {
    const Index tile_rows = (rows_ + tile_cells - 1) / tile_cells;
    const auto n = static_cast<std::size_t>((heading * tile_rows + tile_row) * tile_columns_ +
                                            tile_column);
    if (!tiles_[n]) {
      if (memory() + tile_memory > memory_limit) drop();
      tiles_[n] = make(heading, tile_row * tile_cells, tile_column * tile_cells);
      ++tile_count_;
    }
    return tiles_[n].get();
  }

  void drop() noexcept {
    for (auto& each : tiles_) each.reset();
    tile_count_ = 0;
  }

  // Heights of a square of the map with this corner, NaN off the map.
  void copy_heights(Index first_row, Index first_column, Index edge, double* out) const noexcept {
    std::fill_n(out, edge * edge, std::numeric_limits<double>::quiet_NaN());
    const Index left = std::max<Index>(first_column, 0);
    const Index right = std::min(first_column + edge, columns_);
    const Index bottom = std::max<Index>(first_row, 0), top = std::min(first_row + edge, rows_);
    for (Index row = bottom; row < top && left < right; ++row) {
      std::copy_n(heights_ + row * columns_ + left, right - left,
                  out + (row - first_row) * edge + left - first_column);
    }
  }

  // Lifts of a tile; 0 where its own cell is unknown. Unknown cells around support nothing.
  std::unique_ptr<float[]> make(Index heading, Index first_row, Index first_column) {
    auto& points = points_[static_cast<std::size_t>(heading)];
    if (points.empty()) points = contact_points(tyre_, cell_, heading);
    Index reach = 1;  // of the neighbours that tilt a facet
    for (const ContactPoint& p : points) {
      reach = std::max({reach, std::abs(p.row) + 1, std::abs(p.column) + 1});
    }
    const Index edge = tile_edge + 2 * reach, size = edge * edge;
    memory_.resize(static_cast<std::size_t>(4 * size + lanes));
    double *z = memory_.data(), *east = z + size, *north = east + size, *raw = north + size;
    copy_heights(first_row - reach, first_column - reach, edge, raw);
    SLOPEWISE_INDEPENDENT
    for (Index n = edge; n < size - edge; ++n) {
      const double here = raw[n];
      z[n] = here == here ? here : no_ground;
      east[n] = detail::gentler(here - raw[n - 1], raw[n + 1] - here);
      north[n] = detail::gentler(here - raw[n - edge], raw[n + edge] - here);
    }
    auto out = std::make_unique<float[]>(tile_edge * tile_edge);
    for (Index i = 0; i < tile_edge; ++i) {
      const Index own = (i + reach) * edge + reach;
      std::array<double, lanes> highest;
      for (std::size_t j = 0; j < lanes; ++j) highest[j] = z[own + static_cast<Index>(j)];
      for (const ContactPoint& p : points) {
        const Index at = own + p.row * edge + p.column;
        const double *zp = z + at, *ep = east + at, *np = north + at;
        const double u = p.u, v = p.v, drop = p.drop;
        for (std::size_t j = 0; j < lanes; ++j) {
          highest[j] = max_of(highest[j], zp[j] + u * ep[j] + v * np[j] - drop);
        }
      }
      float* row = out.get() + i * tile_edge;
      for (Index j = 0; j < tile_edge; ++j) {
        const double here = z[own + j], above = highest[static_cast<std::size_t>(j)] - here;
        row[j] = here > no_ground ? static_cast<float>(above) : 0.0F;
      }
    }
    return out;
  }

  // Of a row of a tile, rounded up so that all of it is vectorised.
  static constexpr std::size_t lanes = 40;

  const double* heights_;
  Index rows_, columns_;
  double origin_x_, origin_y_, cell_, per_metre_;
  Footprint tyre_;
  Index tile_columns_;
  std::vector<std::unique_ptr<float[]>> tiles_;
  std::size_t tile_count_ = 0;
  std::array<std::vector<ContactPoint>, heading_count> points_;
  std::vector<double> memory_;  // facets of a tile: height, rise to the east and north [m a cell]
  std::mutex mutex_;
};

}  // namespace slopewise
