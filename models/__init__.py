"""Laws of braking, loads, tip-over and wheel-terrain interaction, and the parameters they need."""
