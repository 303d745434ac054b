"""Learning the braking model from stops: find them, measure them, fit them, choose the margins."""
