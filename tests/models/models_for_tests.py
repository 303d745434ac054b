"""Former place of the quad of `tests.world.vehicles`."""

from tests.world.vehicles import BASE as BASE
from tests.world.vehicles import with_braking as with_braking
from tests.world.vehicles import with_effect as with_effect
