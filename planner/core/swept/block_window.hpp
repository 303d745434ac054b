// Which part of a map candidates ask about: of each row of blocks those between the outermost.
// Candidates fan out or run side by side, so there is little between them that none of them is
// near.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "swept/vehicle_envelope.hpp"

namespace slopewise {

// The blocks of a map: cells along the edge of one, how many there are.
struct BlockLayout {
  Index cells, rows, columns;
  double per_metre;  // blocks in a metre

  BlockLayout(const MapView& map, double resolution, const VehicleEnvelope& sizes) noexcept
      : cells(std::max<Index>(
            static_cast<Index>(
                std::nearbyint(2.0 * sizes.half_length / blocks_per_wheelbase / resolution)),
            1)),
        rows((map.rows + cells - 1) / cells), columns((map.columns + cells - 1) / cells),
        per_metre(1.0 / (static_cast<double>(cells) * resolution)) {}

 private:
  static constexpr double blocks_per_wheelbase = 6.0;
};

// M candidates of N stations: (N, M) positions [m].
struct Positions {
  Index stations, candidates;
  const double *x, *y;
};

// Blocks [first, end).
struct BlockSpan {
  Index first = 0, end = 0;

  [[nodiscard]] bool empty() const noexcept { return end <= first; }
  [[nodiscard]] bool holds(BlockSpan other) const noexcept {
    return other.empty() || (first <= other.first && other.end <= end);
  }
  [[nodiscard]] BlockSpan moved(Index by) const noexcept { return {first + by, end + by}; }
  [[nodiscard]] BlockSpan grown(Index by, Index count) const noexcept {
    return {std::max<Index>(first - by, 0), std::min(end + by, count)};
  }
  [[nodiscard]] Index size() const noexcept { return end - first; }
};

class BlockWindow {
 public:
  BlockSpan rows, columns;         // all that is looked at closely
  std::vector<BlockSpan> screened;  // of each row what is asked about, from the first column on

  // Around positions, those beyond the map as on its edge; `beside` is the share of their extent by
  // which more is taken.
  BlockWindow(const MapView& map, const BlockLayout& layout, const VehicleEnvelope& sizes,
              const Positions& at, double beside) {
    const double half = 0.5 / static_cast<double>(layout.cells);  // heights: of middles of cells
    const auto row_of = [&](Index n) {
      return block_at((at.y[n] - map.origin_y) * layout.per_metre + half, layout.rows);
    };
    const auto column_of = [&](Index n) {
      return block_at((at.x[n] - map.origin_x) * layout.per_metre + half, layout.columns);
    };
    BlockSpan row{layout.rows, 0}, column{layout.columns, 0};
    const Index count = at.stations * at.candidates;
    for (Index n = 0; n < count; ++n) {
      row = joined(row, row_of(n));
      column = joined(column, column_of(n));
    }
    const double more = beside * static_cast<double>(std::max(row.size(), column.size()));
    const auto far = static_cast<Index>(std::ceil(sizes.reach() * layout.per_metre + more)) + 1;
    // The sweep follows wheels to where blocks that are asked about end, and looks ahead there.
    const double look = max_of(sizes.reach(), sizes.fine ? sizes.wheel_look() : 0.0);
    const Index margin = far + static_cast<Index>(std::ceil(look * layout.per_metre));
    rows = row.grown(margin, layout.rows);
    columns = column.grown(margin, layout.columns);
    std::vector<BlockSpan> touched(static_cast<std::size_t>(rows.size()), {columns.size(), 0});
    for (Index n = 0; n < count; ++n) {
      BlockSpan& here = touched[static_cast<std::size_t>(row_of(n) - rows.first)];
      here = joined(here, column_of(n) - columns.first);
    }
    spread(touched, far);
  }

  // Is all of the other, of the same map and vehicle, in this one?
  [[nodiscard]] bool holds(const BlockWindow& other) const noexcept {
    if (!rows.holds(other.rows) || !columns.holds(other.columns)) return false;
    for (Index row = other.rows.first; row < other.rows.end; ++row) {
      if (!span_of(row).holds(other.span_of(row))) return false;
    }
    return true;
  }

  // Blocks of a row of the map that are asked about, counted from the map's first; none beyond.
  [[nodiscard]] BlockSpan span_of(Index row) const noexcept {
    if (row < rows.first || row >= rows.end) return {};
    return screened[static_cast<std::size_t>(row - rows.first)].moved(columns.first);
  }

 private:
  static Index block_at(double block, Index count) noexcept {
    return static_cast<Index>(min_of(max_of(0.0, block), static_cast<double>(count - 1)));
  }

  static BlockSpan joined(BlockSpan span, Index block) noexcept {
    return {std::min(span.first, block), std::max(span.end, block + 1)};
  }

  // So many blocks around those that positions touch.
  void spread(const std::vector<BlockSpan>& touched, Index far) {
    screened.resize(touched.size());
    for (Index row = 0; row < rows.size(); ++row) {
      const BlockSpan near = BlockSpan{row, row + 1}.grown(far, rows.size());
      BlockSpan all{columns.size(), 0};
      for (Index other = near.first; other < near.end; ++other) {
        const BlockSpan& span = touched[static_cast<std::size_t>(other)];
        all = {std::min(all.first, span.first), std::max(all.end, span.end)};
      }
      if (!all.empty()) screened[static_cast<std::size_t>(row)] = all.grown(far, columns.size());
    }
  }
};

}  // namespace slopewise
