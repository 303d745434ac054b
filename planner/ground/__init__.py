"""What the vehicle drives on: the map, what lies under its wheels, and the braking force there."""
