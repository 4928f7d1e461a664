"""The shape of a mission file: its fields, their units, and what to say when one is wrong.

Pydantic checks the shape and the types here, at the edge, and prints the JSON Schema. Bounds are
checked by `swarmbid.model` alone; the schema repeats them for editors. Importing this module costs
0.1 s, so `swarmbid.missionfile` does it on demand.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError

from swarmbid.errors import nearest
from swarmbid.missiontext import Path

Number = Annotated[float, Field(strict=True)]
AltitudeReference = Literal["rel_home", "amsl", "terrain_agl", "wgs84_ellipsoid"]

# Bounds as JSON Schema states them.
_ABOVE_0: dict[str, Any] = {"exclusiveMinimum": 0}
_FROM_0: dict[str, Any] = {"minimum": 0}
_FROM_1: dict[str, Any] = {"minimum": 1}
_ID: dict[str, Any] = {"pattern": "^[A-Za-z0-9_][A-Za-z0-9._-]{0,63}$"}


def _field(default: Any, text: str, unit: str = "", bounds: dict[str, Any] | None = None) -> Any:
    extra: dict[str, Any] = dict(bounds or {})
    if unit:
        extra["x-unit"] = unit
    return Field(default, description=f"{text}, in {unit}." if unit else f"{text}.", json_schema_extra=extra)


class Spec(BaseModel):
    """Base of every part of the file: no unknown fields, no silent conversions."""

    model_config = ConfigDict(extra="forbid", strict=True)


class GeodeticSpec(Spec):
    """A place by WGS 84 latitude and longitude; the file then has an `origin`."""

    latitude: Number = _field(..., "North positive", "degrees", {"minimum": -90, "maximum": 90})
    longitude: Number = _field(..., "East positive", "degrees", {"minimum": -180, "maximum": 180})
    altitude: Number = _field(..., "Above what the origin's altitude_reference names", "m")
    altitude_reference: AltitudeReference | None = _field(
        None, "If given, it must be the origin's: references are never mixed or converted"
    )


class OriginSpec(Spec):
    """Where on Earth the local position [0, 0, 0] is."""

    latitude: Number = _field(..., "North positive", "degrees", {"minimum": -90, "maximum": 90})
    longitude: Number = _field(..., "East positive", "degrees", {"minimum": -180, "maximum": 180})
    altitude: Number = _field(..., "Above what altitude_reference names", "m")
    altitude_reference: AltitudeReference = _field(
        ...,
        "What every altitude of this file counts from: rel_home (take-off point), amsl (mean sea level), "
        "terrain_agl (ground below) or wgs84_ellipsoid",
    )


def _form(value: Any) -> str | None:
    if isinstance(value, dict | GeodeticSpec):
        return "geodetic"
    return "local" if isinstance(value, list) else None


LocalPosition = Annotated[
    list[Number],
    Field(min_length=3, max_length=3, description="[east, north, up] from the origin, in m."),
]
PositionSpec = Annotated[
    Annotated[LocalPosition, Tag("local")] | Annotated[GeodeticSpec, Tag("geodetic")], Discriminator(_form)
]


class AgentSpec(Spec):
    """A robot: where it is, how fast it moves, what it carries."""

    id: str = _field(..., "Its name, unique in the file", bounds=_ID)
    position: PositionSpec = _field(..., "Where it is at available_at")
    type: str = _field("agent", "Any name; see `compatible`")
    speed: Number = _field(1.0, "How fast it moves", "m/s", _ABOVE_0)
    available_at: Number = _field(0.0, "It does not move before", "s", _FROM_0)
    fuel_per_metre: Number = _field(0.0, "Score lost for each metre flown", "score/m", _FROM_0)
    range: Number | None = _field(None, "Most it may fly in all, the way back included", "m", _ABOVE_0)
    endurance: Number | None = _field(None, "Time from available_at until it is back", "s", _ABOVE_0)
    equipment: list[str] = _field([], "Names of what it carries")
    bundle_limit: int | None = _field(None, "Most tasks it takes at once; no limit if left out", "", _FROM_1)
    base: PositionSpec | None = _field(None, "Where it must be able to return to; nowhere if left out")


class TaskSpec(Spec):
    """A job: where, when, what it pays and what it needs."""

    # No seats by number: then the equipment says how many, so there must be some.
    model_config = ConfigDict(
        json_schema_extra={
            "if": {"properties": {"agents_required": {"const": 0}}, "required": ["agents_required"]},
            "then": {"properties": {"equipment": {"minItems": 1}}, "required": ["equipment"]},
        }
    )

    id: str = _field(..., "Its name, unique in the file", bounds=_ID)
    position: PositionSpec = _field(..., "Where it is done")
    type: str = _field("task", "Any name; see `compatible`")
    reward: Number = _field(1.0, "Score for doing it", "", _ABOVE_0)
    start: Number = _field(0.0, "Service may start from here on; early arrivals wait", "s", _FROM_0)
    end: Number | None = _field(None, "Service must have started by then; any time if left out", "s", _FROM_0)
    duration: Number = _field(0.0, "How long service takes", "s", _FROM_0)
    discount: Number = _field(0.0, "How fast the reward fades after start: reward·exp(-x)", "1/s", _FROM_0)
    agents_required: int = _field(
        1, "How many agents do it together; 0 for as many as its equipment takes", bounds=_FROM_0
    )
    equipment: list[str] = _field([], "Names of what those agents must bring between them")
    prerequisites: list[str] = _field([], "Ids of tasks that come first")
    revisit_at: Number | None = _field(None, "When a repeated visit is wanted", "s", _FROM_0)
    revisit_width: Number = _field(
        60.0, "How far from revisit_at the reward has fallen to 1/e", "s", _ABOVE_0
    )


class HeaderSpec(Spec):
    """Everything of a mission file but its agents and tasks."""

    version: Literal[1] = _field(1, "Version of this format")
    name: str = _field("mission", "For reports")
    origin: OriginSpec | None = _field(
        None, "Where on Earth [0, 0, 0] is; needed for latitudes and longitudes"
    )
    compatible: dict[str, list[str]] = _field(
        {}, "For each agent type the task types it may do; a type left out may do all"
    )
    distance_step: Number = _field(0.0, "Distances are rounded down to a multiple of it", "m", _FROM_0)


class MissionSpec(HeaderSpec):
    """A team of robots and its work, for swarmbid. Units are SI."""

    # Only the JSON Schema is made of the whole; files are checked item by item, and start sooner.
    model_config = ConfigDict(extra="forbid", strict=True, defer_build=True)

    agents: list[AgentSpec] = _field(..., "The team; [] for none")
    tasks: list[TaskSpec] = _field(..., "The work; [] for none")


KIND: dict[type[Spec], str] = {
    AgentSpec: "an agent",
    TaskSpec: "a task",
    OriginSpec: "an origin",
    GeodeticSpec: "a position",
    HeaderSpec: "a mission",
    MissionSpec: "a mission",
}

# What people call our fields elsewhere.
_SYNONYMS = {
    "lat": "latitude", "lon": "longitude", "lng": "longitude", "long": "longitude", "alt": "altitude",
    "velocity": "speed", "value": "reward", "score": "reward", "deadline": "end", "latest": "end",
    "earliest": "start", "service_time": "duration", "capabilities": "equipment", "sensors": "equipment",
    "depot": "base", "home": "base", "max_tasks": "bundle_limit", "capacity": "bundle_limit",
    "depends_on": "prerequisites", "requires": "prerequisites", "robots": "agents", "uavs": "agents",
    "vehicles": "agents", "jobs": "tasks", "targets": "tasks", "location": "position",
    "fuel": "fuel_per_metre", "agl": "terrain_agl", "msl": "amsl", "relative": "rel_home",
    "wgs84": "wgs84_ellipsoid", "ellipsoid": "wgs84_ellipsoid", "hae": "wgs84_ellipsoid",
}  # fmt: skip

# Unit found -> (unit wanted, factor).
_UNITS = {
    "m/s": ("m/s", 1.0), "km/h": ("m/s", 1 / 3.6), "kmh": ("m/s", 1 / 3.6), "kph": ("m/s", 1 / 3.6),
    "mph": ("m/s", 0.44704), "kn": ("m/s", 1852 / 3600), "kt": ("m/s", 1852 / 3600),
    "knots": ("m/s", 1852 / 3600), "ms": ("s", 0.001), "s": ("s", 1.0), "sec": ("s", 1.0),
    "min": ("s", 60.0), "minutes": ("s", 60.0), "h": ("s", 3600.0), "hours": ("s", 3600.0),
    "m": ("m", 1.0), "cm": ("m", 0.01), "km": ("m", 1000.0), "ft": ("m", 0.3048), "mi": ("m", 1609.344),
    "nmi": ("m", 1852.0), "°": ("degrees", 1.0), "deg": ("degrees", 1.0),
}  # fmt: skip
_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\D*?)\s*")


def meant_name(word: str, known: list[str]) -> str | None:
    """The name of `known` that `word` was most likely meant to be."""
    synonym = _SYNONYMS.get(word.lower())
    if synonym in known:
        return synonym
    return nearest(word.lower(), known)


def show(value: Any) -> str:
    """Show a value found, short enough for one line."""
    if value is None:
        return "empty"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list):
        return "a list"
    text = repr(value)
    return text if len(text) <= 50 else f"{text[:46]}...{text[-1]}"


@dataclass(frozen=True)
class ShapeFault:
    """One thing wrong with the shape or the types of an object.

    Parameters
    ----------
    path : below the object.
    of_key : the fault is in the name of the field, not in its value.
    """

    path: Path
    why: str
    mend: str
    of_key: bool = False


def explain(error: ValidationError, spec: type[Spec]) -> list[ShapeFault]:
    """Say Pydantic's findings about one object of `spec` in our words."""
    details = error.errors(include_url=False)
    faults = [_explain(detail, spec) for detail in details]
    # A field under a wrong name is not missing as well.
    meant = {
        (*fault.path[:-1], guess)
        for fault in faults
        if fault.of_key and (guess := meant_name(str(fault.path[-1]), _fields_at(spec, fault.path)))
    }
    return [
        fault
        for detail, fault in zip(details, faults, strict=True)
        if detail["type"] != "missing" or fault.path not in meant
    ]


def _explain(error: Any, spec: type[Spec]) -> ShapeFault:
    path: Path = _without_tags(error["loc"])
    found, problem = error["input"], error["type"]
    owner, field = _field_at(spec, path)
    if problem == "extra_forbidden":
        known = _fields_at(spec, path)
        guess = meant_name(str(path[-1]), known)
        mend = f"Did you mean {guess!r}?" if guess else f"It has {', '.join(known)}."
        return ShapeFault(path, f"is no field of {KIND[owner]}", mend, of_key=True)
    if problem == "missing":
        return ShapeFault(path, "is missing", f"Add it: {_lower(field.description)}")
    unit = (field.json_schema_extra or {}).get("x-unit", "") if field else ""
    if "position" in path or "base" in path:
        unit = unit or "m"
    why = f"is {show(found)}"
    if problem in ("float_type", "int_type", "int_from_float"):
        return ShapeFault(path, *_not_a_number(found, unit, whole=problem != "float_type"))
    if problem == "string_type":
        mend = f'Put it in quotes: "{show(found)}".' if isinstance(found, int | float) else "Give text."
        return ShapeFault(path, f"{why}, not text", mend)
    if problem == "list_type":
        mend = f"Write a list: [{found}]." if isinstance(found, str) else "Write a list: [a, b]."
        return ShapeFault(path, f"{why}, not a list", mend)
    if problem in ("too_short", "too_long"):
        return ShapeFault(path, f"has {len(found)} numbers", "Give three: [east, north, up] in m.")
    if problem.startswith("union_tag"):
        mend = "Give [east, north, up] in m, or {latitude, longitude, altitude} and an origin."
        return ShapeFault(path, f"{why}, not a position", mend)
    if problem == "literal_error":
        choices = [str(choice) for choice in get_args(AltitudeReference)] if path[-1] != "version" else ["1"]
        guess = meant_name(str(found), choices)
        mend = f"Did you mean {guess!r}?" if guess else f"Use one of {', '.join(choices)}."
        return ShapeFault(path, why, mend if len(choices) > 1 else "This program reads version 1.")
    # What is left are mappings: model_type, dict_type.
    return ShapeFault(
        path, f"{why}, not {KIND[owner] if not path else 'a mapping'}", "Give `name: value` pairs."
    )


def _without_tags(path: Path) -> Path:
    """Drop the name of the form, local or geodetic, that Pydantic puts after a position."""
    return tuple(
        step
        for before, step in zip(("", *path), path, strict=False)
        if before not in ("position", "base") or isinstance(step, int)
    )


def _field_at(spec: type[Spec], path: Path) -> tuple[type[Spec], Any]:
    """The spec that owns the last step of a path, and the field there (None if it has no such)."""
    below = {"origin": OriginSpec, "position": GeodeticSpec, "base": GeodeticSpec}
    owner = spec
    names = [step for step in path if isinstance(step, str)]
    if len(names) > 1 and names[0] in below:
        owner = below[names.pop(0)]
    return owner, owner.model_fields.get(names[0]) if names else None


def _fields_at(spec: type[Spec], path: Path) -> list[str]:
    owner, _ = _field_at(spec, path)
    return list((MissionSpec if owner is HeaderSpec else owner).model_fields)


def _not_a_number(found: Any, unit: str, *, whole: bool) -> tuple[str, str]:
    wanted = "a whole number" if whole else f"a plain number of {unit}" if unit else "a plain number"
    if whole and isinstance(found, float | bool):
        return f"is {show(found)}, not a whole number", "Give a whole number."
    quantity = _QUANTITY.fullmatch(found) if isinstance(found, str) else None
    if quantity is None:
        return f"is {show(found)}, not a number", f"Give {wanted}."
    number, found_unit = quantity.groups()
    if not found_unit:
        return f"is {show(found)}, which is text", f"Leave out the quotes: {number}."
    known, factor = _UNITS.get(found_unit.lower(), ("", 0.0))
    if known == unit and known:
        return f"is {show(found)}, text with a unit", f"Give {wanted}: {float(number) * factor:.6g}."
    return f"is {show(found)}, text with a unit", f"Give {wanted}."


def _lower(text: str) -> str:
    return text[0].lower() + text[1:]
