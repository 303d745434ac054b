// How fast rough ground may be driven: the body on its springs, rolled over the candidates.
//
// Felt is the amplitude √2 · rms of y'' over about as long as a bounce lasts: that of a sine is its
// own, and of a sharp edge what it sets going (running rms: ISO 2631-1, 6.3.1). The body as a
// whole, which the four wheels share, moves less than that.
//
// Every candidate is rolled at a few speeds, the slowest first; what holds is the first speed that
// is too fast, so nothing slower is: a resonance in between bars what is beyond it.
#pragma once

#include <array>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <tuple>
#include <vector>

#include "candidate_rows.hpp"
#include "swept/quarter_car.hpp"

namespace slopewise {

// M candidates on the ground.
struct RiddenPaths : PoseRows {
  const double *level, *spacing;  // (M,) height of the first stations, distance between all [m]
  const std::int64_t* count;    // (M,) stations of each
  const float* front;           // (N, 2, M) ground under the front wheels, left and right [m]
  double* held;                 // (N, M) out, highest speeds [m/s], inf where nothing is too rough
  Index behind_stations = 0;    // B, before the first one
  float* behind = nullptr;      // (B, 2, M) ground that the front wheels rolled over, farthest first
  const QuarterCar* cars = nullptr;  // (M,) on the spacing of each
};

// W candidates, as lanes, with as many stations under a wheel; spare ones repeat the last.
template <int W>
class RoughnessTile {
 public:
  // Floats that it takes.
  static Index memory_size(const RiddenPaths& paths) noexcept {
    Index most = 0;
    for (Index j = 0; j < paths.candidates; ++j) most = std::max(most, tail(paths.cars[j]));
    return 5 * (paths.behind_stations + paths.stations + most) * W;
  }

  RoughnessTile(const RiddenPaths& paths, std::span<const Index> lanes, float* memory) noexcept
      : paths_(paths), car_(paths.cars[lanes.front()]), lanes_(lanes),
        count_(car_.pre_roll + paths.stations + tail(car_)), path_(memory), spare_(memory + 2 * count_ * W),
        reached_(memory + 4 * count_ * W) {}

  void solve() noexcept {
    copy_in();
    if (car_.rim > 0) roll_over_rim();
    if (car_.patch > 0) even_out();
    sharpen();
    drive();
    hold();
  }

 private:
  using Lanes = std::array<float, W>;

  // What straight lines between samples, and means over them, take from a wave: x²/8 at phase x.
  static constexpr float emphasis = 0.125F;
  static constexpr float infinity = std::numeric_limits<float>::infinity();

  struct Bounce {
    Lanes y, q, square;
  };

  using Steps = BounceSteps<W>;

  // Stations behind the last one whose ground the wheel feels there: the last one's, repeated.
  static Index tail(const RideStations& wheel) noexcept { return wheel.rim + wheel.patch + 1; }

  // The candidate of a lane.
  [[nodiscard]] Index candidate(Index lane) const noexcept {
    return lanes_[std::min(static_cast<std::size_t>(lane), lanes_.size() - 1)];
  }

  // Ground or path of a wheel; beyond the stations the first or last one.
  [[nodiscard]] const float* row(const float* of, Index k, Index side) const noexcept {
    return of + (2 * std::clamp<Index>(k, 0, count_ - 1) + side) * W;
  }

  // The last station of each repeats up to the last one of all, and beyond it.
  void copy_in() noexcept {
    const Index missing = paths_.behind_stations - car_.pre_roll;
    for (Index j = 0; j < W; ++j) {
      const Index lane = candidate(j), last = static_cast<Index>(paths_.count[lane]) - 1;
      for (Index n = 0; n < count_; ++n) {
        const Index k = std::min(n - car_.pre_roll, last);
        const float* from = k < 0 ? paths_.behind + 2 * (missing + n) * paths_.candidates
                                  : paths_.front + 2 * k * paths_.candidates;
        path_[2 * n * W + j] = from[lane];
        path_[(2 * n + 1) * W + j] = from[paths_.candidates + lane];
      }
    }
  }

  // The path of the centre of a wheel of this radius.
  void roll_over_rim() noexcept {
    std::copy_n(path_, 2 * count_ * W, spare_);
    for (Index n = 1; n <= car_.rim; ++n) {
      Lanes drop;
      for (Index j = 0; j < W; ++j) {
        const double away = paths_.cars[candidate(j)].spacing * static_cast<double>(n);
        drop[static_cast<std::size_t>(j)] = static_cast<float>(drop_of_rim(car_.radius, away));
      }
      for (Index k = 0; k < count_; ++k) {
        for (Index side = 0; side < 2; ++side) {
          const float *before = row(path_, k - n, side), *after = row(path_, k + n, side);
          float* out = spare_ + (2 * k + side) * W;
          SLOPEWISE_INDEPENDENT
          for (std::size_t j = 0; j < W; ++j) {
            out[j] = max_of(out[j], max_of(before[j], after[j]) - drop[j]);
          }
        }
      }
    }
    std::swap(path_, spare_);
  }

  // The mean over the contact of the tyre.
  void even_out() noexcept {
    const auto share = static_cast<float>(1.0 / static_cast<double>(2 * car_.patch + 1));
    std::fill_n(spare_, 2 * count_ * W, 0.0F);
    for (Index k = 0; k < count_; ++k) {
      for (Index n = -car_.patch; n <= car_.patch; ++n) {
        for (Index side = 0; side < 2; ++side) {
          const float* from = row(path_, k + n, side);
          float* out = spare_ + (2 * k + side) * W;
          for (Index j = 0; j < W; ++j) out[j] += share * from[j];
        }
      }
    }
    std::swap(path_, spare_);
  }

  void sharpen() noexcept {
    for (Index k = 0; k < count_; ++k) {
      for (Index side = 0; side < 2; ++side) {
        const float *before = row(path_, k - 1, side), *here = row(path_, k, side);
        const float* after = row(path_, k + 1, side);
        float* out = spare_ + (2 * k + side) * W;
        SLOPEWISE_INDEPENDENT
        for (Index j = 0; j < W; ++j) {
          out[j] = here[j] + emphasis * (2.0F * here[j] - before[j] - after[j]);
        }
      }
    }
    std::swap(path_, spare_);
  }

  // The first speed that is too fast at each station.
  void drive() noexcept {
    std::array<std::array<Bounce, 2>, speed_levels> state{};
    std::array<double, speed_levels> speed{};
    for (std::size_t level = 0; level < speed_levels; ++level) {
      speed[level] = car_.slowest / std::pow(speed_ratio, static_cast<double>(level));
    }
    std::array<Steps, speed_levels> steps;
    for (std::size_t level = 0; level < speed_levels; ++level) {
      steps[level] = steps_at(speed[level]);
    }
    for (std::size_t level = 0; level < speed_levels; ++level) {
      for (std::size_t side = 0; side < 2; ++side) set_out(steps[level], side, state[level][side]);
    }
    std::fill_n(reached_, W, infinity);
    for (Index k = 1; k < count_; ++k) {
      Lanes fast{}, over{}, under{}, before{}, power;
      for (std::size_t level = 0; level < speed_levels; ++level) {
        power.fill(0.0F);
        for (std::size_t side = 0; side < 2; ++side) {
          advance(k, steps[level], static_cast<Index>(side), state[level][side], power);
        }
        for (std::size_t j = 0; j < W; ++j) power[j] = max_of(power[j] - steps[level].noise[j], 0.0F);
        note(power, before, static_cast<float>(speed[level]), over, under, fast);
        before = power;
      }
      cross(over, under, fast, reached_ + k * W);
    }
  }

  [[nodiscard]] Steps steps_at(double speed) const noexcept {
    Steps out;
    const QuarterCar* before = nullptr;
    std::optional<BounceStep> step;
    float noise = 0.0F;
    for (Index j = 0; j < W; ++j) {
      const QuarterCar& car = paths_.cars[candidate(j)];
      if (before == nullptr || car.spacing != before->spacing) {
        step.emplace(car, car.spacing / speed);
        noise = step->noise_power(car);
      }
      out.set(static_cast<std::size_t>(j), *step, noise);
      before = &car;
    }
    return out;
  }

  // At the height of the ground, rising as it does.
  void set_out(const Steps& step, std::size_t side, Bounce& state) const noexcept {
    const Index start = std::max<Index>(std::min(car_.pre_roll, car_.rear + car_.ahead), 1);
    const auto per_station = static_cast<float>(1.0 / static_cast<double>(start));
    const float* height = row(path_, 0, static_cast<Index>(side));
    const float* later = row(path_, start, static_cast<Index>(side));
    for (std::size_t j = 0; j < W; ++j) {
      state.y[j] = height[j];
      state.q[j] = (later[j] - height[j]) * per_station * step.per_time[j] - step.drag * height[j];
    }
  }

  // One station on; `power` is the mean square of the acceleration, of two sides the higher.
  void advance(Index k, const Steps& step, Index side, Bounce& state,
               Lanes& power) const noexcept {
    const float *height = row(path_, k - 1, side), *following = row(path_, k, side);
    SLOPEWISE_INDEPENDENT
    for (std::size_t j = 0; j < W; ++j) {
      const float h = height[j], n = following[j], y = state.y[j], q = state.q[j];
      const float next_q = step.qy[j] * y + step.qq[j] * q + step.qh[j] * h + step.qn[j] * n;
      state.y[j] = step.yy[j] * y + step.yq[j] * q + step.yh[j] * h + step.yn[j] * n;
      state.q[j] = next_q;
      const float accel = (next_q - q + step.drag * (n - h)) * step.per_time[j];
      float mean = accel * accel;
      mean += step.keep[j] * (state.square[j] - mean);
      state.square[j] = mean;
      power[j] = max_of(power[j], mean);
    }
  }

  // Where this is the first speed that is too fast: it, the mean square there and before.
  void note(const Lanes& power, const Lanes& before, float speed, Lanes& over, Lanes& under,
            Lanes& fast) const noexcept {
    const auto limit = static_cast<float>(0.5 * car_.limit * car_.limit);
    for (std::size_t j = 0; j < W; ++j) {
      const bool is_first = (fast[j] == 0.0F) & (power[j] > limit);
      over[j] = is_first ? power[j] : over[j];
      under[j] = is_first ? before[j] : under[j];
      fast[j] = is_first ? speed : fast[j];
    }
  }

  // Between two speeds the mean square is taken to be linear in v²; below them, in v² as well.
  void cross(const Lanes& over, const Lanes& under, const Lanes& fast, float* out) const noexcept {
    const auto limit = static_cast<float>(0.5 * car_.limit * car_.limit);
    const auto least = static_cast<float>(speed_ratio * speed_ratio);
    const auto slowest = static_cast<float>(car_.slowest);
    for (std::size_t j = 0; j < W; ++j) {
      const float between = least + (1.0F - least) * (limit - under[j]) / (over[j] - under[j]);
      const float share = std::sqrt(fast[j] == slowest ? limit / over[j] : between);
      out[j] = fast[j] > 0.0F ? fast[j] * share : infinity;
    }
  }

  // Speeds hold a little before their place, and until the rear wheels are over it.
  void hold() noexcept {
    for (std::size_t j = 0; j < lanes_.size(); ++j) {
      const Index end = car_.pre_roll + static_cast<Index>(paths_.count[lanes_[j]]);
      for (Index n = end; n < count_; ++n) reached_[n * W + static_cast<Index>(j)] = infinity;
    }
    // The least of 2, 4, 8 … stations on, each from two halves; then of what is left.
    const Index window = std::min(car_.rear + car_.ahead + 1, count_);
    Index width = 1;
    for (; 2 * width <= window; width *= 2) {
      for (Index n = 0; n < (count_ - width) * W; ++n) {
        reached_[n] = min_of(reached_[n], reached_[n + width * W]);
      }
    }
    for (Index k = 0; k < paths_.stations; ++k) {
      const Index here = car_.pre_roll + k;
      const Index first = std::max<Index>(here - car_.rear, 0);
      const Index last = std::min(here + car_.ahead, count_ - 1);
      const float *early = reached_ + first * W;
      const float* late = reached_ + std::max(last - width + 1, first) * W;
      double* out = paths_.held + k * paths_.candidates;
      for (std::size_t j = 0; j < lanes_.size(); ++j) {
        out[lanes_[j]] = static_cast<double>(min_of(early[j], late[j]));
      }
    }
  }

  const RiddenPaths& paths_;
  const QuarterCar& car_;
  std::span<const Index> lanes_;
  Index count_;
  float *path_, *spare_;  // (count, 2, W) each
  float* reached_;        // (count, W)
};

// Candidates with as many stations under a wheel are ridden together.
inline void limit_by_roughness(const RiddenPaths& paths, float* memory) {
  thread_local std::vector<Index> order;
  order.resize(static_cast<std::size_t>(paths.candidates));
  const auto stations = [&](Index j) -> const RideStations& { return paths.cars[j]; };
  std::iota(order.begin(), order.end(), Index{0});
  std::sort(order.begin(), order.end(), [&](Index a, Index b) {
    return std::tie(stations(a), a) < std::tie(stations(b), b);
  });
  for (std::size_t first = 0, end = 0; first < order.size(); first = end) {
    while (end < order.size() && end - first < wide &&
           stations(order[end]) == stations(order[first])) {
      ++end;
    }
    const std::span<const Index> lanes(order.data() + first, end - first);
    // A wide tile takes less than twice as long as a narrow one.
    if (lanes.size() > narrow) {
      RoughnessTile<wide>(paths, lanes, memory).solve();
    } else {
      RoughnessTile<narrow>(paths, lanes, memory).solve();
    }
  }
}

}  // namespace slopewise
