// Random forces and bounds through the core, for the sanitizers and for what has to hold of every
// answer: no bound is NaN or above the limit, none is left behind a barrier, and stops end in time.
#include <memory>

#include "../driver.hpp"
#include "ground/body_pose.hpp"
#include "ground/braking_forces.hpp"
#include "bounds/speed_bounds.hpp"
#include "ground/surface_bits.hpp"

using namespace slopewise;
using namespace slopewise::driver;

namespace {

std::mt19937_64 generator;

// Rows of the exact size, so that a step beyond them is found.
struct Memory {
  Index stations, candidates;
  std::vector<std::unique_ptr<double[]>> rows;
  std::vector<std::unique_ptr<bool[]>> flags;
  std::vector<std::unique_ptr<std::int64_t[]>> labels;

  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(stations * candidates); }
  Rows<double> numbers(double low, double high) {
    rows.push_back(std::make_unique<double[]>(size()));
    for (std::size_t i = 0; i < size(); ++i) rows.back()[i] = uniform(low, high);
    return {rows.back().get(), candidates};
  }
  Rows<bool> yes(double share) {
    flags.push_back(std::make_unique<bool[]>(size()));
    for (std::size_t i = 0; i < size(); ++i) flags.back()[i] = sometimes(share);
    return {flags.back().get(), candidates};
  }
  Rows<std::int64_t> whole_numbers(Index low, Index high) {
    labels.push_back(std::make_unique<std::int64_t[]>(size()));
    for (std::size_t i = 0; i < size(); ++i) labels.back()[i] = whole(low, high);
    return {labels.back().get(), candidates};
  }
};

Numbers as_read(const Rows<double>& rows) { return {rows.data, rows.stride}; }
Flags as_read(const Rows<bool>& rows) { return {rows.data, rows.stride}; }
Labels as_read(const Rows<std::int64_t>& rows) { return {rows.data, rows.stride}; }

std::vector<std::int64_t> counts_up_to(Index stations, Index candidates) {
  std::vector<std::int64_t> counts(static_cast<std::size_t>(candidates));
  for (auto& count : counts) count = std::min<Index>(stations, whole(2, stations));
  return counts;
}

Surface random_surface() {
  const double slowest = uniform(0, 1), down = uniform(-0.4, 0), lean = uniform(-0.4, 0);
  Surface s{uniform(-0.05, 0.05), uniform(-0.5, 0.5), uniform(-0.03, 0.03), uniform(0.1, 0.8),
            0, 0, uniform(0, 0.6), uniform(0, 0.5), slowest, slowest + uniform(0.1, 6), down,
            -down, lean, -lean, uniform(0.1, 0.9), 1.0};
  s.up_m_m = sometimes(0.5) ? s.m_m : uniform(-0.05, 0.05);
  s.up_b_m = sometimes(0.5) ? s.b_m : uniform(-0.5, 0.5);
  return s;
}

struct Batch {
  Memory memory;
  TerrainRows terrain;
  std::vector<std::int64_t> counts;
  std::vector<double> offset;
  ForceBounds forces;
  bool slides;
};

TerrainRows random_terrain(Memory& m, const std::vector<std::int64_t>& counts) {
  const double steep = uniform(0.01, 0.3);
  Rows<double> station = m.numbers(0, 0.05), grade = m.numbers(-steep, steep);
  Rows<double> sin_grade = m.numbers(0, 0), heading_x = m.numbers(0, 0), heading_y = m.numbers(0, 0);
  for (Index k = 0; k < m.stations; ++k) {
    for (Index j = 0; j < m.candidates; ++j) {
      station.at(k)[j] += 0.25 * static_cast<double>(k);
      sin_grade.at(k)[j] = std::sin(grade.at(k)[j]);
      const double yaw = uniform(-4, 4);
      heading_x.at(k)[j] = std::cos(yaw);
      heading_y.at(k)[j] = std::sin(yaw);
    }
  }
  return {m.stations, m.candidates, counts.data(), as_read(station), as_read(heading_x),
          as_read(heading_y), as_read(m.numbers(-0.3, 0.3)), as_read(grade), as_read(sin_grade),
          as_read(m.numbers(-0.2, 0.2)), as_read(m.numbers(-0.2, 0.2)), as_read(m.yes(0.998))};
}

void expect_forces(const Batch& b) {
  for (Index k = 0; k < b.memory.stations; ++k) {
    for (Index j = 0; j < b.memory.candidates; ++j) {
      const double v = b.forces.slowest.at(k)[j];
      const double low = b.forces.lower_slope.at(k)[j] * v + b.forces.lower_intercept.at(k)[j];
      const double high = b.forces.upper_slope.at(k)[j] * v + b.forces.upper_intercept.at(k)[j];
      expect(low <= high + 1e-9, "the lower bound of a force is not above the upper one");
      expect(b.forces.fastest.at(k)[j] >= 0.0, "a trained speed");
    }
  }
}

void find_random_forces(Batch& b) {
  Memory& m = b.memory;
  const auto count = static_cast<std::size_t>(whole(1, 4)), lines = static_cast<std::size_t>(whole(1, 5));
  std::vector<Surface> surfaces(count);
  for (Surface& s : surfaces) s = random_surface();
  std::vector<std::int64_t> class_bits(static_cast<std::size_t>(whole(1, 5)));
  for (auto& bits : class_bits) bits = whole(1, (1 << count) - 1);
  std::vector<HullLine> hull(sometimes(0.5) ? count * lines : 0);
  for (HullLine& line : hull) line = {uniform(1, 6), uniform(-3, 3)};
  std::vector<double> matrices(sometimes(0.5) ? 16 * count : 0);
  for (std::size_t i = 0; i < matrices.size(); ++i) matrices[i] = i % 5 == 0 ? uniform(0, 1e-3) : 0.0;
  Labels classes{};
  if (class_bits.size() > 1) classes = as_read(m.whole_numbers(0, (1 << class_bits.size()) - 1));
  const bool terms = sometimes(0.5);
  const ForceProblem problem{
      m.stations, m.candidates, b.counts.data(), b.terrain.grade, b.terrain.sin_grade,
      b.terrain.sin_roll, b.terrain.known, classes, class_bits, surfaces,
      sometimes(0.5) ? uniform(0, 0.5) : -1.0, hull,
      terms ? as_read(m.numbers(-0.1, 0)) : Numbers{}, terms ? as_read(m.numbers(0, 0.1)) : Numbers{},
      matrices.empty() ? nullptr : matrices.data(),
      sometimes(0.5) ? as_read(m.numbers(0, 0.1)) : Numbers{}, b.slides};
  find_forces(problem, b.forces);
  expect_forces(b);
}

void expect_bounds(const BoundProblem& p, const Bounds& out) {
  for (Index j = 0; j < p.terrain.candidates; ++j) {
    expect(out.clear_distance[j] <= p.clear[j], "the clear distance");
    for (Index k = 0; k < p.terrain.stations; ++k) {
      const double v_sq = out.speed_sq_max.at(k)[j], limit = p.vehicle.speed;
      expect(v_sq >= 0.0 && v_sq <= limit * limit, "a bound between 0 and the limit");
      expect(k < out.barrier_station[j] || v_sq == 0.0, "nothing moves behind a barrier");
      if (v_sq == 0.0 || p.motion.moves || p.motion.lag > 0.0) continue;
      // A stop is longer than its dead time.
      const double s = p.terrain.station.at(k)[j] + std::sqrt(v_sq) * p.forces.dead_time.at(k)[j];
      expect(s <= out.clear_distance[j] + 1e-6, "the brakes take hold before the clear distance");
    }
  }
}

void bound_random_speeds(Batch& b) {
  Memory& m = b.memory;
  const bool moves = sometimes(0.3);
  MotionTerms motion;
  motion.moves = moves;
  for (double& value : motion.values) value = moves ? uniform(0, 0.02) : 0.0;
  motion.lag = sometimes(0.2) ? uniform(0.05, 0.4) : 0.0;
  motion.fade = sometimes(0.2) ? 1e-3 : 0.0;
  motion.fade_tau = 30.0;
  motion.friction = no_limit;
  const Vehicle vehicle{0.9, 0.9, 1.1, 0.1, 0.1, sometimes(0.5) ? 0.12 : 0.0, 0.6, 6, 0.5, 1.2, 4, 1, 1.5,
                        2, 5, 0.5, 0.45, sometimes(0.5) ? -1.0 : 0.55, 1.0, 1.0};
  std::vector<double> clear(static_cast<std::size_t>(m.candidates));
  for (double& end : clear) end = sometimes(0.5) ? no_limit : uniform(0, 20);
  const auto speeds = [&](bool there) {
    return alike_infinite.unless(there ? as_read(m.numbers(0.5, 9)) : Numbers{});
  };
  const ForceRows forces{
      as_read(b.forces.lower_slope), as_read(b.forces.lower_intercept),
      as_read(b.forces.upper_slope), as_read(b.forces.upper_intercept),
      as_read(b.forces.dead_time), as_read(b.forces.shortest_dead_time),
      as_read(b.forces.slowest), as_read(b.forces.fastest), as_read(b.forces.trained),
      b.forces.distance_offset};
  const StopErrors errors{sometimes(0.5) ? 0.1 : 0.0, sometimes(0.5), 0.01, 0.05, sometimes(0.3) ? 0.05 : 0.0};
  const BoundProblem problem{
      b.terrain, forces, alike_zero.unless(Labels{}), speeds(sometimes(0.5)), speeds(sometimes(0.5)),
      speeds(sometimes(0.3)), b.slides ? as_read(b.forces.friction) : Numbers{}, clear.data(), errors,
      vehicle, motion, !(moves || motion.lag > 0.0 || motion.fade > 0.0)};
  std::vector<Label> barrier(clear.size());
  std::vector<std::int64_t> barrier_station(clear.size());
  std::vector<double> clear_distance(clear.size());
  const Bounds out{m.numbers(0, 0), m.whole_numbers(0, 0), m.numbers(0, 0), m.numbers(0, 0),
                   m.numbers(0, 0), m.numbers(0, 0), m.numbers(0, 0), m.numbers(0, 0),
                   barrier.data(), barrier_station.data(), clear_distance.data()};
  bound_speeds(problem, out, BoundMemory::of_thread(m.stations, m.candidates));
  expect_bounds(problem, out);
}

void batch() {
  Batch b{{whole(2, 90), whole(1, 150), {}, {}, {}}, {}, {}, {}, {}, sometimes(0.5)};
  Memory& m = b.memory;
  b.counts = counts_up_to(m.stations, m.candidates);
  b.offset.resize(b.counts.size());
  b.terrain = random_terrain(m, b.counts);
  b.forces = {m.numbers(0, 0), m.numbers(0, 0), m.numbers(0, 0), m.numbers(0, 0), m.numbers(0, 0),
              m.numbers(0, 0), m.numbers(0, 0), m.numbers(0, 0), b.slides ? m.numbers(0, 0) : Rows<double>{},
              m.yes(0), b.offset.data()};
  find_random_forces(b);
  bound_random_speeds(b);
}

void poses() {
  Memory m{whole(2, 60), whole(1, 70), {}, {}, {}};
  const Rows<double> x = m.numbers(-1, 8), y = m.numbers(-1, 8);
  const Rows<double> heading_x = m.numbers(0, 0), heading_y = m.numbers(0, 0);
  trail({m.stations, m.candidates, x.data, y.data}, uniform(0.1, 2), heading_x.data,
        heading_y.data);
  for (std::size_t n = 0; n < m.size(); ++n) {
    const double length = std::hypot(heading_x.data[n], heading_y.data[n]);
    expect(std::fabs(length - 1.0) < 1e-9, "a heading is a unit vector");
  }
  Memory map{whole(2, 30), whole(2, 30), {}, {}, {}};
  const Rows<std::int64_t> classes = map.whole_numbers(0, 62), bits = m.whole_numbers(0, 0);
  find_surface_bits({classes.data, map.stations, map.candidates, 0, 0, uniform(1, 10)},
                    {m.stations, m.candidates, x.data, y.data, heading_x.data, heading_y.data}, 0.6,
                    0.5, bits.data);
}

}  // namespace

int main(int count, char** arguments) {
  return run(count, arguments, [](Index) {
    batch();
    poses();
  });
}
