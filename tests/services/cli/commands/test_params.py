"""`slopewise params` as an operator meets it."""

from __future__ import annotations

import io
import json
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
from rich.console import Console

from slopewise.models.errors import InputError
from slopewise.services.cli.arguments.robot import ParamsOptions
from slopewise.services.cli.commands.params import as_json, run, show
from tests.services.parameter_client import Robot
from tests.services.service_process import Running, running
from tests.services.warm_process import WarmProcess

G = 9.80665


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    folder = tmp_path_factory.mktemp("params")
    with running(folder, planning='[store]\npath = "p.sqlite"') as started:
        with started.session() as session:
            Robot(started, session).stop(0.42 * G)
        yield started


def params(service: Running, *words: str) -> subprocess.CompletedProcess[str]:
    where = ["--connect", service.endpoint, "--namespace", service.namespace]
    environment = {"COLUMNS": "200", "PATH": "", "USER": "ann"}
    return WarmProcess(["params", *words, *where], environment).finished(60.0)


def test_it_reads_sets_and_goes_back(service: Running) -> None:
    job = ParamsOptions(connect=service.endpoint, namespace=service.namespace)
    screen = Console(width=200, record=True, file=io.StringIO())
    show(run(job), job, screen)
    read = screen.export_text()
    for word in ("version 2", "b_b", "slip_track", "lateral_accel", "stop 1: accepted (robot)"):
        assert word in read, read
    changed = params(service, "limits", "--set", "speed=1.5", "--set", "accel=0.5", "--json")
    assert changed.returncode == 0, changed.stderr
    reply = json.loads(changed.stdout)
    assert reply["version"] == 3
    (limits,) = [g for g in reply["groups"] if g["group"] == "limits"]
    assert (limits["values"]["speed"], limits["values"]["accel"]) == (1.5, 0.5)
    assert limits["who"] == "ann"
    history = params(service, "limits", "--history")
    assert "set speed = 1.5, accel = 0.5" in history.stdout
    assert "ann" in history.stdout
    back = run(replace(job, rollback=2))
    assert {g.group: g.values for g in back.groups}["limits"]["speed"] == 4.0
    newest = as_json(run(replace(job, history=True, most=1)))
    assert [h["cause"] for h in newest["history"]] == ["rolled back to version 2"]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"group": "limits", "changes": ("speed=9",)}, "at most the 4 of the model file"),
        ({"group": "limits", "changes": ("speed",)}, "NAME=VALUE"),
        ({"group": "limits", "changes": ("speed=nan",)}, "NAME=VALUE"),
        ({"changes": ("speed=1",)}, "group"),
        ({"group": "nonsense"}, "one of braking"),
        ({"rollback": 999}, "version"),
        ({"rollback": -1}, "expected a version"),
        ({"rollback": 1, "history": 3}, "one of --history"),
        ({"namespace": "nobody/here", "timeout": 0.3}, "got none"),
        ({"connect": "tcp/127.0.0.1:1"}, "--connect"),
    ],
)
def test_mistakes_are_named(service: Running, changes: dict[str, Any], said: str) -> None:
    job = ParamsOptions(connect=service.endpoint, namespace=service.namespace)
    with pytest.raises(InputError) as caught:
        run(replace(job, **changes))
    assert said in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_a_mistake_is_one_line_and_status_2(service: Running) -> None:
    result = params(service, "limits", "--set", "speed=9")
    assert result.returncode == 2, result.stdout
    assert len(result.stderr.strip().splitlines()) == 1, result.stderr
    assert "at most the 4" in result.stderr
