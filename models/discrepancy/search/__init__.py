"""Which effects, where: screening, fitting, locating."""
