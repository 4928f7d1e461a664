"""Figs. 4, 9 and 11: where the agents of one run are, over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from swarmbid.experiments.hunt2014._cases import VARIANTS, Point, mission_of, negotiate
from swarmbid.experiments.hunt2014._pictures import COLOURS, PALE, legend_below, panels
from swarmbid.model import Mission
from swarmbid.plan import Plan

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = ("printed", "repaired")
RUNS: Mapping[int, Point] = {
    4: Point("repaired", "pairs", 4, tasks=10),
    9: Point("repaired", "kits_3", 6, "both", tasks=10),
    11: Point("repaired", "follow_3", 4, "both", tasks=10),
}
"""Figure -> whose paths it shows: the first run, with fewer agents and tasks, as in the paper. Figs. 9 and
11 with quitting and team rewards, so that few groups stay incomplete."""


def draw(figure: int, seed: int) -> Figure:
    """Draw time along and the X axis of the room up, as the paper does."""
    drawn, axes = panels([VARIANTS[name].title for name in SHOWN], width=5.2, height=3.8)
    handles = []
    for name, one in zip(SHOWN, axes, strict=True):
        given = RUNS[figure]
        point = Point(name, given.experiment, given.agents, given.mode, tasks=given.tasks)
        done = negotiate(point, 0, seed)
        handles = _draw_paths(one, done.mission, done.plan)
        one.set_xlabel("time, s")
        one.set_ylabel("X, m")
    legend_below(drawn, handles)
    return drawn


def _draw_paths(axes: Axes, mission: Mission, plan: Plan) -> list[object]:
    tasks = {task.id: task for task in mission.tasks}
    served = {visit.task for one in plan.agents for visit in one.visits}
    for task in mission.tasks:
        x = task.position[0]
        late = task.end if task.end < 1e9 else task.start
        axes.plot([task.start, late], [x, x], color=PALE, linewidth=7, solid_capstyle="butt", zorder=1)
    starts: dict[str, float] = {}
    handles: list[object] = []
    for row, (agent, one) in enumerate(
        zip(sorted(mission.agents, key=lambda a: a.id), plan.agents, strict=True)
    ):
        times, places = [agent.available_at], [agent.position[0]]
        nudge = 0.03 * (row - len(plan.agents) / 2.0)  # so that agents of one group stay apart
        for visit in one.visits:
            starts[visit.task] = visit.start
            x = tasks[visit.task].position[0]
            left = times[-1]
            # Agents wait where they are until they must leave.
            leave = max(left, visit.start - visit.leg / agent.speed)
            times += [leave, visit.start, visit.end]
            places += [places[-1], x, x]
        colour = COLOURS[row % len(COLOURS)] if row < len(COLOURS) else ("#c2a000", "#777777")[row % 2]
        kind = f" ({agent.type})" if agent.type != "agent" else ""
        handles += axes.plot(
            times, [place + nudge for place in places], color=colour, linewidth=1.4, zorder=2,
            label=f"{agent.id}{kind}",
        )  # fmt: skip
    for task in mission.tasks:
        at = starts.get(task.id, task.start)
        axes.annotate(
            _name(mission, task.id), (at, task.position[0]), xytext=(2, 5), textcoords="offset points",
            fontsize=7, color="#222222" if task.id in served else "#aa3333", zorder=3,
        )  # fmt: skip
    return handles


def _name(mission: Mission, task_id: str) -> str:
    """T3; or its kind with its number, A4; or B7 for what follows."""
    task = next(task for task in mission.tasks if task.id == task_id)
    letters = task.type if task.type != "task" else "T"
    return f"{letters}{int(task_id[1:])}"


def mission_shown(figure: int, seed: int) -> Mission:
    """Return the mission whose paths a figure shows."""
    return mission_of(RUNS[figure], 0, seed)
