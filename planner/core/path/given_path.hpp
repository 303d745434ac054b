// The lines that a given polyline means: stations on a spline through it, and the line along which
// a vehicle of some size follows it.
//
// A polyline is not curved but at its corners, and there without end. What a body as long as a
// wheelbase follows is its mean around each place. Weighed by (1 − u²/h²)², u up to h either way,
// that mean is as curved as the parabola that fits the polyline best within h: an arc through its
// points over the vehicle's own scale. A corner of φ gets a curvature of 15/16 φ/h, and is cut by
// 5/16 h sin(φ/2). Source: least squares with Legendre polynomials of degree 2, M. Abramowitz,
// I. Stegun, Handbook of Mathematical Functions, 22.
#pragma once

#include <array>
#include <cmath>

#include "path/path_deviation.hpp"

namespace slopewise {

inline constexpr Index samples_per_half = 8;  // samples of the mean's weights on either side [1]
inline constexpr Index most_samples = 2'000'000;  // of one polyline [1]: 60 km at the finest
// Shares by which a mean may be more curved than that of another line [1]: where bends limit the
// speed, and where they hardly do. By so much means of chords differ from those of their curve.
inline constexpr double same_bend = 1.03, like_bend = 1.1;
// From which on the speed is that of the sharper bend [1]: stations cut peaks by as much.
inline constexpr double felt_bend = 1.01;
// Share by which a line may be more curved than the mean [1]: a spline through dense points swings
// by less, at a corner it is several times as sharp.
inline constexpr double spline_swing = 3.0;

// A bend of noisy points that is sharper than the line's is slowed for so that on no bank more than
// this is exceeded, unless it is steeper than the least share leaves of the lateral limit [1].
inline constexpr double noise_excess = 0.05, least_share = 0.5;
inline constexpr double noise_width = 4.0;  // standard deviations of a bend that may be noise [1]

// Curvatures from which on bends may limit the speed of a vehicle on any ground, and on even
// ground; standard deviation of those of a mean from the noise of its points [1/m].
struct Bends {
  double felt, limiting, noise;
};

// Share of the lateral limit for who turns more sharply by a ratio than the line, along noise [1]:
// with a bank β that leaves v² κ ≤ a − g β for the line, v² r κ + g β is a (1 + excess) at most.
inline double share_in_noise(double ratio) noexcept {
  return min_of(max_of(noise_excess * ratio / max_of(ratio - 1.0, 1e-9), least_share), 1.0);
}

// Weights of the mean: its middle, and each sample to either side.
inline std::array<double, samples_per_half + 1> mean_weights() noexcept {
  std::array<double, samples_per_half + 1> weights{};
  double sum = 0.0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const double u = static_cast<double>(i) / static_cast<double>(samples_per_half);
    weights[i] = (1.0 - u * u) * (1.0 - u * u);
    sum += i == 0 ? weights[i] : 2.0 * weights[i];
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

// Signed curvature of the circle through three points [1/m].
inline double menger(Point a, Point b, Point c) noexcept {
  const double ax = b.x - a.x, ay = b.y - a.y, bx = c.x - b.x, by = c.y - b.y;
  const double cx = ax + bx, cy = ay + by;
  const double squares = (ax * ax + ay * ay) * (bx * bx + by * by) * (cx * cx + cy * cy);
  return 2.0 * (ax * by - ay * bx) / max_of(std::sqrt(squares), 1e-12);
}

// The mean of a polyline at even samples of its arc.
class FollowedLine {
 public:
  // Samples of a polyline of this length [m] for a half width [m].
  static Index samples(double length, double half) noexcept {
    const double count = std::ceil(length / half * static_cast<double>(samples_per_half));
    return static_cast<Index>(min_of(count, static_cast<double>(most_samples))) + 3;
  }

  static Index memory(Index points, Index samples) noexcept { return points + 6 * samples; }

  FollowedLine(Line given, Index samples, double* memory) noexcept
      : given_(given), count_(samples), along_(memory), even_(along_ + given.count),
        mean_(even_ + 2 * samples), arc_(mean_ + 2 * samples), curvature_(arc_ + samples) {
    given_.measure(along_);
    sample();
    average();
    Line{mean_, count_}.measure(arc_);
    bend();
  }

  [[nodiscard]] double length() const noexcept { return arc_[count_ - 1]; }

  [[nodiscard]] double sharpest() const noexcept {
    double most = 0.0;
    for (Index i = 0; i < count_; ++i) most = max_of(most, curvature_[i]);
    return most;
  }

  // Even stations (count, 2) on the mean, and how far each is along the polyline, (count,) [m].
  void stations(Index count, double* even, double* place) const noexcept {
    const double step = along_[given_.count - 1] / static_cast<double>(count_ - 1);
    Index i = 0;
    for (Index k = 0; k < count; ++k) {
      const double wanted = length() * static_cast<double>(k) / static_cast<double>(count - 1);
      while (i < count_ - 2 && arc_[i + 1] < wanted) ++i;
      const double piece = max_of(arc_[i + 1] - arc_[i], 1e-12);
      const double share = min_of(max_of((wanted - arc_[i]) / piece, 0.0), 1.0);
      const Point p = mean_at(i, share);
      even[2 * k] = p.x;
      even[2 * k + 1] = p.y;
      place[k] = (static_cast<double>(i) + share) * step;
    }
    std::copy_n(given_.xy, 2, even);
    std::copy_n(given_.xy + 2 * (given_.count - 1), 2, even + 2 * (count - 1));
    place[count - 1] = along_[given_.count - 1];
  }

  // Curvature of the mean around places, shares of the polyline, within the half width.
  void curvature(const double* place, Index count, double* out) const noexcept {
    for (Index k = 0; k < count; ++k) {
      const auto i = static_cast<Index>(place[k] * static_cast<double>(count_ - 1) + 0.5);
      out[k] = most_within(curvature_, count_, i, samples_per_half);
    }
  }

  // Is a line of stations as curved as this mean? Its own mean is `its`, over the same half width.
  // Then `sharper` is the curvature of who follows the polyline where that is more than the line's,
  // in noise that for which the speed leaves enough, 0 elsewhere, (stations,) [1/m].
  [[nodiscard]] bool agrees(Line line, const FollowedLine& its, Bends from,
                            double* sharper) const noexcept {
    const double share = static_cast<double>(its.count_ - 1) / static_cast<double>(count_ - 1);
    for (Index i = 0; i < count_; ++i) {
      const double here = curvature_[i];
      if (here <= from.felt) continue;
      const auto at = static_cast<Index>(share * static_cast<double>(i) + 0.5);
      const double most = most_within(its.curvature_, its.count_, at, samples_per_half / 2);
      const double like = here > from.limiting ? same_bend : like_bend;
      if (here > like * most + noise_width * from.noise) return false;
    }
    const double scale = static_cast<double>(count_ - 1) / static_cast<double>(line.count - 1);
    for (Index k = 0; k < line.count; ++k) {
      const Index middle = std::min(std::max<Index>(k, 1), line.count - 2);
      const double bend = std::abs(menger(line[middle - 1], line[middle], line[middle + 1]));
      const auto i = static_cast<Index>(static_cast<double>(k) * scale + 0.5);
      const double ratio = ratio_to(its, i, share);
      sharper[k] = bend * ratio;
      if (from.noise > 0.0 && ratio > 0.0) {
        // The line may be straight where noise is not.
        const double mine = most_within(curvature_, count_, i, samples_per_half / 2);
        sharper[k] = max_of(sharper[k], mine) / share_in_noise(ratio);
      }
      // Where it ends a spline swings.
      if (i < samples_per_half || i + samples_per_half >= count_) continue;
      const double most = most_within(curvature_, count_, i, samples_per_half + 1);
      if (bend > max_of(spline_swing * most, from.limiting)) return false;
    }
    return true;
  }

 private:
  // By how much this mean is more curved than another around a sample, 0 where it is not [1].
  [[nodiscard]] double ratio_to(const FollowedLine& its, Index i, double share) const noexcept {
    const auto at = static_cast<Index>(share * static_cast<double>(i) + 0.5);
    const double mine = most_within(curvature_, count_, i, samples_per_half / 2);
    const double other = most_within(its.curvature_, its.count_, at, samples_per_half / 2);
    return mine > felt_bend * other ? mine / max_of(other, 1e-12) : 0.0;
  }

  static double most_within(const double* values, Index count, Index at, Index around) noexcept {
    double most = 0.0;
    const Index end = std::min(at + around + 1, count);
    for (Index i = std::max<Index>(at - around, 0); i < end; ++i) most = max_of(most, values[i]);
    return most;
  }

  // The mean beyond a sample by a share of the way to the next, on the cubic through four (E. Catmull,
  // R. Rom, A class of local interpolating splines, 1974). Chords bend at the samples alone: stations
  // on them, less than two samples apart, were up to a tenth sharper than the mean.
  [[nodiscard]] Point mean_at(Index i, double share) const noexcept {
    const Line mean{mean_, count_};
    const Point b = mean[i], c = mean[i + 1];
    const Point a = i > 0 ? mean[i - 1] : Point{2.0 * b.x - c.x, 2.0 * b.y - c.y};
    const Point d = i + 2 < count_ ? mean[i + 2] : Point{2.0 * c.x - b.x, 2.0 * c.y - b.y};
    const auto between = [share](double p, double q, double r, double s) {
      const double cubic = 3.0 * (q - r) + s - p, square = 2.0 * p - 5.0 * q + 4.0 * r - s;
      return q + 0.5 * share * (r - p + share * (square + share * cubic));
    };
    return {between(a.x, b.x, c.x, d.x), between(a.y, b.y, c.y, d.y)};
  }

  void sample() noexcept {
    const double length = along_[given_.count - 1];
    Index k = 0;
    for (Index i = 0; i < count_; ++i) {
      const double at = length * static_cast<double>(i) / static_cast<double>(count_ - 1);
      while (k < given_.count - 2 && along_[k + 1] < at) ++k;
      const double piece = max_of(along_[k + 1] - along_[k], 1e-12);
      const Point p = between(given_[k], given_[k + 1], min_of((at - along_[k]) / piece, 1.0));
      even_[2 * i] = p.x;
      even_[2 * i + 1] = p.y;
    }
  }

  // Beyond its ends the polyline goes on as its image in them: there its mean begins and ends.
  [[nodiscard]] Point sample_at(Index i) const noexcept {
    const Index last = count_ - 1, inside = i < 0 ? -i : (i > last ? 2 * last - i : i);
    const Index at = std::min(std::max<Index>(inside, 0), last);
    const Point p = Line{even_, count_}[at];
    if (i >= 0 && i <= last) return p;
    const Point end = Line{even_, count_}[i < 0 ? 0 : last];
    return {2.0 * end.x - p.x, 2.0 * end.y - p.y};
  }

  void average() noexcept {
    const auto weights = mean_weights();
    for (Index i = 0; i < count_; ++i) {
      const bool inner = i >= samples_per_half && i + samples_per_half < count_;
      const double* here = even_ + 2 * i;
      double x = weights[0] * here[0], y = weights[0] * here[1];
      for (Index j = 1; j <= samples_per_half; ++j) {
        const double weight = weights[static_cast<std::size_t>(j)];
        const Point back = inner ? Point{here[-2 * j], here[-2 * j + 1]} : sample_at(i - j);
        const Point ahead = inner ? Point{here[2 * j], here[2 * j + 1]} : sample_at(i + j);
        x += weight * (back.x + ahead.x);
        y += weight * (back.y + ahead.y);
      }
      mean_[2 * i] = x;
      mean_[2 * i + 1] = y;
    }
  }

  // Size of the curvature at each sample, over an eighth of the half width either way.
  void bend() noexcept {
    const Line mean{mean_, count_};
    const Index reach = std::min<Index>(samples_per_half / 8, (count_ - 1) / 2);
    for (Index i = 0; i < count_; ++i) {
      const Index at = std::min(std::max(i, reach), count_ - 1 - reach);
      curvature_[i] = std::abs(menger(mean[at - reach], mean[at], mean[at + reach]));
    }
  }

  Line given_;
  Index count_;
  double *along_, *even_, *mean_, *arc_, *curvature_;
};

// Does a polyline turn at a point by more than an angle, from the way that leads there to the way
// on, both at least as far as `reach` [m]? `from` is the point where the first way begins.
inline bool turns_at(Line line, Index i, double reach, double cosine, Index& from) noexcept {
  const Point here = line[i];
  from = i - 1;
  while (from > 0 && distance_of(line[from], here) < reach) --from;
  Index to = i + 1;
  while (to < line.count - 1 && distance_of(line[to], here) < reach) ++to;
  const Point a = line[from], b = line[to];
  const double back = distance_of(a, here), on = distance_of(b, here);
  if (back < reach || on < reach) return false;
  const double along = (here.x - a.x) * (b.x - here.x) + (here.y - a.y) * (b.y - here.y);
  return along < cosine * back * on;
}

// Index of the first point at which a polyline turns round, by more than an angle [rad]; 0 if it
// never does. Points before the tip turn as well, where the way on leads past them.
inline Index first_turn(Line line, double reach, double angle) noexcept {
  const double cosine = std::cos(angle);
  Index from = 0, first = 1;
  while (first + 1 < line.count && !turns_at(line, first, reach, cosine, from)) ++first;
  if (first + 1 >= line.count) return 0;
  Index tip = first;
  const Point begin = line[from];
  while (tip + 1 < line.count) {
    const Point here = line[tip], next = line[tip + 1];
    const double gone_x = here.x - begin.x, gone_y = here.y - begin.y;
    // The way on leads back from the tip.
    if (gone_x * (next.x - here.x) + gone_y * (next.y - here.y) <= 0.0) break;
    ++tip;
  }
  return tip;
}

}  // namespace slopewise
