// The verifier on one profile of a batch, before anything is finished.
#pragma once

#include "verify/verify.hpp"

namespace slopewise::verify {

[[nodiscard]] inline Index verify_lane_memory(Index stations) noexcept {
  return (track_columns + 4) * stations + verify_memory(stations);
}

// The same verifier on one of the time-optimal profiles v² (N, M) [m²/s²] of a batch, without what a
// plan tells; `clear_distance` (M,) [m], `worst` receives (breach_count,).
inline void verify_lane(const TrackRows& rows, Index j, const Numbers& speed_sq,
                        const double* clear_distance, const VerifyTerms& terms, double* memory,
                        double* worst) noexcept {
  const Index stride = rows.terrain.stations;
  double *profile = memory + track_columns * stride, *told = profile + stride;
  std::array<const double*, track_columns> column{};
  for (std::size_t c = 0; c < column.size(); ++c) column[c] = memory + static_cast<Index>(c) * stride;
  const auto count = static_cast<Index>(rows.terrain.counts[j]);
  copy_columns(rows, j, 0, terms.motion.moves, memory, stride);
  for (Index k = 0; k < count; ++k) profile[k] = speed_sq.at(k)[j];
  const Track track = track_at(count, column);
  const VerifiedPlan plan{track, track, profile, clear_distance[j], rows.forces.distance_offset[j]};
  verify_plan(plan, terms, {told, told + stride, told + 2 * stride, worst, nullptr},
              told + 3 * stride);
}

}  // namespace slopewise::verify
