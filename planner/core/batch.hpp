// W candidates worked on together, as lanes: a constant number of them, so that loops vectorise.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "rows.hpp"

namespace slopewise {

// Lanes of a tile, which stays in the first-level cache, and of what does not fill one [1].
inline constexpr int wide = 64;
inline constexpr int narrow = 8;

using Index = std::ptrdiff_t;

// Before a loop over lanes or stations: what one writes no other reads.
#if defined(__clang__)
#define SLOPEWISE_INDEPENDENT _Pragma("clang loop vectorize(assume_safety)")
#else
#define SLOPEWISE_INDEPENDENT _Pragma("GCC ivdep")
#endif

// As std::min and std::max, by value: through references gcc does not vectorise all loops.
constexpr double min_of(double a, double b) noexcept { return b < a ? b : a; }
constexpr double max_of(double a, double b) noexcept { return a < b ? b : a; }
constexpr float min_of(float a, float b) noexcept { return b < a ? b : a; }
constexpr float max_of(float a, float b) noexcept { return a < b ? b : a; }

// Rows of M candidates in the memory of the caller: (N, M), stations behind one another.
struct Table {
  Index stations = 0;
  Index candidates = 0;
  std::array<double*, row_count> rows{};

  [[nodiscard]] double* at(Row row, Index k) const noexcept {
    return rows[static_cast<std::size_t>(row)] + k * candidates;
  }
};

// Memory of a thread, kept from call to call.
class Workspace {
 public:
  double* reserve(Index count) {
    if (memory_.size() < static_cast<std::size_t>(count)) {
      memory_.resize(static_cast<std::size_t>(count));
    }
    return memory_.data();
  }

  static Workspace& of_thread() {
    thread_local Workspace workspace;
    return workspace;
  }

 private:
  std::vector<double> memory_;
};

// W lanes of a table. Where it has fewer, spare lanes repeat the last candidate in a copy.
template <int W>
class Batch {
 public:
  // Doubles that a copy takes.
  static Index copy_size(Index stations) noexcept { return row_count * stations * W; }

  Batch(const Table& table, Index first, double* memory) noexcept
      : table_(table), first_(first), used_(std::min<Index>(W, table.candidates - first)) {
    const bool full = used_ == W;
    stride_ = full ? table.candidates : W;
    for (std::size_t r = 0; r < rows_.size(); ++r) {
      rows_[r] = full ? table.rows[r] + first
                      : memory + static_cast<Index>(r) * table.stations * W;
      if (!full && static_cast<Row>(r) != Row::speed_sq) copy_in(r);
    }
  }

  [[nodiscard]] Index stations() const noexcept { return table_.stations; }

  [[nodiscard]] double* at(Row row, Index k) const noexcept {
    return rows_[static_cast<std::size_t>(row)] + k * stride_;
  }

  // A number for each candidate, as one for each lane.
  [[nodiscard]] std::array<double, W> lanes_of(const double* of_candidates) const noexcept {
    std::array<double, W> out;
    for (Index j = 0; j < W; ++j) {
      out[static_cast<std::size_t>(j)] = of_candidates[first_ + std::min(j, used_ - 1)];
    }
    return out;
  }

  void give_back(const std::array<double, W>& lanes, double* to_candidates) const noexcept {
    std::copy_n(lanes.begin(), used_, to_candidates + first_);
  }

  // Hand the answer of a copy to the caller.
  void give_back() const noexcept {
    if (used_ == W) return;
    for (Index k = 0; k < stations(); ++k) {
      std::copy_n(at(Row::speed_sq, k), used_, table_.at(Row::speed_sq, k) + first_);
    }
  }

 private:
  void copy_in(std::size_t r) const noexcept {
    for (Index k = 0; k < stations(); ++k) {
      const double* from = table_.at(static_cast<Row>(r), k) + first_;
      double* to = rows_[r] + k * W;
      for (Index j = 0; j < W; ++j) to[j] = from[std::min(j, used_ - 1)];
    }
  }

  const Table& table_;
  Index first_, used_, stride_ = 0;
  std::array<double*, row_count> rows_{};
};

}  // namespace slopewise
