"""What body and wheels meet on their way: steps, rocks, walls, rough ground."""
