"""Signatures on BorealTC: what is told of runs, and of grounds, that took no part in training.

    python examples/borealtc_unseen.py path/to/borealtc [--part chosen|kept|all] [--baseline]

Pieces of five seconds, no overlap, at least three of them driven; stuck ones count. Settings were
chosen on the part `chosen` alone (runs whose number leaves another rest than 2 by 4); `kept` are
the other runs, told by models of all runs but the one asked about. With --baseline a forest of
gradient-boosted trees on the means and spreads of the raw channels goes through the same splits.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import borealtc
import numpy as np
from numpy.typing import NDArray

from slopewise import read_model
from slopewise.models.terrain.classifier import NONE, Classification
from slopewise.models.terrain.reliability import expected_calibration_error
from slopewise.models.terrain.signature import SecondSettings, Signature, second_of, signature_of
from slopewise.models.terrain.signature_fit import fit
from slopewise.models.terrain.signature_memory import SignatureMemory
from slopewise.models.terrain.signature_model import SignatureModel

CHANNELS = (
    "v_left",
    "v_right",
    "current_left",
    "current_right",
    "pitch",
    "yaw_rate",
    "roll_rate",
    "pitch_rate",
    "accel_x",
    "accel_y",
    "accel_z",
)
_MODEL = Path(__file__).with_name("borealtc.toml")
_SECOND, _SECONDS = 100, 5


class Run(NamedTuple):
    """One run: its signatures, and the samples (100 Hz) behind each."""

    name: str
    terrain: str
    signatures: list[Signature]
    pieces: list[NDArray[np.float64]]

    @property
    def kept(self) -> bool:
        """Was the run kept away from all choices?"""
        return int(self.name[-2:]) % 4 == 2


def load(folder: Path) -> list[Run]:
    """All runs that tell something."""
    settings = SecondSettings.of(read_model(_MODEL).vehicle, 0.03, 0.04)
    runs = []
    for name, terrain, wheels, inertial in borealtc.runs(folder):
        columns = borealtc.read_run(name, terrain, wheels, inertial)
        samples = np.column_stack([np.asarray(columns[key]) for key in CHANNELS])
        signatures, pieces = [], []
        step = _SECOND * _SECONDS
        for begin in range(0, len(samples) - step + 1, step):
            piece = samples[begin : begin + step]
            seconds = [second_of(part, settings) for part in np.split(piece, _SECONDS)]
            if found := signature_of([second for second in seconds if second is not None]):
                signatures.append(found)
                pieces.append(piece)
        if signatures:
            runs.append(Run(name, terrain, signatures, pieces))
    return runs


def model_of(runs: Sequence[Run]) -> SignatureModel:
    """A model of some runs."""
    rows = [(s, run.terrain, run.name) for run in runs for s in run.signatures]
    signatures, labels, names = zip(*rows, strict=True)
    return fit(signatures, labels, names)


def told(model: SignatureModel, run: Run, *, remember: bool = True) -> list[Classification]:
    """Answers for a run, piece by piece, with or without what it told before."""
    memory = SignatureMemory(model)
    answers = []
    for signature in run.signatures:
        if not remember:
            memory.begin()
        answers.append(memory.update(signature))
    return answers


def balanced(truth: Sequence[str], answers: Sequence[str]) -> tuple[float, dict[str, float]]:
    """Mean share of right answers over the classes, and the share of each."""
    found, said = np.array(truth), np.array(answers)
    by = {name: float(np.mean(said[found == name] == name)) for name in dict.fromkeys(truth)}
    return float(np.mean(list(by.values()))), by


def leave_one_run_out(asked: Sequence[Run], runs: Sequence[Run]) -> None:
    """Print how each run is told by a model of all others."""
    truth, own, remembered, sure, right = [], [], [], [], []
    run_truth, run_told, wrong, refused = [], [], [], 0
    for run in asked:
        model = model_of([other for other in runs if other is not run])
        alone, together = told(model, run, remember=False), told(model, run)
        closed = [max(model.classes, key=lambda c: a.probabilities[c]) for a in alone]
        own += closed
        remembered += [a.name for a in together]
        truth += [run.terrain] * len(alone)
        sure += [a.probability for a in together]
        right += [a.name == run.terrain for a in together]
        refused += sum(a.name == NONE for a in together)
        last = max(model.classes, key=lambda c: together[-1].probabilities[c])
        usual = max(
            model.classes, key=lambda c: sum(np.log(a.probabilities[c] + 1e-3) for a in alone)
        )
        run_truth.append(run.terrain)
        run_told.append(usual)
        if usual != run.terrain:
            wrong.append(f"{run.name} {usual} (at its end {last})")
    _print("pieces alone, one of the classes", truth, own)
    _print("pieces with the run so far, none of these counts as wrong", truth, remembered)
    known = [i for i, name in enumerate(remembered) if name != NONE]
    _print("  of those answered", [truth[i] for i in known], [remembered[i] for i in known])
    _print("runs", run_truth, run_told)
    print("  runs told wrong:", "; ".join(wrong))
    error = expected_calibration_error(np.array(sure), np.array(right))
    print(
        f"expected calibration error {error:.3f}; p > 0.9 in {np.mean(np.array(sure) > 0.9):.2f}"
        f", of these right {np.mean(np.array(right)[np.array(sure) > 0.9]):.3f}"
    )
    print(f"known ground called none of these: {refused / len(truth):.3f}")


def leave_one_class_out(asked: Sequence[Run], runs: Sequence[Run]) -> None:
    """Print how ground of a class that took no part is told."""
    shares = []
    for name in dict.fromkeys(run.terrain for run in runs):
        model = model_of([run for run in runs if run.terrain != name])
        answers = [a for run in asked if run.terrain == name for a in told(model, run)]
        share = float(np.mean([a.name == NONE for a in answers]))
        sure = float(np.mean([a.name != NONE and a.probability > 0.9 for a in answers]))
        shares.append(share)
        print(
            f"  {name:11s} left out: none of these {share:.2f} of {len(answers)}, "
            f"a known class with p > 0.9 {sure:.2f}"
        )
    print(f"  mean over classes {np.mean(shares):.3f}")


def baseline(asked: Sequence[Run], runs: Sequence[Run]) -> None:
    """Print a forest of gradient-boosted trees on raw windows, same splits."""
    from sklearn.ensemble import HistGradientBoostingClassifier

    truth, said, run_truth, run_told = [], [], [], []
    for run in asked:
        others = [other for other in runs if other is not run]
        x = np.array([_raw(piece) for other in others for piece in other.pieces])
        y = [other.terrain for other in others for _ in other.pieces]
        forest = HistGradientBoostingClassifier(
            max_iter=60, min_samples_leaf=10, class_weight="balanced", random_state=0
        ).fit(x, y)
        share = forest.predict_proba(np.array([_raw(piece) for piece in run.pieces]))
        said += [str(name) for name in forest.classes_[share.argmax(axis=1)]]
        truth += [run.terrain] * len(share)
        run_truth.append(run.terrain)
        run_told.append(str(forest.classes_[np.log(share + 1e-3).sum(axis=0).argmax()]))
    _print("gradient-boosted trees on raw windows, pieces", truth, said)
    _print("gradient-boosted trees on raw windows, runs", run_truth, run_told)


def _raw(piece: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean, spread, extremes of each channel and of its steps from sample to sample."""
    steps = np.diff(piece, axis=0)
    parts = (piece.mean(0), piece.std(0), piece.min(0), piece.max(0), steps.std(0))
    return np.concatenate(parts)


def _print(what: str, truth: Sequence[str], answers: Sequence[str]) -> None:
    mean, by = balanced(truth, answers)
    words = ", ".join(f"{name} {share:.2f}" for name, share in by.items())
    print(f"{what}: balanced {mean:.3f} of {len(truth)}; {words}", flush=True)


def main() -> None:
    """Print everything."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--part", choices=("chosen", "kept", "all"), default="all")
    parser.add_argument("--baseline", action="store_true")
    options = parser.parse_args()
    runs = load(options.folder)
    if options.part == "chosen":
        runs = [run for run in runs if not run.kept]
    asked = [run for run in runs if run.kept] if options.part == "kept" else runs
    print(f"{len(asked)} runs asked, of {len(runs)} that models are made of")
    leave_one_run_out(asked, runs)
    leave_one_class_out(asked, runs)
    if options.baseline:
        baseline(asked, runs)


if __name__ == "__main__":
    main()
