// Heights as a wheel feels them: the mean of the largest window around a cell that holds nothing
// but noise.
//
// Where no contrast is significant (height_contrasts.hpp), the height is that of the plane nearest
// to the cells of a disc. Elsewhere each window around the cell is weighed by its risk: the variance
// of its mean, and what its heights scatter beyond the noise, which is structure that a mean would
// hide. The raw height is one of the windows, and the only one for a cell that stands out of those
// around it: a post is little scatter in a disc of a hundred cells.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "ground/height_contrasts.hpp"

namespace slopewise {

// Scatter beyond the noise that counts as structure, in its standard deviations [1]: of a disc,
// which is asked first, and of the finer windows.
inline constexpr double disc_doubt = 2.0, window_doubt = 1.0;

// Share of a disc's cells that tells its slope [1]: a quarter of one is known in a map's corner.
inline constexpr double slope_share = 0.2;

// Windows one behind the other; the last one is the disc.
struct Windows {
  Taps taps;
  Index count;
  const std::int32_t* start;  // (count + 1,) of their taps
  const double* variance;     // (count,) of their means, for noise of variance 1
};

// What a map is averaged with.
struct AveragingTools {
  Contrasts wide;    // on a map of blocks of stride x stride cells
  Contrasts narrow;  // of single cells
  Windows windows;
  Index stride;
  double noise_std, block_noise_std, significance, known_share;
};

// A plane through heights around a cell: its height there, its slopes [m a cell], the variance of
// the height for noise of variance 1, and what the heights scatter about it [m²].
struct Plane {
  double level = 0.0, variance = 0.0, scatter = 0.0, cells = 0.0;
  double slope_x = unknown_height, slope_y = unknown_height;
  bool known = false;
};

class Averaging {
 public:
  Averaging(const Heights& map, const Heights& blocks, const Structure& structure,
            const AveragingTools& tools)
      : map_(map), blocks_(blocks), structure_(structure), tools_(tools),
        windows_(tools.windows), noise_(tools.noise_std * tools.noise_std) {
    const double std = tools.significance * tools.narrow.std[0];
    outlier_ = std * std * noise_;
  }

  // Height of a known cell that is near structure.
  [[nodiscard]] double height(Index i, Index j) const noexcept {
    double risk = noise_, height = *map_.at(i, j);
    if (stands_out(i, j)) return height;
    const Index disc = windows_.start[windows_.count - 1];
    const Index cells = windows_.start[windows_.count] - disc;
    const Plane plane =
        nearest_plane(i, j, {cells, windows_.taps.row + disc, windows_.taps.column + disc},
                      windows_.variance[windows_.count - 1] * static_cast<double>(cells));
    if (plane.known) {
      consider(plane.level, plane.variance, plane.scatter, disc_doubt, plane.cells - 3.0, risk,
               height);
    }
    // A window has at least the risk of its variance: where the disc has less, none is worth its sum.
    std::optional<std::array<double, 2>> slope;
    for (Index w = 0; w + 1 < windows_.count; ++w) {
      if (windows_.variance[w] * noise_ >= risk) continue;
      if (!slope) slope = slope_beside(i, j, plane);
      consider_window(i, j, w, *slope, risk, height);
    }
    return height;
  }

 private:
  void consider(double level, double variance, double scatter, double doubt, double freedoms,
                double& risk, double& height) const noexcept {
    const double spread = std::sqrt(2.0 / freedoms);
    const double structure = scatter - noise_ * (1.0 + doubt * spread);
    const double own = variance * noise_ + std::max(structure, 0.0);
    if (own < risk) {
      risk = own;
      height = level;
    }
  }

  void consider_window(Index i, Index j, Index w, const std::array<double, 2>& slope, double& risk,
                       double& height) const noexcept {
    const double middle = *map_.at(i, j);
    double sum = 0.0, squares = 0.0;
    Index known = 0;
    for (Index t = windows_.start[w]; t < windows_.start[w + 1]; ++t) {
      const Index row = windows_.taps.row[t], column = windows_.taps.column[t];
      const double rise = *map_.at(i + row, j + column) - middle -
                          slope[0] * static_cast<double>(column) -
                          slope[1] * static_cast<double>(row);
      if (std::isnan(rise)) continue;
      sum += rise;
      squares += rise * rise;
      ++known;
    }
    const auto all = static_cast<double>(windows_.start[w + 1] - windows_.start[w]);
    const auto count = static_cast<double>(known);
    if (known < 2 || count < tools_.known_share * all) return;
    const double mean = sum / count, variance = windows_.variance[w] * all / count;
    // Of correlated noise a window shows less scatter than its standard deviation.
    const double shown = std::max((1.0 - variance) * count / (count - 1.0), 1e-3);
    consider(middle + mean, variance, (squares / count - mean * mean) * count / (count - 1.0) / shown,
             window_doubt, count - 1.0, risk, height);
  }

  // Whether a cell differs significantly from the plane of the known ones around it.
  [[nodiscard]] bool stands_out(Index i, Index j) const noexcept {
    const Plane around = nearest_plane(i, j, tools_.narrow.taps, 0.0);
    const double rise = *map_.at(i, j) - around.level;
    const auto full = static_cast<double>(tools_.narrow.taps.count - 1);
    return around.known && rise * rise > outlier_ * (1.0 + around.variance) * full / (full + 1.0);
  }

  // Plane nearest to the known heights of taps. lost: variance of their mean times their number,
  // for noise of variance 1 (1 if it is white); 0: white, and without the cell in the middle.
  [[nodiscard]] Plane nearest_plane(Index i, Index j, const Taps& taps, double lost) const noexcept {
    const double middle = *map_.at(i, j);
    double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0, z = 0, xz = 0, yz = 0, zz = 0;
    const bool is_ring = lost == 0.0;
    for (Index t = 0; t < taps.count; ++t) {
      const auto u = static_cast<double>(taps.column[t]), v = static_cast<double>(taps.row[t]);
      const double h = *map_.at(i + taps.row[t], j + taps.column[t]) - middle;
      if (std::isnan(h) || (is_ring && u == 0.0 && v == 0.0)) continue;
      n += 1.0, x += u, y += v, xx += u * u, xy += u * v, yy += v * v;
      z += h, xz += u * h, yz += v * h, zz += h * h;
    }
    const auto all = static_cast<double>(taps.count - (is_ring ? 1 : 0));
    const double a = xx * yy - xy * xy, b = xy * y - x * yy, c = x * xy - xx * y;
    const double determinant = n * a + x * b + y * c;
    Plane plane;
    if (n < slope_share * all || n < 4.0 || determinant < 1e-6 * n * a) return plane;
    const double d = n * yy - y * y, e = x * y - n * xy, f = n * xx - x * x;
    plane.level = (a * z + b * xz + c * yz) / determinant;
    plane.slope_x = (b * z + d * xz + e * yz) / determinant;
    plane.slope_y = (c * z + e * xz + f * yz) / determinant;
    const double left = zz - plane.level * z - plane.slope_x * xz - plane.slope_y * yz;
    plane.variance = a / determinant * (is_ring ? 1.0 : lost);
    const double shown = std::max((1.0 - 3.0 * lost / n) * n / (n - 3.0), 1e-3);
    plane.scatter = std::max(left, 0.0) / (n - 3.0) / shown;
    plane.level += middle;
    plane.cells = n;
    plane.known = n >= tools_.known_share * all;
    return plane;
  }

  // Slope of the ground on both sides of the strongest jump in reach; the plane's if there is none.
  [[nodiscard]] std::array<double, 2> slope_beside(Index i, Index j,
                                                   const Plane& plane) const noexcept {
    const Index begin = windows_.start[windows_.count - 1], end = windows_.start[windows_.count];
    const Index rows = blocks_.rows(), columns = blocks_.columns();
    float strongest = 0.0F;
    Index row = -1, column = -1;
    for (Index t = begin; t < end; ++t) {
      const Index u = i + windows_.taps.row[t], v = j + windows_.taps.column[t];
      if (u < 0 || v < 0) continue;
      const Index p = u / tools_.stride, q = v / tools_.stride;
      if (p >= rows || q >= columns) continue;
      const float jump = structure_.jump[static_cast<std::size_t>(p * columns + q)];
      if (jump > strongest) strongest = jump, row = p, column = q;
    }
    if (row < 0) return {plane.slope_x, plane.slope_y};
    const Index n = structure_.which[static_cast<std::size_t>(row * columns + column)];
    const Index taps = tools_.wide.taps.count;
    double x = 0.0, y = 0.0;
    for (Index t = 0; t < taps; ++t) {
      const double h =
          *blocks_.at(row + tools_.wide.taps.row[t], column + tools_.wide.taps.column[t]);
      x += tools_.wide.slope_x[n * taps + t] * h;
      y += tools_.wide.slope_y[n * taps + t] * h;
    }
    const auto cells = static_cast<double>(tools_.stride);
    return {x / cells, y / cells};
  }

  const Heights& map_;
  const Heights& blocks_;
  const Structure& structure_;  // of the blocks
  const AveragingTools& tools_;
  const Windows& windows_;
  double noise_, outlier_;
};

namespace detail {

// Means of blocks; unknown where one of their cells is.
inline Heights blocks_of(const Heights& map, Index stride, Index rim) {
  const Index rows = (map.rows() + stride - 1) / stride;
  const Index columns = (map.columns() + stride - 1) / stride;
  Heights out(rows, columns, rim);
  const auto share = 1.0F / static_cast<float>(stride * stride);
  for (Index i = 0; i < rows; ++i) {
    for (Index j = 0; j < columns; ++j) {
      float sum = 0.0F;
      for (Index u = 0; u < stride; ++u) {
        for (Index v = 0; v < stride; ++v) sum += *map.at(i * stride + u, j * stride + v);
      }
      *out.at(i, j) = sum * share;
    }
  }
  return out;
}

// Mark the cells in the disc around each cell of a structure, whose cells are blocks.
inline void mark_around(const Structure& structure, Index stride, const Windows& windows,
                        Index rows, Index columns, std::vector<std::uint8_t>& marked) {
  const Index begin = windows.start[windows.count - 1], end = windows.start[windows.count];
  const Index blocks = (columns + stride - 1) / stride;
  for (Index i = 0; i < rows; ++i) {
    for (Index j = 0; j < columns; ++j) {
      if (structure.there[static_cast<std::size_t>(i / stride * blocks + j / stride)] == 0) continue;
      for (Index t = begin; t < end; ++t) {
        const Index u = i + windows.taps.row[t], v = j + windows.taps.column[t];
        if (u < 0 || v < 0 || u >= rows || v >= columns) continue;
        marked[static_cast<std::size_t>(u * columns + v)] = 1;
      }
    }
  }
}

// Mean of the disc around each cell of a row.
inline void average_row(const Heights& map, const Windows& windows, Index i,
                        std::vector<float>& sums) noexcept {
  const Index begin = windows.start[windows.count - 1], end = windows.start[windows.count];
  const auto share = 1.0F / static_cast<float>(end - begin);
  std::fill(sums.begin(), sums.end(), 0.0F);
  for (Index t = begin; t < end; ++t) {
    add_row(map.at(i + windows.taps.row[t], windows.taps.column[t]), share, map.columns(),
            sums.data());
  }
}

}  // namespace detail

// Average a map (rows, columns) of heights [m], NaN where unknown. `rim` is as far as any tap
// reaches, in cells or blocks.
inline void average_heights(const double* elevation, Index rows, Index columns, Index rim,
                             const AveragingTools& tools, double* out) {
  const auto cells = static_cast<std::size_t>(rows * columns);
  double level = 0.0;
  for (std::size_t c = 0; c < cells; ++c) {
    if (!std::isnan(elevation[c])) {
      level = elevation[c];
      break;
    }
  }
  Heights map(rows, columns, rim * tools.stride);
  for (Index i = 0; i < rows; ++i) {
    for (Index j = 0; j < columns; ++j) {
      *map.at(i, j) = static_cast<float>(elevation[i * columns + j] - level);
    }
  }
  const Heights blocks = detail::blocks_of(map, tools.stride, rim);
  const Structure coarse =
      structure_of(blocks, tools.wide, tools.block_noise_std, tools.significance);
  const Structure fine = structure_of(map, tools.narrow, tools.noise_std, tools.significance);
  std::vector<std::uint8_t> marked(cells, 0);
  detail::mark_around(coarse, tools.stride, tools.windows, rows, columns, marked);
  detail::mark_around(fine, 1, tools.windows, rows, columns, marked);
  const Averaging averaging(map, blocks, coarse, tools);
  std::vector<float> sums(static_cast<std::size_t>(columns));
  for (Index i = 0; i < rows; ++i) {
    detail::average_row(map, tools.windows, i, sums);
    for (Index j = 0; j < columns; ++j) {
      const auto cell = static_cast<std::size_t>(i * columns + j);
      if (std::isnan(elevation[cell])) {
        out[cell] = elevation[cell];
      } else if (marked[cell] == 0) {
        out[cell] = level + static_cast<double>(sums[static_cast<std::size_t>(j)]);
      } else {
        out[cell] = level + averaging.height(i, j);
      }
    }
  }
}

}  // namespace slopewise
