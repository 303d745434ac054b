// A convex stopping path, lowered until v² linear between stations stays below it.
#pragma once

#include "bounds/bound_problem.hpp"

namespace slopewise {

// Least share of a bound that is left where the next station may be passed as well [1].
inline constexpr double share_kept = 0.5;
// Share of the second difference given up [1]: 1/8 for a parabola, the rest for bounds that are not
// quite one.
inline constexpr double chord_share = 1.0 / 6.0;

namespace detail {

struct Chords {
  Lane previous, bend_before;  // bound and its bend in the row before [m²/s²]
  LaneLabels stop;             // station at which the candidate comes to its stop
};

[[nodiscard]] constexpr bool looks_ahead(Label label) noexcept {
  return (label == limiting::stopping_path) | (label == limiting::tip_over) |
         (label == limiting::rollover);
}

// Lower row k; notes which candidates come to their stop there.
inline void lower_row(const Bounds& out, Index k, Index stations, Index lanes,
                      Chords& chords) noexcept {
  const Index next = std::min(k + 1, stations - 1);
  const double *row_ahead = out.speed_sq_max.at(next),
               *row_beyond = out.speed_sq_max.at(std::min(k + 2, stations - 1));
  double* row = out.speed_sq_max.at(k);
  const Label *label_ahead = out.limiting.at(next), *barrier = out.barrier;
  Label* label = out.limiting.at(k);
  SLOPEWISE_INDEPENDENT
  for (Index j = 0; j < lanes; ++j) {
    const auto n = static_cast<std::size_t>(j);
    const double here = row[j];
    const double ahead = max_of(row_ahead[j], 0.0), beyond = max_of(row_beyond[j], 0.0);
    // Steps of bounds that do not look ahead hold between stations already.
    const double here_bends = max_of(chords.previous[n] - 2.0 * here + ahead, 0.0);
    double bend = looks_ahead(label[j]) ? here_bends : 0.0;
    bend = here <= 0.0 ? here_bends : bend;
    const double next_bends = max_of(here - 2.0 * ahead + beyond, 0.0);
    double bend_ahead = looks_ahead(label_ahead[j]) ? next_bends : 0.0;
    bend_ahead = ahead <= 0.0 ? next_bends : bend_ahead;
    const double most = max_of(max_of(chords.bend_before[n], bend), bend_ahead);
    const double lowered = here - chord_share * most;
    // A step of the stopping path is not the stop at its end: the judge sees to the rest.
    double floor = ahead <= 0.0 ? -no_limit : share_kept * here;
    floor = here <= 0.0 ? -no_limit : floor;
    const double least = max_of(lowered, floor);
    chords.previous[n] = here;
    chords.bend_before[n] = bend;
    const bool before = chords.stop[n] > k;
    const bool stays = before & (least > 0.0), comes = before & (least <= 0.0);
    row[j] = stays ? least : 0.0;
    label[j] = stays ? label[j] : barrier[j];
    chords.stop[n] = comes ? k : chords.stop[n];
  }
}

// Stop candidates at row k - 1 that would come to their stop before row k.
inline void stop_before(const Bounds& out, Index k, Index lanes, const Chords& chords) noexcept {
  double* row = out.speed_sq_max.at(k - 1);
  Label* label = out.limiting.at(k - 1);
  SLOPEWISE_INDEPENDENT
  for (Index j = 0; j < lanes; ++j) {
    const bool stops = chords.stop[static_cast<std::size_t>(j)] == k;
    row[j] = stops ? 0.0 : row[j];
    label[j] = stops ? out.barrier[j] : label[j];
  }
}

}  // namespace detail

// The last station that is not below zero becomes the one to stop at.
inline void keep_chords_below(const Bounds& out, Index stations, Index lanes) noexcept {
  detail::Chords chords{};
  std::copy_n(out.speed_sq_max.at(0), lanes, chords.previous.begin());
  chords.stop.fill(stations);
  for (Index k = 0; k < stations; ++k) {
    detail::lower_row(out, k, stations, lanes, chords);
    if (k > 0) detail::stop_before(out, k, lanes, chords);
  }
}

// The speed limit of the model, by its square.
inline void keep_limit(const Bounds& out, double highest_sq, Index stations, Index lanes) noexcept {
  for (Index k = 0; k < stations; ++k) {
    double* row = out.speed_sq_max.at(k);
    Label* label = out.limiting.at(k);
    SLOPEWISE_INDEPENDENT
    for (Index j = 0; j < lanes; ++j) {
      label[j] = row[j] >= highest_sq ? limiting::speed_limit : label[j];
      row[j] = min_of(row[j], highest_sq);
    }
  }
}

}  // namespace slopewise
