// Structure of a map: where contrasts of its heights exceed the noise.
//
// A contrast is a weighted sum of heights that is zero on every plane: a jump, a ridge, a block or a
// cell against the cells around it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "batch.hpp"

namespace slopewise {

inline constexpr float unknown_height = std::numeric_limits<float>::quiet_NaN();

// Cells around one cell, as offsets in rows and columns.
struct Taps {
  Index count;
  const std::int32_t *row, *column;
};

// K weighted sums over the same taps; the first `jumps` of them also tell the slope beside a jump.
struct Contrasts {
  Taps taps;
  Index count, jumps;
  const float* weight;           // (K, taps)
  const float* std;              // (K,) for noise of standard deviation 1
  const float *slope_x, *slope_y;  // (jumps, taps) rise a cell
};

// A map of floats with a rim of unknown cells around it.
class Heights {
 public:
  Heights(Index rows, Index columns, Index rim)
      : rows_(rows), columns_(columns), rim_(rim), width_(columns + 2 * rim),
        cells_(static_cast<std::size_t>((rows + 2 * rim) * width_), unknown_height) {}

  [[nodiscard]] Index rows() const noexcept { return rows_; }
  [[nodiscard]] Index columns() const noexcept { return columns_; }
  [[nodiscard]] const float* at(Index i, Index j) const noexcept {
    return cells_.data() + (i + rim_) * width_ + j + rim_;
  }
  [[nodiscard]] float* at(Index i, Index j) noexcept {
    return cells_.data() + (i + rim_) * width_ + j + rim_;
  }

 private:
  Index rows_, columns_, rim_, width_;
  std::vector<float> cells_;
};

// What contrasts say of each cell of a map, row by row.
struct Structure {
  std::vector<float> jump;          // the strongest jump, in standard deviations; < 0 if unknown
  std::vector<std::uint8_t> which;  // number of that contrast
  std::vector<std::uint8_t> there;  // 1 where some contrast is significant, or unknown
};

namespace detail {

// Add a weighted row of heights to a row of sums.
inline void add_row(const float* heights, float weight, Index count, float* sums) noexcept {
  for (Index j = 0; j < count; ++j) sums[j] += weight * heights[j];
}

// Take in one contrast along a row.
inline void note_contrast(const float* sums, float scale, float significance, std::uint8_t number,
                          bool is_jump, Index first, Structure& out, Index count) noexcept {
  for (Index j = 0; j < count; ++j) {
    const auto cell = static_cast<std::size_t>(first + j);
    const float strength = std::abs(sums[j]) * scale;
    if (!(strength <= significance)) out.there[cell] = 1;
    if (is_jump && strength > out.jump[cell]) {
      out.jump[cell] = strength;
      out.which[cell] = number;
    }
  }
}

}  // namespace detail

// Look at a map through contrasts; noise_std is that of its cells [m].
inline Structure structure_of(const Heights& map, const Contrasts& contrasts, double noise_std,
                              double significance) {
  const Index rows = map.rows(), columns = map.columns();
  const auto cells = static_cast<std::size_t>(rows * columns);
  Structure out{std::vector<float>(cells, -1.0F), std::vector<std::uint8_t>(cells, 0),
                std::vector<std::uint8_t>(cells, 0)};
  std::vector<float> sums(static_cast<std::size_t>(contrasts.count * columns));
  for (Index i = 0; i < rows; ++i) {
    std::fill(sums.begin(), sums.end(), 0.0F);
    for (Index t = 0; t < contrasts.taps.count; ++t) {
      const float* heights = map.at(i + contrasts.taps.row[t], contrasts.taps.column[t]);
      for (Index n = 0; n < contrasts.count; ++n) {
        const float weight = contrasts.weight[n * contrasts.taps.count + t];
        // What a jump does not weigh, the slope beside it does: it has to be known.
        if (weight != 0.0F || n < contrasts.jumps) {
          detail::add_row(heights, weight, columns, sums.data() + n * columns);
        }
      }
    }
    for (Index n = 0; n < contrasts.count; ++n) {
      const float scale = 1.0F / (contrasts.std[n] * static_cast<float>(noise_std));
      detail::note_contrast(sums.data() + n * columns, scale, static_cast<float>(significance),
                            static_cast<std::uint8_t>(n), n < contrasts.jumps, i * columns, out,
                            columns);
    }
  }
  return out;
}

}  // namespace slopewise
