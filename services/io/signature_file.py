"""Signature files: classes as training runs show them, as JSON in the folder of a terrain file."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.terrain.signature import DRIVING_NAMES, FEATURE_NAMES
from slopewise.models.terrain.signature_model import LinearPicture, NormalPicture, SignatureModel
from slopewise.services.io.files import fault, write_atomic

_VERSION = 1  # Version of the file's format
_NUMBERS = ("temperature", "threshold", "known_refused")


def write_signatures(model: SignatureModel, path: Path) -> None:
    """Write, all or nothing; :func:`read_signatures` gives the same again."""
    content = {
        "version": _VERSION,
        "features": [n for n, used in zip(FEATURE_NAMES, model.used, strict=True) if used],
        "driving": list(DRIVING_NAMES),
        "classes": list(model.classes),
        "runs": list(model.runs),
        **{name: getattr(model, name) for name in _NUMBERS},
        "centre": model.centre.tolist(),
        "width": model.width.tolist(),
        "linear": _lists(model.linear),
        "normal": _lists(model.normal),
    }
    write_atomic(path, (json.dumps(content, ensure_ascii=False) + "\n").encode())


def _lists(picture: LinearPicture | NormalPicture) -> dict[str, Any]:
    return {f.name: getattr(picture, f.name).tolist() for f in dataclasses.fields(picture)}


def read_signatures(path: Path) -> SignatureModel:
    """The model of a signature file."""
    try:
        content = json.loads(path.read_text("utf-8"))
    except OSError as error:
        raise fault(path, "", f"expected a signature file, got {error.strerror}") from None
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise fault(path, "", f"expected JSON, got {error}") from None
    if not isinstance(content, dict) or content.get("version") != _VERSION:
        raise fault(path, "version", f"expected a signature file of version {_VERSION}")
    return _Reader(path, content).model()


@dataclasses.dataclass(frozen=True, slots=True)
class _Reader:
    """Checks what it reads: sizes, numbers that are finite, names that are known."""

    path: Path
    content: dict[str, Any]

    def model(self) -> SignatureModel:
        features = self._names("features", set(FEATURE_NAMES))
        if self._names("driving", set(DRIVING_NAMES)) != DRIVING_NAMES:
            raise fault(self.path, "driving", f"expected {', '.join(DRIVING_NAMES)}")
        if features != tuple(name for name in FEATURE_NAMES if name in features):
            raise fault(self.path, "features", "expected them once each, in their usual order")
        classes = self._names("classes", None)
        f, d, c = len(features), len(DRIVING_NAMES), len(classes)
        q = f + d
        linear = {
            "fill": (q,),
            "scale": (q,),
            "weights": (c, q),
            "intercept": (c,),
            "means": (c, q),
            "precision": (q, q),
        }
        normal = {
            "mean": (c, f),
            "slopes": (d, f),
            "usual": (d,),
            "spread": (f,),
            "correlation": (f, f),
            "doubt": (c, f),
        }
        return SignatureModel(
            classes=classes,
            runs=tuple(self._array("runs", (c,)).astype(int).tolist()),
            used=np.array([name in features for name in FEATURE_NAMES]),
            linear=LinearPicture(**{k: self._array(f"linear.{k}", s) for k, s in linear.items()}),
            normal=NormalPicture(**{k: self._array(f"normal.{k}", s) for k, s in normal.items()}),
            centre=self._array("centre", (2,)),
            width=self._array("width", (2,)),
            **{name: float(self._array(name, ())) for name in _NUMBERS},
        )

    def _names(self, key: str, known: set[str] | None) -> tuple[str, ...]:
        names = self.content.get(key)
        if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
            raise fault(self.path, key, "expected names")
        for name in names:
            if names.count(name) > 1 or (known is not None and name not in known):
                raise fault(self.path, key, f"expected known names once each, got {name}")
        return tuple(names)

    def _array(self, key: str, shape: tuple[int, ...]) -> np.ndarray[Any, np.dtype[np.float64]]:
        value: Any = self.content
        for part in key.split("."):
            value = value.get(part) if isinstance(value, dict) else None
        try:
            array = np.array(value, np.float64)
        except (TypeError, ValueError):
            raise fault(self.path, key, "expected numbers") from None
        if array.shape != shape or not np.isfinite(array).all():
            size = " by ".join(map(str, shape)) or "one"
            raise fault(self.path, key, f"expected {size} finite numbers")
        return array
