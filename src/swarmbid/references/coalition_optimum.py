"""The best plan there is where tasks need groups, equipment and prerequisites; for small missions.

Any plan that can be executed can be written down in the order in which its tasks start: one task after
the other, each with its whole group, each at the end of its members' paths so far. So partial plans are
grown in just this way, the most promising first. Of each it is kept where its members stand, when they
are free, and what it has earned; of two that stand alike, one that is nowhere better is dropped. What it
promises is what it has earned and what its remaining tasks would earn if each had its best group, which
came from the nearest places and waited for nobody: never less than the truth. So as soon as no partial
plan promises more than the best plan has earned, that plan is proven to be the best.

As in `swarmbid.references.optimum` no insertion rule enters, and every visit starts as early as it can.
"""

from __future__ import annotations

import dataclasses
import heapq
import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

from swarmbid.arrays import DECAY, INVERSE_WIDTH, MissionArrays
from swarmbid.errors import Fault, InputError
from swarmbid.model import Mission, Task
from swarmbid.references.optimum import OptimumResult

if TYPE_CHECKING:
    from swarmbid.scores import Score

MAX_PARTS = 300_000
"""Most partial plans grown, some ten seconds of plain Python and half a GiB."""

_SLACK = 1e-9  # relative rounding allowed where a sum just meets a limit
_NOWHERE = -math.inf
_Stance = tuple[int, tuple[tuple[int, int], ...]]
"""Bits of the tasks done, and each agent's kind and place, in order."""


@dataclass(slots=True)
class _Part:
    """A partial plan.

    Parameters
    ----------
    value : score units earned. done : bits of the tasks done.
    places : row of the place where each agent stands. free : s, when it is free there.
    ends : s, when each task ends; 0 if it is not done.
    metres : flown by each. counts : tasks of each.
    task, group, start : of the visit that made it of `before`.
    dropped : another one was found that is nowhere worse.
    """

    value: float
    done: int
    places: tuple[int, ...]
    free: tuple[float, ...]
    ends: tuple[float, ...]
    metres: tuple[float, ...]
    counts: tuple[int, ...]
    before: _Part | None = None
    task: int = -1
    group: tuple[int, ...] = ()
    start: float = 0.0
    dropped: bool = False


def coalition_optimum(mission: Mission, score: Score, *, max_parts: int = MAX_PARTS) -> OptimumResult:
    """Return the plan of the highest total score, all groups complete and starting together.

    Parameters
    ----------
    score : what a visit is worth; every member of a group is paid its own.
    max_parts : most partial plans to grow before giving up.

    Raises
    ------
    InputError : the mission is too large.

    Examples
    --------
    >>> from swarmbid.scores import make_score
    >>> from swarmbid.model import Agent
    >>> here, there = (0.0, 0.0, 0.0), (3.0, 4.0, 0.0)
    >>> mission = Mission(
    ...     agents=(Agent(id="a", position=here), Agent(id="b", position=there)),
    ...     tasks=(Task(id="t", position=there, reward=8.0, agents_required=2),),
    ... )
    >>> found = coalition_optimum(mission, make_score("distance_cost"))
    >>> found.paths, found.value
    ({'a': [('t', 5.0)], 'b': [('t', 5.0)]}, 11.0)
    """
    search = _Search(mission, score, max_parts)
    best = search.run()
    orders: dict[str, list[str]] = {agent.id: [] for agent in mission.agents}
    starts: dict[str, float] = {}
    part: _Part | None = best
    while part is not None and part.before is not None:
        task = search.tasks[part.task]
        starts[task.id] = part.start
        for row in part.group:
            orders[search.agents[row].id].insert(0, task.id)
        part = part.before
    return OptimumResult(
        paths={name: [(task_id, starts[task_id]) for task_id in order] for name, order in orders.items()},
        value=best.value,
        proven=all(task.revisit_at is None for task in mission.tasks),
        num_paths=search.grown,
    )


class _Search:
    """Tables of one mission, and the partial plans grown so far.

    Places are rows: first the tasks', then where each agent begins.
    """

    def __init__(self, mission: Mission, score: Score, max_parts: int) -> None:
        self.mission, self.score, self.max_parts = mission, score, max_parts
        arrays = MissionArrays(mission)
        self.agents, self.tasks = arrays.agents, arrays.tasks
        self.grown = 0
        num_tasks = len(self.tasks)
        spots = [task.position for task in self.tasks] + [agent.position for agent in self.agents]
        self.legs = [[mission.distance(spot, task.position) for task in self.tasks] for spot in spots]
        self.homes = [
            [0.0 if agent.base is None else mission.distance(spot, agent.base) for spot in spots]
            for agent in self.agents
        ]
        self.rows_needed = [[arrays.task_row[need] for need in task.prerequisites] for task in self.tasks]
        self.needs = [sum(1 << row for row in rows) for rows in self.rows_needed]
        self.groups = [list(self.possible_groups(task)) for task in self.tasks]
        self.limits = [num_tasks if one.bundle_limit is None else one.bundle_limit for one in self.agents]
        self.timed = not _is_timeless(arrays, score)
        self.shortest = self.shortest_times()
        self.soonest = [
            [self.soonest_start(row, task) for task in range(num_tasks)] for row in range(len(self.agents))
        ]
        # A user's own score may mix the time and the way, so of its hopes nothing is taken off.
        self.fading = self.timed and score.visit_function() is None
        self.fresh = [
            [
                score.value(mission, agent, task, soonest, 0.0)
                for task, soonest in zip(self.tasks, self.soonest[row], strict=True)
            ]
            for row, agent in enumerate(self.agents)
        ]
        self.hopes = [
            [
                [self.hope(row, place, task) for task in range(num_tasks)]
                for place in (*range(num_tasks), num_tasks + row)
            ]
            for row in range(len(self.agents))
        ]
        self.rests: dict[int, list[list[float]]] = {}
        self.kinds = _kinds(arrays, score)
        self.kept: dict[_Stance, list[tuple[_Part, list[float]]]] = {}

    def possible_groups(self, task: Task) -> Iterator[tuple[int, ...]]:
        """Yield every group that would be complete, as agent rows."""
        able = [row for row, agent in enumerate(self.agents) if self.mission.can_do(agent, task)]
        sizes = range(1, len(task.equipment) + 1) if task.agents_required == 0 else [task.agents_required]
        for size in sizes:
            for group in combinations(able, size):
                brought = [self.agents[row].equipment & task.equipment for row in group]
                if frozenset[str]().union(*brought) != task.equipment:
                    continue
                # Where equipment says how many, everybody must be needed.
                if task.agents_required > 0 or all(
                    frozenset[str]().union(*brought[:spot], *brought[spot + 1 :]) != task.equipment
                    for spot in range(size)
                ):
                    yield group

    def shortest_times(self) -> list[list[list[float]]]:
        """Least s from the end of service at a place to the start of a task, by whatever way.

        Straight, but where distances are rounded a detour can be shorter.
        """
        tables = []
        for agent in self.agents:
            table = [[leg / agent.speed for leg in row] for row in self.legs]
            for via, task in enumerate(self.tasks):
                for row in table:
                    for to in range(len(self.tasks)):
                        row[to] = min(row[to], row[via] + task.duration + table[via][to])
            tables.append(table)
        return tables

    def hope(self, row: int, place: int, task: int) -> float:
        """At most what a visit of `task` from `place` can be worth to an agent; -inf if it may not do it."""
        agent, wanted = self.agents[row], self.tasks[task]
        if not self.mission.can_do(agent, wanted) or place == task:
            return _NOWHERE
        if place < len(self.tasks) and not self.mission.can_do(agent, self.tasks[place]):
            return _NOWHERE
        return self.score.value(self.mission, agent, wanted, self.soonest[row][task], self.legs[place][task])

    def soonest_start(self, row: int, task: int) -> float:
        """The start, s, at which a visit is worth most to an agent, of those that it can ever reach."""
        agent, wanted = self.agents[row], self.tasks[task]
        start = max(agent.available_at + self.shortest[row][len(self.tasks) + row][task], wanted.start)
        return start if wanted.revisit_at is None else max(start, min(wanted.revisit_at, wanted.end))

    def run(self) -> _Part:
        """Grow partial plans, the most promising first, until none promises more than the best has."""
        count = len(self.agents)
        root = _Part(
            value=0.0,
            done=0,
            places=tuple(len(self.tasks) + row for row in range(count)),
            free=tuple(agent.available_at for agent in self.agents),
            ends=(0.0,) * len(self.tasks),
            metres=(0.0,) * count,
            counts=(0,) * count,
        )
        best = root
        queue = [(-self.promise(root), 0, root)]
        while queue:
            promise, _, part = heapq.heappop(queue)
            if -promise <= best.value:
                break
            if part.dropped:
                continue
            for grown in self.extensions(part):
                self.grown += 1
                if self.grown > self.max_parts:
                    raise InputError([self.too_large()])
                home = self.comes_home(grown)
                # Without rounded distances no detour helps who cannot come home.
                if not home and self.mission.distance_step == 0.0:
                    continue
                if home and grown.value > best.value:
                    best = grown
                promised = self.promise(grown)
                if promised > best.value and self.keep(grown):
                    heapq.heappush(queue, (-promised, -self.grown, grown))
        return best

    def extensions(self, part: _Part) -> Iterator[_Part]:
        """Yield `part` with one more task, by each group that can do it."""
        for task, wanted in enumerate(self.tasks):
            bit = 1 << task
            if part.done & bit or self.needs[task] & ~part.done:
                continue
            floor = max([wanted.start, *(part.ends[need] for need in self.rows_needed[task])])
            for group in self.groups[task]:
                if any(part.counts[row] >= self.limits[row] for row in group):
                    continue
                start, places, metres = floor, list(part.places), list(part.metres)
                for row in group:
                    leg = self.legs[part.places[row]][task]
                    start = max(start, part.free[row] + leg / self.agents[row].speed)
                    metres[row] += leg
                    places[row] = task
                if start > wanted.end:
                    continue
                if any(metres[row] > self.agents[row].range * (1.0 + _SLACK) for row in group):
                    continue
                for begin in _starts(wanted, start):
                    value, free, counts = part.value, list(part.free), list(part.counts)
                    ends = (*part.ends[:task], begin + wanted.duration, *part.ends[task + 1 :])
                    for row in group:
                        leg = self.legs[part.places[row]][task]
                        value += self.score.value(self.mission, self.agents[row], wanted, begin, leg)
                        free[row] = begin + wanted.duration
                        counts[row] += 1
                    yield _Part(
                        value=value,
                        done=part.done | bit,
                        places=tuple(places),
                        free=tuple(free),
                        ends=ends,
                        metres=tuple(metres),
                        counts=tuple(counts),
                        before=part,
                        task=task,
                        group=group,
                        start=begin,
                    )

    def comes_home(self, part: _Part) -> bool:
        """Whether everybody can end here: back at base within range and endurance."""
        for row, count in enumerate(part.counts):
            if count == 0:
                continue
            agent, back = self.agents[row], self.homes[row][part.places[row]]
            if part.metres[row] + back > agent.range * (1.0 + _SLACK):
                return False
            latest = (agent.available_at + agent.endurance) * (1.0 + _SLACK)
            if part.free[row] + back / agent.speed > latest:
                return False
        return True

    def promise(self, part: _Part) -> float:
        """What the best plan that grows out of `part` is worth at most."""
        rest = ((1 << len(self.tasks)) - 1) & ~part.done
        nearest = self.from_rest(rest)
        total = part.value
        for task, wanted in enumerate(self.tasks):
            if not rest >> task & 1:
                continue
            hopes, reached = [], []
            for row, place in enumerate(part.places):
                soonest = part.free[row] + self.shortest[row][place][task]
                reached.append(soonest)
                if soonest > wanted.end or part.counts[row] >= self.limits[row]:
                    hopes.append(_NOWHERE)
                else:
                    stands = min(place, len(self.tasks))
                    hopes.append(max(self.hopes[row][stands][task], nearest[row][task]))
            best = 0.0
            floor = max([0.0, *(part.ends[need] for need in self.rows_needed[task])])
            for group in self.groups[task]:
                worth = sum([hopes[row] for row in group])
                if worth > best and self.fading:
                    start = max([floor, *(reached[row] for row in group)])
                    worth -= sum([self.fade(row, task, start) for row in group])
                best = max(best, worth)
            total += best
        return total

    def fade(self, row: int, task: int, start: float) -> float:
        """What a visit loses at least, of its hope, when it starts no sooner than `start`."""
        soonest = self.soonest[row][task]
        if start <= soonest:
            return 0.0
        agent, wanted = self.agents[row], self.tasks[task]
        late = self.score.value(self.mission, agent, wanted, start, 0.0)
        return self.fresh[row][task] - late

    def from_rest(self, rest: int) -> list[list[float]]:
        """For each agent and task the best hope of coming there from another task of `rest`."""
        if rest not in self.rests:
            others = [place for place in range(len(self.tasks)) if rest >> place & 1]
            self.rests[rest] = [
                [
                    max([_NOWHERE, *(hopes[place][task] for place in others)])
                    for task in range(len(self.tasks))
                ]
                for hopes in self.hopes
            ]
        return self.rests[rest]

    def keep(self, part: _Part) -> bool:
        """Note `part` unless one that stands alike is nowhere worse; drop those that it beats."""
        key, burdens = self.stance(part)
        kept = self.kept.setdefault(key, [])
        survivors = []
        for other, theirs in kept:
            if other.value >= part.value and all(a <= b for a, b in zip(theirs, burdens, strict=True)):
                return False
            if part.value >= other.value and all(a <= b for a, b in zip(burdens, theirs, strict=True)):
                other.dropped = True
            else:
                survivors.append((other, theirs))
        survivors.append((part, burdens))
        self.kept[key] = survivors
        return True

    def stance(self, part: _Part) -> tuple[_Stance, list[float]]:
        """How a partial plan stands, and what it can be worse in: times, metres, full bundles.

        Agents that are alike but for where they began may stand in for each other.
        """
        team = []
        for row, agent in enumerate(self.agents):
            burden = [part.free[row]] if self.timed else []
            if agent.range < math.inf:
                burden.append(part.metres[row])
            if agent.bundle_limit is not None:
                burden.append(float(part.counts[row]))
            team.append((self.kinds[row], part.places[row], burden))
        team.sort()
        burdens = [number for _, _, burden in team for number in burden]
        if self.timed:
            awaited = 0
            for task, needs in enumerate(self.needs):
                if not part.done >> task & 1:
                    awaited |= needs & part.done
            burdens += [end for task, end in enumerate(part.ends) if awaited >> task & 1]
        return (part.done, tuple([(kind, place) for kind, place, _ in team])), burdens

    def too_large(self) -> Fault:
        """The mission asked for more than was allowed."""
        return Fault(
            f"mission {self.mission.name}",
            "",
            f"is too large for the exact optimum: {len(self.agents)} agents and {len(self.tasks)} tasks"
            f" took more than {self.max_parts:,} partial plans",
            "Give fewer tasks, smaller bundle limits or tighter windows, or raise max_parts.",
        )


def _starts(task: Task, start: float) -> Iterator[float]:
    """Yield the starts of service tried: at once, and at the scheduled time of a revisit."""
    yield start
    if task.revisit_at is not None and start < min(task.revisit_at, task.end):
        yield min(task.revisit_at, task.end)


def _is_timeless(arrays: MissionArrays, score: Score) -> bool:
    """Whether it matters to nothing when anything is done."""
    if any(task.end < math.inf for task in arrays.tasks):
        return False
    if any(agent.endurance < math.inf for agent in arrays.agents):
        return False
    if score.visit_function() is not None:
        return False
    tables = [
        arrays.task_table(agent, "optimum", lambda table: score.fill(table, arrays))
        for agent in arrays.agents
    ]
    return not any(table[DECAY].any() or table[INVERSE_WIDTH].any() for table in tables)


def _kinds(arrays: MissionArrays, score: Score) -> list[int]:
    """Number the agents' kinds: who is of one kind can do the same for the same, from wherever it is."""
    seen: dict[object, int] = {}
    kinds = []
    for agent in arrays.agents:
        like = dataclasses.replace(agent, id="any", position=(0.0, 0.0, 0.0), available_at=0.0)
        begun = agent.position if score.fixed(arrays, agent) is not None else None
        back = agent.available_at + agent.endurance
        kinds.append(seen.setdefault((dataclasses.replace(like, endurance=1.0), back, begun), len(seen)))
    return kinds
