// Ground, braking force and hazards along candidates.
#include <sstream>

#include "ground/braking_forces.hpp"
#include "ground/ground_and_body.hpp"
#include "slopewise/candidates.hpp"
#include "swept/rough_ground.hpp"
#include "swept/sweep.hpp"

namespace slopewise {
namespace {

// Share by which the steps of an even path may differ [1]: chords of a curve do, by (κ Δs)² / 24.
constexpr double evenness = 0.02;
// Steps may be longer than the spacing by their rounding [1].
constexpr double step_rounding = 1.0 + 1e-6;
constexpr double least_step_length = 1e-3;  // of stations [m]
constexpr Index least_stations = 3, most_stations = 20000;  // [1]
// Cells of the largest map, for indices that never overflow [1].
constexpr Index most_cells = Index{1} << 31;
// The tracking band is rounded up to this share of a cell [1], as in Python.
constexpr double band_share = 0.5;
// Share by which a curvature may exceed the largest one [1]: stations are on a curve, the chords
// between them inside it.
constexpr double curvature_tolerance = 0.01;

void expect_even(const EvenPath& path, double spacing) {
  const std::size_t n = path.x.size();
  expect(n == path.y.size(), "path: expected as many y as x");
  expect(n >= least_stations && n <= most_stations, "path: expected 3 to 20000 stations");
  double least = no_limit, most = 0.0, before_x = 0.0, before_y = 0.0;
  for (std::size_t k = 0; k + 1 < n; ++k) {
    const double dx = path.x[k + 1] - path.x[k], dy = path.y[k + 1] - path.y[k];
    const double step = std::sqrt(dx * dx + dy * dy);
    expect(std::isfinite(step), "path: expected finite positions");
    expect(step >= least_step_length, "path: expected stations 1 mm apart at least");
    expect(k == 0 || dx * before_x + dy * before_y > 0.0, "path: expected turns below 90 degrees");
    least = min_of(least, step);
    most = max_of(most, step);
    before_x = dx;
    before_y = dy;
  }
  if (most > spacing * step_rounding) {
    throw std::invalid_argument("path: expected stations at most " + std::to_string(spacing) +
                                " m apart (`spacing`), got " + std::to_string(most) + " m");
  }
  expect(most <= (1.0 + evenness) * least, "path: expected stations at even distances");
}

// Single precision is another resolution: cells would be displaced at the far end of a large map.
void expect_resolution(double given, double exported) {
  if (std::abs(given - exported) <= 1e-9 * exported) return;
  std::ostringstream message;
  message.precision(9);
  message << "map: expected the resolution that the model was exported for, " << exported
          << " m, got " << given << " m";
  throw std::invalid_argument(message.str());
}

}  // namespace

Planner::Planner(const PlanningModel& model, const HeightMap& map) {
  expect(map.heights != nullptr && map.rows >= 2 && map.columns >= 2 && map.rows < most_cells &&
             map.columns < most_cells / map.rows,
         "map: expected 2 x 2 to 2^31 cells");
  expect(std::isfinite(map.origin_x) && std::isfinite(map.origin_y), "map: expected a finite origin");
  expect_resolution(map.resolution, model.resolution);
  expect(!model.surfaces.empty(), "model: expected a surface");
  candidates_ = std::make_unique<Candidates>(model, std::make_shared<MapGround>(model.tyre, map));
}

Planner::~Planner() = default;

void Planner::sample_terrain(const std::vector<EvenPath>& paths) {
  Candidates& c = *candidates_;
  c.solved = false;
  c.candidates = 0;
  expect(!paths.empty(), "paths: expected a candidate");
  for (const EvenPath& path : paths) expect_even(path, c.model.spacing);
  c.lay(paths);
  c.sample_ground();
  c.find_braking_forces();
  c.sweep_body();
  c.limit_by_rough_ground();
  c.limit_by_steering();
}

void Planner::Candidates::lay(const std::vector<EvenPath>& paths) {
  stations = 0;
  candidates = static_cast<Index>(paths.size());
  count.clear();
  for (const EvenPath& path : paths) {
    count.push_back(static_cast<std::int64_t>(path.x.size()));
    stations = std::max(stations, static_cast<Index>(path.x.size()));
  }
  x = y = OwnRows(stations, candidates);
  for (Index j = 0; j < candidates; ++j) {
    const EvenPath& path = paths[static_cast<std::size_t>(j)];
    for (Index k = 0; k < stations; ++k) {
      const auto n = std::min(static_cast<std::size_t>(k), path.x.size() - 1);
      x.rows().at(k)[j] = path.x[n];
      y.rows().at(k)[j] = path.y[n];
    }
  }
}

// As planner/pipeline/band_bounds.py has it: stations and bends are those of the candidate.
void Planner::Candidates::lay_beside(const Candidates& batch, Index j) {
  candidates = 2;
  count.assign(2, batch.count[static_cast<std::size_t>(j)]);
  stations = static_cast<Index>(count[0]);
  OwnRows turned_x(stations, candidates), turned_y = turned_x;
  x = y = turned_x;
  const verify::GroundLimits& error = model.ground;
  for (Index k = 0; k < stations; ++k) {
    const double dx = batch.body_heading_x.at(k, j), dy = batch.body_heading_y.at(k, j);
    const double across =
        error.across + error.across_per_curvature * std::abs(batch.curvature.at(k, j));
    for (Index side : {0, 1}) {
      const double left = side == 0 ? across : -across;
      x.rows().at(k)[side] = batch.x.at(k, j) - left * dy;
      y.rows().at(k)[side] = batch.y.at(k, j) + left * dx;
      turned_x.rows().at(k)[side] = dx;
      turned_y.rows().at(k)[side] = dy;
    }
  }
  sample_ground(&turned_x, &turned_y);
  for (Index k = 0; k < stations; ++k) {
    for (Index side : {0, 1}) {
      station.rows().at(k)[side] = batch.station.at(k, j);
      curvature.rows().at(k)[side] = batch.curvature.at(k, j);
      heading_x.rows().at(k)[side] = batch.heading_x.at(k, j);
      heading_y.rows().at(k)[side] = batch.heading_y.at(k, j);
    }
  }
  find_braking_forces();
  hazard.assign(static_cast<std::size_t>(stations * candidates), 0);
  rough_speed = steering_speed = OwnRows(stations, candidates, no_limit);
}

void Planner::Candidates::sample_ground(const OwnRows* turned_x, const OwnRows* turned_y) {
  allocate({&z, &station, &heading_x, &heading_y, &curvature, &grade, &sin_grade, &sin_roll, &bends,
            &body_x, &body_y, &body_heading_x, &body_heading_y});
  const auto cells = static_cast<std::size_t>(stations * candidates);
  known = std::make_unique<bool[]>(cells);
  twist.assign(cells, 0.0F);
  front.assign(2 * cells, 0.0F);
  const TerrainTable table{
      stations, candidates, x.data(), y.data(), count.data(),
      turned_x != nullptr ? turned_x->read().data : nullptr,
      turned_y != nullptr ? turned_y->read().data : nullptr,
      model.body.body_offset, z.data(), station.data(), heading_x.data(), heading_y.data(),
      curvature.data(), grade.data(), sin_grade.data(), sin_roll.data(), bends.data(), known.get(),
      twist.data(), front.data()};
  slopewise::sample_ground(
      ground->grid, table, {body_x.data(), body_y.data(), body_heading_x.data(), body_heading_y.data()},
      model.steering.centre_offset, 2.0 * model.envelope.half_length,
      2.0 * model.envelope.half_width);
}

void Planner::Candidates::find_braking_forces() {
  allocate({&force_lower_slope, &force_lower, &force_upper_slope, &force_upper, &dead_time,
            &shortest_dead_time, &slowest, &fastest, &friction});
  trained = std::make_unique<bool[]>(static_cast<std::size_t>(stations * candidates));
  distance_offset.assign(static_cast<std::size_t>(candidates), 0.0);
  const ForceProblem problem{
      stations, candidates, count.data(), grade.read(), sin_grade.read(), sin_roll.read(),
      flags(known), {}, {&model.surface_bits, 1}, model.surfaces, model.extrapolation_margin,
      model.hull, {}, {}, model.uncertainty.empty() ? nullptr : model.uncertainty.data(), {},
      model.slides};
  find_forces(problem,
              {force_lower_slope.rows(), force_lower.rows(), force_upper_slope.rows(),
               force_upper.rows(), dead_time.rows(), shortest_dead_time.rows(), slowest.rows(),
               fastest.rows(),
               model.slides ? friction.rows() : Rows<double>{}, {trained.get(), candidates},
               distance_offset.data()});
}

double Planner::Candidates::spacing_of(Index j) const noexcept {
  double longest = least_step_length;
  for (Index k = 0; k < 2; ++k) {
    longest = max_of(longest, std::hypot(x.at(k + 1, j) - x.at(k, j), y.at(k + 1, j) - y.at(k, j)));
  }
  return longest;
}

void Planner::Candidates::sweep_body() {
  hazard.assign(static_cast<std::size_t>(stations * candidates), 0);
  double spacing = 0.0, widest = 0.0;
  for (Index j = 0; j < candidates; ++j) spacing = max_of(spacing, spacing_of(j));
  OwnRows across(stations, candidates);
  const HeightMap& map = ground->map;
  const verify::GroundLimits& error = model.ground;
  const bool banded = has_band() || error.turned > 0.0;
  for (Index n = 0; n < stations * candidates; ++n) {
    across.data()[n] =
        error.across + error.across_per_curvature * std::abs(curvature.data()[n]);
    widest = max_of(widest, across.data()[n]);
  }
  std::optional<BandWidth> band;
  const double step = band_share * map.resolution;
  if (banded) band = {step * std::ceil(widest / step), error.turned, model.body.body_offset};
  const MapView view{ground->heights.data(), map.rows, map.columns, map.origin_x, map.origin_y,
                     1.0 / map.resolution};
  const BroadPhase phase(view, map.resolution, model.envelope, band,
                         {stations, candidates, body_x.data(), body_y.data()}, 0.0);
  const SweptPaths paths{poses(), station.data(), count.data(), known.get(), twist.data(), spacing,
                         banded ? across.data() : nullptr};
  std::vector<double> found(static_cast<std::size_t>(4 * candidates)),
      memory(static_cast<std::size_t>(NarrowPhase::memory_size(phase, spacing)));
  sweep(phase, paths, {model.code_of_hazard.data(), hazard.data(), found.data()}, memory.data());
}

void Planner::Candidates::limit_by_rough_ground() {
  rough_speed = OwnRows(stations, candidates, no_limit);
  std::vector<double> spacing;
  for (Index j = 0; j < candidates; ++j) spacing.push_back(spacing_of(j));
  limit_ride_speeds(ground->grid, model.envelope,
                        {model.ride_frequency, model.ride_damping, model.limits.vertical_accel,
                         model.limits.speed},
                        {poses(), z.data(), spacing.data(), count.data(), front.data(),
                         rough_speed.data()});
}

// Turns that are too tight at any speed, or too sudden for the speed; the first station, where the
// vehicle stands, is blocked by nothing.
void Planner::Candidates::limit_by_steering() {
  const verify::SteeringTerms& s = model.steering;
  steering_speed = OwnRows(stations, candidates, no_limit);
  const auto curvature_at = [&](Index k, Index j) {
    if (!(s.centre_offset > 0.0)) return curvature.at(k, j);
    return (body_heading_x.at(k, j) * heading_y.at(k, j) -
            body_heading_y.at(k, j) * heading_x.at(k, j)) / s.centre_offset;
  };
  const auto angle_at = [&](Index k, Index j) {
    const double turn = curvature_at(k, j), sine = turn * s.centre_offset;
    return std::atan2(s.arm * turn, std::sqrt(max_of(1.0 - sine * sine, 0.0)));
  };
  for (Index j = 0; j < candidates; ++j) {
    for (Index k = 1; k < static_cast<Index>(count[static_cast<std::size_t>(j)]); ++k) {
      std::int64_t& code = hazard[static_cast<std::size_t>(k * candidates + j)];
      const bool tight =
          std::abs(curvature_at(k, j)) > (1.0 + curvature_tolerance) * s.max_curvature;
      if (tight && code == 0) code = limiting::steering;
      if (!std::isfinite(s.max_rate)) continue;
      const double step = std::hypot(x.at(k, j) - x.at(k - 1, j), y.at(k, j) - y.at(k - 1, j));
      const double turned = std::abs(angle_at(k, j) - angle_at(k - 1, j));
      const double follows = turned > 0.0 ? s.max_rate * step / turned : no_limit;
      for (Index end : {k - 1, k}) {
        double& speed = steering_speed.rows().at(end)[j];
        speed = min_of(speed, follows);
      }
    }
  }
}

}  // namespace slopewise
