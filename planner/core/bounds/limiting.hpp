// What can limit a plan at a station, by the codes of planner/limiting.py; a test compares them.
#pragma once

#include <cstdint>

namespace slopewise {

using Label = std::int64_t;

namespace limiting {

inline constexpr Label none = -1;  // of a station that nothing blocks
inline constexpr Label speed_limit = 0;
inline constexpr Label stopping_path = 1;
inline constexpr Label tip_over = 2;
inline constexpr Label rollover = 3;
inline constexpr Label lateral = 4;
inline constexpr Label wheel_speed = 5;
inline constexpr Label traction = 6;
inline constexpr Label accel = 7;
inline constexpr Label decel = 8;
inline constexpr Label jerk = 9;
inline constexpr Label unknown_terrain = 10;
inline constexpr Label model_validity = 11;
inline constexpr Label step = 12;
inline constexpr Label clearance = 13;
inline constexpr Label body = 14;
inline constexpr Label roughness = 15;
inline constexpr Label crest = 16;
inline constexpr Label friction = 17;
inline constexpr Label holding = 18;
inline constexpr Label steering = 19;
inline constexpr Label count = steering + 1;  // of all bounds

}  // namespace limiting

}  // namespace slopewise
