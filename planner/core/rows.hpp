// The rows of a batch: a number for each station and candidate.
#pragma once

#include <array>

namespace slopewise {

// ROW(name, type, unit, meaning): the one place where a row is declared.
#define SLOPEWISE_ROWS(ROW)                                                                  \
  ROW(station, "float64", "m", "distance from the path start, increasing")                   \
  ROW(speed_sq_max, "float64", "m²/s²", "highest admissible v²")                             \
  ROW(sin_grade, "float64", "1", "sine of the grade")                                        \
  ROW(force_lower_slope, "float64", "s/m", "change of the lower force with speed")           \
  ROW(force_lower_intercept, "float64", "1", "lower force over weight at rest")              \
  ROW(trained_speed_min, "float64", "m/s", "below it the force does not change with speed")  \
  ROW(accel_max, "float64", "m/s²", "by comfort, thrust and front axle load")                \
  ROW(required_thrust_ratio, "float64", "1", "thrust that holds the speed, over weight")     \
  ROW(speed_sq, "float64", "m²/s²", "v² of the profile; the answer")

enum class Row : int {
#define SLOPEWISE_NAME(name, type, unit, meaning) name,
  SLOPEWISE_ROWS(SLOPEWISE_NAME)
#undef SLOPEWISE_NAME
};

struct RowInfo {
  const char *name, *type, *unit, *meaning;
};

inline constexpr auto row_table = std::to_array<RowInfo>({
#define SLOPEWISE_INFO(name, type, unit, meaning) {#name, type, unit, meaning},
    SLOPEWISE_ROWS(SLOPEWISE_INFO)
#undef SLOPEWISE_INFO
});

inline constexpr int row_count = static_cast<int>(row_table.size());

}  // namespace slopewise
