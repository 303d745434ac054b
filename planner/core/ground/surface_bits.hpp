// Which terrain classes a vehicle touches along candidates, as bits of an integer.
#pragma once

#include <cmath>

#include "candidate_rows.hpp"

namespace slopewise {

// Class of each cell of a map, below 63.
struct ClassMap {
  const std::int64_t* classes;
  Index rows, columns;
  double origin_x, origin_y;  // centre of cell [0, 0] [m]
  double per_metre;           // cells in a metre

  // Bits of the classes of the four cells around a place in cells: no strip is stepped over. None
  // off the map; at its rim the cells beyond are taken to be those before.
  [[nodiscard]] std::int64_t around(double u, double v) const noexcept {
    const double column = std::floor(u), row = std::floor(v);
    const double right = static_cast<double>(columns - 1), top = static_cast<double>(rows - 1);
    if (!((column >= -1.0) & (row >= -1.0) & (column <= right) & (row <= top))) return 0;
    const Index east = column >= 0.0 && column < right ? 1 : 0;
    const Index north = row >= 0.0 && row < top ? columns : 0;
    const std::int64_t* cell = classes + static_cast<Index>(max_of(row, 0.0)) * columns +
                               static_cast<Index>(max_of(column, 0.0));
    constexpr std::int64_t bit = 1;
    return bit << cell[0] | bit << cell[east] | bit << cell[north] | bit << cell[north + east];
  }
};

// Classes below the wheels and the middle of a rectangle of wheels, (N, M); half sizes in m.
inline void find_surface_bits(const ClassMap& map, const PoseRows& poses, double half_length,
                              double half_width, std::int64_t* bits) noexcept {
  for (Index n = 0; n < poses.stations * poses.candidates; ++n) {
    const double u = (poses.x[n] - map.origin_x) * map.per_metre;
    const double v = (poses.y[n] - map.origin_y) * map.per_metre;
    const double ahead_u = poses.heading_x[n] * map.per_metre;
    const double ahead_v = poses.heading_y[n] * map.per_metre;
    std::int64_t found = map.around(u, v);
    for (const double ahead : {half_length, -half_length}) {
      for (const double aside : {half_width, -half_width}) {
        found |= map.around(u + ahead * ahead_u - aside * ahead_v,
                            v + ahead * ahead_v + aside * ahead_u);
      }
    }
    bits[n] = found;
  }
}

}  // namespace slopewise
