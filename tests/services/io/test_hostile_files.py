"""Files of every kind that cannot be used: one line that names the file and the field.

Hostile and broken files: one line, no crash, little memory.
"""

from __future__ import annotations

import dataclasses
import resource
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slopewise.models.errors import InputError
from slopewise.services.io.bags import opened
from slopewise.services.io.drive_log import read_drive_log, read_logs
from slopewise.services.io.files import read_toml
from slopewise.services.io.log_checks import refuse_ramps, refuse_unit
from slopewise.services.io.map_file import map_info, read_map
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.path_file import read_paths
from slopewise.services.io.plan_file import read_external_plans
from slopewise.services.io.table import read_csv, write_csv
from slopewise.services.ros.settings import read_settings
from slopewise.services.settings.service_settings import read_config
from tests.services.faults import bad_inputs, fault_in

READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "drive_log": ("log.csv", lambda path: read_drive_log([path])),
    "geojson": ("p.geojson", read_paths),
    "model_text": ("m.toml", read_model),
    "paths": ("p.csv", read_paths),
    "plans": ("p.csv", read_external_plans),
    "ros": ("ros.toml", read_settings),
    "service": ("service.toml", read_config),
    "topics": ("topics.toml", lambda path: read_logs([path.with_name("drive.mcap")], path)),
}
UNREADABLE: list[tuple[str, bytes, str, str]] = [
    ("model_text", b"\xff\xfe", "byte 0", "UTF-8"),
    ("model_text", b"name = \x00", "line 1, column 8", "expected TOML"),
    ("model_text", b"a = " + b"[" * 5000, "", "expected TOML"),
    ("paths", b"x,y\n\xff\xff", "byte 4", "UTF-8"),
    ("paths", "x,y\n0,0\n".encode("utf-16"), "byte 0", "expected UTF-8 text, got UTF-16"),
    ("paths", b"\x89PNG\r\n\x1a\n\x00\x00", "byte 0", "UTF-8"),
    ("geojson", b"[" * 100_000, "", "expected JSON"),
]


@pytest.mark.parametrize("kind", READERS)
def test_the_error_names_file_and_field(tmp_path: Path, kind: str) -> None:
    name, read = READERS[kind]
    path = tmp_path / name
    cases = [(text.encode(), field, message) for text, field, message in bad_inputs(kind)]
    for content, field, message in cases + [case[1:] for case in UNREADABLE if case[0] == kind]:
        path.write_bytes(content)
        with fault_in(path, field, message):
            read(path)


@pytest.mark.parametrize("kind", READERS)
def test_a_missing_file_is_named(tmp_path: Path, kind: str) -> None:
    name, read = READERS[kind]
    with fault_in(tmp_path / name, "", "expected an existing file"):
        read(tmp_path / name)


@settings(deadline=None)
@given(
    kind=st.sampled_from(("drive_log", "geojson", "paths", "plans")),
    content=st.binary(max_size=40)
    | st.text(alphabet='x,y\n"1.e-;', max_size=40)
    | st.text(alphabet='0123.,-\n"runtvcmdpi_ e', max_size=60).map(
        lambda text: f"run,t,v,v_cmd,pitch,x,y,speed\n{text}"
    ),
)
def test_any_bytes_are_read_or_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, kind: str, content: str | bytes
) -> None:
    name, read = READERS[kind]
    path = tmp_path_factory.mktemp("any") / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    try:
        read(path)
    except InputError as error:
        assert str(error).isprintable()  # noqa: PT017  either outcome is right


ATV = find_model("atv").read_text()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a." * 100_000 + "b = 1\n", "line 1: expected keys of at most 20 parts"),
        ("x = 1\n[" + '"a" . ' * 30_000 + "b]\n", "line 2: expected keys of at most 20 parts"),
        ("x = 1\n" + "# " + "y" * 1_100_000, "at most 1000000 bytes"),
        ("x = " + "[" * 50_000 + "]" * 50_000, "expected TOML"),
        ("x = " + "{a=" * 50_000, "expected TOML"),
    ],
)
def test_toml_that_would_take_gigabytes_is_refused_in_little(
    tmp_path: Path, text: str, message: str
) -> None:
    file = tmp_path / "m.toml"
    file.write_text(text)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError) as error:
        read_toml(file)
    assert message in str(error.value)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000


def test_numbers_with_many_digits_and_floats_are_no_deep_keys(tmp_path: Path) -> None:
    file = tmp_path / "m.toml"
    file.write_text("x = [" + ", ".join(["0.1"] * 1000) + "]\n")
    assert len(read_toml(file)["x"]) == 1000


@pytest.mark.parametrize("suffix", [".mcap", ".db3"])
def test_recordings_with_absurd_lengths_are_bad_input(tmp_path: Path, suffix: str) -> None:
    magic = b"\x89MCAP0\r\n"
    header = magic + b"\x01" + struct.pack("<Q", 2**62) + b"x" * 100
    footer = b"\x02" + struct.pack("<Q", 20) + struct.pack("<QQL", 2**61, 2**61, 0) + magic
    for n, content in enumerate(
        (header, header + footer, magic + footer, b"SQLite format 3\0" * 9)
    ):
        file = tmp_path / f"{n}{suffix}"
        file.write_bytes(content)
        with pytest.raises(InputError, match="expected a ROS 2 recording"), opened(file):
            pass


def test_names_do_nothing_in_a_spreadsheet_and_come_back_as_they_were(tmp_path: Path) -> None:
    names = [
        "=1+1",
        "+cmd|' /C calc'!A0",
        "-2+3",
        "@SUM(A1)",
        "\tx",
        "'=quoted",
        "'plain",
        "ok",
        "-5",
    ]
    file = tmp_path / "plan.csv"
    write_csv({"candidate": names, "=x": np.arange(float(len(names)))}, file)
    for line in file.read_text().splitlines():
        for cell in line.replace('"', "").split(","):
            assert cell[:1] not in "=+@\t" or not cell, line
    table = read_csv(file)
    assert table.text("candidate") == names
    assert list(table.columns) == ["candidate", "=x"]


def map_file(folder: Path, resolution: float, origin: tuple[float, float]) -> Path:
    file = folder / "m.npz"
    np.savez(file, elevation=np.zeros((9, 9)), resolution=resolution, origin=np.array(origin))
    return file


@pytest.mark.parametrize(
    ("resolution", "origin", "field"),
    [
        (1e-9, (0.0, 0.0), "resolution"),
        (1e6, (0.0, 0.0), "resolution"),
        (0.5, (1e12, 0.0), "origin"),
        (0.5, (0.0, -1e300), "origin"),
    ],
)
def test_maps_lie_on_this_earth(
    tmp_path: Path, resolution: float, origin: tuple[float, float], field: str
) -> None:
    file = map_file(tmp_path, resolution, origin)
    for read in (map_info, read_map):
        with pytest.raises(InputError, match=field):
            read(file)


def test_a_missing_name_of_an_effect_is_what_is_reported(tmp_path: Path) -> None:
    file = tmp_path / "m.toml"
    file.write_text(ATV + "\n[[effect]]\ntau = 0.3\n")
    with pytest.raises(InputError, match=r"effect\[0\].name: missing key"):
        read_model(file)
    file.write_text(ATV + '\n[[effect]]\nnme = "brake_lag"\n')
    with pytest.raises(InputError, match="did you mean name"):
        read_model(file)


@pytest.mark.parametrize(
    ("unit", "factor"), [("km/h", 3.6), ("mph", 1 / 0.44704), ("knots", 1 / 0.514444)]
)
def test_coefficients_of_another_unit_are_recognised(unit: str, factor: float) -> None:
    known = read_model(find_model("atv")).braking
    grades = np.linspace(-0.2, 0.2, 30)
    force = factor * (known.b_m * grades + known.b_b) + (factor - 1.0) * np.sin(grades)
    b_m, b_b = np.polyfit(grades, force, 1)
    learned = dataclasses.replace(known, b_m=float(b_m), b_b=float(b_b))
    with pytest.raises(InputError, match=f"log: column v: expected m/s, .* looks like .*{unit}"):
        refuse_unit(learned, known, grades, "log")
    refuse_unit(known, known, grades, "log")
    better = dataclasses.replace(known, b_b=1.8 * known.b_b)
    refuse_unit(better, known, grades, "log")


def test_stops_that_take_as_long_from_any_speed_are_no_brakes() -> None:
    known = read_model(find_model("husky")).braking
    ramps = dataclasses.replace(known, m_b=0.1, b_b=0.004)
    with pytest.raises(InputError, match=r"at rest, got 0.004: 0.1 from 1 m/s, 0.024 from 0.2 m/s"):
        refuse_ramps(ramps, "log")
    refuse_ramps(known, "log")
