// A height grid as Python holds it.
#pragma once

#include "bindings/bindings.hpp"
#include "ground/height_grid.hpp"

namespace slopewise {

// A map that stays while its grid does.
struct MapGrid {
  Input2 elevation;
  HeightGrid grid;

  MapGrid(const Input2& heights, double origin_x, double origin_y, double resolution,
          double half_length, double half_width, double radius)
      : elevation(heights),
        grid(heights.data(), static_cast<Index>(heights.shape(0)),
             static_cast<Index>(heights.shape(1)), origin_x, origin_y, resolution,
             {half_length, half_width, radius}) {
    if (heights.shape(0) < 2 || heights.shape(1) < 2) {
      throw nb::value_error("elevation: expected two rows and two columns at least");
    }
  }
};

}  // namespace slopewise
