"""What every negotiator must do on local commands (`swarmbid.negotiator`)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

from swarmbid.model import Mission, Task
from swarmbid.negotiator import Negotiator
from swarmbid.testing._team import Broken, Check, Make, Team, held_by, mission_of

FEW_AND_MANY = ((4, 3), (3, 7))
"""Numbers of agents and tasks: a task for each, and more than that."""
SHAPES = ("complete", "line", "ring")


def add_task(make: Make) -> None:
    for shape in SHAPES:
        for apart in (False, True):
            team = _settled(make, (4, 2), shape)
            starter, started = _start(team)
            task = Task(id="sudden", position=(40.0, 40.0, 0.0), reward=200.0, discount=0.001)
            _tell(team, lambda one, task=task: one.add_task(task), apart=apart)  # type: ignore[misc]
            team.mission = dataclasses.replace(team.mission, tasks=(*team.mission.tasks, task))
            team.settle(f"after a new task on a {shape} graph the agents")
            team.check_assignment(physics=False)
            if team.agents[starter].path[:1] != [(started, team.now_started)]:
                raise Broken(f"{starter} does not know any more, after a new task, what it had started")
            if not any("sudden" in team.path_tasks(name) for name in team.agents):
                raise Broken(
                    f"nobody does a new task on a {shape} graph, although it pays and agents are idle"
                )


def cancel_task(make: Make) -> None:
    for shape in SHAPES:
        for apart in (False, True):
            team = _settled(make, FEW_AND_MANY[apart], shape)
            task = team.path_tasks(_busy(team))[0]
            _tell(team, lambda one, task=task: one.cancel_task(task), apart=apart)  # type: ignore[misc]
            team.settle(f"after a task was cancelled on a {shape} graph the agents")
            for name, one in team.agents.items():
                if task in team.path_tasks(name):
                    raise Broken(f"{name} still plans a cancelled task")
                if one.beliefs()[task]:
                    raise Broken(f"{name} believes that {one.beliefs()[task][0][0]} wins a cancelled task")
            team.check_assignment()
    _refuses(make, "cancel_task", lambda one: one.cancel_task("nothing"))


def start_task(make: Make) -> None:
    for shape in SHAPES:
        for size in FEW_AND_MANY:
            team = _settled(make, size, shape)
            starter, task = _start(team)
            place = next(one.position for one in team.mission.tasks if one.id == task)
            for name, one in team.agents.items():
                if name != starter:
                    one.set_position(place, team.now)  # from now on every other bids more than it did
            team.settle(f"after a task was started on a {shape} graph the agents")
            team.check_assignment(physics=False)
            if team.agents[starter].path[:1] != [(task, team.now_started)]:
                raise Broken(f"the path of {starter} does not begin with the task that it has started: "
                             f"{team.agents[starter].path}")  # fmt: skip
    # Before anybody has heard of the bids: the starter may be far from the best, and still has the task.
    for name in ("a0", "a2"):
        team = _Team(make, mission_of(11, agents=3, tasks=4), "ring")
        team.round()
        team.round()
        path = team.path_tasks(name)
        if path:
            team.agents[name].start_task(path[0], team.now)
            team.settle("after a task was started at once the agents")
            team.check_assignment(physics=False)
            if path[0] not in team.path_tasks(name):
                raise Broken(f"{name} has lost a task that it had started, to a better bid")
    _refuses(make, "start_task", lambda one: one.start_task("nothing", 0.0))


def finish_task(make: Make) -> None:
    for shape in SHAPES:
        for size in FEW_AND_MANY:
            team = _settled(make, size, shape)
            starter, task = _start(team)
            for _ in range(3):
                team.round()
            team.agents[starter].finish_task(task, team.now)
            finished = team.now
            team.settle(f"after a task was finished on a {shape} graph the agents")
            for name in team.agents:
                if task in team.path_tasks(name):
                    raise Broken(f"{name} plans to do a task that {starter} has finished")
            done = next(one for one in team.mission.tasks if one.id == task)
            agents = tuple(
                dataclasses.replace(agent, position=done.position, available_at=finished)
                if agent.id == starter else agent
                for agent in team.mission.agents
            )  # fmt: skip
            team.check_physics(dataclasses.replace(team.mission, agents=agents))
            team.agents[starter].leave()
            _settle_without(
                team, starter, f"after one that had finished a task left a {shape} graph, the others"
            )
            for name in team.agents:
                if task in team.path_tasks(name):
                    raise Broken(f"{name} does a task again that was finished, because {starter} left")
    _refuses(make, "finish_task", lambda one: one.finish_task("t0", 0.0))


def set_position(make: Make) -> None:
    for shape in SHAPES:
        for size in FEW_AND_MANY:
            team = _settled(make, size, shape)
            moved = _busy(team)
            team.agents[moved].set_position((0.0, 79.0, 0.0), team.now)
            agents = tuple(
                dataclasses.replace(agent, position=(0.0, 79.0, 0.0), available_at=team.now)
                if agent.id == moved else agent
                for agent in team.mission.agents
            )  # fmt: skip
            team.settle(f"after one moved on a {shape} graph the agents")
            team.check_assignment(physics=False)
            team.check_physics(dataclasses.replace(team.mission, agents=agents))


def leave(make: Make) -> None:
    for shape in SHAPES:
        for size in FEW_AND_MANY:
            team = _settled(make, size, shape)
            gone = _busy(team) if shape != "line" else "a0"
            given_up = team.path_tasks(gone)
            team.agents[gone].leave()
            if team.path_tasks(gone):
                raise Broken(f"{gone} has left and still plans {team.path_tasks(gone)}")
            _settle_without(team, gone, f"after one left a {shape} graph the others")
            team.check_assignment()
            if given_up and len(team.agents) >= len(team.mission.tasks):
                for task in given_up:
                    if not any(task in team.path_tasks(name) for name in team.agents):
                        raise Broken(f"nobody does {task}, which {gone} gave up by leaving")


def leave_while_busy(make: Make) -> None:
    for rounds in (0, 4):
        team = _settled(make, (3, 7), "complete")
        starter, task = _start(team)
        for _ in range(rounds):
            team.round()
        team.agents[starter].leave()
        if team.path_tasks(starter) != [task]:
            raise Broken(f"{starter} left in the middle of {task}; its path is {team.path_tasks(starter)}")
        _settle_without(team, starter, "after one left in the middle of a task, the others")
        for name in team.agents:
            if task in team.path_tasks(name):
                raise Broken(f"{name} plans {task}, which {starter} is still busy with as it leaves")


def lose_agent(make: Make) -> None:
    for shape in SHAPES:
        for size in FEW_AND_MANY:
            for apart in (False, True):
                team = _settled(make, size, shape)
                gone = _busy(team) if shape != "line" else "a0"
                lost = team.path_tasks(gone)
                del team.agents[gone]
                _tell(team, lambda one, gone=gone: one.lose_agent(gone), apart=apart)  # type: ignore[misc]
                team.settle(f"after one was lost on a {shape} graph the others")
                team.check_assignment()
                _check_nothing_won_by(team, gone)
                if len(team.agents) >= len(team.mission.tasks):
                    for task in lost:
                        if not any(task in team.path_tasks(name) for name in team.agents):
                            raise Broken(f"nobody does {task}, which the lost {gone} was to do")
    _refuses(make, "lose_agent", lambda one: one.lose_agent("nobody"))


class _Team(Team):
    now_started = 0.0
    """s, when the last task was started."""


def _settled(make: Make, size: tuple[int, int], shape: str) -> _Team:
    team = _Team(make, mission_of(sum(size) + len(shape), agents=size[0], tasks=size[1]), shape)
    team.settle(f"on a {shape} graph the agents")
    return team


def _busy(team: Team) -> str:
    """The first agent that plans something."""
    for name in team.agents:
        if team.path_tasks(name):
            return name
    raise Broken("nobody does anything, although every task pays")


def _start(team: _Team) -> tuple[str, str]:
    """Let an agent start the first task of its path."""
    starter = _busy(team)
    task = team.path_tasks(starter)[0]
    team.now_started = team.now
    team.agents[starter].start_task(task, team.now)
    path = team.agents[starter].path
    if path[:1] != [(task, team.now)] or len({name for name, _ in path}) != len(path):
        raise Broken(f"{starter} started {task} at {team.now:g} s, and its path is {path}")
    return starter, task


def _tell(team: Team, command: Callable[[Negotiator], None], *, apart: bool) -> None:
    """Give a command to everybody: at once, or to one after the other, with rounds between."""
    for one in team.agents.values():
        command(one)
        if apart:
            team.round()


def _settle_without(team: Team, gone: str, what: str) -> None:
    """Let `gone` say its last words and the others agree.

    It stays in reach for as long as an answer needs to cross the team: on a line, it takes the link away.
    """
    for _ in range(2 * len(team.agents)):
        team.round()
    del team.agents[gone]
    team.settle(what)
    for name, one in team.agents.items():
        for task in held_by(gone, one):
            if task not in _done(team, gone):
                raise Broken(f"{name} believes that {gone} wins {task}, although it has left")


def _done(team: Team, gone: str) -> set[str]:
    """Tasks that all believe to be won by one that is gone, and that nobody plans: finished ones."""
    believed = [held_by(gone, one) for one in team.agents.values()]
    return set.intersection(*believed) if getattr(team, "now_started", 0.0) else set()


def _check_nothing_won_by(team: Team, gone: str) -> None:
    for name, one in team.agents.items():
        for task in held_by(gone, one):
            raise Broken(f"{name} believes that {gone} wins {task}, although it is lost")


def _refuses(make: Make, name: str, command: Callable[[Negotiator], None]) -> None:
    """A command about something unknown is the caller's mistake, and raises ValueError."""
    mission: Mission = mission_of(12, agents=2, tasks=2)
    try:
        command(make("a0", mission))
    except ValueError:
        return
    raise Broken(f"{name} about something unknown, or never started, does not raise ValueError")


CHECKS = (
    Check("add_task", "A task that becomes known later is bid on like any other, also when the agents are "
          "told one after the other.", add_task),
    Check("cancel_task", "Nobody does a cancelled task, and nobody is believed to win it. A neighbour that "
          "has not been told yet may still say so: do not believe it.", cancel_task),
    Check("start_task", "Who has begun a task keeps it, whatever others bid, and it stands first in the path "
          "with the time when it began. Take it out of the bundle without giving up the win.", start_task),
    Check("finish_task", "A finished task is never done again, not even when its agent leaves. The agent is "
          "free from then on, where the task is.", finish_task),
    Check("set_position", "After an agent has said where it is, its times count from there: nothing counted "
          "from the old place may be kept.", set_position),
    Check("leave", "Who leaves gives up everything and says so; the others forget its wins, do its tasks, "
          "and agree without it.", leave),
    Check("leave_while_busy", "What was started before leaving is finished by the one that leaves: it stays "
          "in its path, and nobody else takes it.", leave_while_busy),
    Check("lose_agent", "What a lost agent held is open again, for all and for good: news of its old bids "
          "may still be relayed, and must not be believed.", lose_agent),
)  # fmt: skip
