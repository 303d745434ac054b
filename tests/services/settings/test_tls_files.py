from __future__ import annotations

import json
from pathlib import Path

import pytest

from slopewise.services.settings.service_settings import ZenohSettings
from slopewise.services.settings.zenoh_session import zenoh_config
from tests.services import certificates
from tests.services.faults import fault_in

ENDPOINT = ("tls/127.0.0.1:7447",)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    certificates.make(tmp_path)
    return tmp_path


def settings(file: Path, listen: tuple[str, ...] = ENDPOINT) -> ZenohSettings:
    return ZenohSettings(config=str(file), listen=listen)


@pytest.mark.parametrize("name", ["loopback", "tls", "mtls"])
def test_shipped_files_are_usable(folder: Path, name: str) -> None:
    config = zenoh_config(settings(folder / f"{name}.json5"))
    tls = json.loads(config.get_json("transport/link/tls"))
    for path in (tls["listen_certificate"], tls["listen_private_key"]):
        assert path is None or Path(path).is_absolute()
    assert json.loads(config.get_json("scouting/gossip/enabled")) is False


def test_what_is_not_named_is_denied(folder: Path) -> None:
    config = zenoh_config(settings(folder / "mtls.json5"))
    access = json.loads(config.get_json("access_control"))
    assert access["enabled"]
    assert access["default_permission"] == "deny"
    denied = [rule for rule in access["rules"] if rule["permission"] != "allow"]
    assert [rule["key_exprs"] for rule in denied] == [["slopewise/robot/v1/alive/planner"]]
    named = {rule for policy in access["policies"] for rule in policy["rules"]}
    assert named == {rule["id"] for rule in access["rules"]}


def test_a_missing_key_is_named(folder: Path) -> None:
    (folder / "tls" / "service.key").unlink()
    file = folder / "mtls.json5"
    with fault_in(file, "transport.link.tls.listen_private_key", "service.key"):
        zenoh_config(settings(file))


def test_names_in_certificates_need_certificates(folder: Path) -> None:
    file = folder / "mtls.json5"
    file.write_text(file.read_text().replace("enable_mtls: true", "enable_mtls: false"))
    with fault_in(file, "transport.link.tls.enable_mtls", "expected true"):
        zenoh_config(settings(file))


def test_an_unencrypted_endpoint_next_to_an_encrypted_one_is_rejected(folder: Path) -> None:
    file = folder / "mtls.json5"
    with fault_in(file, "listen or connect", "tls/", "tcp/127.0.0.1:7447"):
        zenoh_config(settings(file, (*ENDPOINT, "tcp/127.0.0.1:7447")))
