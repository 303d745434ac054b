// Random maps, paths and vehicles through the whole planner, for the sanitizers: ordinary ones, and
// with numbers that are none, too large, too small or missing. A wrong argument throws, by name.
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "driver.hpp"
#include "slopewise/finish.cpp"
#include "slopewise/sample_terrain.cpp"
#include "slopewise/solve.cpp"

using namespace slopewise;

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
using driver::sometimes;
using driver::uniform;
using driver::whole;

// Over decades.
double spread(double low, double high) { return std::exp(uniform(std::log(low), std::log(high))); }

double wild() {
  constexpr double of[] = {nan, no_limit, -no_limit, 0.0, -0.0, 1e300, -1e300, 1e18, 1e-300, -1.0};
  return of[whole(0, 9)];
}

double climb(double radius, double step, double within) {
  const double contact = std::sqrt(radius * radius - (radius - step) * (radius - step));
  const double left = contact - std::min(within, contact);
  return std::sqrt(radius * radius - left * left) - (radius - step);
}

VehicleEnvelope envelope(double radius, double cell) {
  const double length = uniform(2.5, 8.0) * radius, width = uniform(2.0, 6.0) * radius;
  const double stride = std::min(radius / 6.0, cell), step = uniform(0.1, 1.0) * radius;
  const double seen = std::max(std::round(0.5 * radius / stride), 1.0) * stride;
  const bool fine = cell <= radius;
  return {0.5 * length, 0.5 * width, 0.5 * length + uniform(0.0, 1.0), 0.5 * length + uniform(0.0, 1.0),
          0.5 * width + uniform(0.0, 0.5), fine ? 0.5 * cell : 0.0, 0.71 * cell,
          uniform(0.2, 1.5) * radius, fine ? uniform(0.2, 1.0) * radius : no_limit, radius,
          uniform(0.1, 0.5) * radius, step, stride, seen + stride, climb(radius, 0.9 * step, seen),
          climb(radius, step, seen) - 0.03 * (seen + stride), std::round(2.5 * radius / stride) * stride,
          static_cast<Index>(std::ceil(radius / cell)) + 1, fine};
}

Surface surface() {
  const double steep = uniform(0.05, 0.5), friction = sometimes(0.3) ? uniform(0.2, 1.0) : no_limit;
  return {uniform(-0.1, 0.1), uniform(-1, 0.2), uniform(-0.05, 0.05), uniform(0.1, 0.8),
          uniform(-0.1, 0.1), uniform(-1, 0.2), uniform(0, 1), uniform(0, 0.5), uniform(0, 1),
          uniform(1, 8), -steep, steep, -std::sin(steep), std::sin(steep), friction, friction};
}

Vehicle limits(double cg_z, double length, double cg_x, double width) {
  return {cg_z / (length - cg_x), cg_z / cg_x, 2.0 * cg_z / width, uniform(0, 0.3), uniform(0, 0.2),
          uniform(0, 0.5), 0.5 * width, uniform(1, 10), uniform(0.1, 1), uniform(0.1, 3),
          uniform(0.5, 10), uniform(0.2, 3), sometimes(0.3) ? no_limit : uniform(0.3, 5),
          uniform(0.5, 5), uniform(0.5, 8), cg_x / length, cg_z / length,
          sometimes(0.5) ? -1.0 : uniform(0.2, 0.8), 1.0, 1.0};
}

PlanningModel random_model(double cell) {
  const double radius = spread(std::max(0.05, 0.3 * cell), 0.8);
  PlanningModel model{};
  const VehicleEnvelope size = model.envelope = envelope(radius, cell);
  const double length = 2.0 * size.half_length, width = 2.0 * size.half_width;
  const double cg_x = uniform(0.3, 0.7) * length, cg_z = uniform(0.1, 0.8) * length;
  const bool trails = sometimes(0.3), rear_axle = !trails && sometimes(0.2);
  model.resolution = cell;
  model.spacing = std::min(cell, 0.25);
  model.front = size.front;
  model.jerk = uniform(0.3, 5);
  model.ride_frequency = uniform(0.5, 5);
  model.ride_damping = uniform(0.05, 1);
  model.extrapolation_margin = sometimes(0.3) ? uniform(0, 0.5) : -1.0;
  model.limits = limits(cg_z, length, cg_x, width);
  if (size.fine) model.tyre = {std::sqrt(radius * radius - std::pow(std::max(radius - size.max_step, 0.0), 2)), uniform(0, 0.1), radius};
  const double rod = trails ? 0.5 * length : 0.0, ahead = rear_axle ? 0.5 * length : 0.0;
  model.body = {length, width, radius, 2.0 * size.half_tyre, size.front, size.rear, 2.0 * size.side,
                size.clearance, size.max_step, size.wheel_travel, rod, ahead};
  model.weighed = {length, width, cg_x, cg_z, width};
  model.steering = {rod, trails || rear_axle ? length : 0.0, sometimes(0.5) ? no_limit : uniform(0.05, 1),
                    sometimes(0.5) ? no_limit : uniform(0.1, 2)};
  const double steep = uniform(0.1, 0.5), band = sometimes(0.4) ? uniform(0, 0.4) : 0.0;
  model.ground = {-steep, steep, -steep, steep, band, sometimes(0.3) ? band : 0.0, sometimes(0.3) ? 0.05 : 0.0};
  model.tolerance = {0.01, 0.01, 0.1, 0.25};
  model.errors = {uniform(0, 0.3), sometimes(0.5), uniform(0, 0.1), uniform(0, 0.3), uniform(0, 0.2)};
  model.motion.friction = no_limit;
  model.code_of_hazard = {0, 10, 12, 12, 12, 13, 14, 14, 14};
  for (Index n = whole(1, 3); n > 0; --n) model.surfaces.push_back(surface());
  for (const Surface& s : model.surfaces) model.slides |= std::isfinite(s.friction);
  model.surface_bits = whole(1, (1 << model.surfaces.size()) - 1);
  if (sometimes(0.4)) model.uncertainty.assign(16 * model.surfaces.size(), 1e-4);
  if (sometimes(0.3)) model.hull.assign(2 * model.surfaces.size(), {uniform(1, 5), uniform(-2, 2)});
  return model;
}

// Waves, steps and posts; holes, and now and then numbers that are no heights.
std::vector<double> random_heights(Index rows, Index columns, double cell) {
  std::vector<double> z;
  const bool gentle = sometimes(0.6);
  const double level = sometimes(0.1) ? 8e3 : 0.0, wave = uniform(0, gentle ? 0.2 : 1.0);
  const double per = uniform(0.05, gentle ? 0.4 : 1.5), strange = sometimes(0.1) ? 0.02 : 0.0;
  const double noise = sometimes(0.4) ? spread(1e-4, gentle ? 0.01 : 0.3) : 0.0;
  const double edge = sometimes(gentle ? 0.1 : 0.3) ? uniform(0.02, 0.5) : 0.0, hole = sometimes(gentle ? 0.1 : 0.3) ? 0.01 : 0.0;
  for (Index i = 0; i < rows; ++i) {
    for (Index j = 0; j < columns; ++j) {
      const double x = per * cell * static_cast<double>(j), y = per * cell * static_cast<double>(i);
      double height = level + wave * std::sin(x) * std::cos(0.7 * y) + uniform(-noise, noise);
      if (j > columns / 2) height += edge;
      if (sometimes(hole)) height = nan;
      z.push_back(sometimes(strange) ? wild() : height);
    }
  }
  return z;
}

EvenPath random_path(double width, double height, double spacing) {
  EvenPath path;
  const Index count = sometimes(0.02) ? whole(0, 4) : whole(3, 120);
  const double step = spacing * (sometimes(0.02) ? spread(1e-6, 3.0) : uniform(0.3, 1.0));
  double x = uniform(-0.05, 1.0) * width, y = uniform(-0.05, 1.0) * height, yaw = uniform(-4, 4);
  const double turn = sometimes(0.02) ? uniform(-3, 3) : uniform(-0.05, 0.05);
  for (Index k = 0; k < count; ++k, yaw += turn * uniform(0.9, 1.0)) {
    path.x.push_back(sometimes(0.0002) ? wild() : x);
    path.y.push_back(y);
    x += step * std::cos(yaw);
    y += step * std::sin(yaw);
  }
  return path;
}

void expect_plan(const Plan& plan, const PlanningModel& model, double start) {
  using driver::expect;
  const bool drives = plan.status == Status::ok || plan.status == Status::blocked;
  expect(std::abs(plan.speed.front() - start) < 1e-6 || drives || plan.speed.front() < start + 1e-6,
         "a plan begins at the start speed, or below");
  expect(plan.speed.back() == 0.0, "a plan rests at its end");
  for (std::size_t k = 0; k < plan.speed.size(); ++k) {
    expect(std::isfinite(plan.speed[k]) && plan.speed[k] >= 0.0, "speeds are numbers");
    expect(k == 0 || plan.station[k] > plan.station[k - 1], "stations increase");
    if (!drives) continue;
    expect(plan.speed[k] <= model.limits.speed + 1e-9, "no speed is above its limit");
    const double ends = plan.station[k] + plan.stop_distance[k];
    expect(plan.speed[k] == 0.0 || ends <= plan.clear_distance + 1e-4, "stops end before the clear distance");
  }
}

std::array<Index, 5> counts{};  // of plans by status, of refused inputs

void plan_something(Index problem) {
  const double cell = spread(0.03, 1.5);
  const Index rows = sometimes(0.02) ? whole(0, 2) : whole(2, 70);
  const Index columns = sometimes(0.02) ? whole(0, 2) : whole(2, 70);
  const PlanningModel model = random_model(cell);
  const std::vector<double> z = random_heights(rows, columns, cell);
  const double origin = sometimes(0.02) ? wild() : sometimes(0.1) ? 5e6 : 0.0;
  const double width = cell * static_cast<double>(columns), height = cell * static_cast<double>(rows);
  try {
    Planner planner(model, {z.data(), rows, columns, origin, 0.0, cell});
    std::vector<EvenPath> paths;
    for (Index n = problem % 50 == 0 ? whole(0, 140) : whole(1, 5); n > 0; --n) {
      paths.push_back(random_path(width, height, model.spacing));
      if (origin == 5e6) for (double& x : paths.back().x) x += origin;
    }
    planner.sample_terrain(paths);
    const double start = sometimes(0.02) ? wild() : sometimes(0.5) ? 0.0 : uniform(0, sometimes(0.2) ? 6.0 : 1.0);
    planner.solve(start, sometimes(0.05) ? wild() : sometimes(0.5) ? no_limit : uniform(0, 30));
    for (std::size_t j = 0; j < paths.size(); ++j) {
      const Plan plan = planner.finish(j);
      expect_plan(plan, model, start);
      ++counts[static_cast<std::size_t>(plan.status)];
    }
  } catch (const std::invalid_argument& error) {
    ++counts[4];
    driver::expect(std::string(error.what()).find(": expected ") != std::string::npos, error.what());
  }
}

// What the error of a wrong argument says.
void expect_message(double resolution, const EvenPath& path, const std::string& words) {
  driver::generator.seed(1);
  const PlanningModel model = random_model(0.2);
  const std::vector<double> z(100, 0.0);
  std::string message;
  try {
    Planner planner(model, {z.data(), 10, 10, 0.0, 0.0, resolution});
    planner.sample_terrain({path});
  } catch (const std::invalid_argument& error) {
    message = error.what();
  }
  driver::expect(message == words, message.c_str());
}

}  // namespace

int main(int count, char** arguments) {
  expect_message(0.2f, {}, "map: expected the resolution that the model was exported for, 0.2 m, got 0.200000003 m");
  expect_message(0.2, {{1.0, 1.0, 1.0}, {1.0, 1.0, 1.0}}, "path: expected stations 1 mm apart at least");
  const int status = driver::run(count, arguments, plan_something);
  for (const Index plans : counts) std::printf("%td ", plans);
  return status;
}
