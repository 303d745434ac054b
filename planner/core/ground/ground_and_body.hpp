// Ground along candidates, and the pose of the body on it.
#pragma once

#include "ground/body_pose.hpp"
#include "ground/terrain.hpp"

namespace slopewise {

// Middle of the wheelbase [m] and unit vector of the heading, (N, M) each; null where they are those
// of the path.
struct BodyTable {
  double *x, *y, *heading_x, *heading_y;
};

// Fill in the rows of a table and of the body. Its heading is that of the table, where it has one;
// else its steering centre trails behind the reference point by `rod` [m], or it has the heading of
// the path. Its middle is ahead of the path by the offset of the table.
inline void sample_ground(HeightGrid& grid, TerrainTable t, const BodyTable& body, double rod,
                          double length, double width) {
  const Index stride = t.candidates, count = t.stations * stride;
  const bool is_given = t.body_x != nullptr, trails = !is_given && rod > 0.0;
  if (trails) trail({t.stations, stride, t.x, t.y}, rod, body.heading_x, body.heading_y);
  if (!is_given) {
    t.body_x = trails ? body.heading_x : t.heading_x;
    t.body_y = trails ? body.heading_y : t.heading_y;
  }
  sample_terrain(grid, t, length, width);
  // What is unknown from the first station on has the first known height.
  for (Index j = 0; j < stride; ++j) {
    Index seen = 0;
    while (seen < t.stations && !std::isfinite(t.z[seen * stride + j])) ++seen;
    const double height = seen < t.stations ? t.z[seen * stride + j] : 0.0;
    for (Index k = 0; k < seen; ++k) t.z[k * stride + j] = height;
  }
  if (body.x == nullptr) return;
  std::copy_n(t.x, count, body.x);
  std::copy_n(t.y, count, body.y);
  for (Index n = 0; n < count && !trails; ++n) {
    body.heading_x[n] = t.body_x[n];
    body.heading_y[n] = t.body_y[n];
    body.x[n] += t.body_offset * t.body_x[n];
    body.y[n] += t.body_offset * t.body_y[n];
  }
}

}  // namespace slopewise
