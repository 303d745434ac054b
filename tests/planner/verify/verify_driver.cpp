// Random plans and paths through verifier, labels and paths of a horizon, for the sanitizers and for
// what has to hold of every answer.
#include <memory>
#include <vector>

#include "../driver.hpp"
#include "verify/labels.hpp"
#include "path/polyline.hpp"
#include "verify/verify_lane.hpp"
#include "verify/verify_ground.hpp"

using namespace slopewise;
using namespace slopewise::verify;
using namespace slopewise::driver;

namespace {

std::mt19937_64 generator;

Vehicle vehicle() {
  return {1.2,  1.1, 0.9,  uniform(0.05, 0.3), 0.05, 0.1, 0.5, uniform(1, 5), 0.6, 2.0,
          uniform(1, 5), 1.0, sometimes(0.2) ? infinite : uniform(0.5, 3), uniform(0.5, 3), 3.0,
          0.5,  0.4, sometimes(0.5) ? -1.0 : 0.6, 1.0,  1.0};
}

VerifyTerms terms() {
  MotionTerms motion;
  motion.friction = sometimes(0.5) ? infinite : uniform(0.2, 0.8);
  motion.lag = sometimes(0.3) ? 0.2 : 0.0;
  motion.moves = sometimes(0.3);
  if (motion.moves) motion.values[0] = 0.05;
  const bool in_time = motion.moves || motion.lag > 0.0 || motion.friction < infinite;
  return {{1.2, 1.0, 0.6, 0.5, 1.3}, vehicle(), motion,
          {uniform(0, 0.2), sometimes(0.5), uniform(0, 0.05), uniform(0, 0.2), uniform(0, 0.1)},
          {sometimes(0.5) ? 0.6 : 0.0, 1.2, sometimes(0.5) ? infinite : 0.3, 0.5},
          in_time, whole(0, 3), 0.02, sometimes(0.5)};
}

// M tracks of up to N stations, sometimes with a number that is none.
struct Tracks {
  Index n = whole(2, 60), m = whole(1, 12);
  std::vector<std::vector<double>> rows;
  std::vector<std::int64_t> count;
  std::vector<double> offset = numbers(m, 0, 0.2);

  Tracks() {
    const double low[] = {0, -1, -1, -0.3, -0.3, -0.2, -0.2, -0.04, 0.2, -0.04, 0.3, 0, 0, 0.5, 0.2, 0};
    const double high[] = {0, 1, 1, 0.3, 0.3, 0.2, 0.2, 0.04, 0.7, 0.04, 0.8, 0.5, 1, 5, 0.9, 0.5};
    for (std::size_t r = 0; r < 16; ++r) rows.push_back(numbers(n * m, low[r], high[r]));
    for (Index i = 0; i < n * m; ++i) rows[0][static_cast<std::size_t>(i)] = 0.25 * static_cast<double>(i / m);
    if (sometimes(0.2)) rows[static_cast<std::size_t>(whole(3, 14))].back() = std::nan("");
    for (Index j = 0; j < m; ++j) count.push_back(whole(2, n));
  }

  [[nodiscard]] TrackRows view(bool slips) const {
    const auto& r = rows;
    const auto row = [&](std::size_t of) { return Numbers{r[of].data(), m}; };
    const TerrainRows terrain{n,      m,      count.data(), row(0), row(1), row(2),
                              row(3), row(4), {},           row(5), row(6), {}};
    const ForceRows forces{row(7), row(8), row(9), row(10), row(11), row(15), row(12), {}, {}, offset.data()};
    return {terrain, forces, row(13), slips ? row(14) : Numbers{}};
  }
};

void plans() {
  const Tracks batch;
  const VerifyTerms by = terms();
  const Index n = batch.n, m = batch.m;
  const TrackRows rows = batch.view(sometimes(0.5));
  auto speed_sq = numbers(n * m, -0.1, 9.0);
  if (sometimes(0.1)) speed_sq[static_cast<std::size_t>(whole(0, n * m - 1))] = std::nan("");
  const auto clear = numbers(m, 0, 20);
  std::vector<double> worst(static_cast<std::size_t>(m) * breach_count),
      memory(static_cast<std::size_t>(verify_lane_memory(n)));
  for (Index j = 0; j < m; ++j) {
    verify_lane(rows, j, {speed_sq.data(), m}, clear.data(), by, memory.data(),
                worst.data() + j * static_cast<Index>(breach_count));
  }
  for (const double each : worst) expect(each >= 0.0, "breaches are not negative");
  const Index j = whole(0, m - 1), stations = static_cast<Index>(batch.count[static_cast<std::size_t>(j)]);
  std::vector<double> columns(static_cast<std::size_t>(track_columns * stations));
  copy_columns(rows, j, 0, true, columns.data(), stations);
  std::array<const double*, track_columns> column{};
  for (std::size_t c = 0; c < column.size(); ++c) column[c] = columns.data() + static_cast<Index>(c) * stations;
  const Track track = track_at(stations, column);
  auto accel = numbers(stations, -1, 1), most = numbers(stations - 1, 0, 1), least = most;
  const auto bound = numbers(stations, 0, 9);
  const Numbers some{bound.data(), 1}, push{accel.data(), 1};
  const ProfileProblem of{stations, 1, {}, {}, {}, {}, push, {}, some, push, some, some, 1.0, 1.0, {}};
  limit_segments(track, bound.data(), of, by.limits, most.data(), least.data());
  std::vector<std::int64_t> label(static_cast<std::size_t>(stations), 99), code(label);
  label_stations({stations, bound.data(), accel.data(), bound.data(), label.data(), most.data(),
                  least.data(), 1.0, sometimes(0.5)}, code.data());
}

// Lines on a map with holes, and beyond its rim.
void ground() {
  const Index rows = whole(2, 90), columns = whole(2, 90), n = whole(2, 60);
  auto heights = numbers(rows * columns, 0.0, sometimes(0.5) ? 0.02 : 0.5);
  for (double& height : heights) {
    if (sometimes(0.005)) height = std::nan("");
  }
  const double cell = uniform(0.03, 0.6), width = cell * static_cast<double>(columns);
  const MapView map{heights.data(), rows, columns, 0.0, 0.0, cell, 1.0 / cell};
  const BodySizes sizes{1.2, 1.0, uniform(0.1, 0.5), 0.2, 0.9, 0.9, 1.2, 0.25, 0.09, 0.1,
                        sometimes(0.5) ? 0.6 : 0.0, sometimes(0.5) ? 0.6 : 0.0};
  auto x = numbers(n, -1.0, 1.0), y = numbers(n, 0.0, 0.1), station = x;
  const double start = uniform(-0.2, 0.9) * width, step = uniform(0.0, 0.3);
  for (Index k = 0; k < n; ++k) {
    x[static_cast<std::size_t>(k)] = start + step * static_cast<double>(k);
    y[static_cast<std::size_t>(k)] += 0.5 * cell * static_cast<double>(rows);
    station[static_cast<std::size_t>(k)] = step * static_cast<double>(k);
  }
  const PlannedLine line{n, x.data(), y.data(), station.data()};
  const auto force = numbers(n, 0.1, 0.6), friction = numbers(n, 0.2, 1.0);
  const auto offset = numbers(n, 0.0, 0.3);
  std::vector<double> memory(static_cast<std::size_t>(
      ground_memory(line, count_poses(line, pose_step(map, sizes)), columns)));
  const GroundRange range{uniform(0.0, 1.0), uniform(0.0, 20.0)};
  const GroundFinding found = first_blocked(
      map, sizes, line, {force.data(), friction.data(), y.data(), offset.data()},
      {-0.26, 0.26, -0.26, 0.26, uniform(0.0, 0.2), 0.0, 0.02}, {0.01, 0.01, 0.1, 0.25}, range,
      memory.data());
  expect(found.kind == GroundKind::none ||
             (found.station >= range.begin && found.station <= range.end),
         "what blocks the path is in the range");
}

void horizon() {
  const Index n = whole(2, 40), m = whole(1, 20);
  const auto x = numbers(n * m, -9, 9), y = numbers(n * m, -9, 9);
  std::vector<std::int64_t> count;
  for (Index j = 0; j < m; ++j) count.push_back(whole(2, n));
  const Paths paths{n, m, x.data(), y.data(), count.data()};
  std::vector<std::int64_t> segment(count);
  std::vector<double> values(static_cast<std::size_t>(6 * m));
  double* v = values.data();
  locate_on_paths(paths, {uniform(-9, 9), uniform(-9, 9)}, uniform(-4, 4),
                  {segment.data(), v, v + m, v + 2 * m, v + 3 * m, v + 4 * m, v + 5 * m});
  for (std::size_t j = 0; j < count.size(); ++j) {
    expect(segment[j] >= 0 && segment[j] + 1 < count[j], "a place is on a segment");
  }
}

}  // namespace

int main(int count, char** arguments) {
  return run(count, arguments, [](Index) {
    plans();
    ground();
    horizon();
  });
}
