// The ground under a tyre along its way, and where it stands, from facets of cells.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "swept/vehicle_envelope.hpp"

namespace slopewise {

// Height of what is unknown, where the highest counts [m].
inline constexpr double unknown_height = -1e12;
// Heights below are no ground [m]: half of the marker, since heights are interpolated.
inline constexpr double abyss = 0.5 * unknown_height;

// A cell as a plane: height above a level [m], NaN where unknown; rise to the east and to the north
// over a cell [m]. A cell is read at once.
struct Facet {
  float height, east, north, unused;
};

// Part of a map; the outermost cells are unknown, so that a look beyond may take them instead.
struct FacetGrid {
  std::vector<Facet> cells;
  Index rows = 0, columns = 0;
  double origin_x = 0.0, origin_y = 0.0;  // centre of cell [0, 0] [m]
  double per_metre = 1.0, level = 0.0;

  [[nodiscard]] double u(double x) const noexcept { return (x - origin_x) * per_metre; }
  [[nodiscard]] double v(double y) const noexcept { return (y - origin_y) * per_metre; }
};

// How far the rim of a wheel lies above its lowest point, so far from it along the way [m].
inline double drop_of_rim(double radius, double away) noexcept {
  return radius - std::sqrt(max_of(radius * radius - away * away, 0.0));
}

// Samples that are worked on together [1].
inline constexpr Index lanes_abreast = 8;

// Samples along a straight line: cell of the first one, its place in it, cells a sample.
class SampleRun {
 public:
  SampleRun(const FacetGrid& ground, const Pose2d& pose, Place begin, double stride) noexcept
      : cells_(ground.cells.data()), columns_(static_cast<std::int32_t>(ground.columns)),
        last_row_(static_cast<std::int32_t>(ground.rows - 1)), last_column_(columns_ - 1) {
    const Place at = pose.at(begin.x, begin.y);
    const double u = ground.u(at.x), v = ground.v(at.y);
    const double column = std::nearbyint(min_of(max_of(u, -farthest), farthest));
    const double row = std::nearbyint(min_of(max_of(v, -farthest), farthest));
    column_ = static_cast<std::int32_t>(column);
    row_ = static_cast<std::int32_t>(row);
    u_ = static_cast<float>(u - column);
    v_ = static_cast<float>(v - row);
    step_u_ = static_cast<float>(stride * pose.heading_x * ground.per_metre);
    step_v_ = static_cast<float>(stride * pose.heading_y * ground.per_metre);
  }

  // Height of the facet under a sample [m], NaN where it is unknown; off the map all is.
  [[nodiscard]] float height(std::int32_t n) const noexcept {
    const float u = u_ + static_cast<float>(n) * step_u_;
    const float v = v_ + static_cast<float>(n) * step_v_;
    const float j = std::nearbyint(u), i = std::nearbyint(v);
    const std::int32_t column =
        std::clamp<std::int32_t>(static_cast<std::int32_t>(j) + column_, 0, last_column_);
    const std::int32_t row =
        std::clamp<std::int32_t>(static_cast<std::int32_t>(i) + row_, 0, last_row_);
    const Facet& cell = cells_[static_cast<std::uint32_t>(row * columns_ + column)];
    return cell.height + cell.east * (u - j) + cell.north * (v - i);
  }

 private:
  static constexpr double farthest = 1e9;  // so that cells are counted in 32 bits

  const Facet* cells_;
  std::int32_t columns_, last_row_, last_column_, row_, column_;
  float u_, v_, step_u_, step_v_;
};

// Where samples under a tyre lie: the first one, ahead of the pose; the middle of the tyre, to the
// left of it [m]; slope to the left that the wheel leans with [1].
struct TyreLine {
  double begin, aside, lean;
};

// How far a line of samples lies to the left of the middle of the tyre [m].
inline double tyre_offset(Index line, const VehicleEnvelope& sizes) noexcept {
  const double share = 2.0 * static_cast<double>(line) / static_cast<double>(sizes.tyres - 1);
  return sizes.half_tyre * (share - 1.0);
}

// Highest known ground across a tyre along its way, above the level of the facets [m], of samples
// from a first one to before an end; unknown_height where nothing is known. What the wheel leans
// with is taken off: on a cross slope a tyre meets what lies askew with its lower edge, too. Samples
// behind the end, up to the next multiple of the lanes, are touched, too.
inline void sample_tyre(const FacetGrid& ground, const Pose2d& pose, const TyreLine& line,
                        Index first, Index end, const VehicleEnvelope& sizes,
                        double* profile) noexcept {
  std::fill(profile + first, profile + std::max(first, end), unknown_height);
  for (Index tyre = 0; tyre < sizes.tyres; ++tyre) {
    const double off = tyre_offset(tyre, sizes), leaned = line.lean * off;
    const SampleRun run(ground, pose, {line.begin, line.aside + off}, sizes.stride);
    for (Index n = first; n < end; n += lanes_abreast) {
      SLOPEWISE_INDEPENDENT
      for (std::int32_t lane = 0; lane < lanes_abreast; ++lane) {
        // Unknown cells count for none.
        const auto height = static_cast<double>(run.height(static_cast<std::int32_t>(n) + lane));
        profile[n + lane] = max_of(profile[n + lane], height - leaned);
      }
    }
  }
}

// How far the rim of a wheel lies above its lowest point, a stride apart, to either side [m].
struct Rim {
  static constexpr Index lanes = 2 * lanes_abreast;

  const double* drop;  // the last one repeated up to a multiple of the lanes
  Index strides;       // to either side

  static Index strides_of(const VehicleEnvelope& sizes) noexcept {
    return static_cast<Index>(sizes.radius / sizes.stride);
  }
  static Index padded_size(Index strides) noexcept {
    return (2 * strides / lanes + 1) * lanes;
  }
};

// Heights above the level that wheels stand on at least: the highest known ground under their axles,
// where standing_height looks for it, too [m]; unknown_height where nothing is known.
inline std::array<double, wheel_count> heights_under_axles(const FacetGrid& ground,
                                                           const Pose2d& pose,
                                                           const VehicleEnvelope& sizes,
                                                           Index strides) noexcept {
  const double back = static_cast<double>(strides) * sizes.stride;
  std::array<double, wheel_count> highest;
  highest.fill(unknown_height);
  for (Index tyre = 0; tyre < sizes.tyres; ++tyre) {
    const double off = tyre_offset(tyre, sizes);
    SLOPEWISE_INDEPENDENT
    for (std::size_t wheel = 0; wheel < wheel_count; ++wheel) {
      const Place at = wheel_at(static_cast<int>(wheel), sizes);
      const SampleRun run(ground, pose, {at.x - back, at.y + off}, sizes.stride);
      const auto height = static_cast<double>(run.height(static_cast<std::int32_t>(strides)));
      highest[wheel] = max_of(highest[wheel], height);
    }
  }
  return highest;
}

// Height of the lowest point of a wheel that stands on its rim [m], NaN where all is unknown. Into
// unknown ground it sinks as far as what is known around lets it, or its height there is unknown.
inline double standing_height(const FacetGrid& ground, const Pose2d& pose, Place wheel,
                              const VehicleEnvelope& sizes, const Rim& rim,
                              bool sinks_into_unknown) noexcept {
  const double begin = wheel.x - static_cast<double>(rim.strides) * sizes.stride;
  std::array<double, Rim::lanes> highest, total;  // NaN stays in the total
  highest.fill(unknown_height);
  total.fill(0.0);
  const auto last = static_cast<std::int32_t>(2 * rim.strides);
  for (Index tyre = 0; tyre < sizes.tyres; ++tyre) {
    const SampleRun run(ground, pose, {begin, wheel.y + tyre_offset(tyre, sizes)}, sizes.stride);
    for (std::int32_t first = 0; first <= last; first += Rim::lanes) {
      const double* drop = rim.drop + first;
      SLOPEWISE_INDEPENDENT
      for (std::int32_t lane = 0; lane < Rim::lanes; ++lane) {
        const auto n = static_cast<std::size_t>(lane);
        const double height =
            static_cast<double>(run.height(std::min(first + lane, last))) - drop[lane];
        highest[n] = max_of(highest[n], height);
        total[n] += height;
      }
    }
  }
  for (std::size_t half = Rim::lanes / 2; half > 0; half /= 2) {  // halves abreast, not one by one
    for (std::size_t n = 0; n < half; ++n) {
      highest[n] = max_of(highest[n], highest[n + half]);
      total[n] += total[n + half];
    }
  }
  const double top = highest[0], sum = total[0];
  const bool all_known = sum == sum;
  const bool is_supported = top > abyss && (all_known || sinks_into_unknown);
  return is_supported ? top + ground.level : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace slopewise
