// Random problems through the core, for the sanitizers and for what has to hold of every answer.
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "../driver.hpp"
#include "ground/ground_behind.hpp"
#include "ground/height_grid.hpp"
#include "profile/smoothing.hpp"
#include "ground/terrain.hpp"
#include "profile/time_optimal.hpp"

using namespace slopewise;
using namespace slopewise::driver;

namespace {

std::mt19937_64 generator;

void time_optimal_batch() {
  const Index n = whole(1, 90), m = whole(1, 150), size = n * m;
  std::vector<std::vector<double>> rows;
  const double low[] = {0, 0, -0.3, -0.04, 0.05, 0, 0, -0.1, -1};
  const double high[] = {0, 9, 0.3, 0.04, 0.8, 2, 1.5, 0.3, -1};
  for (std::size_t r = 0; r < 9; ++r) rows.push_back(numbers(size, low[r], high[r]));
  for (Index i = 0; i < size; ++i) {
    rows[0][static_cast<std::size_t>(i)] = 0.25 * static_cast<double>(i / m);
    if (uniform(0, 1) < 0.05) rows[1][static_cast<std::size_t>(i)] = 0.0;
  }
  const bool hard = uniform(0, 1) < 0.3, broken = uniform(0, 1) < 0.1;
  if (broken) rows[1][static_cast<std::size_t>(whole(0, size - 1))] = std::nan("");
  const auto start = numbers(m, 0, 9);
  std::vector<double> reachable(start.size()), cost(start.size());
  const auto row = [&](std::size_t r) { return Numbers{rows[r].data(), m}; };
  const Limits limits{hard ? std::numeric_limits<double>::infinity() : uniform(0.3, 4),
                      uniform(0.05, 2)};
  solve_time_optimal({n, m, row(0), row(1), row(2), row(3), row(4), row(5), row(6), row(7),
                      {rows[8].data(), m}},
                     limits, start.data(), reachable.data());
  add_travel_cost(rows[0].data(), rows[8].data(), n, m, 3.0, cost.data());
  for (std::size_t i = 0; !broken && i < rows[8].size(); ++i) {
    expect(rows[8][i] >= 0.0 && rows[8][i] <= rows[1][i], "0 <= v² <= bound");
  }
}

void smoothing() {
  const Index n = whole(min_stations, 200);
  const auto ds = numbers(n - 1, 0.05, 0.5), accel = numbers(n - 1, 0.0, 2.0),
             decel = numbers(n - 1, 0.3, 3.0);
  auto top = numbers(n, 0.0, 9.0);
  if (uniform(0, 1) < 0.5) top.back() = 0.0;
  // What rests once, rests for good.
  if (uniform(0, 1) < 0.7) std::fill(top.begin() + whole(0, n - 1), top.end(), 0.0);
  const double before = uniform(0, 1) < 0.5 ? std::nan("") : uniform(-6, 6);
  const SmoothingProblem p{n,           ds.data(), top.data(), accel.data(), decel.data(),
                           uniform(0.5, 10), before};
  std::vector<double> memory(static_cast<std::size_t>(smoothing_memory(n))), answer(top.size()),
      inside(top.size());
  const int iterations = smooth(p, memory.data(), answer.data());
  expect(std::abs(iterations) <= max_linearisations * max_iterations, "iterations are bounded");
  if (iterations <= 0) return;
  keep_inside(answer.data(), top.data(), n, inside.data());
  for (std::size_t k = 0; k < inside.size(); ++k) {
    expect(std::abs(inside[k] - answer[k]) < 1e-3, "the answer is below the time-optimal profile");
  }
}

// Paths on a map with holes, beyond its rim and with stations in one place.
void terrain() {
  const Index rows = whole(2, 90), columns = whole(2, 90), n = whole(2, 20), m = whole(1, 70);
  auto heights = numbers(rows * columns, 0.0, 0.5);
  for (double& height : heights) {
    if (uniform(0, 1) < 0.02) height = std::nan("");
  }
  const double cell = uniform(0.03, 0.4);
  const Footprint tyre{uniform(0, 0.25), uniform(0, 0.1), uniform(0, 1) < 0.2 ? 0.0 : 0.3};
  HeightGrid grid(heights.data(), rows, columns, 0.0, 0.0, cell, tyre);
  const double width = cell * static_cast<double>(columns);
  auto x = numbers(n * m, -0.2 * width, 1.2 * width), y = numbers(n * m, -1.0, 9.0);
  x[static_cast<std::size_t>(m)] = x[0];
  y[static_cast<std::size_t>(m)] = y[0];
  std::vector<std::int64_t> count(static_cast<std::size_t>(m));
  for (auto& each : count) each = whole(2, n);
  std::vector<std::vector<double>> out(9, std::vector<double>(x.size()));
  const auto known = std::make_unique<bool[]>(x.size());
  std::vector<float> twist(x.size()), front(2 * x.size()), behind(2 * x.size());
  sample_terrain(grid,
                 {n, m, x.data(), y.data(), count.data(), out[2].data(), out[3].data(),
                  0.0, out[0].data(), out[1].data(), out[2].data(), out[3].data(),
                   out[4].data(), out[5].data(), out[6].data(),
                  out[7].data(), out[8].data(), known.get(), twist.data(), front.data()},
                 1.2, 1.0);
  for (const double grade : out[5]) expect(std::abs(grade) < 1.6, "grades are known");
  sample_behind(grid,
                {n, m, x.data(), y.data(), out[2].data(), out[3].data(), x.data(), out[0].data(),
                 front.data(), behind.data()},
                1.2, 1.0);
}

}  // namespace

int main(int count, char** arguments) {
  return run(count, arguments, [](Index problem) {
    time_optimal_batch();
    smoothing();
    if (problem % 4 == 0) terrain();
  });
}
