// What shortcuts pass is passed by what they save: random tracks and stops, followed both ways.
//
// Exits with 1 and prints counts where a stop without a check of its loads unloads something, or one
// without a march ends for its loads.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include "bounds/integrated_stop.hpp"
#include "verify/verify.hpp"

namespace {

using namespace slopewise;

constexpr Index stations = 40;
constexpr double spacing = 0.25, rounding = 1e-6;

// Rolling ground with turns, crests and patches of another braking force.
class RandomTrack {
 public:
  explicit RandomTrack(std::mt19937& random) : random_(random) {
    const double grade = draw(-0.3, 0.3), swell = draw(0.0, 0.2), wave = draw(0.1, 3.0);
    const double phase = draw(0.0, 6.0), roll = draw(-0.25, 0.25), turn = draw(0.0, 0.4);
    const double weak = draw(0.5, 1.5), slope = draw(-0.02, 0.05), level = draw(0.3, 0.6);
    const double more = draw(0.02, 0.2), friction = draw(0.0, 1.0) < 0.7 ? draw(0.3, 0.9) : 1e9;
    dead_time = draw(0.0, 0.4);
    slowest = draw(0.0, 1.0);
    for (Index k = 0; k < stations; ++k) {
      const double s = spacing * static_cast<double>(k), share = (k / 7) % 2 == 1 ? weak : 1.0;
      const std::array<double, verify::track_columns> row{
          s, grade + swell * std::sin(wave * s + phase), roll + 0.1 * std::sin(s),
          turn * std::sin(0.7 * s + phase), 0.0, share * slope, share * level,
          share * slope + 0.01, share * level + more, dead_time, dead_time, slowest, 10.0,
          swell * wave * std::cos(wave * s + phase), friction < 1e9 ? friction : verify::infinite};
      for (std::size_t c = 0; c < row.size(); ++c) columns[c].push_back(row[c]);
    }
    const double height = draw(0.4, 0.9);
    body = {1.2, 1.0, 0.6, height, 1.0};
    limits.rear_lever = height / (body.wheelbase - body.cg_x);
    limits.front_lever = height / body.cg_x;
    limits.side_lever = 2.0 * height / body.track_width;
    limits.min_load = draw(0.05, 0.5);
    limits.brake_share = -1.0;
  }

  [[nodiscard]] double draw(double low, double high) const {
    return std::uniform_real_distribution<>(low, high)(random_);
  }
  [[nodiscard]] verify::Track track() const {
    std::array<const double*, verify::track_columns> at{};
    for (std::size_t c = 0; c < at.size(); ++c) at[c] = columns[c].data();
    return verify::track_at(stations, at);
  }
  [[nodiscard]] std::vector<StopStation> path() const {
    const verify::Track t = track();
    std::vector<StopStation> out;
    for (Index k = 0; k < stations; ++k) {
      const double sine = std::sin(t.grade[k]), upright = std::cos(t.grade[k]);
      const double bank = upright * std::sin(t.roll[k]), bend = std::fabs(t.curvature[k]);
      out.push_back({t.station[k], t.grade[k], sine, t.lower_slope[k], t.lower_intercept[k],
                     t.upper_slope[k], t.upper_intercept[k], t.dead_time[k],
                     t.shortest_dead_time[k], t.slowest[k],
                     upright * std::cos(t.roll[k]), t.curvature[k] > 0.0 ? bank : -bank,
                     bend / (gravity * std::cos(t.roll[k])),
                     std::max(-t.vertical_curvature[k], 0.0) / gravity, bend, 0.0});
    }
    return out;
  }

  std::array<std::vector<double>, verify::track_columns> columns;
  verify::Body body{};
  Vehicle limits{};
  double dead_time, slowest;

 private:
  std::mt19937& random_;
};

struct Count {
  long passed = 0, wrong = 0;
};

// Stops whose loads the verifier does not look at.
void count_unchecked(const RandomTrack& ground, double height, Count& count) {
  std::vector<double> memory(static_cast<std::size_t>(verify::survey_columns * stations));
  std::vector<double> speeds(2 * static_cast<std::size_t>(stations));
  const verify::Track track = ground.track();
  const verify::Survey survey = verify::survey_of(track, ground.body, memory.data());
  const verify::Surveyed on{track, survey};
  const double fastest = ground.draw(1.0, 5.0);
  const auto fallen = [height](double v) { return std::sqrt(v * v + 2.0 * gravity * height); };
  const verify::SafeStopSpeeds safe(on, ground.limits, fallen(fastest), speeds.data());
  for (Index i = 0; i < stations / 2; ++i) {
    const double speed = ground.draw(0.2, 1.0) * fastest;
    const verify::StopCommand command{track.station[i], speed, ground.dead_time, ground.slowest};
    const double reached = fallen(command.force_speed());
    verify::StopEnd stop{0.0, 0.0, 0.0, i, i};
    verify::stop_by_energy(on, command, height, stop);
    if (!safe.has_grip(i, reached, stop.station)) continue;
    if (!safe.is_loaded(i, reached, stop.station)) continue;
    const verify::Shares least = verify::loads_by_energy(on, command, i, stop);
    const double lightest = std::min({least.axle, least.side, least.wheel});
    ++count.passed;
    count.wrong += lightest < ground.limits.min_load - rounding;
  }
}

// Stops that the bounds do not march.
void count_not_marched(const RandomTrack& ground, double height, Count& count) {
  const std::vector<StopStation> path = ground.path();
  MotionTerms motion;
  motion.friction = verify::infinite;
  const StopConditions conditions{motion, ground.limits, 1e9, height, ground.draw(1.0, 8.0)};
  const double speed = ground.draw(0.2, 4.0);
  if (!detail::is_loaded_throughout(0, speed, path, conditions)) return;
  const Ending how = march_stop(0, speed, path, conditions).how;
  ++count.passed;
  count.wrong += how == Ending::rear_load || how == Ending::side_load;
}

}  // namespace

int main() {
  std::mt19937 random(7);
  Count unchecked, not_marched;
  for (int n = 0; n < 12000; ++n) {
    const RandomTrack ground(random);
    const double height = n % 3 == 0 ? 0.0 : ground.draw(0.0, 0.1);
    count_unchecked(ground, height, unchecked);
    count_not_marched(ground, height, not_marched);
  }
  std::printf("%ld stops without a check of loads, %ld unload; %ld not marched, %ld end for loads\n",
              unchecked.passed, unchecked.wrong, not_marched.passed, not_marched.wrong);
  const bool enough = unchecked.passed > 10000 && not_marched.passed > 1000;
  return enough && unchecked.wrong + not_marched.wrong == 0 ? 0 : 1;
}
