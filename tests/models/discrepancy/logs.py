"""Former place of `tests.world.logs`."""

from tests.world.logs import WORLDS as WORLDS
from tests.world.logs import log as log
