"""YAML and JSON text to plain data that remembers where each value stood.

YAML is read as YAML 1.2 understands plain words: ``no`` and ``on`` are text, ``1e5`` is a number, ``007``
is text. Tags are refused, so that reading a file never makes an object. Anchors, aliases and merge
keys (``<<``) work, within a budget. JSON is read by the standard library, and its lines are worked out
only when something is wrong.
"""

from __future__ import annotations

import json
import math
import re
from bisect import bisect_right
from collections.abc import Iterator
from typing import Any

from swarmbid.errors import Fault, InputError

Path = tuple[str | int, ...]
"""A place in plain data: ``("tasks", 3, "start")``."""

MAX_JSON_BYTES = 64 * 2**20
MAX_YAML_BYTES = 8 * 2**20
"""YAML takes about 60 bytes of memory for one of text and JSON far less, hence two caps."""

MAX_VALUES = 2_000_000
"""Most values a YAML file may expand to through its aliases; the largest mission needs half of it."""

MAX_DEPTH = 32
MAX_FAULTS = 100
"""Faults printed; the rest is counted. Nobody mends the hundred-and-first before the first."""

_NUMBER = re.compile(r"[-+]?(?:0|[1-9][0-9]*|(?=\.[0-9]))(?:\.[0-9]*)?(?:[eE][-+]?[0-9]+)?")
_INFINITE = re.compile(r"([-+]?)\.(?:inf|Inf|INF)")
_WORDS: dict[str, bool | float | None] = {"": None, "~": None, "null": None, "Null": None, "NULL": None}
_WORDS |= {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_WORDS |= {".nan": math.nan, ".NaN": math.nan, ".NAN": math.nan}


def dotted(path: Path) -> str:
    """Return a path the way people write it: ``tasks[3].start``."""
    text = ""
    for step in path:
        text += f"[{step}]" if isinstance(step, int) else f".{step}" if text else str(step)
    return text


class Source:
    """Plain data, the places of its values, and the faults found in it so far.

    Parameters
    ----------
    name : file name for messages.
    data : mappings, lists, text, numbers.
    """

    def __init__(self, name: str, data: Any) -> None:
        self.name = name
        self.data = data
        self._faults: list[tuple[tuple[int, int], Fault]] = []
        self._more = 0

    def place(self, path: Path, *, of_key: bool) -> tuple[int, int] | None:
        """Line and column, from 1, of a value, or of the nearest thing around it; None without text."""
        return None

    def add(self, path: Path, why: str, mend: str, *, of_key: bool = False) -> None:
        """Note one fault at `path`, or at its key for a field that should not be there."""
        if len(self._faults) >= MAX_FAULTS:
            self._more += 1
            return
        place = self.place(path, of_key=of_key)
        if place is not None and any(at == place and fault.why == why for at, fault in self._faults):
            return  # one fault in a template that several agents merge
        where = self.name if place is None else f"{self.name}:{place[0]}:{place[1]}"
        self._faults.append((place or (0, 0), Fault(where, dotted(path), why, mend)))

    def done(self) -> None:
        """Raise everything noted, in order of the text, if anything was."""
        if self._faults:
            self._faults.sort(key=lambda pair: pair[0])
            faults = [fault for _, fault in self._faults]
            if self._more:
                faults.append(Fault(self.name, "", f"has {self._more} more faults", "Mend these first."))
            raise InputError(faults)


def read(text: str, name: str, *, as_json: bool) -> Source:
    """Read text into a source; raises `InputError` where it is no YAML or no JSON at all."""
    return _read_json(text, name) if as_json else _read_yaml(text, name)


def _syntax(name: str, line: int, column: int, why: str, mend: str) -> InputError:
    return InputError([Fault(f"{name}:{line}:{column}", "", why, mend)])


# -- JSON ----------------------------------------------------------------------------------------------


class _JsonSource(Source):
    """JSON, whose text is scanned again, one container at a time, when a place is asked for."""

    def __init__(self, name: str, data: Any, text: str) -> None:
        super().__init__(name, data)
        self._text = text
        self._line_ends: list[int] | None = None
        self._members: dict[int, list[tuple[str | int, int, int]]] = {}

    def place(self, path: Path, *, of_key: bool) -> tuple[int, int]:
        offset = self._skip(0)
        for depth, step in enumerate(path):
            last = depth == len(path) - 1
            # The last of two equal keys is the one that Python kept.
            found = [member for member in self.members(offset) if member[0] == step]
            if not found:
                break
            offset = found[-1][1] if last and of_key else found[-1][2]
        return self.line_column(offset)

    def line_column(self, offset: int) -> tuple[int, int]:
        if self._line_ends is None:
            self._line_ends = [match.start() for match in re.finditer("\n", self._text)]
        line = bisect_right(self._line_ends, offset)
        return line + 1, offset - (self._line_ends[line - 1] if line else -1)

    def members(self, offset: int) -> list[tuple[str | int, int, int]]:
        """Key, offset of the key, offset of the value: of the object or list at `offset`."""
        if offset not in self._members:
            self._members[offset] = list(self._scan(offset))
        return self._members[offset]

    def _scan(self, offset: int) -> Iterator[tuple[str | int, int, int]]:
        if self._text[offset] not in "{[":
            return
        decoder = json.JSONDecoder()
        is_object = self._text[offset] == "{"
        offset = self._skip(offset + 1)
        index = 0
        while self._text[offset] not in "}]":
            key: str | int = index
            key_at = offset
            if is_object:
                key, offset = decoder.raw_decode(self._text, offset)
                offset = self._skip(self._skip(offset) + 1)  # past the colon
            yield key, key_at, offset
            _, offset = decoder.raw_decode(self._text, offset)
            offset = self._skip(offset)
            if self._text[offset] == ",":
                offset = self._skip(offset + 1)
            index += 1

    def _skip(self, offset: int) -> int:
        while self._text[offset] in " \t\r\n":
            offset += 1
        return offset

    def add_repeated_keys(self) -> None:
        """Note every key that an object holds twice, wherever it is."""
        todo: list[tuple[Path, int]] = [((), self._skip(0))]
        while todo:
            path, offset = todo.pop()
            seen: set[str | int] = set()
            for key, key_at, value_at in self.members(offset):
                if key in seen:
                    self.add_repeated_key((*path, key), key_at)
                seen.add(key)
                todo.append(((*path, key), value_at))

    def add_repeated_key(self, path: Path, key_at: int) -> None:
        line, column = self.line_column(key_at)
        fault = Fault(f"{self.name}:{line}:{column}", dotted(path), "is given twice", "Keep one of the two.")
        self._faults.append(((line, column), fault))


def _read_json(text: str, name: str) -> Source:
    repeated = False

    def to_dict(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        nonlocal repeated
        members = dict(pairs)
        repeated = repeated or len(members) < len(pairs)
        return members

    try:
        data = json.loads(text, object_pairs_hook=to_dict)
    except json.JSONDecodeError as error:
        if error.pos >= len(text.rstrip()) or error.msg.startswith("Unterminated"):
            why, mend = "ends in the middle of its JSON", "The file was cut short: write it again."
        else:
            why, mend = f"is not JSON here: {error.msg.lower()}", "Mend the JSON, or write YAML (.yaml)."
        raise _syntax(name, error.lineno, error.colno, why, mend) from None
    except RecursionError:
        raise _syntax(name, 1, 1, "is nested too deeply", "A mission is five levels deep.") from None
    except ValueError:  # Python's own bound on the digits of an int
        raise _syntax(name, 1, 1, "holds a number of thousands of digits", "Round it.") from None
    source = _JsonSource(name, data, text)
    if repeated:
        source.add_repeated_keys()
    return source


# -- YAML ----------------------------------------------------------------------------------------------


class _YamlSource(Source):
    """YAML, whose nodes carry their marks."""

    def __init__(self, name: str, root: Any) -> None:
        super().__init__(name, None)
        self._root = root
        self._budget = MAX_VALUES
        self.data = self._plain(root, ())

    def place(self, path: Path, *, of_key: bool) -> tuple[int, int]:
        node = self._root
        mark = node.start_mark
        for depth, step in enumerate(path):
            pair = _child(node, step)
            if pair is None:
                break
            key, node = pair
            mark = key.start_mark if of_key and depth == len(path) - 1 else node.start_mark
        return mark.line + 1, mark.column + 1

    def _refuse(self, node: Any, path: Path, why: str, mend: str) -> InputError:
        mark = node.start_mark
        where = f"{self.name}:{mark.line + 1}:{mark.column + 1}"
        return InputError([Fault(where, dotted(path), why, mend)])

    def _plain(self, node: Any, path: Path) -> Any:
        self._budget -= 1
        if self._budget < 0:
            raise self._refuse(
                node,
                path,
                f"makes more than {MAX_VALUES:,} values of its aliases",
                "Write fewer aliases (*).",
            )
        if len(path) > MAX_DEPTH:
            raise self._refuse(node, (), "is nested too deeply", "A mission is five levels deep.")
        if node.tag not in _OUR_TAGS:
            raise self._refuse(
                node, path, f"has the tag {node.tag!r}", "Write plain values, without tags (!)."
            )
        if node.id == "scalar":
            return _scalar(node.value) if node.tag == _PLAIN else node.value
        if node.id == "sequence":
            return [self._plain(item, (*path, index)) for index, item in enumerate(node.value)]
        members: dict[str, Any] = {}
        merged: dict[str, Any] = {}
        for key_node, value_node in node.value:
            if key_node.id != "scalar":
                raise self._refuse(key_node, path, "is no name of a field", "Write `name: value`.")
            key = key_node.value
            if key == "<<" and key_node.tag == _PLAIN:
                parents = value_node.value if value_node.id == "sequence" else [value_node]
                for parent in parents:
                    if parent.id != "mapping":
                        raise self._refuse(parent, path, "cannot be merged", "Name a mapping: `<<: *name`.")
                    merged = self._plain(parent, (*path, key)) | merged
            elif key in members:
                mark = key_node.start_mark
                where = f"{self.name}:{mark.line + 1}:{mark.column + 1}"
                fault = Fault(where, dotted((*path, key)), "is given twice", "Keep one of the two.")
                self._faults.append(((mark.line + 1, mark.column + 1), fault))
            else:
                members[key] = self._plain(value_node, (*path, key))
        return merged | members


def _child(node: Any, step: str | int) -> tuple[Any, Any] | None:
    """Key node and value node of one step down, looking into merged mappings last."""
    if node.id == "sequence" and isinstance(step, int) and step < len(node.value):
        return node.value[step], node.value[step]
    if node.id != "mapping":
        return None
    merged: list[Any] = []
    for key, value in node.value:
        if key.value == step:
            return key, value
        if key.value == "<<":
            merged += value.value if value.id == "sequence" else [value]
    return next((found for parent in merged if (found := _child(parent, step)) is not None), None)


def _scalar(text: str) -> Any:
    if text in _WORDS:
        return _WORDS[text]
    if _NUMBER.fullmatch(text):
        whole = text.lstrip("+-").isdigit() and len(text) < 20
        return int(text) if whole else float(text)
    infinite = _INFINITE.fullmatch(text)
    if infinite:
        return -math.inf if infinite[1] == "-" else math.inf
    return text


_PLAIN = "plain"
_OUR_TAGS = (_PLAIN, "text", "tag:yaml.org,2002:seq", "tag:yaml.org,2002:map")


def _loader() -> Any:
    """A YAML loader that makes nodes only: no tag of it constructs anything."""
    import yaml
    from yaml.resolver import BaseResolver

    class Resolver(BaseResolver):
        def resolve(self, kind: Any, value: Any, implicit: Any) -> str:
            if kind is yaml.ScalarNode:
                return _PLAIN if implicit[0] else "text"
            return str(super().resolve(kind, value, implicit))  # type: ignore[no-untyped-call]

    if yaml.__with_libyaml__:
        from yaml.cyaml import CParser  # type: ignore[attr-defined]

        class FastLoader(CParser, Resolver):
            def __init__(self, stream: str) -> None:
                CParser.__init__(self, stream)
                Resolver.__init__(self)

        return FastLoader

    from yaml.composer import Composer
    from yaml.parser import Parser
    from yaml.reader import Reader
    from yaml.scanner import Scanner

    class SlowLoader(Reader, Scanner, Parser, Composer, Resolver):
        def __init__(self, stream: str) -> None:
            Reader.__init__(self, stream)
            Scanner.__init__(self)
            Parser.__init__(self)
            Composer.__init__(self)
            Resolver.__init__(self)

    return SlowLoader


def _read_yaml(text: str, name: str) -> Source:
    import yaml

    try:
        root = _loader()(text).get_single_node()
    except yaml.MarkedYAMLError as error:
        raise _explain(error, text, name) from None
    except yaml.YAMLError as error:
        position = getattr(error, "position", 0)
        line = text.count("\n", 0, position) + 1
        column = position - text.rfind("\n", 0, position)
        raise _syntax(name, line, column, "holds a character that YAML forbids", "Remove it.") from None
    except RecursionError:
        raise _syntax(name, 1, 1, "is nested too deeply", "A mission is five levels deep.") from None
    if root is None:
        raise InputError([Fault(name, "", "is empty", "A mission has `agents:` and `tasks:`.")])
    return _YamlSource(name, root)


_YAML_MENDS = {
    "found undefined alias": "Define it earlier with &.",
    "but found another document": "Keep one mission a file: no second `---`.",
    "exceeded maximum nesting depth": "A mission is five levels deep.",
    "found duplicate anchor": "Give each anchor (&) its own name.",
}


def _explain(error: Any, text: str, name: str) -> InputError:
    """Say in our words what the YAML parser stumbled over."""
    mark = error.problem_mark or error.context_mark
    lines = text.splitlines()
    line, column = (mark.line + 1, mark.column + 1) if mark else (1, 1)
    problem = str(error.problem)
    if line > text.rstrip().count("\n") + 1 or "end of stream" in problem:
        last = max(1, text.rstrip().count("\n") + 1)
        column = len(lines[last - 1].rstrip()) + 1
        return _syntax(
            name, last, column, "ends in the middle of its YAML", "The file was cut short: write it again."
        )
    if lines[line - 1][column - 1 : column] == "\t":
        return _syntax(name, line, column, "has a tab where YAML wants spaces", "Indent with spaces.")
    mend = _YAML_MENDS.get(problem, "Mind the indentation, colons and brackets above.")
    return _syntax(name, line, column, f"is not YAML here: {problem.removeprefix('but ')}", mend)
