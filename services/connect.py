"""How commands reach a running service."""

from __future__ import annotations

import re

import zenoh

from models.errors import InputError
from services.config import ZenohSettings, zenoh_config

_PLACE = re.compile(r"\s+at \S+\.rs:\d+\.?")


def words_of(error: zenoh.ZError) -> str:
    """What zenoh says, without the places in its own source."""
    return _PLACE.sub("", str(error))


def client_session(connect: str, config: str = "") -> zenoh.Session:
    """A session of a client.

    Args:
        connect: endpoint of the service, or of a router. config: zenoh's own settings, such as
            certificates; "" for none.

    Raises:
        InputError: nobody is there, or nobody who lets this client in.
    """
    settings = ZenohSettings(mode="client", connect=(connect,), config=config)
    try:
        return zenoh.open(zenoh_config(settings))
    except zenoh.ZError:
        raise InputError(
            "--connect", "", f"expected a service at {connect} that lets this client in, got none"
        ) from None
