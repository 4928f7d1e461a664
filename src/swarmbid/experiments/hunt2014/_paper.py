"""The paper's statements, from `experiments/data/hunt2014.yaml`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from swarmbid.experiments.hunt2014._cases import Point
from swarmbid.experiments.hunt2014._stats import Effect, Level, stated_effect


@dataclass(frozen=True)
class StatedLevel:
    """A mean and a spread that the paper states.

    Parameters
    ----------
    name : in the data file. figure : number. what : it is about.
    measure : a key of `_runs.MEASURES`. place : experiment, agents, mode.
    level : the numbers. source : "text" or "derived". quote, where : of the paper.
    """

    name: str
    figure: int
    what: str
    measure: str
    place: Mapping[str, Any]
    level: Level
    source: str
    where: str
    quote: str

    def at(self, variant: str) -> Point:
        """Return where a variant is measured for it."""
        return place(variant, self.measure, self.place)


@dataclass(frozen=True)
class StatedEffect:
    """A comparison that the paper states, or that we read out of a sentence.

    Parameters
    ----------
    of, against : places compared. says : less, more or similar. within : factor that counts as similar.
    p : threshold of significance. stated : the size, where the paper gives means and spreads.
    reading : how we read a sentence without numbers; empty for numbers of the text.
    """

    name: str
    figure: int
    what: str
    measure: str
    of: Mapping[str, Any]
    against: Mapping[str, Any]
    says: str
    within: float
    p: float
    stated: Effect | None
    source: str
    reading: str
    where: str
    quote: str

    def sides(self, variant: str) -> tuple[Point, Point]:
        """Return the two points of a variant that it compares."""
        return place(variant, self.measure, self.of), place(variant, self.measure, self.against)


@dataclass(frozen=True)
class Paper:
    """Everything of the data file."""

    about: Mapping[str, Any]
    settings: tuple[Mapping[str, str], ...]
    levels: tuple[StatedLevel, ...]
    effects: tuple[StatedEffect, ...]
    statements: Mapping[int, str]


def place(variant: str, measure: str, at: Mapping[str, Any]) -> Point:
    """Return the point of a variant at a place of the data file; computing times have points of their own."""
    return Point(variant, at["experiment"], at["agents"], at.get("mode", "base"), timed=measure == "seconds")


@cache
def paper() -> Paper:
    """Read the data file."""
    import yaml

    file = files("swarmbid.experiments") / "data" / "hunt2014.yaml"
    data = yaml.safe_load(file.read_text(encoding="utf-8"))
    runs = data["paper"]["runs"]
    levels = tuple(
        StatedLevel(
            name=item["id"],
            figure=item["figure"],
            what=item["what"],
            measure=item["measure"],
            place=item["at"],
            level=Level(float(item["mean"]), float(item["sd"]), runs),
            source=item["source"],
            where=item["where"],
            quote=item["quote"],
        )
        for item in data["levels"]
    )
    numbers = {item.name: item.level for item in levels}
    return Paper(
        about=data["paper"],
        settings=tuple(data["settings"]),
        levels=levels,
        effects=tuple(_effect(item, numbers) for item in data["effects"]),
        statements={item["figure"]: item["quote"] for item in data["statements"]},
    )


def _effect(item: Mapping[str, Any], numbers: Mapping[str, Level]) -> StatedEffect:
    first, second = item.get("levels", (None, None))
    return StatedEffect(
        name=item["id"],
        figure=item["figure"],
        what=item["what"],
        measure=item["measure"],
        of=item["of"],
        against=item["against"],
        says=item["says"],
        within=float(item.get("within", 1.0)),
        p=float(item["p"]),
        stated=stated_effect(numbers[first], numbers[second]) if first else None,
        source=item["source"],
        reading=item.get("reading", ""),
        where=item["where"],
        quote=item["quote"],
    )
