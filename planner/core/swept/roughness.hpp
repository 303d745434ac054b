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

#include "ground/ground_behind.hpp"
#include "swept/quarter_car.hpp"

namespace slopewise {

// Ground under the front wheels of M candidates, left and right [m], and the distance between the
// stations of each [m]; from it the highest speeds [m/s], inf where roughness limits nothing.
struct RoughPaths {
  Index behind_stations, stations, candidates;
  const float *behind, *front;  // (B, 2, M) before the first station, (N, 2, M) from it on
  const double* spacing;        // (M,)
  double* held;                 // (N, M) out
};

// W candidates, as lanes; spare ones repeat the last.
template <int W>
class RoughnessTile {
 public:
  // Floats that it takes.
  static Index memory_size(const RoughPaths& paths) noexcept {
    return 5 * (paths.behind_stations + paths.stations) * W;
  }

  RoughnessTile(const RoughPaths& paths, const QuarterCar& car, Index first,
                float* memory) noexcept
      : paths_(paths), car_(car), first_(first),
        used_(std::min<Index>(W, paths.candidates - first)),
        count_(paths.behind_stations + paths.stations), path_(memory),
        spare_(memory + 2 * count_ * W), reached_(memory + 4 * count_ * W) {}

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

  // Ground or path of a wheel; beyond the stations the first or last one.
  [[nodiscard]] const float* row(const float* of, Index k, Index side) const noexcept {
    return of + (2 * std::clamp<Index>(k, 0, count_ - 1) + side) * W;
  }

  void copy_in() noexcept {
    for (Index n = 0; n < 2 * count_; ++n) {
      const Index before = 2 * paths_.behind_stations;
      const float* from = first_ + (n < before ? paths_.behind + n * paths_.candidates
                                               : paths_.front + (n - before) * paths_.candidates);
      std::copy_n(from, used_, path_ + n * W);
      std::fill_n(path_ + n * W + used_, W - used_, from[used_ - 1]);
    }
  }

  // The path of the centre of a wheel of this radius.
  void roll_over_rim() noexcept {
    for (Index k = 0; k < count_; ++k) {
      for (Index side = 0; side < 2; ++side) {
        float* out = spare_ + (2 * k + side) * W;
        std::copy_n(row(path_, k, side), W, out);
        for (Index n = 1; n <= car_.rim; ++n) {
          const float *before = row(path_, k - n, side), *after = row(path_, k + n, side);
          const auto drop = static_cast<float>(
              drop_of_rim(car_.radius, car_.spacing * static_cast<double>(n)));
          for (Index j = 0; j < W; ++j) {
            out[j] = max_of(out[j], max_of(before[j], after[j]) - drop);
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
    const auto step = [&](std::size_t n) { return BounceStep(car_, car_.spacing / speed[n]); };
    const std::array<BounceStep, speed_levels> steps{step(0), step(1), step(2), step(3)};
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
        note(power, before, static_cast<float>(speed[level]), over, under, fast);
        before = power;
      }
      cross(over, under, fast, reached_ + k * W);
    }
  }

  // At the height of the ground, rising as it does.
  void set_out(const BounceStep& step, std::size_t side, Bounce& state) const noexcept {
    const Index start = std::max<Index>(std::min(count_ - 1, car_.rear + car_.ahead), 1);
    const auto per_station = static_cast<float>(1.0 / static_cast<double>(start));
    const float* height = row(path_, 0, static_cast<Index>(side));
    const float* later = row(path_, start, static_cast<Index>(side));
    for (std::size_t j = 0; j < W; ++j) {
      state.y[j] = height[j];
      state.q[j] = (later[j] - height[j]) * per_station * step.per_time - step.drag * height[j];
    }
  }

  // One station on; `power` is the mean square of the acceleration, of two sides the higher.
  void advance(Index k, const BounceStep& step, Index side, Bounce& state,
               Lanes& power) const noexcept {
    const float *height = row(path_, k - 1, side), *following = row(path_, k, side);
    SLOPEWISE_INDEPENDENT
    for (std::size_t j = 0; j < W; ++j) {
      const float h = height[j], n = following[j], y = state.y[j], q = state.q[j];
      const float next_q = step.qy * y + step.qq * q + step.qh * h + step.qn * n;
      state.y[j] = step.yy * y + step.yq * q + step.yh * h + step.yn * n;
      state.q[j] = next_q;
      const float accel = (next_q - q + step.drag * (n - h)) * step.per_time;
      float mean = accel * accel;
      mean += step.keep * (state.square[j] - mean);
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
    // The least of 2, 4, 8 … stations on, each from two halves; then of what is left.
    const Index window = car_.rear + car_.ahead + 1;
    Index width = 1;
    for (; 2 * width <= window; width *= 2) {
      for (Index n = 0; n < (count_ - width) * W; ++n) {
        reached_[n] = min_of(reached_[n], reached_[n + width * W]);
      }
    }
    for (Index k = 0; k < paths_.stations; ++k) {
      const Index here = paths_.behind_stations + k;
      const Index first = std::max<Index>(here - car_.rear, 0);
      const Index last = std::min(here + car_.ahead, count_ - 1);
      const float *early = reached_ + first * W;
      const float* late = reached_ + std::max(last - width + 1, first) * W;
      double* out = paths_.held + k * paths_.candidates + first_;
      for (Index j = 0; j < used_; ++j) {
        const auto least = static_cast<double>(min_of(early[j], late[j]));
        out[j] = least * (paths_.spacing[first_ + j] / car_.spacing);
      }
    }
  }

  const RoughPaths& paths_;
  const QuarterCar& car_;
  Index first_, used_, count_;
  float *path_, *spare_;  // (count, 2, W) each
  float* reached_;        // (count, W)
};

inline Index roughness_memory(const RoughPaths& paths) noexcept {
  return RoughnessTile<wide>::memory_size(paths);
}

inline void limit_by_roughness(const RoughPaths& paths, const QuarterCar& car,
                               float* memory) noexcept {
  Index first = 0;  // a wide tile takes less than twice as long as a narrow one
  for (; paths.candidates - first > narrow; first += wide) {
    RoughnessTile<wide>(paths, car, first, memory).solve();
  }
  if (first < paths.candidates) RoughnessTile<narrow>(paths, car, first, memory).solve();
}

}  // namespace slopewise
