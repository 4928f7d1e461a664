"""The two pictures, in the look of the other reproductions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from swarmbid.experiments.dymkou2019._runs import UAVS, Assigned
from swarmbid.experiments.hunt2014._pictures import COLOURS, PALE, PAPER, as_svg, styled
from swarmbid.scenarios import dymkou2019

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from swarmbid.simulator import Run

_MORE = (*COLOURS, "#bf7e00", "#882255", "#2e90c8")


def pictures(flown: Run | None, assigned: dict[str, list[Assigned]]) -> dict[str, str]:
    """File name -> SVG."""
    with styled():
        drawn = {}
        if flown is not None:
            drawn["dymkou2019-1.svg"] = as_svg(_simulation(flown))
        if assigned:
            drawn["dymkou2019-2.svg"] = as_svg(_assignment(assigned))
        return drawn


def _simulation(flown: Run) -> Figure:
    """Draw paths in x, y and time; a window is a vertical bar at its task."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.6, 5.6), layout="constrained")
    axes: Any = figure.add_subplot(projection="3d")
    tasks = {task.id: task for task in flown.mission.tasks}
    starts = {agent.id: agent for agent in flown.mission.agents}
    for task in tasks.values():
        east, north, _ = task.position
        axes.plot([east] * 2, [north] * 2, [task.start, task.end], color=PALE, linewidth=9.0,
                  solid_capstyle="butt")  # fmt: skip
        axes.text(east, north, task.end, f" {task.id} {task.type}", fontsize=7, color=PAPER)
    for row, plan in enumerate(flown.plan.agents):
        agent = starts[plan.agent]
        stops = [(agent.position[0], agent.position[1], agent.available_at)]
        for visit in plan.visits:
            east, north, _ = tasks[visit.task].position
            stops += [(east, north, time) for time in (visit.arrival, visit.start, visit.end)]
        colour = _MORE[row % len(_MORE)]
        axes.plot(*zip(*stops, strict=True), color=colour, linewidth=1.6, label=f"{agent.id} {agent.type}")
        axes.scatter(*stops[0], color=colour, s=22)
        served = [(stops[place], stops[place + 1]) for place in range(2, len(stops) - 1, 3)]
        for begin, end in served:
            axes.plot(*zip(begin, end, strict=True), color=colour, linewidth=3.0)
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")
    axes.set_zlabel("time, s")
    axes.view_init(elev=22.0, azim=-58.0)
    axes.set_box_aspect((1.0, 1.0, 0.9), zoom=0.9)
    axes.legend(loc="upper left", fontsize=8)
    return figure


def _assignment(assigned: dict[str, list[Assigned]]) -> Figure:
    """Draw the first mission's division beside the shares of the optimum over all missions."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.2, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2, squeeze=False, width_ratios=(1.0, 1.15))[0]
    # Contract Net is the slides' subject; its division of the first mission is the one to show.
    name, outcomes = list(assigned.items())[-1]
    first = outcomes[0]
    mission = dymkou2019.make(first.seed, agents=UAVS, tasks=UAVS, self_assignment=True)
    places = {task.id: task.position for task in mission.tasks}
    for row, agent in enumerate(mission.agents):
        colour = _MORE[row % len(_MORE)]
        east, north, _ = agent.position
        left.plot(east, north, "o", color=colour, markersize=6)
        left.annotate(agent.id, (east, north), xytext=(5, 5), textcoords="offset points", fontsize=7)
        target = places.get(first.places.get(agent.id, ""))
        if target is not None:
            left.annotate("", target[:2], (east, north), arrowprops={"arrowstyle": "->", "color": colour})
    left.plot([one[0] for one in places.values()], [one[1] for one in places.values()], "s", color=PAPER,
              markersize=5, fillstyle="none")  # fmt: skip
    left.set_aspect("equal")
    left.set_xlabel("east, m")
    left.set_ylabel("north, m")
    left.set_title(f"Who goes where by {name}, mission {first.seed}", fontsize=10)
    for row, (algorithm, found) in enumerate(assigned.items()):
        shares = sorted(one.share for one in found)
        steps = [(place + 1) / len(shares) for place in range(len(shares))]
        style = ("-", "--", ":")[row % 3]
        right.step(shares, steps, style, where="post", color=COLOURS[row % len(COLOURS)], label=algorithm)
    right.set_xlabel("share of the optimum")
    right.set_ylabel("share of missions with no more")
    right.set_title(f"Over {len(outcomes)} missions", fontsize=10)
    right.legend(loc="upper left")
    return figure
