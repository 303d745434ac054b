"""Files that come with the package: vehicles to begin with, each a model file of its own."""
