"""Former place of `tests.world`: vehicles, ground, paths and plans."""

# ruff: noqa: F403
from tests.world.ground import *
from tests.world.plans import *
from tests.world.vehicles import *
