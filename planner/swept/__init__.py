"""Hazards of body and wheels along a path: steps, rocks, walls, rough ground."""
