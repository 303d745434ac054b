// Random maps, vehicles and paths through the sweep and the roughness, for the sanitizers and for
// what has to hold of every answer.
#include <array>
#include <memory>
#include <vector>

#include "../driver.hpp"
#include "swept/roughness.hpp"
#include "swept/sweep.hpp"

using namespace slopewise;
using namespace slopewise::driver;

namespace {

std::mt19937_64 generator;

// Memory of the exact size, so that a step beyond it is found.
template <class T>
std::unique_ptr<T[]> memory(Index count) {
  return std::make_unique<T[]>(static_cast<std::size_t>(count));
}

VehicleEnvelope random_vehicle(double cell) {
  const double radius = uniform(0.1, 0.5), step = uniform(0.2, 0.9) * radius;
  const double half_length = uniform(0.3, 1.0), half_width = uniform(0.2, 0.6);
  const double stride = std::min(radius / 6.0, cell);
  const bool fine = cell <= radius;
  const double chord = (std::max(std::round(0.5 * radius / stride), 1.0) + 1.0) * stride;
  return {half_length,
          half_width,
          half_length + uniform(0.0, 0.5),
          half_length + uniform(0.0, 0.5),
          half_width + uniform(0.0, 0.3),
          fine ? 0.5 * cell : 0.0,
          0.5 * diagonal * cell,
          uniform(0.1, 0.4),
          fine ? uniform(0.05, 0.3) : std::numeric_limits<double>::infinity(),
          radius,
          uniform(0.02, 0.2),
          step,
          stride,
          chord,
          0.6 * step,
          0.6 * step - 0.03 * chord,
          std::round(2.5 * radius / stride) * stride,
          whole(2, 6),
          fine};
}

struct Scene {
  double cell = uniform(0.05, 0.6);
  Index rows = whole(2, 60), columns = whole(2, 60);
  std::vector<double> heights = std::vector<double>(static_cast<std::size_t>(rows * columns));
  MapView map{heights.data(), rows,         columns,
              uniform(-5, 5), uniform(-5, 5), 1.0 / cell};

  Scene() {
    const double noise = uniform(0.0, 0.1), east = uniform(-0.3, 0.3);
    for (Index n = 0; n < rows * columns; ++n) {
      double& z = heights[static_cast<std::size_t>(n)];
      z = east * cell * static_cast<double>(n % columns) + noise * uniform(-1, 1);
      if (uniform(0, 1) < 0.01) z = std::nan("");
      if (uniform(0, 1) < 0.01) z += 0.5;
    }
  }
};

// Rows of M candidates of N stations, some of which leave the map.
struct Paths {
  Index stations = whole(2, 25), candidates = whole(1, 80), size = stations * candidates;
  std::array<std::unique_ptr<double[]>, 6> row;  // x, y, heading, station, across
  std::unique_ptr<std::int64_t[]> count = memory<std::int64_t>(candidates);
  std::unique_ptr<bool[]> known = memory<bool>(size);
  std::unique_ptr<float[]> twist = memory<float>(size);
  double spacing = uniform(0.05, 0.4);

  explicit Paths(const Scene& scene) {
    for (auto& each : row) each = memory<double>(size);
    for (Index j = 0; j < candidates; ++j) {
      const double turn = uniform(-0.3, 0.3);
      double angle = uniform(0.0, 6.3);
      double x = scene.map.origin_x + uniform(0, scene.cell * static_cast<double>(scene.columns));
      double y = scene.map.origin_y + uniform(0, scene.cell * static_cast<double>(scene.rows));
      count[j] = whole(2, stations);
      for (Index k = 0; k < stations; ++k, angle += turn * spacing) {
        const Index at = k * candidates + j;
        const double numbers[] = {x, y, std::cos(angle), std::sin(angle),
                                  spacing * static_cast<double>(k), uniform(0, 0.3)};
        for (std::size_t r = 0; r < row.size(); ++r) row[r][at] = numbers[r];
        known[at] = uniform(0, 1) < 0.99;
        twist[at] = uniform(0, 1) < 0.99 ? static_cast<float>(uniform(-0.2, 0.2)) : std::nanf("");
        x += spacing * std::cos(angle);
        y += spacing * std::sin(angle);
      }
    }
  }

  [[nodiscard]] Positions positions() const {
    return {stations, candidates, row[0].get(), row[1].get()};
  }
  [[nodiscard]] SweptPaths swept(bool has_band) const {
    return {stations,     candidates,   row[0].get(), row[1].get(), row[2].get(),
            row[3].get(), row[4].get(), count.get(),  known.get(),  twist.get(),
            spacing,      has_band ? row[5].get() : nullptr};
  }
};

// Sweep a batch; the codes.
std::vector<std::int64_t> swept_codes(const BroadPhase& grid, const SweptPaths& paths) {
  std::array<std::int64_t, hazard_kinds> code_of_kind{0, 11, 12, 12, 12, 13, 14, 14, 14};
  std::vector<std::int64_t> code(static_cast<std::size_t>(paths.stations * paths.candidates), -1);
  const auto found = memory<double>(4 * paths.candidates);
  const auto buffer = memory<double>(NarrowPhase::memory_size(grid, paths.spacing));
  sweep(grid, paths, {code_of_kind.data(), code.data(), found.get()}, buffer.get());
  for (Index j = 0; j < paths.candidates; ++j) {
    Index blocked = 0;
    for (Index k = 0; k < paths.stations; ++k) {
      const std::int64_t here = code[static_cast<std::size_t>(k * paths.candidates + j)];
      blocked += here != 0;
      if (here == 0) continue;
      expect(k > 0 && k < paths.count[j], "a blocked station is one of the candidate's");
      const auto kind = static_cast<std::size_t>(found[4 * j]);
      expect(code_of_kind[kind] == here, "the hazard found is the one that blocks");
    }
    expect(blocked <= 1, "a candidate ends at its first hazard");
  }
  return code;
}

// One column of a table of M candidates.
template <class T>
std::vector<T> column(const T* table, Index rows, Index candidates, Index j) {
  std::vector<T> out;
  for (Index k = 0; k < rows; ++k) out.push_back(table[k * candidates + j]);
  return out;
}

void sweep_batch() {
  const Scene scene;
  const Paths all(scene);
  const bool has_band = uniform(0, 1) < 0.4;
  std::optional<BandWidth> width;
  if (has_band) width = {0.3, uniform(0, 0.1), uniform(0, 0.5)};
  const VehicleEnvelope vehicle = random_vehicle(scene.cell);
  const Positions at = all.positions();
  const BroadPhase grid(scene.map, scene.cell, vehicle, width, at, uniform(0, 0.2));
  const Positions part{std::max<Index>(at.stations / 2, 1), at.candidates, at.x, at.y};
  expect(grid.covers(part) && grid.covers(at), "what was asked about is covered");
  const SweptPaths paths = all.swept(has_band);
  const auto codes = swept_codes(grid, paths);
  const Index n = paths.stations, m = paths.candidates, j = whole(0, m - 1);
  std::array<std::vector<double>, 6> rows;
  for (std::size_t r = 0; r < rows.size(); ++r) rows[r] = column(all.row[r].get(), n, m, j);
  const auto twist = column(paths.twist, n, m, j);
  const auto known = memory<bool>(n);
  for (Index k = 0; k < n; ++k) known[k] = paths.known[k * m + j];
  const SweptPaths alone{n,
                         1,
                         rows[0].data(),
                         rows[1].data(),
                         rows[2].data(),
                         rows[3].data(),
                         rows[4].data(),
                         paths.count + j,
                         known.get(),
                         twist.data(),
                         paths.spacing,
                         has_band ? rows[5].data() : nullptr};
  expect(swept_codes(grid, alone) == column(codes.data(), n, m, j),
         "a code does not depend on the candidates next to it");
}

void roughness_batch() {
  const VehicleEnvelope vehicle = random_vehicle(0.05);
  const double frequency = uniform(0.5, 4), damping = uniform(0.05, 0.9);
  const double accel = uniform(0.5, 5), speed = uniform(0.5, 10), spacing = uniform(0.02, 0.5);
  const Index n = whole(1, 60), m = whole(1, 80);
  std::vector<QuarterCar> cars;
  std::vector<std::int64_t> count;
  std::vector<Index> order(static_cast<std::size_t>(m)), first{0};
  Index most = 0;
  for (Index j = 0; j < m; ++j) {
    const double share = whole(0, 1) > 0 ? 1.0 : uniform(0.7, 1.0);
    cars.emplace_back(vehicle, frequency, damping, accel, speed, share * spacing);
    count.push_back(whole(1, n));
    most = std::max(most, cars.back().pre_roll);
  }
  const auto behind = memory<float>(2 * most * m), front = memory<float>(2 * n * m);
  for (Index i = 0; i < 2 * most * m; ++i) behind[i] = static_cast<float>(uniform(0, 0.05));
  for (Index i = 0; i < 2 * n * m; ++i) front[i] = static_cast<float>(uniform(0, 0.05));
  const auto held = memory<double>(n * m);
  const RoughPaths paths{most,         n,            m,           behind.get(), front.get(),
                         count.data(), cars.data(), held.get()};
  limit_by_roughness(paths, order, memory<float>(roughness_memory(paths)).get());
  const Index j = whole(0, m - 1);
  const auto lane = static_cast<std::size_t>(j);
  const Index own = static_cast<Index>(count[lane]), rolled = cars[lane].pre_roll;
  const auto behind_j =
      column(behind.get() + 2 * (most - rolled) * m, 2 * rolled, m, j);
  const auto front_j = column(front.get(), 2 * own, m, j);
  std::vector<double> held_j(static_cast<std::size_t>(own));
  const RoughPaths alone{rolled,          own,         1, behind_j.data(), front_j.data(),
                         &count[lane], &cars[lane], held_j.data()};
  limit_by_roughness(alone, first, memory<float>(roughness_memory(alone)).get());
  for (Index k = 0; k < own; ++k) {
    const double here = held[k * m + j];
    expect(here == held_j[static_cast<std::size_t>(k)], "a speed depends on its candidate only");
    expect(here > 0.0, "a speed is above 0, or infinite");
  }
}

}  // namespace

int main(int count, char** arguments) {
  return run(count, arguments, [](Index) {
    sweep_batch();
    roughness_batch();
  });
}
