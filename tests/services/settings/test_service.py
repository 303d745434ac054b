from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from slopewise.services.settings.service_settings import ServiceConfig, ZenohSettings, read_config
from slopewise.services.settings.zenoh_session import zenoh_config
from tests.services import certificates
from tests.services.faults import fault_in

SHIPPED = Path(__file__).parents[3] / "configs" / "service.toml"


def test_shipped_file_has_the_defaults() -> None:
    assert read_config(SHIPPED) == ServiceConfig(model="atv")


def test_shipped_file_names_every_key() -> None:
    named = set(re.findall(r"^(?:# )?(\w+) = ", SHIPPED.read_text(), re.MULTILINE))
    config = ServiceConfig(model="atv")
    tables = [config, config.zenoh, config.planning, config.sizes, config.status, config.page]
    tables += [config.learning, config.store, config.discrepancy]
    keys = {name for table in tables for name in table.__dataclass_fields__}
    names = {"zenoh", "planning", "sizes", "status", "page", "learning", "store", "discrepancy"}
    assert keys - named == names


def test_files_are_relative_to_the_settings(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("")
    tables = '[store]\npath = "a.sqlite"\n[discrepancy]\nsamples = "stops"'
    (tmp_path / "service.toml").write_text(f'model = "mine.toml"\n{tables}')
    config = read_config(tmp_path / "service.toml")
    paths = config.model, config.store.path, config.discrepancy.samples
    assert paths == tuple(str(tmp_path / name) for name in ("mine.toml", "a.sqlite", "stops"))


def test_by_default_it_listens_on_loopback_only() -> None:
    config = zenoh_config(ZenohSettings())
    assert json.loads(config.get_json("listen/endpoints")) == ["tcp/127.0.0.1:7447"]
    assert json.loads(config.get_json("scouting/multicast/enabled")) is False


def test_a_service_uses_shared_memory_only_if_zenohs_settings_say_so(tmp_path: Path) -> None:
    key = "transport/shared_memory/enabled"
    assert zenoh_config(ZenohSettings(), 1000).get_json(key) == "false"
    file = tmp_path / "zenoh.json5"
    file.write_text("{}")
    from_file = ZenohSettings(config=str(file))
    assert zenoh_config(from_file, 1000).get_json(key) == "true"
    assert zenoh_config(ZenohSettings()).get_json(key) == "true"


def test_settings_that_zenoh_refuses_are_named() -> None:
    with fault_in("zenoh", "", "expected usable settings"):
        zenoh_config(ZenohSettings(listen=("nonsense",)))


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
