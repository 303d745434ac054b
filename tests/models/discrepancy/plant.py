"""Former place of `tests.world.plant`."""

from tests.world.plant import drive as drive
