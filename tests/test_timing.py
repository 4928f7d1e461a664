"""The earliest joint starts are those that a hand finds, and those that trying again and again finds."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmbid.model import Agent, Mission, Task
from swarmbid.timing import joint_starts


def at(x: float, y: float = 0.0) -> tuple[float, float, float]:
    return (x, y, 0.0)


def test_a_group_waits_for_its_last_member_and_delays_what_follows():
    """t: a is there at 3 s, b (free at 2 s) at 2 + 6 = 8 s; 1 s of service, then a's u, 4 m on, at 13 s."""
    mission = Mission(
        agents=(Agent(id="a", position=at(0)), Agent(id="b", position=at(9), available_at=2.0)),
        tasks=(
            Task(id="t", position=at(3), duration=1.0, agents_required=2),
            Task(id="u", position=at(7)),
        ),
    )
    assert joint_starts(mission, {"a": ["t", "u"], "b": ["t"]}) == {"t": 8.0, "u": 13.0}
    assert joint_starts(mission, {"a": ["u", "t"], "b": ["t"]}) == {"u": 7.0, "t": 11.0}
    assert joint_starts(mission, {}) == {}


def test_windows_prerequisites_and_what_is_given_hold_starts_back():
    """t opens at 5 s and takes 2 s; u waits for it until 7 s; or until 9 s, when so told."""
    mission = Mission(
        agents=(Agent(id="a", position=at(0)), Agent(id="b", position=at(0))),
        tasks=(
            Task(id="t", position=at(1), start=5.0, duration=2.0),
            Task(id="u", position=at(1), prerequisites=("t",)),
        ),
    )
    orders = {"a": ["t"], "b": ["u"]}
    assert joint_starts(mission, orders) == {"t": 5.0, "u": 7.0}
    assert joint_starts(mission, orders, {"u": 9.0}) == {"t": 5.0, "u": 9.0}
    assert joint_starts(mission, orders, {"t": 1.0}) == {"t": 5.0, "u": 7.0}
    # A prerequisite that nobody does holds nothing back: whether that may be is for others to judge.
    assert joint_starts(mission, {"b": ["u"]}) == {"u": 1.0}


@pytest.mark.parametrize(
    ("orders", "needs"),
    [
        ({"a": ["s", "t"], "b": ["t", "s"]}, {}),
        ({"a": ["s", "t"]}, {"s": ("t",)}),
        ({"a": ["s", "t"], "b": ["u", "v"]}, {"s": ("v",), "u": ("t",)}),
    ],
)
def test_who_waits_in_a_circle_never_starts(orders, needs):
    """Even though nothing takes any time."""
    tasks = tuple(Task(id=one, position=at(0), prerequisites=needs.get(one, ())) for one in "stuv")
    mission = Mission(agents=tuple(Agent(id=one, position=at(0)) for one in "ab"), tasks=tasks)
    assert joint_starts(mission, orders) is None


@given(st.data())
def test_starts_are_the_least_that_keep_every_rule(data):
    """Raising starts from their windows' opening until nothing has to be raised gives the same."""
    ids = "rstu"
    tasks = tuple(
        Task(
            id=one,
            position=at(data.draw(st.integers(0, 3))),
            start=float(data.draw(st.integers(0, 4))),
            duration=float(data.draw(st.integers(0, 2))),
            prerequisites=tuple(data.draw(st.lists(st.sampled_from(ids[:row]), unique=True)) if row else ()),
        )
        for row, one in enumerate(ids)
    )
    agents = tuple(
        Agent(id=one, position=at(0), speed=2.0, available_at=float(data.draw(st.integers(0, 3))))
        for one in "abc"
    )
    orders = {agent.id: data.draw(st.lists(st.sampled_from(ids), unique=True)) for agent in agents}
    found = joint_starts(Mission(agents=agents, tasks=tasks), orders)

    by_id = {task.id: task for task in tasks}
    starts = {one: by_id[one].start for order in orders.values() for one in order}
    # A circle without length settles here, so it is told apart by who comes before whom.
    before = {(one, need) for one in starts for need in by_id[one].prerequisites if need in starts}
    for order in orders.values():
        before |= {(later, first) for row, later in enumerate(order) for first in order[:row]}
    for _ in ids:
        before |= {(x, z) for x, y in before for w, z in before if y == w}
    if any(x == y for x, y in before):
        assert found is None
        return
    for _ in range(20):
        for agent in agents:
            place, free = agent.position, agent.available_at
            for one in orders[agent.id]:
                travel = abs(place[0] - by_id[one].position[0]) / agent.speed
                starts[one] = max(starts[one], free + travel)
                place, free = by_id[one].position, starts[one] + by_id[one].duration
        for one in starts:
            for need in by_id[one].prerequisites:
                if need in starts:
                    starts[one] = max(starts[one], starts[need] + by_id[need].duration)
    assert found == starts
