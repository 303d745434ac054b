"""Samples of stops: extracted from streams, stored within a limit, damaged ones quarantined."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from slopewise.models.errors import InputError
from slopewise.services.discovery.stop_extractor import StopExtractor
from slopewise.services.discovery.stop_store import StopStore, StoredStop, read_stop, read_stops
from tests.services.robot_plant import ASPHALT, Vehicle


def stored(seed: int = 0, source: str = "robot") -> StoredStop:
    _, samples = Vehicle(seed=seed).stop(ASPHALT, 2.0)
    return StoredStop(
        source=source,
        surface="",
        at=100.0 + seed,
        vehicle="v",
        model="m",
        columns=list(samples),
        values=np.stack(list(samples.values())),
    )


def in_pieces(samples: dict[str, np.ndarray], size: int) -> list[dict[str, np.ndarray]]:
    n = len(samples["t"])
    return [{k: v[a : a + size] for k, v in samples.items()} for a in range(0, n, size)]


def drives(count: int = 3) -> dict[str, np.ndarray]:
    """Stops one after the other, standing still for two seconds after each."""
    vehicle = Vehicle(seed=4)
    parts: list[dict[str, np.ndarray]] = []
    begin = 0.0
    for _ in range(count):
        _, samples = vehicle.stop(ASPHALT, 2.0)
        t = np.arange(len(samples["t"]) + 100) / vehicle.rate
        longer = {k: np.pad(v, (0, 100), "edge") for k, v in samples.items()}
        parts.append({**longer, "t": begin + t})
        begin += float(t[-1]) + 1.0 / vehicle.rate
    return {k: np.concatenate([p[k] for p in parts]) for k in parts[0]}


@pytest.mark.parametrize("size", [1, 7, 60, 10_000])
def test_every_stop_is_extracted_once_from_messages_of_any_size(size: int) -> None:
    extractor, stops = StopExtractor(), list[dict[str, np.ndarray]]()
    samples = drives()
    for piece in in_pieces(samples, size):
        stops += extractor.add_samples("robot", piece)
    assert len(stops) == 3
    for cut in stops:
        t, v, command = (cut[n] for n in ("t", "v", "v_cmd"))
        (edge,) = np.flatnonzero((command[1:] <= 0.01) & (command[:-1] > 0.01)) + 1
        begin, rest = t[edge], t[edge + np.argmax(v[edge:] <= 0.02)]
        # As much before and after as there was.
        assert begin - t[0] >= 0.9
        assert begin - t[0] <= 1.51
        assert t[-1] - rest == pytest.approx(1.0, abs=0.03)
        assert np.isin(t, samples["t"]).all()


def test_an_incomplete_stop_is_excluded_and_the_next_is_not() -> None:
    samples = drives(1)
    t, moving = samples["t"], samples["v"] > 0.05
    middle = 0.5 * (t[np.argmax(samples["v_cmd"] <= 0.01)] + t[moving][-1])
    gap = {k: v[(t < middle) | (t > middle + 0.6)] for k, v in samples.items()}
    aborted = {**samples, "v_cmd": np.where(t > middle, 2.0, samples["v_cmd"])}
    slow = {**samples, "v": 0.1 * samples["v"]}
    for incomplete in (gap, aborted, slow):
        extractor = StopExtractor()
        assert extractor.add_samples("robot", incomplete) == []
        later = {**samples, "t": t + 60.0}
        assert len(extractor.add_samples("robot", later)) == 1


def test_a_restarted_clock_and_other_columns_start_another_stream() -> None:
    samples = drives(1)
    first, second = in_pieces(samples, len(samples["t"]) // 2 + 1)
    extractor = StopExtractor()
    assert extractor.add_samples("robot", second) == []
    assert extractor.add_samples("robot", {**first, "roll": 0.0 * first["t"]}) == []
    assert extractor.add_samples("robot", second) == []
    assert extractor.add_samples("other", first) == []
    assert len(extractor.add_samples("other", second)) == 1


def test_a_stored_stop_is_read_unchanged(tmp_path: Path) -> None:
    store = StopStore(tmp_path / "a" / "stops", 1_000_000, Counter())
    stop = stored(source="robot ä")
    store.put(stop)
    (name,) = store.latest(10)
    back = read_stop(store.folder / name)
    np.testing.assert_array_equal(back.values, stop.values)
    assert (back.source, back.columns, back.at) == (stop.source, stop.columns, stop.at)
    assert store.counters["stops_kept"] == 1


def test_the_oldest_are_deleted_and_numbers_continue(tmp_path: Path) -> None:
    store = StopStore(tmp_path, 60_000, Counter())
    for seed in range(30):
        store.put(stored(seed))
    times = [read_stop(tmp_path / name).at for name in store.latest(100)]
    assert sum(f.stat().st_size for f in tmp_path.iterdir()) <= 60_000
    assert 3 < len(times) < 30
    assert times == sorted(times)
    assert times[-1] == 129.0
    again = StopStore(tmp_path, 60_000, Counter())
    assert again.latest(100) == store.latest(100)
    again.put(stored(30))
    assert read_stop(tmp_path / again.latest(1)[0]).at == 130.0


def test_damaged_files_are_quarantine_and_counted_and_others_read(tmp_path: Path) -> None:
    store = StopStore(tmp_path, 1_000_000, Counter())
    for seed in range(8):
        store.put(stored(seed))
    names = store.latest(10)
    content = bytearray((tmp_path / names[2]).read_bytes())
    content[len(content) // 2] ^= 1
    (tmp_path / names[2]).write_bytes(content)
    (tmp_path / names[4]).write_bytes(b"")
    for name in names[5:7]:
        (tmp_path / name).write_bytes((tmp_path / name).read_bytes()[:-1])
    (tmp_path / names[7]).unlink()
    stops, damaged, data = read_stops(tmp_path, names)
    assert damaged == [names[i] for i in (2, 4, 5, 6)]
    assert [s.at for s in stops] == [100.0, 101.0, 103.0]
    assert data == read_stops(tmp_path, [names[i] for i in (0, 1, 3)])[2]
    assert data != read_stops(tmp_path, names[:2])[2]
    store.quarantine(damaged)
    assert store.counters["stops_damaged"] == 4
    assert len(list(tmp_path.glob("*.damaged"))) == 3
    assert store.latest(10) == [names[i] for i in (0, 1, 3, 7)]


def test_a_place_that_is_no_folder_is_reported_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="expected a folder") as caught:
        StopStore(tmp_path / "file" / "stops", 1000, Counter())
    assert len(str(caught.value).splitlines()) == 1
