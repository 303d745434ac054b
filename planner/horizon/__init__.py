"""The moving horizon: plans that continue from one cycle to the next."""
