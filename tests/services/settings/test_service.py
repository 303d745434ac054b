from __future__ import annotations

import json
import re
from pathlib import Path

from slopewise.services.settings.service_settings import (
    ServiceConfig,
    SizeLimits,
    ZenohSettings,
    read_config,
)
from slopewise.services.settings.zenoh_session import zenoh_config
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
    assert zenoh_config(ZenohSettings(), SizeLimits()).get_json(key) == "false"
    file = tmp_path / "zenoh.json5"
    file.write_text("{}")
    from_file = ZenohSettings(config=str(file))
    assert zenoh_config(from_file, SizeLimits()).get_json(key) == "true"
    assert zenoh_config(ZenohSettings()).get_json(key) == "true"


def test_settings_that_zenoh_refuses_are_named() -> None:
    with fault_in("zenoh", "", "expected usable settings"):
        zenoh_config(ZenohSettings(listen=("nonsense",)))
