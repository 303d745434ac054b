// Arrays of a batch of candidates, in the memory of the caller.
#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include "batch.hpp"

namespace slopewise {

inline constexpr double no_limit = std::numeric_limits<double>::infinity();

// (N, M): a number for each station and candidate, stations behind one another.
template <class T>
struct Rows {
  T* data = nullptr;  // null where there is nothing
  Index stride = 0;   // from one station to the next; 0 where all stations and candidates are alike

  [[nodiscard]] T* at(Index k) const noexcept { return data + k * stride; }
  // Of candidates from this one on.
  [[nodiscard]] Rows from(Index first) const noexcept {
    return {stride == 0 ? data : data + first, stride};
  }
};
using Numbers = Rows<const double>;
using Labels = Rows<const std::int64_t>;
using Flags = Rows<const bool>;

// What stands in for numbers that are not there, for a tile of candidates.
template <class T>
struct Alike {
  std::array<T, static_cast<std::size_t>(wide)> lanes;

  explicit constexpr Alike(T value) noexcept : lanes{} { lanes.fill(value); }
  // The numbers, or these in their place.
  [[nodiscard]] Rows<const T> unless(Rows<const T> rows) const noexcept {
    return rows.data != nullptr ? rows : Rows<const T>{lanes.data(), 0};
  }
};
inline constexpr Alike<double> alike_infinite{no_limit};
inline constexpr Alike<std::int64_t> alike_zero{0};

// Poses of M candidates of N stations, (N, M) each: middle of the wheelbase [m], unit vector of the
// heading of the body.
struct PoseRows {
  Index stations, candidates;
  const double *x, *y, *heading_x, *heading_y;
};

// Terrain below M candidates of up to N stations; units as in planner/ground/terrain_profile.py.
struct TerrainRows {
  Index stations, candidates;
  const std::int64_t* counts;  // (M,) stations that each candidate has; rows beyond are padding
  Numbers station, heading_x, heading_y, curvature, grade, sin_grade, sin_roll, vertical_curvature;
  Flags known;
};

// Braking force along them: F_b/W = slope [s/m] * speed at brake onset + intercept [1].
struct ForceRows {
  Numbers lower_slope, lower_intercept, upper_slope, upper_intercept;
  Numbers dead_time;         // from command to onset, longest of the surfaces until then [s]
  Numbers shortest_dead_time;  // of the surfaces there [s]
  Numbers slowest, fastest;  // trained speeds [m/s]
  Flags trained;
  const double* distance_offset;  // (M,) added to every stop [m]
};

// What is carried along the stations of a tile, a lane for each candidate.
using Lane = std::array<double, static_cast<std::size_t>(wide)>;
using LaneLabels = std::array<std::int64_t, static_cast<std::size_t>(wide)>;

// Candidates worked on together.
struct Tile {
  Index first, lanes;
};

template <class Work>
void for_each_tile(Index candidates, const Work& work) noexcept {
  for (Index first = 0; first < candidates; first += wide) {
    work(Tile{first, std::min<Index>(wide, candidates - first)});
  }
}

}  // namespace slopewise
