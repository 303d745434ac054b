// Speeds along a fan of arcs over a hill, without Python, from 1 m/s or the speed given. Before:
//     slopewise export atv --cpp . --resolution 0.2 --height-std 0
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <limits>
#include <vector>

#include "atv.hpp"

namespace {

constexpr long cells = 200;  // along an edge, of 0.2 m

std::vector<double> heights() {
  std::vector<double> z;
  for (long row = 0; row < cells; ++row) {
    for (long column = 0; column < cells; ++column) {
      const double x = 0.2 * static_cast<double>(column), y = 0.2 * static_cast<double>(row);
      const double away = (x - 22.0) * (x - 22.0) + (y - 20.0) * (y - 20.0);
      z.push_back(2.0 * std::exp(-away / 60.0) + 0.03 * std::sin(2.0 * x + y));
    }
  }
  // Nothing is known there.
  for (long row = 60; row < 80; ++row) z[row * cells + 130] = std::numeric_limits<double>::quiet_NaN();
  return z;
}

slopewise::EvenPath arc(double curvature) {
  slopewise::EvenPath path;
  const double step = 0.2;
  double x = 5.0, y = 20.0, heading = 0.5 * curvature * step;
  for (int k = 0; k <= 120; ++k, heading += curvature * step) {
    path.x.push_back(x);
    path.y.push_back(y);
    x += step * std::cos(heading);
    y += step * std::sin(heading);
  }
  return path;
}

}  // namespace

int main(int count, char** given) try {
  const std::vector<double> z = heights();
  slopewise::Planner planner(atv, {z.data(), cells, cells, 0.0, 0.0, 0.2});
  std::vector<slopewise::EvenPath> fan;
  for (int i = -3; i <= 3; ++i) fan.push_back(arc(0.02 * i));
  planner.sample_terrain(fan);
  planner.solve(count > 1 ? std::atof(given[1]) : 1.0);
  std::printf("candidate,status,x,y,station,speed\n");
  for (std::size_t j = 0; j < fan.size(); ++j) {
    const slopewise::Plan plan = planner.finish(j);
    for (std::size_t k = 0; k < plan.speed.size(); ++k) {
      std::printf("%zu,%d,%.17g,%.17g,%.17g,%.17g\n", j, static_cast<int>(plan.status),
                  fan[j].x[k], fan[j].y[k], plan.station[k], plan.speed[k]);
    }
  }
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
