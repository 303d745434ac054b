"""Ground: the map, what lies under the wheels, and the braking force there."""
