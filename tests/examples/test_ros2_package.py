"""The colcon package in examples/ros2, as far as it can be checked without ROS."""

from __future__ import annotations

import dataclasses
import importlib
import os
import re
import runpy
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import zenoh

from slopewise.services.ros.settings import EdgeSettings, read_settings
from slopewise.services.settings.service_settings import ZenohSettings
from slopewise.services.settings.zenoh_session import zenoh_config
from tests.examples import ros_fakes
from tests.examples.ros_fakes import Answer
from tests.services.service_process import free_port

PACKAGE = Path(__file__).parents[2] / "examples" / "ros2" / "slopewise_ros"
ORDER = ("name", "version", "description", "maintainer", "license", "url", "author", "depend")
"""Elements of format 3 in the order of its schema, all dependencies as one; then export."""
EDGE = """#!{python}
import signal, sys, time
signal.signal(signal.SIGINT, lambda *_: sys.exit(0))
assert sys.argv[1:3] == ["ros", "--config"], sys.argv
{body}
"""


@pytest.fixture
def package(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The node's module, on a fake of rclpy."""
    ros_fakes.rclpy(monkeypatch)
    monkeypatch.syspath_prepend(str(PACKAGE))
    for name in [name for name in sys.modules if name.startswith("slopewise_ros")]:
        monkeypatch.delitem(sys.modules, name)
    return importlib.import_module("slopewise_ros.edge_node")


def program(folder: Path, body: str) -> str:
    """A stand-in for `slopewise`."""
    file = folder / "slopewise"
    file.write_text(EDGE.format(python=sys.executable, body=body))
    file.chmod(0o755)
    return str(file)


def node_with(package: ModuleType, executable: str, **values: Any) -> Any:
    node = package.EdgeNode()
    node.values.update({"executable": executable, "start_patience": 10.0, **values})
    return node


READY = 'print("slopewise: plan of ROS 2 at here", flush=True)\ntime.sleep(60)'


def test_it_starts_and_stops_the_edge(package: ModuleType, tmp_path: Path) -> None:
    node = node_with(package, program(tmp_path, READY))
    assert node.trigger_configure() is Answer.SUCCESS
    settings = node._edge.settings
    assert read_settings(settings) == EdgeSettings()
    for _ in range(2):
        assert node.trigger_activate() is Answer.SUCCESS
        process = node._edge._process
        assert process.poll() is None
        assert len(node.timers) == 1
        assert node.trigger_deactivate() is Answer.SUCCESS
        assert process.returncode == 0
        assert node.timers == []
    assert node.trigger_cleanup() is Answer.SUCCESS
    assert not settings.exists()
    node.trigger_configure()
    node.trigger_activate()
    process = node._edge._process
    assert node.trigger_shutdown() is Answer.SUCCESS
    assert (process.returncode, node.state) == (0, "finalized")


def test_a_program_that_is_not_there(package: ModuleType) -> None:
    node = node_with(package, "no-such-program")
    assert node.trigger_configure() is Answer.FAILURE
    assert node.state == "unconfigured"
    assert "no-such-program" in node.logger.lines[-1][1]


REFUSES = 'print("slopewise: ros.toml: wrong", file=sys.stderr)\nsys.exit(2)'


@pytest.mark.parametrize(
    ("body", "patience", "line"),
    [(REFUSES, 10.0, "slopewise: ros.toml: wrong"), ("time.sleep(60)", 0.5, "ready line")],
)
def test_an_edge_that_does_not_start(
    package: ModuleType, tmp_path: Path, body: str, patience: float, line: str
) -> None:
    node = node_with(package, program(tmp_path, body), start_patience=patience)
    node.trigger_configure()
    begun = time.monotonic()
    assert node.trigger_activate() is Answer.FAILURE
    assert time.monotonic() - begun < 5.0
    assert node.state == "inactive"
    assert any(level == "error" and line in text for level, text in node.logger.lines)


def test_an_edge_that_ends_by_itself(package: ModuleType, tmp_path: Path) -> None:
    body = 'print("slopewise: there", flush=True)\ntime.sleep(0.3)'
    node = node_with(package, program(tmp_path, body))
    node.trigger_configure()
    assert node.trigger_activate() is Answer.SUCCESS
    node._edge._process.wait(5.0)
    node.timers[0]()
    assert (node.state, node.timers) == ("inactive", [])
    assert any(level == "error" for level, _ in node.logger.lines)


def test_an_unresponsive_edge_is_killed(package: ModuleType, tmp_path: Path) -> None:
    body = f"signal.signal(signal.SIGINT, signal.SIG_IGN)\n{READY}"
    node = node_with(package, program(tmp_path, body), stop_patience=0.3)
    node.trigger_configure()
    node.trigger_activate()
    process = node._edge._process
    assert node.trigger_deactivate() is Answer.SUCCESS
    assert process.returncode == -9


def test_it_starts_the_real_edge(package: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("rosbags", reason="the ros extra is not installed")
    paths = [str(Path(sys.executable).parent), os.environ.get("PATH", "")]
    monkeypatch.setenv("PATH", os.pathsep.join(paths))
    monkeypatch.setenv("PYTHONPATH", str(PACKAGE.parents[2]))
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    router = ZenohSettings(mode="router", listen=(endpoint,))
    node = node_with(package, "slopewise", start_patience=60.0)
    node.values["ros.connect"] = [endpoint]
    with zenoh.open(zenoh_config(router)):
        assert node.trigger_configure() is Answer.SUCCESS
        assert node.trigger_activate() is Answer.SUCCESS, node.logger.lines
        process = node._edge._process
        assert node.trigger_deactivate() is Answer.SUCCESS
        assert process.returncode == 0
    node.trigger_cleanup()


def typed(values: dict[str, Any]) -> dict[str, tuple[type, Any]]:
    """A parameter of ROS has a type: 1 is not 1.0."""
    return {name: (type(value), value) for name, value in values.items()}


def test_parameters_are_the_settings_of_the_edge(package: ModuleType, tmp_path: Path) -> None:
    yaml = pytest.importorskip("ruamel.yaml", reason="the ros extra is not installed")
    given: dict[str, Any] = sys.modules["slopewise_ros.parameters"].EDGE
    fixed: dict[str, Any] = sys.modules["slopewise_ros.parameters"].NODE
    expected = {
        f"{table}.{key}": list(value) if isinstance(value, tuple) else value
        for table, values in dataclasses.asdict(EdgeSettings()).items()
        for key, value in values.items()
    }
    assert typed(given) == typed(expected)
    file = yaml.YAML(typ="safe").load((PACKAGE / "config" / "slopewise.yaml").read_text())
    tables = file["/**"]["ros__parameters"]
    flat = {name: value for name, value in tables.items() if not isinstance(value, dict)}
    for table, values in tables.items():
        if isinstance(values, dict):
            flat |= {f"{table}.{key}": value for key, value in values.items()}
    assert typed(flat) == typed(fixed | given)


def test_package_xml_is_of_format_3() -> None:
    root = ET.parse(PACKAGE / "package.xml").getroot()
    assert (root.tag, root.get("format")) == ("package", "3")
    assert re.fullmatch(r"[a-z][a-z0-9_]*", root.findtext("name", ""))
    assert re.fullmatch(r"\d+\.\d+\.\d+", root.findtext("version", ""))
    assert root.findtext("description", "").strip()
    assert "@" in (root.find("maintainer").get("email") or "")  # type: ignore[union-attr]
    assert root.findtext("license") == "Apache-2.0"
    kinds = ["depend" if child.tag.endswith("depend") else child.tag for child in root]
    assert kinds[-1] == "export"
    places = [ORDER.index(kind) for kind in kinds[:-1]]
    assert places == sorted(places)
    depends = {child.text for child in root if child.tag == "exec_depend"}
    code = "".join(file.read_text() for file in PACKAGE.rglob("*.py"))
    imported = re.findall(r"^(?:from|import) (\w+)", code, re.MULTILINE)
    ours = {"slopewise_ros", "setuptools", "glob", "__future__"} | set(sys.stdlib_module_names)
    assert set(imported) - ours <= depends
    assert root.findtext("export/build_type") == "ament_python"


def test_setup_builds_and_installs_files_that_exist(tmp_path: Path) -> None:
    pytest.importorskip("setuptools", reason="setuptools is not installed")
    command = [sys.executable, "setup.py", "-q", "egg_info", "--egg-base", str(tmp_path)]
    command += ["build", "--build-base", str(tmp_path / "build")]
    done = subprocess.run(command, cwd=PACKAGE, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "build" / "lib" / "slopewise_ros" / "edge_node.py").is_file()
    entry_points = (tmp_path / "slopewise_ros.egg-info" / "entry_points.txt").read_text()
    assert "edge = slopewise_ros.edge_node:main" in entry_points
    assert (PACKAGE / "resource" / "slopewise_ros").is_file()
    for name in re.findall(r'glob\("(.*?)"\)', (PACKAGE / "setup.py").read_text()):
        assert list(PACKAGE.glob(name)), name


def test_the_launch_file_describes_the_node(monkeypatch: pytest.MonkeyPatch) -> None:
    ros_fakes.launch(monkeypatch)
    launch = runpy.run_path(str(PACKAGE / "launch" / "slopewise.launch.py"))
    (entities,) = launch["generate_launch_description"]().arguments
    kinds = [type(entity).__name__ for entity in entities]
    assert kinds.count("DeclareLaunchArgument") == 3
    node = next(entity for entity in entities if type(entity).__name__ == "LifecycleNode")
    assert node.named["package"] == "slopewise_ros"
    assert f"{node.named['executable']} = " in (PACKAGE / "setup.py").read_text()
    # The handler of the second transition has to be there before the first one is asked for.
    assert kinds.index("RegisterEventHandler") < kinds.index("EmitEvent")
