"""Questions for plans and updates of the map, from the wire to the answer."""
