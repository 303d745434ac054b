// How steep it may be between stations: where a wheel crosses an edge of the map, grade kinks.
//
// Heights between cells are ruled surfaces, so that the grade under the wheels is close to linear
// but for a kink wherever an axle crosses a line of cell centres. With one kink between two
// stations the grade there is that at which the straight lines from both sides meet.
#pragma once

#include "ground/force_problem.hpp"

namespace slopewise {

// Lowest and highest of something around a station.
struct Extremes {
  double lowest, highest;
};

// Extremes of the grade from a station to the next, from those two and one more on either side.
[[nodiscard]] inline Extremes extremes_to_next(double before, double here, double ahead,
                                               double beyond) noexcept {
  const double rises = here - before, falls = ahead - beyond, change = ahead - here;
  const double bend = rises + falls;
  const double share = (falls + change) / (bend != 0.0 ? bend : 1.0);
  const bool inside = (share > 0.0) & (share < 1.0);
  const double kink = inside ? here + rises * share : here;
  return {min_of(kink, min_of(here, ahead)), max_of(kink, max_of(here, ahead))};
}

// Extremes of the grade from the station before to the one after, row by row of a tile.
class GradeAround {
 public:
  Lane lowest{}, highest{};  // of the row that was stepped to last

  GradeAround(const Numbers& grade, Index stations, std::size_t lanes) noexcept
      : grade_(grade), last_(stations - 1), lanes_(lanes) {
    lowest_before_.fill(no_limit);
    highest_before_.fill(-no_limit);
  }

  void step_to(Index k) noexcept {
    const double *before = grade_.at(std::max<Index>(k - 1, 0)), *here = grade_.at(k),
                 *ahead = grade_.at(std::min(k + 1, last_)),
                 *beyond = grade_.at(std::min(k + 2, last_));
    const std::size_t lanes = lanes_;
    SLOPEWISE_INDEPENDENT
    for (std::size_t j = 0; j < lanes; ++j) {
      const Extremes next = extremes_to_next(before[j], here[j], ahead[j], beyond[j]);
      lowest[j] = min_of(next.lowest, lowest_before_[j]);
      highest[j] = max_of(next.highest, highest_before_[j]);
      lowest_before_[j] = next.lowest;
      highest_before_[j] = next.highest;
    }
  }

 private:
  const Numbers& grade_;
  Index last_;
  std::size_t lanes_;
  Lane lowest_before_{}, highest_before_{};
};

// A row with those of both neighbouring stations.
struct Neighbours {
  const double *before, *here, *after;

  Neighbours(const Numbers& rows, Index k, Index stations) noexcept
      : before(rows.at(std::max<Index>(k - 1, 0))),
        here(rows.at(k)),
        after(rows.at(std::min(k + 1, stations - 1))) {}
  [[nodiscard]] double lowest(std::size_t j) const noexcept {
    return min_of(min_of(before[j], here[j]), after[j]);
  }
  [[nodiscard]] double highest(std::size_t j) const noexcept {
    return max_of(max_of(before[j], here[j]), after[j]);
  }
};

}  // namespace slopewise
