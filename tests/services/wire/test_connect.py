from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import zenoh

from slopewise.models.errors import InputError
from slopewise.services.settings.service_settings import ServiceConfig, ZenohSettings
from slopewise.services.wire.connect import client_session, error_text, options
from tests.services.command_line import one_line_of, slopewise
from tests.services.service_process import Running, free_port


def test_a_missing_service_is_reported() -> None:
    with pytest.raises(InputError, match="--connect: expected a service at tcp"):
        client_session(f"tcp/127.0.0.1:{free_port()}")


def test_positions_in_the_source_of_zenoh_are_removed() -> None:
    error = zenoh.ZError("No way [in use at /src/x/tcp.rs:61.] at /src/y/unicast.rs:338.")
    assert error_text(error) == "No way [in use]"


def test_an_address_in_use_is_one_line(service: Running, tmp_path: Path) -> None:
    settings = tmp_path / "second.toml"
    settings.write_text(f'model = "atv"\n[zenoh]\nlisten = ["{service.endpoint}"]\n')
    done = slopewise("serve", "--config", settings, timeout=120.0)
    one_line_of(done, "in use")
    assert ".rs" not in done.stderr


@pytest.mark.parametrize(
    ("namespace", "settings", "expected"),
    [
        ("slopewise/robot", {}, ""),
        ("slopewise/robot", {"listen": ("tcp/0.0.0.0:7447",)}, ""),
        (
            "farm/atv-3",
            {"listen": ("tcp/10.0.0.7:7447",)},
            "--connect tcp/10.0.0.7:7447 --namespace farm/atv-3",
        ),
        (
            "slopewise/robot",
            {"listen": ("tls/[::]:7443",)},
            "--connect tls/[::1]:7443 --zenoh FILE",
        ),
        (
            "slopewise/robot",
            {"mode": "client", "connect": ("tcp/router:7447",)},
            "--connect tcp/router:7447",
        ),
    ],
)
def test_options_reach_the_service(namespace: str, settings: dict[str, Any], expected: str) -> None:
    config = ServiceConfig(model="atv", namespace=namespace, zenoh=ZenohSettings(**settings))
    assert " ".join(options(config)) == expected
