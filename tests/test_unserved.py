"""Why a task for a group is left over; the reasons for single agents are in test_plan.py."""

from __future__ import annotations

import math
from typing import Any

import pytest

from swarmbid.model import Agent, Mission, Task
from swarmbid.scores import Score, make_score
from swarmbid.unserved import REASONS, explain_unserved, offers

REWARD = make_score("time_window")
CAMERA, WINCH, BOTH = frozenset({"camera"}), frozenset({"winch"}), frozenset({"camera", "winch"})


def at(x: float, y: float = 0.0) -> tuple[float, float, float]:
    return (x, y, 0.0)


def agent(name: str, x: float = 0.0, **fields: Any) -> Agent:
    return Agent(id=name, position=at(x), **fields)


def left_over(
    *agents: Agent,
    others: tuple[Task, ...] = (),
    paths: dict[str, list[tuple[str, float]]] | None = None,
    score: Score = REWARD,
    **fields: Any,
) -> tuple[str, str]:
    """Why task t, 10 m to the east and for two agents, is left over when `agents` follow `paths`."""
    task = Task(id="t", position=at(10), **({"agents_required": 2} | fields))
    mission = Mission(agents=agents, tasks=(task, *others))
    return judged(mission, paths or {}, score)


def judged(
    mission: Mission, paths: dict[str, list[tuple[str, float]]], score: Score = REWARD
) -> tuple[str, str]:
    tasks = {task.id: task for task in mission.tasks}
    steps = {name: [(tasks[one], start) for one, start in path] for name, path in paths.items()}
    left = {
        one.task: one for one in explain_unserved(mission, steps, score, algorithm="cbga", insertion="shift")
    }
    assert left["t"].reason in REASONS
    return left["t"].reason, left["t"].detail


def test_equipment_that_takes_more_agents_than_there_are_seats():
    """Two seats, three things, one of them each."""
    team = [
        agent(name, equipment=frozenset({item}))
        for name, item in zip("abc", ("hook", "lamp", "rope"), strict=True)
    ]
    needs = frozenset({"hook", "lamp", "rope"})
    assert left_over(*team, equipment=needs) == (
        "missing_equipment",
        "It needs hook, lamp, rope of 2 agents; to bring that takes 3.",
    )
    assert left_over(*team, equipment=needs, agents_required=0)[0] == "no_group"
    assert left_over(*team, equipment=needs, agents_required=3)[0] == "no_group"


def test_equipment_that_nobody_has_for_as_many_as_it_takes():
    assert left_over(agent("a", equipment=CAMERA), equipment=BOTH, agents_required=0) == (
        "missing_equipment",
        "It needs camera, winch; the agents that may do it have no winch between them.",
    )


def test_too_few_are_there_in_time():
    """10 m at 1 m/s until 12 s: a at 10 s, b from 3 m behind at 13 s."""
    assert left_over(agent("a"), agent("b", -3), end=12.0) == (
        "window",
        "It needs 2 agents by 12 s; those in time, even doing nothing else: only a.",
    )
    assert left_over(agent("a", -4), agent("b", -3), end=12.0) == (
        "window",
        "It needs 2 agents by 12 s; those in time, even doing nothing else: nobody.",
    )
    assert left_over(agent("a"), agent("b", -2), end=12.0)[0] == "no_group"


def test_those_in_time_lack_what_the_late_one_has():
    team = agent("a", equipment=CAMERA), agent("b", equipment=CAMERA), agent("c", -3, equipment=WINCH)
    assert left_over(*team, end=12.0, equipment=BOTH) == (
        "window",
        "It needs 2 agents with camera, winch by 12 s; those in time, even doing nothing else: a and b,"
        " without winch.",
    )


def test_too_few_can_reach_it():
    """b may fly 9 m, it is 10 m away."""
    assert left_over(agent("a"), agent("b", range=9.0)) == (
        "range",
        "It needs 2 agents; those with the range and endurance, even doing nothing else: only a.",
    )


def test_the_prerequisite_that_is_unserved_is_named():
    first = Task(id="p", position=at(0), end=0.0)
    assert left_over(agent("a"), agent("b"), others=(first,), prerequisites=("p",)) == (
        "prerequisite",
        "It comes after p, which nobody does.",
    )


def test_too_few_gain_by_it_even_alone():
    """Worth 1 each; b pays 0.2 a metre for 10 m: 1 - 2 < 0."""
    assert left_over(agent("a"), agent("b", fuel_per_metre=0.2)) == (
        "no_gain",
        "It needs 2 agents; those who would gain by it, even with nothing else to do: only a.",
    )


def test_too_few_gain_by_it_given_what_they_do():
    """From 0 it is 10 m for both: 1 - 0.09 * 10 = 0.1. But b goes to u, 10 m west: 30 m in all, 1.8 more."""
    u = Task(id="u", position=at(-10), reward=5.0)
    team = agent("a"), agent("b", fuel_per_metre=0.09)
    assert left_over(*team)[0] == "no_group"
    assert left_over(*team, others=(u,), paths={"b": [("u", 10.0)]}) == (
        "no_gain",
        "It needs 2 agents; those who would gain by it now: only a.",
    )


def test_who_could_join_is_named_with_the_gain():
    """Both have nothing else to do. Of eight, six are named."""
    assert left_over(agent("a"), agent("b"), reward=3.0) == (
        "no_group",
        "It needs 2 agents; a (gain 3) and b (gain 3) could each join, but cbga formed no group of them.",
    )
    found = left_over(*(agent(name) for name in "abcdefgh"))[1]
    assert "e (gain 1), f (gain 1) and 2 more could each join" in found


def test_full_bundles_and_full_days_leave_too_few():
    """t until 10 s: a is free; b has its one task; c is at n until 5 s and would come at 15 s."""
    others = Task(id="m", position=at(0)), Task(id="n", position=at(0), end=0.0, duration=5.0)
    assert left_over(
        agent("a"),
        agent("b", bundle_limit=1),
        agent("c"),
        others=others,
        paths={"b": [("m", 0.0)], "c": [("n", 0.0)]},
        end=10.0,
    ) == (
        "no_room",
        "It needs 2 agents; those with room for it: only a;"
        " the others: 1 with a full bundle, 1 with no place on the path.",
    )


def pair_with_a_promise(end: float) -> tuple[Mission, dict[str, list[tuple[str, float]]]]:
    """a and b do g together at 20 m, at 20 s, by `end`; t, for one, is 10 m west of both."""
    tasks = (
        Task(id="g", position=at(20), agents_required=2, end=end),
        Task(id="t", position=at(-10)),
        Task(id="u", position=at(20), reward=5.0, end=21.0),
    )
    mission = Mission(agents=(agent("a"), agent("b")), tasks=tasks)
    return mission, {"a": [("g", 20.0)], "b": [("g", 20.0), ("u", 20.0)]}


def test_a_place_that_would_delay_others_beyond_their_window_is_none():
    """t first: 10 + 30 m, g at 40 s. That suits a and g, open until 50 s, but not b, whose u closes at 21 s.

    t last: fine as soon as it may be done so late.
    """
    mission, paths = pair_with_a_promise(end=50.0)
    assert judged(mission, paths)[0] == "other"
    early = [task if task.id != "t" else Task(id="t", position=at(-10), end=30.0) for task in mission.tasks]
    mission = Mission(agents=mission.agents, tasks=tuple(early))
    assert judged(mission, paths) == ("no_room", "Agents able to do it: 2 with no place on the path.")
    # Without u it is b's bundle and g only, and both may be as late as that.
    assert judged(mission, {"a": [("g", 20.0)], "b": [("g", 20.0)]})[0] == "other"


@pytest.mark.parametrize(("order", "position"), [("st", 1), ("ts", 0)])
def test_a_place_that_would_close_a_circle_is_none(order, position):
    """Two groups at one place, nothing takes time: a, who does s, can add t only in the order of b."""
    tasks = {one: Task(id=one, position=at(0), agents_required=2, end=0.0) for one in "st"}
    mission = Mission(agents=(agent("a"), agent("b")), tasks=tuple(tasks.values()))
    steps = {"a": [(tasks["s"], 0.0)], "b": [(tasks[one], 0.0) for one in order]}
    (offer,) = offers(mission, steps, REWARD, tasks["t"], algorithm="cbga", insertion="shift")
    assert (offer.agent, offer.gain, offer.position) == ("a", 1.0, position)


def test_a_member_more_waits_for_the_group_and_for_what_comes_first():
    """p ends at 30 s, t's group starts then; c would come at 10 s, and after t it would be late for v."""
    tasks = (
        Task(id="p", position=at(0), start=25.0, duration=5.0),
        Task(id="t", position=at(10), agents_required=2, prerequisites=("p",)),
        Task(id="v", position=at(20), end=39.0),
    )
    mission = Mission(agents=(agent("a"), agent("b"), agent("c")), tasks=tasks)
    steps = {"a": [(tasks[0], 25.0)], "b": [(tasks[1], 30.0)], "c": [(tasks[2], 20.0)]}
    found = {
        one.agent: one
        for one in offers(mission, steps, REWARD, tasks[1], algorithm="cbga", insertion="shift")
    }
    assert (found["a"].position, found["c"].position) == (1, 1)  # before v: 30 + 10 = 40 s > 39 s


@pytest.mark.parametrize(
    ("carries", "says"), [(CAMERA, ""), (frozenset({"lamp"}), "it carries nothing of camera, winch")]
)
def test_who_brings_nothing_cannot_join_where_equipment_decides(carries, says):
    task = Task(id="t", position=at(10), agents_required=0, equipment=BOTH)
    mission = Mission(agents=(agent("a", equipment=carries),), tasks=(task,))
    (offer,) = offers(mission, {}, REWARD, task, algorithm="cbga", insertion="shift")
    assert (offer.detail if says else "") == says
    assert (offer.gain is None) == bool(says)


def test_a_gain_counts_from_when_the_group_starts():
    """c could be there at 10 s, but t starts with a at 30 s: exp(-0.1 * 30), not exp(-0.1 * 10)."""
    task = Task(id="t", position=at(10), agents_required=2, discount=0.1)
    mission = Mission(agents=(agent("a"), agent("c")), tasks=(task,))
    score = make_score("time_discounted")
    (offer,) = offers(mission, {"a": [(task, 30.0)]}, score, task, algorithm="cbga", insertion="shift")
    assert offer.gain == pytest.approx(math.exp(-3.0))


@pytest.mark.parametrize(("endurance", "position"), [(39.0, 1), (40.0, 0)])
def test_a_place_that_would_keep_others_beyond_their_endurance_is_none(endurance, position):
    """t first makes a do g at 10 + 30 = 40 s, and with it b; t last costs a as much, and b nothing."""
    mission, _ = pair_with_a_promise(end=50.0)
    g, t, _ = mission.tasks
    mission = Mission(agents=(agent("a"), agent("b", endurance=endurance)), tasks=(g, t))
    steps = {"a": [(g, 20.0)], "b": [(g, 20.0)]}
    found = offers(mission, steps, REWARD, t, algorithm="cbga", insertion="shift")
    assert (found[0].agent, found[0].position) == ("a", position)
