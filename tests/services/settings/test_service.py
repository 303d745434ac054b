from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from slopewise.services.settings.service_settings import (
    ServiceConfig,
    SizeLimits,
    ZenohSettings,
    read_config,
)
from slopewise.services.settings.zenoh_session import zenoh_config
from tests.services.faults import fault_in

SHIPPED = Path(__file__).parents[3] / "configs" / "service.toml"


def test_shipped_file_says_the_defaults() -> None:
    assert read_config(SHIPPED) == ServiceConfig(model="atv")


def test_shipped_file_names_every_key() -> None:
    named = set(re.findall(r"^(?:# )?(\w+) = ", SHIPPED.read_text(), re.MULTILINE))
    config = ServiceConfig(model="atv")
    tables = [config, config.zenoh, config.planning, config.sizes, config.status, config.page]
    tables += [config.learning, config.store, config.discrepancy]
    keys = {name for table in tables for name in table.__dataclass_fields__}
    names = {"zenoh", "planning", "sizes", "status", "page", "learning", "store", "discrepancy"}
    assert keys - named == names


@pytest.mark.parametrize(
    ("text", "field", "words"),
    [
        ("", "model", "missing key"),
        ('model = "atv"\nnamespace = "a//b"', "namespace", "words joined by /"),
        ('model = "atv"\nnamespace = "a/**"', "namespace", "words joined by /"),
        ('model = "atv"\nid = "a/b"', "id", "one word"),
        ('model = "atv"\n[planning]\nworkers = 0', "planning.workers", ">= 1"),
        ('model = "atv"\n[planning]\nworkers = 1.5', "planning.workers", "1.5"),
        ('model = "atv"\n[planning]\ndeadline = 0.005', "planning.early", "less than"),
        ('model = "atv"\n[planning]\nqueu = 1', "planning.queu", "did you mean queue"),
        ('model = "atv"\n[zenoh]\nmode = "star"', "zenoh.mode", "'peer'"),
        ('model = "atv"\n[sizes]\nrequest_bytes = 1', "sizes.request_bytes", ">= 1000"),
        ('model = "atv"\n[learning]\nrise = 0.5', "learning.rise", "<= 0.2"),
        ('model = "atv"\n[learning]\nestimators = ["a/b"]', "learning.estimators[0]", "one word"),
        ('model = "atv"\n[store]\nmegabytes = 0.1', "store.megabytes", ">= 0.3"),
        ('model = "atv"\n[discrepancy]\nstops = 3', "discrepancy.stops", ">= 12"),
        ("model = ", "end of document", "TOML"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, field: str, words: str) -> None:
    file = tmp_path / "service.toml"
    file.write_text(text)
    with fault_in(file, field, words):
        read_config(file)


def test_files_are_looked_for_beside_the_settings(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("")
    (tmp_path / "service.toml").write_text('model = "mine.toml"')
    assert read_config(tmp_path / "service.toml").model == str(tmp_path / "mine.toml")


def test_the_store_is_beside_the_settings(tmp_path: Path) -> None:
    (tmp_path / "service.toml").write_text('model = "atv"\n[store]\npath = "a.sqlite"')
    assert read_config(tmp_path / "service.toml").store.path == str(tmp_path / "a.sqlite")


def test_samples_of_stops_are_beside_the_settings(tmp_path: Path) -> None:
    (tmp_path / "service.toml").write_text('model = "atv"\n[discrepancy]\nsamples = "stops"')
    assert read_config(tmp_path / "service.toml").discrepancy.samples == str(tmp_path / "stops")


def test_nobody_else_can_reach_it_unless_asked_for() -> None:
    config = zenoh_config(ZenohSettings())
    assert json.loads(config.get_json("listen/endpoints")) == ["tcp/127.0.0.1:7447"]
    assert json.loads(config.get_json("scouting/multicast/enabled")) is False


def test_a_service_takes_no_shared_memory_unless_told_to(tmp_path: Path) -> None:
    key = "transport/shared_memory/enabled"
    assert zenoh_config(ZenohSettings(), SizeLimits()).get_json(key) == "false"
    own = tmp_path / "zenoh.json5"
    own.write_text("{}")
    told = ZenohSettings(config=str(own))
    assert zenoh_config(told, SizeLimits()).get_json(key) == "true"
    assert zenoh_config(ZenohSettings()).get_json(key) == "true"


def test_settings_that_zenoh_refuses_are_named() -> None:
    with fault_in("zenoh", "", "expected usable settings"):
        zenoh_config(ZenohSettings(listen=("nonsense",)))
