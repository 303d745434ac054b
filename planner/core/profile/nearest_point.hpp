// The point nearest to another under constraints that reach over three neighbours at most.
//
// A primal-dual interior-point method with Mehrotra's corrector. Its linear system has two diagonals
// beside the main one, so that an iteration costs a few passes along the stations. It needs no
// start and fails only where no point keeps the constraints.
// Source: S. Mehrotra, On the implementation of a primal-dual interior point method, SIAM J. Optim.
// 2, 1992; J. Nocedal, S. Wright, Numerical Optimization, 2nd ed., algorithm 16.4.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "batch.hpp"

namespace slopewise {

// Kinds of rows, one each at every station, and over how many neighbours each reaches.
enum Kind : int { speed_max, speed_min, accel_max, accel_min, jerk_max, jerk_min };
inline constexpr int kind_count = 6;
constexpr int reach_of(int kind) noexcept { return kind / 2 + 1; }

// Eleven iterations are typical, and a program that takes 60 does not converge [1].
inline constexpr int max_iterations = 60;
// Of constraints and of optimality, in their own units.
inline constexpr double nearest_tolerance = 1e-5;
// Share of the tolerance up to which slack times multiplier of each row may differ from none [1].
inline constexpr double centring_share = 0.01;
// Share of the way to the border that a step may go [1].
inline constexpr double border_share = 0.995;
// Smallest slack and multiplier [scaled]: keeps their quotients finite.
inline constexpr double smallest_slack = 1e-12;
// Residual from which the iteration has diverged [scaled].
inline constexpr double divergence = 1e12;

// Minimise |x − target|² / 2 over rows · x <= limit, N stations.
struct NearestProblem {
  NearestProblem(Index stations, const double* to, double* memory) noexcept
      : n(stations), target(to), open(memory), rows(open + n), limit(rows + kind_count * 3 * n) {}

  static Index memory(Index n) noexcept { return n + kind_count * 3 * n + kind_count * n; }

  // Coefficients of x[k + i] in the rows of a kind.
  [[nodiscard]] double* at(int kind, int i) const noexcept { return rows + (kind * 3 + i) * n; }
  [[nodiscard]] double* limit_of(int kind) const noexcept { return limit + kind * n; }

  Index n;
  const double* target;  // (N,)
  double* open;          // (N,) 0 where x is as the target, else 1
  double* rows;          // (kinds, 3, N) 0 behind the last station, and in rows that there are not
  double* limit;         // (kinds, N) positive in rows that there are not
};

class NearestSolver {
 public:
  static Index memory(Index n) noexcept { return 7 * kind_count * n + 10 * n + 2 * (n + 2); }

  NearestSolver(const NearestProblem& problem, double* memory) noexcept : p(problem), n(problem.n) {
    const Index many = kind_count * n;
    for (double** row : {&multiplier, &slack, &over_slack, &over_multiplier, &residual, &ds, &dz}) {
      *row = memory;
      memory += many;
    }
    for (double** row : {&gradient, &along, &sums, &d, &e, &f}) {
      *row = memory;
      memory += row == &sums ? 5 * n : n;
    }
    x = memory;
    step = x + n + 2;
  }

  // The nearest point; iterations, at least one, negative if no point keeps the constraints.
  int solve(double* nearest) noexcept {
    begin();
    int used = -max_iterations;
    for (int iteration = 0; iteration < max_iterations; ++iteration) {
      const auto [gap, violation, imbalance] = residuals();
      if (violation <= nearest_tolerance && imbalance <= nearest_tolerance &&
          gap <= centring_share * nearest_tolerance) {
        used = iteration + 1;
        break;
      }
      if (!(violation + imbalance + gap < divergence)) return -iteration - 1;
      build_matrix();
      if (!factor()) return -iteration - 1;
      const double after = gap_after(newton_step(0.0, 0.0));
      const double centre = after / gap * (after / gap) * (after / gap) * gap;
      advance(newton_step(centre, 1.0));
    }
    std::copy_n(x, n, nearest);
    return used;
  }

  // Sum of multiplier times what is left to the limit at a point, where that is positive.
  [[nodiscard]] double weighed_slack(const double* point) noexcept {
    double total = 0.0;
    std::copy_n(point, n, x);
    for (int m = 0; m < kind_count; ++m) {
      times(m, x, along);
      for (Index k = 0; k < n; ++k) {
        total += multiplier[m * n + k] * max_of(p.limit_of(m)[k] - along[k], 0.0);
      }
    }
    return total;
  }

  // Do the multipliers prove that no point from 0 to the target keeps the rows?
  //
  // A sum of the rows, each times its multiplier, is below the sum of their limits at every point
  // that keeps them. Where it is above it even at the lowest point of the box, there is none:
  // Farkas' lemma, which holds for multipliers of any origin. An iteration that diverges leads to
  // such multipliers.
  [[nodiscard]] bool is_infeasible() noexcept {
    add_up_rows(multiplier);
    double least = 0.0, highest = 0.0, size = 0.0;
    for (Index k = 0; k < n; ++k) {
      for (int m = 0; m < kind_count; ++m) highest += multiplier[m * n + k] * p.limit_of(m)[k];
      const double moved = gradient[k] * p.target[k];
      size += std::abs(moved);
      least += p.open[k] == 0.0 ? moved : min_of(moved, 0.0);
    }
    return least - highest > nearest_tolerance * (size + std::abs(highest));
  }

 private:
  struct Residuals {
    double gap;        // mean of slack times multiplier
    double violation;  // largest of a row
    double imbalance;  // largest gradient left at a station
  };

  void begin() noexcept {
    std::fill_n(ds, 2 * kind_count * n, 0.0);  // and dz, which is behind it
    std::copy_n(p.target, n, x);
    std::fill_n(x + n, 2, 0.0);
    std::fill_n(step + n, 2, 0.0);
    for (int m = 0; m < kind_count; ++m) {
      times(m, x, along);
      for (Index k = 0; k < n; ++k) {
        slack[m * n + k] = max_of(p.limit_of(m)[k] - along[k], 1.0);
        multiplier[m * n + k] = 1.0;
      }
    }
  }

  // The rows of a kind times a point, which has two zeros behind it.
  void times(int kind, const double* point, double* __restrict out) const noexcept {
    const double *a = p.at(kind, 0), *b = p.at(kind, 1), *c = p.at(kind, 2);
    const int reach = reach_of(kind);
    for (Index k = 0; k < n && reach == 1; ++k) out[k] = a[k] * point[k];
    for (Index k = 0; k < n && reach == 2; ++k) out[k] = a[k] * point[k] + b[k] * point[k + 1];
    for (Index k = 0; k < n && reach == 3; ++k) {
      out[k] = a[k] * point[k] + b[k] * point[k + 1] + c[k] * point[k + 2];
    }
  }

  Residuals residuals() noexcept {
    double *products = sums, *largest = sums + n;
    std::fill_n(products, 2 * n, 0.0);
    for (int m = 0; m < kind_count; ++m) {
      times(m, x, along);
      const double *s = slack + m * n, *z = multiplier + m * n, *limit = p.limit_of(m);
      double *r = residual + m * n, *over_s = over_slack + m * n, *over_z = over_multiplier + m * n;
      SLOPEWISE_INDEPENDENT
      for (Index k = 0; k < n; ++k) {
        r[k] = along[k] + s[k] - limit[k];
        over_s[k] = 1.0 / s[k];
        over_z[k] = 1.0 / z[k];
        products[k] += s[k] * z[k];
        largest[k] = max_of(largest[k], std::abs(r[k]));
      }
    }
    double gap = 0.0, violation = 0.0, imbalance = 0.0, total = 0.0;
    for (Index k = 0; k < n; ++k) {
      gap += products[k];
      violation = max_of(violation, largest[k]);
    }
    add_up_rows(multiplier);
    for (Index k = 0; k < n; ++k) {
      const double left = p.open[k] * (p.target[k] - x[k] - gradient[k]);
      imbalance = max_of(imbalance, std::abs(left));
      total += left;  // NaN is in a sum what it is not in a maximum.
    }
    return {gap / static_cast<double>(kind_count * n) + 0.0 * total, violation, imbalance};
  }

  // Mean of slack times multiplier after a share of the steps.
  double gap_after(double share) noexcept {
    std::fill_n(sums, n, 0.0);
    for (int m = 0; m < kind_count; ++m) {
      const double *s = slack + m * n, *z = multiplier + m * n, *to_s = ds + m * n,
                   *to_z = dz + m * n;
      double* __restrict total = sums;
      for (Index k = 0; k < n; ++k) {
        total[k] += (s[k] + share * to_s[k]) * (z[k] + share * to_z[k]);
      }
    }
    double after = 0.0;
    for (Index k = 0; k < n; ++k) after += sums[k];
    return after / static_cast<double>(kind_count * n);
  }

  // Newton's step towards a centre, and the share of it that may be gone.
  double newton_step(double centre, double corrects) noexcept {
    const Index many = kind_count * n;
    SLOPEWISE_INDEPENDENT
    for (Index i = 0; i < many; ++i) {
      const double product = slack[i] * multiplier[i] - centre + corrects * ds[i] * dz[i];
      dz[i] = multiplier[i] + (multiplier[i] * residual[i] - product) * over_slack[i];
    }
    add_up_rows(dz);
    for (Index k = 0; k < n; ++k) step[k] = p.open[k] * (p.target[k] - x[k] - gradient[k]);
    solve_factored(step);
    double* longest = sums;
    std::fill_n(longest, n, 0.0);
    for (int m = 0; m < kind_count; ++m) {
      times(m, step, along);
      const double *r = residual + m * n, *z = multiplier + m * n, *over_s = over_slack + m * n,
                   *over_z = over_multiplier + m * n;
      double *to_s = ds + m * n, *to_z = dz + m * n;
      SLOPEWISE_INDEPENDENT
      for (Index k = 0; k < n; ++k) {
        const double change = -r[k] - along[k];
        const double force = to_z[k] + z[k] * (over_s[k] * along[k] - 1.0);
        to_s[k] = change;
        to_z[k] = force;
        longest[k] = max_of(longest[k], -change * over_s[k]);
        longest[k] = max_of(longest[k], -force * over_z[k]);
      }
    }
    double most = border_share;
    for (Index k = 0; k < n; ++k) most = max_of(most, longest[k]);
    return border_share / most;
  }

  void advance(double share) noexcept {
    const Index many = kind_count * n;
    for (Index k = 0; k < n; ++k) x[k] += share * step[k];
    SLOPEWISE_INDEPENDENT
    for (Index i = 0; i < many; ++i) {
      slack[i] = max_of(smallest_slack, slack[i] + share * ds[i]);
      multiplier[i] = max_of(smallest_slack, multiplier[i] + share * dz[i]);
    }
  }

  // Sum of the rows, each by its weight, into `gradient`.
  void add_up_rows(const double* weights) noexcept {
    std::fill_n(sums, 3 * n, 0.0);
    for (int m = 0; m < kind_count; ++m) {
      const double* weight = weights + m * n;
      for (int i = 0; i < reach_of(m); ++i) {
        const double* row = p.at(m, i);
        double* __restrict total = sums + i * n;
        for (Index k = 0; k < n; ++k) total[k] += row[k] * weight[k];
      }
    }
    std::copy_n(sums, n, gradient);
    for (Index i = 1; i < 3; ++i) {
      for (Index k = 0; k + i < n; ++k) gradient[k + i] += sums[i * n + k];
    }
  }

  // 1 + Σ multiplier / slack · rowᵀ row, without stations that are fixed: three diagonals.
  void build_matrix() noexcept {
    double *bb = sums, *bc = bb + n, *cc = bc + n;
    std::fill_n(sums, 3 * n, 0.0);
    std::fill_n(d, 3 * n, 0.0);  // and e, f, which are behind it
    for (int m = 0; m < kind_count; ++m) {
      const int reach = reach_of(m);
      const double *z = multiplier + m * n, *over_s = over_slack + m * n;
      const double *a = p.at(m, 0), *b = p.at(m, 1), *c = p.at(m, 2);
      SLOPEWISE_INDEPENDENT
      for (Index k = 0; k < n; ++k) {
        along[k] = z[k] * over_s[k];
        d[k] += along[k] * a[k] * a[k];
      }
      if (reach < 2) continue;
      SLOPEWISE_INDEPENDENT
      for (Index k = 0; k < n; ++k) {
        e[k] += along[k] * a[k] * b[k];
        bb[k] += along[k] * b[k] * b[k];
      }
      if (reach < 3) continue;
      SLOPEWISE_INDEPENDENT
      for (Index k = 0; k < n; ++k) {
        f[k] += along[k] * c[k] * a[k];
        bc[k] += along[k] * b[k] * c[k];
        cc[k] += along[k] * c[k] * c[k];
      }
    }
    for (Index k = 0; k + 1 < n; ++k) d[k + 1] += bb[k];
    for (Index k = 0; k + 2 < n; ++k) d[k + 2] += cc[k];
    for (Index k = 0; k + 1 < n; ++k) e[k + 1] += bc[k];
    for (Index k = 0; k < n; ++k) {
      d[k] = 1.0 + p.open[k] * d[k];
      e[k] = k + 1 < n ? e[k] * p.open[k] * p.open[k + 1] : 0.0;
      f[k] = k + 2 < n ? f[k] * p.open[k] * p.open[k + 2] : 0.0;
    }
  }

  // Replace the matrix by its factors L D Lᵀ: 1/D in the first diagonal, L in the others.
  bool factor() noexcept {
    double now = d[0], later = d[1], last = d[2], beside = e[0];
    for (Index k = 0; k < n; ++k) {
      if (!(now > 0.0)) return false;
      const double over = 1.0 / now, part = beside * over, part_2 = f[k] * over;
      d[k] = over;
      now = later - beside * part;
      later = last - f[k] * part_2;
      last = k + 3 < n ? d[k + 3] : 1.0;
      beside = (k + 1 < n ? e[k + 1] : 0.0) - beside * part_2;
      e[k] = part;
      f[k] = part_2;
    }
    return true;
  }

  // Replace a point by what the factored matrix maps to it.
  void solve_factored(double* point) const noexcept {
    double before = 0.0, before_2 = 0.0;
    for (Index k = 0; k < n; ++k) {
      const double now = point[k] - before;
      point[k] = now;
      before = before_2 + e[k] * now;
      before_2 = f[k] * now;
    }
    double after = 0.0, after_2 = 0.0;
    for (Index k = n - 1; k >= 0; --k) {
      const double now = point[k] * d[k] - e[k] * after - f[k] * after_2;
      point[k] = now;
      after_2 = after;
      after = now;
    }
  }

  const NearestProblem& p;
  Index n;
  // (kinds, N): of each row its multiplier and slack, their inverses, what it is violated by with
  // its slack, and the steps of slack and multiplier.
  double *multiplier, *slack, *over_slack, *over_multiplier, *residual, *ds, *dz;
  // (N,): sum of the rows by their multipliers, the rows of a kind times a point, room for sums
  // over rows, and the three diagonals of the matrix.
  double *gradient, *along, *sums, *d, *e, *f;
  double *x, *step;  // (N + 2,) point and step, two zeros behind them
};

}  // namespace slopewise
