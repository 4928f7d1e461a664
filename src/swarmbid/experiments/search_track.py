"""Search and track: what each part of the mission is worth, measured by leaving it out.

The same missions are flown with other searches, other ways of allocating, a bad radio and vehicles that
fail. Every variant meets the same targets, which move alike and are as hard to see.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field
from typing import Any

from swarmbid.errors import Fault, InputError
from swarmbid.scenarios import search_track
from swarmbid.searchmeasures import Measures
from swarmbid.worldsim import fly

Progress = Callable[[int, int], None] | None
SEEDS = 100
QUICK_SEEDS = 4
SETTING: dict[str, Any] = {
    "uavs": 4,
    "static": 4,
    "moving": 2,
    "width": 2500.0,
    "hole": 400.0,
    "duration": 600.0,
    "endurance": 900.0,
}
Z = 1.959963984540054
"""97.5 % point of the normal distribution."""


@dataclass(frozen=True)
class Variant:
    """One way of flying the missions.

    Parameters
    ----------
    name : for the table. differs : in what, in words. mission : options of the scenario. flight : of `fly`.
    """

    name: str
    differs: str
    mission: dict[str, Any] = field(default_factory=dict)
    flight: dict[str, Any] = field(default_factory=dict)


OURS = Variant("ours", "divided by belief, Contract Net")
VARIANTS = (
    OURS,
    Variant(
        "greedy",
        "search: each flies where it promises most, nothing is divided",
        flight={"strategy": "greedy"},
    ),
    Variant("lawnmower", "search: equal shares once, swept up and down", flight={"strategy": "lawnmower"}),
    Variant("random walk", "search: straight legs to anywhere", flight={"strategy": "random_walk"}),
    Variant("cbba", "allocation: CBBA alone", flight={"allocation": "cbba"}),
    Variant(
        "central", "allocation: a planner that everybody hears at once", flight={"allocation": "central"}
    ),
    Variant(
        "short radio", "radio: 1,000 m and 30 % lost", mission={"radio_range": 1000.0}, flight={"loss": 0.3}
    ),
    Variant(
        "two fail",
        "vehicles: two of four fail in flight",
        flight={"crashes": {"uav01": 200.0, "uav03": 350.0}},
    ),
)


@dataclass(frozen=True)
class Row:
    """One line of the table: means over the missions, and half the width of their 95 % intervals.

    Parameters
    ----------
    values : measure -> (mean, half width).
    """

    variant: str
    runs: int
    values: dict[str, tuple[float, float]]


COLUMNS = (
    ("found", "found %", 100.0),
    ("first_detection", "first s", 1.0),
    ("mean_detection", "mean s", 1.0),
    ("served", "visited %", 100.0),
    ("tracked", "followed %", 100.0),
    ("tracked_since_found", "once found %", 100.0),
    ("longest_gap", "longest gap s", 1.0),
    ("gospa", "GOSPA m", 1.0),
    ("unserved", "unserved", 1.0),
    ("metres", "km", 0.001),
    ("messages", "messages", 1.0),
    ("bytes", "MB", 1e-6),
)
BETTER = {
    "found": 1.0,
    "first_detection": -1.0,
    "mean_detection": -1.0,
    "tracked": 1.0,
    "tracked_since_found": 1.0,
}
"""What ours is compared by, pair by pair: 1.0 if more is better."""


@dataclass(frozen=True)
class Comparison:
    """All flights, and the tables made of them.

    Parameters
    ----------
    measures : variant -> what each mission came to, in order of seed.
    """

    setting: dict[str, Any]
    seeds: int
    measures: dict[str, tuple[Measures, ...]]

    def rows(self) -> list[Row]:
        """One for each variant."""
        return [
            Row(name, len(runs), {key: _mean([getattr(one, key) for one in runs]) for key, _, _ in COLUMNS})
            for name, runs in self.measures.items()
        ]

    def table(self, *, every_instance: bool = False) -> tuple[list[str], list[list[str]]]:
        """Return headings and rows as text; with `every_instance` a row for each seed of ours too."""
        lines = [
            [row.variant, *(_text(*row.values[key], scale) for key, _, scale in COLUMNS)]
            for row in self.rows()
        ]
        if every_instance:
            lines += [
                [f"ours, seed {seed}", *(f"{getattr(one, key) * scale:.4g}" for key, _, scale in COLUMNS)]
                for seed, one in enumerate(self.measures[OURS.name])
            ]
        return ["variant", *(heading for _, heading, _ in COLUMNS)], lines

    def against(self, other: str) -> dict[str, tuple[float, float]]:
        """Return by how much ours is better than another variant, pair by pair: mean and half width."""
        mine, theirs = self.measures[OURS.name], self.measures[other]
        return {
            key: _mean(
                [sign * (getattr(a, key) - getattr(b, key)) for a, b in zip(mine, theirs, strict=True)]
            )
            for key, sign in BETTER.items()
        }

    def worse(self) -> list[str]:
        """Return where ours is worse than a variant by more than chance, in sentences."""
        names = {key: heading for key, heading, _ in COLUMNS}
        scales = {key: scale for key, _, scale in COLUMNS}
        found = []
        for other in self.measures:
            if other in (OURS.name, "central", "short radio", "two fail"):
                continue
            for key, (mean, half) in self.against(other).items():
                if mean + half < 0.0:
                    by = f"{-mean * scales[key]:.3g} ± {half * scales[key]:.2g}"
                    found.append(f"ours is worse than {other} in {names[key]!r} by {by}")
        return found

    def summary(self) -> str:
        """Return what it comes to, in a few lines."""
        missions = (
            f"{self.seeds} missions of {self.setting['duration']:g} s, means ± half their 95 % intervals."
        )
        worse = self.worse()
        verdict = "Worse than an ablation nowhere." if not worse else "\n".join(one + "." for one in worse)
        return f"{missions}\n{verdict}"

    def problems(self) -> list[str]:
        """Return where the mission falls behind something simpler: that is what it must not do."""
        return self.worse()

    def to_dict(self) -> dict[str, Any]:
        """Return it ready for JSON."""
        return {
            "setting": self.setting,
            "seeds": self.seeds,
            "rows": [asdict(row) for row in self.rows()],
            "against": {name: self.against(name) for name in self.measures if name != OURS.name},
        }

    def page(self) -> str:
        """Return the page of the documentation."""
        headings, lines = self.table()
        table = ["| " + " | ".join(headings) + " |", "|---" + "|---:" * (len(headings) - 1) + "|"]
        table += ["| " + " | ".join(line) + " |" for line in lines]
        setting = ", ".join(f"{name} {value:g}" for name, value in self.setting.items())
        what = [f"- **{one.name}**: {one.differs}." for one in VARIANTS]
        pairs = ["| compared with | " + " | ".join(BETTER) + " |", "|---" * (len(BETTER) + 1) + "|"]
        scales = {key: scale for key, _, scale in COLUMNS}
        for name in self.measures:
            if name != OURS.name:
                cells = [_text(mean, half, scales[key]) for key, (mean, half) in self.against(name).items()]
                pairs.append(f"| {name} | " + " | ".join(cells) + " |")
        return _PAGE.format(
            seeds=self.seeds, setting=setting, what="\n".join(what), table="\n".join(table),
            pairs="\n".join(pairs),
            summary=self.summary(),
        )  # fmt: skip


def run(*, quick: bool = False, progress: Progress = None, seeds: int | None = None) -> Comparison:
    """Fly all variants.

    Parameters
    ----------
    quick : a few missions only. seeds : how many missions.
    progress : called with (done, total).
    """
    if seeds is not None and seeds < 1:
        raise InputError([Fault("bench search_track", "seeds", f"is {seeds}", "Give 1 or more.")])
    count = seeds if seeds is not None else QUICK_SEEDS if quick else SEEDS
    flights: list[list[Measures]] = []
    # Processes of their own: the flights of one seed do not depend on those of another.
    with ProcessPoolExecutor() as pool:
        for seed, flown in enumerate(pool.map(_fly_all, [SETTING] * count, range(count))):
            flights.append(flown)
            if progress is not None:
                progress((seed + 1) * len(VARIANTS), count * len(VARIANTS))
    found = {one.name: [flown[row] for flown in flights] for row, one in enumerate(VARIANTS)}
    return Comparison(dict(SETTING), count, {name: tuple(runs) for name, runs in found.items()})


def _fly_all(setting: dict[str, Any], seed: int) -> list[Measures]:
    """Fly the missions of one seed."""
    return [
        fly(search_track.make(seed, **(setting | one.mission)), seed=seed, **one.flight).measures
        for one in VARIANTS
    ]


def _mean(values: Sequence[float]) -> tuple[float, float]:
    """Mean, and half the width of its 95 % interval (normal)."""
    count = len(values)
    mean = sum(values) / count
    if count < 2:
        return mean, math.inf
    variance = sum((value - mean) ** 2 for value in values) / (count - 1)
    return mean, Z * math.sqrt(variance / count)


def _text(mean: float, half: float, scale: float) -> str:
    digits = 0 if abs(mean * scale) >= 100.0 else 1 if abs(mean * scale) >= 10.0 else 2
    if math.isinf(half):
        return f"{mean * scale:.{digits}f}"
    return f"{mean * scale:.{digits}f} ± {half * scale:.{digits}f}"


_PAGE = """\
# What each part of search and track is worth

The scenario `search_track` ({setting}), flown with {seeds} seeds. The same seed gives every variant the same
targets. No UAV knows how many targets there are, where, or of what type; the figures are counted from the
truth, which the UAVs never see.

This page is written by `swarmbid bench search_track --write docs/search_track.md`. Do not edit it.

{what}

## Means over all missions

Mean ± half of its 95 % interval. *Mean s*: mean time to find a target, one that is never found counting with
the mission's length. *Followed*: share of the mission's time for which a moving target was seen and followed;
*once found* the same of the time since it was found. *Central* is no rival but a bound: it hears everything
at once and is obeyed at once, over any distance.

{table}

## Ours less the others, mission by mission

Positive is better for ours, whatever the column; ± is half of the 95 % interval of the mean difference.

{pairs}

{summary}
"""
