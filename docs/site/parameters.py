"""References of files and messages, made from the schemas that read them: unit, range, default."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Iterator
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
import numpy as np

from slopewise.models.input_errors import Tracking
from slopewise.models.parameters import Braking, Effect, Limits, Terrain
from slopewise.models.quantity import describe_plausible, describe_range
from slopewise.models.steering import Steering
from slopewise.models.surface_braking import SurfaceBraking, UphillBraking
from slopewise.models.vehicle import Vehicle
from slopewise.services.discovery import investigation_process
from slopewise.services.guard import zenoh_transport
from slopewise.services.io.topics import Channel, MapSource, PathSource
from slopewise.services.ros.settings import EdgeSettings
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire import model_proposal, observations, parameter_messages, plan_messages
from slopewise.services.wire.codec import schema_of

_HEAD = "| key | unit and range | default | what |\n|---|---|---|---|\n"


def model_page() -> str:
    """Keys of a model file, and effects."""
    tables = (
        ("vehicle", Vehicle),
        ("braking", Braking),
        ("braking.uphill", UphillBraking),
        ("braking.terrain.NAME", SurfaceBraking),
        ("terrain", Terrain),
        ("limits", Limits),
        ("steering", Steering),
        ("tracking", Tracking),
    )
    parts = [
        "# Model file\n",
        "TOML, in SI units and radians. A key that is not known is an error that names it. What\n"
        "each number means: [nomenclature](../nomenclature.md); where the laws are from:\n"
        "[references](../references.md).\n",
        f"## Top\n\n{_HEAD}| `name` | text | required | Of the vehicle. |\n",
    ]
    parts += [f"## [{name}]\n\n{_lead(kind)}\n\n{_table(kind)}\n" for name, kind in tables]
    parts += [
        f"## [[effect]]\n\n{_lead(Effect)}\n\n{_table(Effect)}\n",
        "Names and parameters of all effects: [effects](effects.md).\n",
    ]
    return "\n".join(parts)


def service_page() -> str:
    """Keys of the service's settings."""
    intro = (
        "What `slopewise serve --config FILE` reads; `configs/service.toml` is the shipped one.\n"
    )
    return "\n".join(["# Service settings\n", intro, *_settings(ServiceConfig)])


def edge_page() -> str:
    """Keys of the edge's settings, and of topic mappings."""
    intro = "What `slopewise ros --config ros.toml` reads; `configs/ros.toml` is the shipped one.\n"
    return "\n".join(
        [
            "# ROS 2 settings\n",
            intro,
            *_settings(EdgeSettings),
            "# Topic mapping\n",
            "What `--topics` reads for recordings; `configs/topics.toml` is the shipped one.\n",
            f"## [map]\n\n{_lead(MapSource)}\n\n{_table(MapSource)}\n",
            f"## [paths]\n\n{_lead(PathSource)}\n\n{_table(PathSource)}\n",
            f"## [COLUMN]\n\n{_lead(Channel)}\n\n{_table(Channel)}\n",
        ]
    )


def messages_page() -> str:
    """Schemas of what travels over zenoh."""
    parts = [
        "# Messages\n",
        "Keys below the namespace, JSON (`application/json`) or MessagePack\n"
        "(`application/msgpack`), the schema's name behind it in the encoding.\n",
        "| key | what |\n|---|---|",
        "| `v1/plan` | queryable: `PlanRequest` to `PlanReply` |",
        "| `v1/map` | in: `MapUpdate` |",
        "| `v1/obs/stop`, `v1/obs/drive`, `v1/obs/terrain` | in: observations, put or queried |",
        "| `v1/params`, `v1/params/GROUP` | queryable and published: parameters |",
        "| `v1/params/set`, `v1/params/rollback`, `v1/params/adopt` | queryable: changes |",
        "| `v1/discrepancy` | queryable: findings in stored stops, an investigation |",
        "| `v1/status` | out: `ServiceStatus`, JSON |",
        "| `v1/guard/command`, `v1/guard/motion`, `v1/guard/clear`, `v1/guard/confirm` | in: "
        "`GuardCommand`, `GuardMotion`, `GuardClear`, `GuardConfirm`; of a guard without ROS 2 |",
        "| `v1/guard/output` | out: `GuardOutput`, JSON; of a guard without ROS 2 |",
        "| `v1/guard/status` | out: `GuardStatus`, JSON |",
        "| `v1/alive/ID` | liveliness token |\n",
    ]
    modules = (
        plan_messages,
        observations,
        parameter_messages,
        model_proposal,
        investigation_process,
        zenoh_transport,
    )
    for module in modules:
        for _, kind in inspect.getmembers(module, _is_message):
            if kind.__module__ != module.__name__ or not kind.__struct_fields__:
                continue
            parts.append(f"## {kind.__name__}\n\n`{schema_of(kind)}` – {_lead(kind)}\n")
            parts.append(f"| field | type | default | what |\n|---|---|---|---|\n{_fields(kind)}\n")
    return "\n".join(parts)


def _is_message(kind: Any) -> bool:
    return inspect.isclass(kind) and issubclass(kind, plan_messages.Message)


def _settings(kind: Any) -> Iterator[str]:
    """The top table, and one for each table in it."""
    inner = {f.name: f.type for f in dataclasses.fields(kind)}
    hints = get_type_hints(kind)
    tables = [name for name in inner if dataclasses.is_dataclass(hints[name])]
    if len(tables) < len(inner):
        yield f"## Top\n\n{_table(kind, leave_out=tables)}\n"
    for name in tables:
        yield f"## [{name}]\n\n{_lead(hints[name])}\n\n{_table(hints[name])}\n"


def _table(kind: Any, leave_out: list[str] | None = None) -> str:
    texts, hints = _attributes(kind), get_type_hints(kind)
    rows = []
    for field in dataclasses.fields(kind):
        if field.name in (leave_out or ()):
            continue
        metadata = field.metadata
        expected = describe_range(metadata) if "unit" in metadata else _kind(hints[field.name])
        if "unit" in metadata and (plausible := describe_plausible(metadata)):
            expected += f", plausible {plausible}"
        expected = expected.removeprefix("a finite number ").replace(">=", "≥").replace("<=", "≤")
        text = metadata.get("text") or texts.get(field.name, "")
        rows.append(f"| `{field.name}` | {_cell(expected)} | {_default(field)} | {_cell(text)} |")
    return _HEAD + "\n".join(rows)


def _default(field: Any) -> str:
    if field.default is not dataclasses.MISSING:
        return "optional" if field.default is None else f"`{_toml(field.default)}`"
    if field.default_factory is not dataclasses.MISSING:
        default = field.default_factory()
        return "optional" if not default else f"`{_toml(default)}`"
    return "required"


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple | list):
        return f"[{', '.join(_toml(item) for item in value)}]"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _kind(hint: Any) -> str:
    text = str(hint)
    if "Literal" in text:
        return ", ".join(f'"{choice}"' for choice in get_args(hint))
    for piece, name in (
        ("dict", "table"),
        ("tuple", "list"),
        ("bool", "true or false"),
        ("str", "text"),
    ):
        if piece in text:
            return name
    return "number" if "float" in text or "int" in text else "table"


def _fields(kind: Any) -> str:
    texts = {
        name: text for base in reversed(kind.__mro__) for name, text in _attributes(base).items()
    }
    rows = []
    for field in msgspec.structs.fields(kind):
        if field.default is not msgspec.NODEFAULT:
            default = "null" if field.default is None else f"`{_toml(field.default)}`"
        else:
            default = "required" if field.required else "empty"
        rows.append(
            f"| `{field.encode_name}` | {_cell(_wire(field.type))} | {default} | "
            f"{_cell(texts.get(field.name, ''))} |"
        )
    return "\n".join(rows)


def _wire(hint: Any) -> str:
    """Type of a field of a message; messages by their names."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return _wire(arguments[0])
    if origin in (Union, UnionType):
        return " or ".join(map(_wire, arguments))
    if origin is Literal:
        return " or ".join(f"`{choice}`" for choice in arguments)
    if origin is not None:
        return f"{origin.__name__}[{', '.join(map(_wire, arguments))}]"
    return {np.ndarray: "array", str: "text", NoneType: "null"}.get(hint, hint.__name__)


def _lead(kind: Any) -> str:
    """The first paragraph of a docstring."""
    return " ".join((inspect.getdoc(kind) or "").split("\n\n")[0].split()).replace("``", "`")


def _attributes(kind: Any) -> dict[str, str]:
    """Description of each attribute, from the comment on it or the docstring.

    Several may share a sentence.
    """
    text = inspect.getdoc(kind) or ""
    source = inspect.getsource(kind) if kind.__module__.startswith("slopewise") else ""
    comments = re.findall(r"(?m)^    (\w+): [^#\n]*# (?!words: ok)(.*?)(?:; words: ok)?$", source)
    body = " ".join(
        note if re.match(r"\w+(, \w+)+: ", note) else f"{name}: {note}" for name, note in comments
    )
    if "Attributes:" in text:
        body = " ".join([body, *text.split("Attributes:", 1)[1].split()])
    if not body:
        return {}
    names = "|".join(sorted(get_type_hints(kind, include_extras=True), key=len, reverse=True))
    starts = list(re.finditer(rf"(?:^|(?<=\s))((?:{names})(?:, (?:{names}))*): ", body))
    ends = [match.start() for match in starts[1:]] + [len(body)]
    texts: dict[str, str] = {}
    for match, end in zip(starts, ends, strict=True):
        for name in match[1].split(", "):
            sentence = body[match.end() : end].strip().rstrip(";")
            # Names of types keep their case.
            plain = sentence.split(" ", 1)[0].isalpha()
            texts[name] = sentence[:1].upper() + sentence[1:] if plain else sentence
    return texts


def _cell(text: str) -> str:
    return text.replace("``", "`").replace("|", "&#124;").replace("<", "&lt;").replace("[", r"\[")
