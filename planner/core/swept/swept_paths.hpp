// Candidates as the body sweeps them, and their poses.
#pragma once

#include <array>
#include <cmath>

#include "candidate_rows.hpp"
#include "swept/vehicle_envelope.hpp"

namespace slopewise {

// M candidates of up to N stations; arrays are (N, M) unless stated otherwise.
struct SweptPaths : PoseRows {
  const double* station;                        // [m]
  const std::int64_t* count;                    // (M,) stations of each
  const bool* known;                            // the ground under path and wheels is
  const float* twist;                           // of the ground under the wheels [m]
  double spacing;                               // largest distance between two poses [m]
  const double* across;  // by how far the reference point may be off the line [m]; null: by nothing
};

namespace detail {

// Across, within which a rear wheel meets the ground that the front one met [m].
constexpr double same_track = 0.01;

// Stations of up to `wide` candidates; at which their front wheels were where their rear ones are.
using FrontStations = std::array<Index, wide>;

// Do the rear wheels of a pose roll where the front ones did at an earlier one? Not at the first of
// the way, and not in a turn whose centre is beside one of the axles. Axles are told apart across
// the mean of both headings, along which they move on an arc.
inline bool follows_front(const SweptPaths& paths, Index at, Index before,
                          const VehicleEnvelope& sizes) noexcept {
  const double half = sizes.half_length;
  const double along_x = paths.heading_x[at] + paths.heading_x[before];
  const double along_y = paths.heading_y[at] + paths.heading_y[before];
  const double dx = paths.x[at] - paths.x[before] - half * along_x;
  const double dy = paths.y[at] - paths.y[before] - half * along_y;
  const double across = 0.5 * (along_x * dy - along_y * dx);
  const double wider = paths.across != nullptr ? paths.across[at] - paths.across[before] : 0.0;
  return max_of(std::abs(across), wider) <= same_track;
}

// The pose at station k of candidate j, how far it is from the one before, and how far it may be off
// its line [m].
struct PoseOnPath {
  Pose2d pose;
  double back, across;

  PoseOnPath(const SweptPaths& paths, Index k, Index j) noexcept {
    const Index at = k * paths.candidates + j, before = k > 0 ? at - paths.candidates : at;
    pose = {paths.x[at], paths.y[at], paths.heading_x[at], paths.heading_y[at]};
    across = paths.across != nullptr ? paths.across[at] : 0.0;
    const double dx = paths.x[at] - paths.x[before], dy = paths.y[at] - paths.y[before];
    back = std::sqrt(dx * dx + dy * dy);
  }
};

// The last station so far before station k [m], or the first after where the vehicle stands.
inline Index station_before(const SweptPaths& paths, Index k, Index j, double length) noexcept {
  if (k == 0) return 1;
  const double end = paths.station[k * paths.candidates + j] - length;
  while (k > 1 && paths.station[k * paths.candidates + j] > end) --k;
  return k;
}

}  // namespace detail

}  // namespace slopewise
