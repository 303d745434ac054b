// A map in blocks of cells: how high and how tilted each is, and whether all of it is known.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "swept/tyre_profile.hpp"

namespace slopewise {

// The smaller of two slopes, 0 where they differ in sign or one is unknown.
// Source: minmod limiter, Roe, Characteristic-based schemes (1986).
inline float gentler(float before, float after) noexcept {
  const float least = std::copysign(min_of(std::abs(before), std::abs(after)), before);
  return before * after > 0.0F ? least : 0.0F;
}

// Blocks of cells; heights above the level of the facets [m].
class MapBlocks {
 public:
  Index rows, columns;
  // Highest and lowest cell, NaN where none is known; height of a plane in the middle of the block,
  // its rise to the east and to the north across a block; how far facets of cells stick out of it,
  // up and down (≥ 0). `mean` is that of the planes around.
  std::vector<float> top, low, middle, east, north, above, below, mean;
  std::vector<std::uint8_t> hidden;  // 1 where some cell is unknown
  FacetGrid facets;

  // So many blocks from a first cell of the map on, which may be below 0; beyond the map nothing is
  // known. Means continue so many blocks into unknown ground.
  MapBlocks(const MapView& map, double resolution, Index first_row, Index first_column,
            Index cells, Index block_rows, Index block_columns, int beyond)
      : rows(block_rows), columns(block_columns) {
    const auto count = static_cast<std::size_t>(rows * columns);
    for (auto* part : {&top, &low, &middle, &east, &north, &above, &below}) part->resize(count);
    hidden.resize(count);
    tilt_cells(map, first_row, first_column, rows * cells, columns * cells);
    facets.origin_x = map.origin_x + static_cast<double>(first_column) * resolution;
    facets.origin_y = map.origin_y + static_cast<double>(first_row) * resolution;
    facets.per_metre = map.per_metre;
    for (Index r = 0; r < rows; ++r) {
      for (Index c = 0; c < columns; ++c) {
        if (cells == 1) {
          take_cell(r * columns + c);
        } else {
          gather(r, c, cells);
        }
      }
    }
    hide_edge();
    smooth(beyond);
  }

 private:
  static constexpr float unknown_cell = std::numeric_limits<float>::quiet_NaN();

  // Each cell is a plane through its own height, with the gentler of the slopes to its neighbours:
  // exact on slopes, and a single high cell keeps its full height. Beside unknown ground a cell is
  // level.
  void tilt_cells(const MapView& map, Index first_row, Index first_column, Index cell_rows,
                  Index cell_columns) {
    const Index stride = cell_columns + 2;  // with a rim of one cell
    std::vector<float> heights(static_cast<std::size_t>((cell_rows + 2) * stride), unknown_cell);
    copy_heights(map, first_row - 1, first_column - 1, cell_rows + 2, stride, heights);
    facets.rows = cell_rows;
    facets.columns = cell_columns;
    facets.cells.resize(static_cast<std::size_t>(cell_rows * cell_columns));
    for (Index i = 0; i < cell_rows; ++i) {
      const float* here = heights.data() + (i + 1) * stride + 1;
      const float *south = here - stride, *north_of = here + stride;
      Facet* out = facets.cells.data() + i * cell_columns;
      SLOPEWISE_INDEPENDENT
      for (Index j = 0; j < cell_columns; ++j) {
        out[j] = {here[j], gentler(here[j] - here[j - 1], here[j + 1] - here[j]),
                  gentler(here[j] - south[j], north_of[j] - here[j]), 0.0F};
      }
    }
  }

  // 2⁻²⁴ of it is 0.06 mm [m].
  static constexpr double farthest_level = 1e3;

  // Height of the first known cell of a part of a map, 0 where all is unknown [m].
  static double first_known(const MapView& map, Index bottom, Index end, Index left,
                            Index right) noexcept {
    for (Index i = bottom; i < end; ++i) {
      const double* row = map.heights + i * map.columns;
      const double* found = std::find_if(row + left, row + right,
                                         [](double height) { return std::isfinite(height); });
      if (found != row + right) return *found;
    }
    return 0.0;
  }

  // Heights above the level: that of the first known cell of the map, so that they are the same in
  // every window, or of the window where that is too far for single precision.
  void copy_heights(const MapView& map, Index first_row, Index first_column, Index height,
                    Index width, std::vector<float>& out) {
    const Index bottom = std::max<Index>(first_row, 0);
    const Index end = std::min(first_row + height, map.rows);
    const Index left = std::max<Index>(first_column, 0);
    const Index right = std::min(first_column + width, map.columns);
    const double here = first_known(map, bottom, end, left, right);
    const double level = first_known(map, 0, map.rows, 0, map.columns);
    facets.level = std::abs(level - here) <= farthest_level ? level : here;
    for (Index i = bottom; i < end; ++i) {
      const double* from = map.heights + i * map.columns;
      float* to = out.data() + (i - first_row) * width - first_column;
      for (Index j = left; j < right; ++j) to[j] = static_cast<float>(from[j] - facets.level);
    }
  }

  // The plane of a single cell is its facet.
  void take_cell(Index at) noexcept {
    const auto n = static_cast<std::size_t>(at);
    const Facet& cell = facets.cells[n];
    const bool is_unknown = cell.height != cell.height;
    top[n] = low[n] = middle[n] = cell.height;
    east[n] = is_unknown ? cell.height : cell.east;
    north[n] = is_unknown ? cell.height : cell.north;
    above[n] = below[n] = 0.0F;
    hidden[n] = is_unknown ? 1 : 0;
  }

  // The plane of several cells is level with their mean, tilted like the mean of their facets.
  void gather(Index r, Index c, Index cells) noexcept {
    const auto n = static_cast<std::size_t>(r * columns + c);
    const Facet* corner = facets.cells.data() + (r * facets.columns + c) * cells;
    double highest = -infinity, lowest = infinity, total = 0.0, tilt_x = 0.0, tilt_y = 0.0;
    Index known = 0;
    for (Index i = 0; i < cells; ++i) {
      for (Index j = 0; j < cells; ++j) {
        const Facet& cell = corner[i * facets.columns + j];
        if (std::isnan(cell.height)) continue;
        ++known;
        highest = max_of(highest, static_cast<double>(cell.height));
        lowest = min_of(lowest, static_cast<double>(cell.height));
        total += static_cast<double>(cell.height);
        tilt_x += static_cast<double>(cell.east);
        tilt_y += static_cast<double>(cell.north);
      }
    }
    hidden[n] = known == cells * cells ? 0 : 1;
    above[n] = below[n] = 0.0F;
    if (known == 0) {
      for (auto* part : {&top, &low, &middle, &east, &north}) (*part)[n] = unknown_cell;
      return;
    }
    const double per = static_cast<double>(known);
    const Plane plane{total / per, tilt_x / per, tilt_y / per};
    measure_deviation(corner, cells, plane, n);
    top[n] = static_cast<float>(highest);
    low[n] = static_cast<float>(lowest);
    middle[n] = static_cast<float>(plane.level);
    east[n] = static_cast<float>(plane.east * static_cast<double>(cells));
    north[n] = static_cast<float>(plane.north * static_cast<double>(cells));
  }

  struct Plane {
    double level, east, north;  // [m], rise over a cell [m]
  };

  // How far the facets of a block stick out of its plane.
  void measure_deviation(const Facet* corner, Index cells, const Plane& plane,
                         std::size_t n) noexcept {
    const double centre = 0.5 * static_cast<double>(cells - 1);
    double up = 0.0, down = 0.0;
    for (Index i = 0; i < cells; ++i) {
      for (Index j = 0; j < cells; ++j) {
        const Facet& cell = corner[i * facets.columns + j];
        if (std::isnan(cell.height)) continue;
        const double off = static_cast<double>(cell.height) - plane.level -
                           plane.east * (static_cast<double>(j) - centre) -
                           plane.north * (static_cast<double>(i) - centre);
        const double facet = 0.5 * (std::abs(static_cast<double>(cell.east) - plane.east) +
                                    std::abs(static_cast<double>(cell.north) - plane.north));
        up = max_of(up, off + facet);
        down = max_of(down, facet - off);
      }
    }
    above[n] = static_cast<float>(up);
    below[n] = static_cast<float>(down);
  }

  // The outermost facets are unknown, so that whoever looks beyond may take them instead.
  void hide_edge() noexcept {
    const Index count = facets.rows * facets.columns;
    for (Index n = 0; n < count; ++n) {
      const Index i = n / facets.columns, j = n % facets.columns;
      const bool is_edge = i == 0 || j == 0 || i == facets.rows - 1 || j == facets.columns - 1;
      if (is_edge) facets.cells[static_cast<std::size_t>(n)].height = unknown_cell;
    }
  }

  // Means of 3 x 3 blocks, continued so many blocks into unknown ground; NaN beyond.
  void smooth(int beyond) {
    mean.resize(middle.size());
    std::vector<Index> missing;
    for (Index i = 0; i < rows; ++i) {
      for (Index j = 0; j < columns; ++j) {
        const float here = mean_around(middle, i, j);
        mean[static_cast<std::size_t>(i * columns + j)] = here;
        if (here != here) missing.push_back(i * columns + j);
      }
    }
    std::vector<float> found;
    for (int round = 1; round < beyond; ++round) {
      found.clear();
      for (const Index n : missing) found.push_back(mean_around(mean, n / columns, n % columns));
      for (std::size_t n = 0; n < missing.size(); ++n) {
        mean[static_cast<std::size_t>(missing[n])] = found[n];
      }
      std::erase_if(missing,
                    [&](Index n) { return !std::isnan(mean[static_cast<std::size_t>(n)]); });
    }
  }

  [[nodiscard]] float mean_around(const std::vector<float>& heights, Index i,
                                  Index j) const noexcept {
    double total = 0.0, known = 0.0;
    for (Index k = std::max<Index>(i - 1, 0); k < std::min(i + 2, rows); ++k) {
      for (Index m = std::max<Index>(j - 1, 0); m < std::min(j + 2, columns); ++m) {
        const float here = heights[static_cast<std::size_t>(k * columns + m)];
        total += here == here ? static_cast<double>(here) : 0.0;
        known += here == here ? 1.0 : 0.0;
      }
    }
    return known > 0.0 ? static_cast<float>(total / known) : unknown_cell;
  }

  static constexpr double infinity = std::numeric_limits<double>::infinity();
};

}  // namespace slopewise
