"""Tests of behaviour that is wanted and not there yet, each with what is missing.

They run, and are expected to fail until the planner does what they ask; none is about a plan that
would be too fast.
"""

from __future__ import annotations

OPEN: dict[str, str] = {}
_OLD: dict[str, str] = {
    "test_starts_too_fast_for_a_short_path_are_told_apart": "sentence of the emergency stop",
    "test_turning_resistance_helps_to_stop_in_turns_only": "helpful effects do not raise the bound",
    "test_effects_change_the_stopping_bound_in_their_direction": "the same for drag and wind",
    "test_a_slow_stretch_is_driven_slowly_and_not_given_up": "steps of the speed limit",
    "test_a_stop_line_on_the_way_is_stopped_at_and_left_again_or_said_to_block": "stop lines",
    "test_effects_add_up_on_hills_and_stay_sound": "order of lag and fade where both are given",
    "test_each_bound_bites": "the speed that power sustains is approached, not reached",
    "test_a_weaker_brake_never_makes_it_faster": "steps of a bound are lowered too much",
    "test_json_is_json_and_ranked": "JSON output under error filters",
}
