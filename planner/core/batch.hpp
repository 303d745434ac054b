// Candidates worked on together, as lanes, so that loops vectorise.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

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

}  // namespace slopewise
