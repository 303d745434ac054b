// Braking force that the ground of each station offers: the model, the surface and its effects.
#pragma once

#include "ground/force_margins.hpp"

namespace slopewise {

namespace detail {

inline void add_rows(double* to, const double* what, std::size_t lanes) noexcept {
  for (std::size_t j = 0; j < lanes; ++j) to[j] += what[j];
}

// A tile, row by row: what the surfaces give, then what lowers, widens and caps it.
class ForceTile {
 public:
  ForceTile(const ForceProblem& problem, const ForceBounds& out, std::size_t lanes) noexcept
      : problem_(problem), out_(out), lanes_(lanes),
        around_(problem.grade, problem.stations, lanes), dips_(problem, lanes) {}

  void find() noexcept {
    std::fill_n(out_.distance_offset, lanes_, 0.0);
    bits_.fill(problem_.class_bits[0]);
    for (Index k = 0; k < problem_.stations; ++k) find_row(k);
  }

 private:
  void find_row(Index k) noexcept {
    const ForceProblem& p = problem_;
    const ForceRow row(p, out_, k, lanes_);
    const Neighbours grade(p.grade, k, p.stations);
    if (p.classes.data != nullptr) surfaces_of(p, k, lanes_, bits_);
    around_.step_to(k);
    find_force(row, p.surfaces, p.margin, around_, bits_);
    if (!p.hull.empty()) hold_below(row, grade, p.hull, p.surfaces.size(), bits_);
    if (p.least_term.data != nullptr) {
      add_rows(row.lower_intercept, p.least_term.at(k), lanes_);
      add_rows(row.upper_intercept, p.most_term.at(k), lanes_);
    }
    if (p.uncertainty != nullptr) widen(row, p.uncertainty, p.surfaces, bits_);
    if (p.slides) {
      find_frictions(p.surfaces, bits_, lanes_, frictions_);
      std::copy_n(frictions_.least.begin(), lanes_, out_.friction.at(k));
      cap_by_friction(row, frictions_, grade, Neighbours(p.sin_roll, k, p.stations));
    }
    // Drag needs no friction: it adds to a force that is capped.
    if (p.drag.data != nullptr) add_rows(row.upper_intercept, p.drag.at(k), lanes_);
    dips_.take_from(row, k);
  }

  const ForceProblem& problem_;
  const ForceBounds& out_;
  std::size_t lanes_;
  GradeAround around_;
  Dips dips_;
  LaneLabels bits_{};
  Frictions frictions_;
};

inline ForceProblem part_of(const ForceProblem& problem, Index first) noexcept {
  ForceProblem out = problem;
  out.counts += first;
  for (Numbers* rows : {&out.grade, &out.sin_grade, &out.sin_roll, &out.least_term, &out.most_term,
                        &out.drag}) {
    *rows = rows->from(first);
  }
  out.known = out.known.from(first);
  out.classes = out.classes.from(first);
  return out;
}

inline ForceBounds part_of(const ForceBounds& bounds, Index first) noexcept {
  ForceBounds out = bounds;
  out.distance_offset += first;
  for (Rows<double>* rows :
       {&out.lower_slope, &out.lower_intercept, &out.upper_slope, &out.upper_intercept,
        &out.dead_time, &out.shortest_dead_time, &out.slowest, &out.fastest, &out.friction}) {
    *rows = rows->from(first);
  }
  out.trained = out.trained.from(first);
  return out;
}

}  // namespace detail

// Bounds of the force along a batch.
inline void find_forces(const ForceProblem& problem, const ForceBounds& out) noexcept {
  for_each_tile(problem.candidates, [&](const Tile& tile) {
    const ForceProblem part = detail::part_of(problem, tile.first);
    const ForceBounds bounds = detail::part_of(out, tile.first);
    detail::ForceTile(part, bounds, static_cast<std::size_t>(tile.lanes)).find();
  });
}

}  // namespace slopewise
