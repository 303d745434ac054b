"""A model taken elsewhere: as CasADi functions with derivatives, as C, as JSON schema."""
