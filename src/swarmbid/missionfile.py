"""Mission files: YAML or JSON to a `Mission` and back, with every fault named by line and column.

A file gives positions in local metres, ``[east, north, up]``, or as ``{latitude, longitude, altitude}``
with an `origin` that says what altitudes count from. Reading goes: bytes, size, text, plain data
(`swarmbid.missiontext`), shape and types (`swarmbid.missionspec`), local metres (`swarmbid.geodesy`),
the model's own rules, and last the sense of the whole. A fault in one step does not hide those of the
next, so one run reports them all.
"""

from __future__ import annotations

import gc
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import MISSING, fields
from os import PathLike
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, TypeVar

from swarmbid.errors import Fault, InputError
from swarmbid.geodesy import FARTHEST, to_local
from swarmbid.missiontext import MAX_JSON_BYTES, MAX_YAML_BYTES, Path, Source, read
from swarmbid.model import Agent, Mission, Origin, Position, Task, distance, fewest_sets, mission_findings

if TYPE_CHECKING:
    from swarmbid.missionspec import GeodeticSpec, Spec

MAX_ITEMS = 100_000
"""Most agents and tasks of one file, together: ten times the largest mission that is tested."""

FORMAT_VERSION = 1

_LISTS = ("agents", "tasks")
_HERE: Position = (0.0, 0.0, 0.0)
_Made = TypeVar("_Made", Agent, Task, Origin, Mission)


def load_mission(path: str | PathLike[str]) -> Mission:
    """Read a mission file; the suffix says whether it is YAML or JSON, else its first character.

    Unlike a `Mission` made by a program, a file is refused when a task needs what no agent of it can
    bring: a running fleet may still be joined by such an agent, but in a file it is a slip of the pen.

    Raises
    ------
    InputError : with every fault of the file, as ``file:line:column: field: why. mend``.

    Examples
    --------
    >>> mission = load_mission("examples/quickstart.yaml")  # doctest: +SKIP
    >>> len(mission.agents), len(mission.tasks)  # doctest: +SKIP
    (3, 6)
    """
    name = str(path)
    text, as_json = _text(path, name)
    with _no_garbage_collection():
        return _Reading(read(text, name, as_json=as_json)).mission(servable=True)


def mission_from_dict(data: dict[str, Any], where: str = "mission") -> Mission:
    """Make a mission of plain data, such as the head of a trace; `where` names it in faults.

    Raises
    ------
    InputError : with every fault, as ``where: field: why. mend``.
    """
    return _Reading(Source(where, data)).mission(servable=False)


def mission_to_dict(mission: Mission) -> dict[str, Any]:
    """Return the mission as plain data for JSON, in local metres; `mission_from_dict` undoes it exactly.

    Fields at their defaults are left out; so JSON never meets an infinity.
    """
    data: dict[str, Any] = {"version": FORMAT_VERSION} | _plain(mission)
    data["agents"] = [_plain(agent) for agent in mission.agents]
    data["tasks"] = [_plain(task) for task in mission.tasks]
    return data


def mission_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of mission files, with units, for editors to complete from."""
    from swarmbid.missionspec import MissionSpec

    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | MissionSpec.model_json_schema()


def _plain(item: Mission | Agent | Task | Origin) -> dict[str, Any]:
    data: dict[str, Any] = {}
    for field in fields(item):
        value = getattr(item, field.name)
        default = field.default if field.default_factory is MISSING else field.default_factory()
        if field.name in ("agents", "tasks") or value == default:
            continue
        if isinstance(value, Origin):
            value = _plain(value)
        elif isinstance(value, dict):
            value = {key: sorted(value[key]) for key in sorted(value)}
        elif isinstance(value, frozenset):
            value = sorted(value)
        elif isinstance(value, tuple):
            value = list(value)
        data[field.name] = value
    return data


def _text(path: str | PathLike[str], name: str) -> tuple[str, bool]:
    """The text of a file, and whether to read it as JSON; refuses by size before anything is parsed."""

    def refuse(why: str, mend: str) -> InputError:
        return InputError([Fault(name, "", why, mend)])

    try:
        with FilePath(path).open("rb") as file:
            data = file.read(MAX_JSON_BYTES + 1)
    except IsADirectoryError:
        raise refuse("is a directory", "Give the mission file inside it.") from None
    except FileNotFoundError:
        raise refuse("does not exist", "Check the spelling of the path.") from None
    except (OSError, ValueError) as error:
        why = (getattr(error, "strerror", None) or str(error)).lower()
        raise refuse(f"cannot be read: {why}", "Check the path and your rights to it.") from None
    suffix = FilePath(path).suffix.lower()
    as_json = suffix == ".json" or (suffix not in (".yaml", ".yml") and data.lstrip()[:1] == b"{")
    cap = MAX_JSON_BYTES if as_json else MAX_YAML_BYTES
    if len(data) > cap:
        mend = "Split the mission." if as_json else "Write it as JSON, which may be larger, or split it."
        raise refuse(f"is larger than {cap // 2**20} MiB", mend)
    # Every agent and task has one; counting bytes takes no time, parsing them does.
    if data.count(b'"position"' if as_json else b"position:") > MAX_ITEMS:
        raise refuse(f"has more than {MAX_ITEMS:,} agents and tasks", "Split the mission.")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise refuse("is not text", "A mission is UTF-8 text in YAML or JSON.")
    if not text.strip():
        raise refuse("is empty", "A mission has `agents:` and `tasks:`.")
    return text, as_json


@contextmanager
def _no_garbage_collection() -> Iterator[None]:
    """Parsing makes millions of objects and no garbage; looking for some would take 3/4 of the time."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


class _Reading:
    """One source on its way to a mission."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.origin: Origin | None = None
        # Whether what agents are and carry can be trusted; if not, say nothing about what they lack.
        self.team_is_sound = True

    def mission(self, *, servable: bool) -> Mission:
        """Check everything and make the mission, or raise every fault."""
        from swarmbid.missionspec import AgentSpec, HeaderSpec, TaskSpec

        data = self.fields_of_mission()
        header = self.checked((), {k: v for k, v in data.items() if k not in _LISTS}, HeaderSpec)
        if header.get("origin") is not None:
            self.origin = self.made(Origin, ("origin",), dict(header["origin"]))
        agent_fields = self.items(data, "agents", AgentSpec)
        task_fields = self.items(data, "tasks", TaskSpec)
        self.place_on_map(data, {"agents": agent_fields, "tasks": task_fields})
        agents = [self.made(Agent, ("agents", i), item) for i, item in enumerate(agent_fields)]
        tasks = [self.made(Task, ("tasks", i), item) for i, item in enumerate(task_fields)]
        team = tuple(agent for agent in agents if agent is not None)
        work = tuple(task for task in tasks if task is not None)
        for finding in mission_findings(team, work):
            self.source.add(finding.path, finding.why, finding.mend)
        head = {key: value for key, value in header.items() if key not in ("version", "origin")}
        head["origin"] = self.origin
        rules = self.made(Mission, (), head | {"agents": (), "tasks": ()})
        if servable and rules is not None and self.team_is_sound and team:
            self.find_unservable(rules, team, work)
        self.source.done()
        return Mission(agents=team, tasks=work, **head)

    def fields_of_mission(self) -> dict[str, Any]:
        """The outermost mapping, if this is meant to be a mission at all."""
        from swarmbid.missionspec import meant_name, show

        data = self.source.data
        if not isinstance(data, dict):
            found = f"is no mission but {show(data)}"
        elif not any(meant_name(str(key), list(_LISTS)) for key in data):
            found = "is no mission: it has " + (
                ", ".join(str(key)[:40] for key in list(data)[:5]) or "nothing"
            )
        else:
            return data
        self.source.add((), found, "A mission has `agents:` and `tasks:`.")
        self.source.done()
        raise AssertionError("done() raises")

    def items(self, data: dict[str, Any], kind: str, spec: type[Spec]) -> list[dict[str, Any]]:
        """Check the shape of each agent or task; the faulty fields of one are left out or replaced."""
        from swarmbid.missionspec import meant_name

        if kind not in data and any(meant_name(str(key), [kind]) for key in data):
            return []  # the wrong name is the fault
        if kind not in data:
            self.source.add((kind,), "is missing", f"Add it; write `{kind}: []` for none.")
            return []
        raw = data[kind]
        if not isinstance(raw, list):
            self.source.add((kind,), "is not a list", f"Start each with a dash; `{kind}: []` for none.")
            return []
        if len(raw) > MAX_ITEMS:
            self.source.add((kind,), f"are {len(raw):,}, more than {MAX_ITEMS:,}", "Split the mission.")
            return []
        return [self.checked((kind, index), item, spec) for index, item in enumerate(raw)]

    def checked(self, path: Path, raw: Any, spec: type[Spec]) -> dict[str, Any]:
        """Check one mapping against its spec; return its right fields, and stand-ins for required ones."""
        from pydantic import ValidationError

        from swarmbid.missionspec import explain

        try:
            return _given(spec.model_validate(raw))
        except ValidationError as error:
            wrong = set()
            for fault in explain(error, spec):
                self.source.add((*path, *fault.path), fault.why, fault.mend, of_key=fault.of_key)
            # What is missing under its right name is there under a wrong one, and wrong as well.
            for detail in error.errors(include_url=False):
                wrong.add(detail["loc"][0] if detail["loc"] else "")
        if path[:1] == ("agents",) and wrong & {"", "type", "equipment"}:
            self.team_is_sound = False
        if "equipment" in wrong:
            wrong.add("agents_required")  # 0 of them is right or wrong by the equipment
        right = {key: raw[key] for key in raw if key not in wrong} if isinstance(raw, dict) else {}
        return _given(spec.model_validate(_stand_ins(path) | right))

    def made(self, kind: type[_Made], path: Path, values: dict[str, Any]) -> _Made | None:
        """Make one object; where the model refuses fields, note them and make it without."""
        try:
            return kind(**values)
        except InputError as error:
            self.refused(path, error.faults, values)
        return kind(**_stand_ins(path) | values) if len(path) == 2 else None

    def refused(self, path: Path, faults: list[Fault], values: dict[str, Any]) -> None:
        """Note what the model found wrong with the object at `path`, and take it out of `values`."""
        for fault in faults:
            steps = fault.field.split(".", 1)
            self.source.add((*path, *steps), fault.why, fault.mend)
            values.pop(steps[0], None)
            if steps[0] == "equipment":
                values.pop("agents_required", None)  # 0 of them is right or wrong by the equipment
            if path[:1] == ("agents",) and steps[0] in ("type", "equipment"):
                self.team_is_sound = False

    def place_on_map(self, data: dict[str, Any], groups: dict[str, list[dict[str, Any]]]) -> None:
        """Replace every latitude and longitude by local metres, all in one conversion."""
        from swarmbid.missionspec import GeodeticSpec

        found: list[tuple[Path, dict[str, Any], str]] = []
        for kind, items in groups.items():
            for index, item in enumerate(items):
                for name in ("position", "base"):
                    if isinstance(item.get(name), GeodeticSpec):
                        found.append(((kind, index, name), item, name))
        if found and self.origin is None and data.get("origin") is None:
            self.source.add(
                found[0][0],
                "is in latitude and longitude, but the file has no origin",
                "Add `origin: {latitude, longitude, altitude, altitude_reference}`.",
            )
        sound = []
        for path, item, name in found:
            point = item[name]
            item[name] = (0.0, 0.0, 0.0)
            if self.origin is not None and self.point_is_sound(path, point, self.origin):
                sound.append((path, item, name, (point.latitude, point.longitude, point.altitude)))
        if self.origin is None:
            return
        places = to_local([point for *_, point in sound], self.origin)
        for (path, item, name, _), place in zip(sound, places, strict=True):
            item[name] = place
            metres = distance(place, _HERE)
            if metres > FARTHEST:
                self.source.add(
                    path,
                    f"is {metres / 1000:,.0f} km from the origin",
                    f"Stay within {FARTHEST / 1000:.0f} km; are latitude and longitude swapped?",
                )

    def point_is_sound(self, path: Path, point: GeodeticSpec, origin: Origin) -> bool:
        """Check one latitude, longitude and altitude; a point obeys the rules of an origin."""
        reference = point.altitude_reference or origin.altitude_reference
        if reference != origin.altitude_reference:
            self.source.add(
                (*path, "altitude_reference"),
                f"is {reference!r}, but the origin's is {origin.altitude_reference!r}",
                "Use one for the whole mission; none is converted, for that takes a geoid or terrain model.",
            )
            return False
        values = {"latitude": point.latitude, "longitude": point.longitude, "altitude": point.altitude}
        return self.made(Origin, path, values | {"altitude_reference": reference}) is not None

    def find_unservable(self, rules: Mission, agents: tuple[Agent, ...], tasks: tuple[Task, ...]) -> None:
        """Note the tasks that this team cannot do, however it divides them, and types that nobody has."""
        from swarmbid.missionspec import meant_name

        types = {agent.type for agent in agents}
        for name in rules.compatible:
            if name not in types:
                guess = meant_name(name, sorted(types))
                mend = f"Did you mean {guess!r}?" if guess else "Remove it, or add such an agent."
                self.source.add(("compatible", name), "is the type of no agent", mend, of_key=True)
        sets = Counter((agent.type, agent.equipment) for agent in agents)
        able_to: dict[str, Counter[frozenset[str]]] = {}
        for index, task in enumerate(tasks):
            if task.type not in able_to:
                anything = frozenset([task.type])
                able_to[task.type] = Counter()
                for (kind, equipment), count in sets.items():
                    if task.type in rules.compatible.get(kind, anything):
                        able_to[task.type][equipment] += count
            able = able_to[task.type]
            carried = frozenset[str]().union(*able)
            path: Path = ("tasks", index)
            if not able:
                self.source.add(
                    (*path, "type"),
                    f"is {task.type!r}, which no agent may do",
                    "Allow it in `compatible`, or change the type.",
                )
            elif task.equipment - carried:
                lacking = sorted(task.equipment - carried)[0]
                guess = meant_name(lacking, sorted(carried))
                self.source.add(
                    (*path, "equipment"),
                    f"needs {lacking!r}, which no agent that may do it carries",
                    f"Did you mean {guess!r}?" if guess else "Give it to an agent, or drop the task.",
                )
            elif task.agents_required == 1 and not any(task.equipment <= equipment for equipment in able):
                self.source.add(
                    (*path, "equipment"),
                    f"needs {', '.join(sorted(task.equipment))} together, which no single agent carries",
                    "Give them all to one agent, or raise agents_required.",
                )
            elif task.agents_required > able.total():
                team = "is 1 agent" if len(agents) == 1 else f"are {len(agents)} agents"
                if able.total() < len(agents):
                    team += f", of whom {able.total()} may do it"
                self.source.add(
                    (*path, "agents_required"),
                    f"is {task.agents_required}, but there {team}",
                    "Add agents, or lower it.",
                )
            elif 1 < task.agents_required < (fewest := fewest_sets(task.equipment, able)):
                self.source.add(
                    (*path, "agents_required"),
                    f"is {task.agents_required}, but to bring {', '.join(sorted(task.equipment))}"
                    f" takes {fewest} agents",
                    "Raise it, or 0 for as many as the equipment takes.",
                )


def _given(spec: Spec) -> dict[str, Any]:
    """The fields that a file gives; null means the default."""
    given = {name: getattr(spec, name) for name in spec.model_fields_set}
    return {name: value for name, value in given.items() if value is not None}


def _stand_ins(path: Path) -> dict[str, Any]:
    """Harmless values for the required fields of an agent or task whose own are faulty."""
    return {"id": f"unnamed.{path[0]}.{path[1]}", "position": [0.0, 0.0, 0.0]} if len(path) == 2 else {}
