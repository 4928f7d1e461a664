"""What counts as a clean end of a negotiation: each fault on its own, and none where there is none."""

from __future__ import annotations

from typing import Any

import pytest

from swarmbid.experiments._cleanliness import State, joint_starts, judge_state
from swarmbid.messages import Message
from swarmbid.model import Agent, Mission, Task
from swarmbid.simulator import simulate


class Fixed:
    """A negotiator that holds what it is given; `restless` ones hold something else at every tick."""

    def __init__(
        self, agent_id: str, beliefs: dict[str, Any], path: list[str], *, restless: bool = False
    ) -> None:
        self.agent_id = agent_id
        self._beliefs = beliefs
        self.path = [(task_id, 0.0) for task_id in path]
        self.digest = 1
        self.restless = restless

    def beliefs(self) -> dict[str, Any]:
        return self._beliefs

    def next_tick(self) -> float | None:
        return 0.0

    def tick(self, now: float) -> list[Message]:
        self.digest += self.restless
        return []


def mission_of(*tasks: Task, **agents: str) -> Mission:
    """Agents, each with the letters of its equipment, all at (0, 0) with 1 m/s."""
    crew = agents or {"a": "", "b": ""}
    return Mission(
        agents=tuple(
            Agent(id=name, position=(0.0, 0.0, 0.0), equipment=frozenset(letters))
            for name, letters in crew.items()
        ),
        tasks=tasks,
    )


def task(name: str, east: float = 10.0, seats: int = 2, **fields: Any) -> Task:
    return Task(id=name, position=(east, 0.0, 0.0), agents_required=seats, reward=100.0, **fields)


def judged(mission: Mission, paths: dict[str, list[str]], held: dict[str, str] | None = None) -> State:
    """All believe the same: `held` tasks -> letters of the agents; by default what the paths say."""
    crews = held or {
        one.id: "".join(name for name, path in paths.items() if one.id in path) for one in mission.tasks
    }
    beliefs = {one.id: tuple((name, 5.0) for name in crews.get(one.id, "")) for one in mission.tasks}
    return judge_state([Fixed(name, beliefs, path) for name, path in paths.items()], mission)  # type: ignore[misc]


def faults(state: State) -> dict[str, Any]:
    return {name: value for name, value in state.items() if isinstance(value, list) and value}


def test_a_complete_group_at_rest_is_clean():
    state = judged(mission_of(task("t")), {"a": ["t"], "b": ["t"]})
    assert state["clean"] and state["quiescent"] and state["agreed"] and not faults(state)


def test_a_mission_that_nobody_serves_is_clean_too():
    assert judged(mission_of(task("t")), {"a": [], "b": []})["clean"]


@pytest.mark.parametrize(
    ("seats", "paths", "held", "fault"),
    [
        (1, {"a": ["t"], "b": ["t"]}, None, "overfilled"),
        (3, {"a": [], "b": []}, {"t": "ab"}, "underfilled"),
        (1, {"a": ["t"], "b": ["t"]}, {"t": "a"}, "overfilled"),
    ],
)
def test_seats_are_neither_too_many_nor_too_few(
    seats: int, paths: dict[str, list[str]], held: dict[str, str] | None, fault: str
):
    """The second is what no plan would show: both wait for a third that never comes."""
    state = judged(mission_of(task("t", seats=seats)), paths, held)
    assert faults(state) == {fault: ["t"]}
    assert not state["clean"]


def test_a_full_group_without_its_equipment_is_a_fault():
    need = frozenset("kw")
    for letters, found in (({"a": "k", "b": "k"}, {"equipment": ["t"]}), ({"a": "k", "b": "w"}, {})):
        state = judged(mission_of(task("t", equipment=need), **letters), {"a": ["t"], "b": ["t"]})
        assert faults(state) == found


def test_a_group_with_open_seats_lacks_members_until_its_equipment_is_there():
    need = frozenset("kw")
    mission = mission_of(task("t", seats=0, equipment=need), a="k", b="w")
    assert faults(judged(mission, {"a": ["t"], "b": []})) == {"underfilled": ["t"]}
    assert faults(judged(mission, {"a": ["t"], "b": ["t"]})) == {}


def test_what_comes_after_an_unserved_task_is_a_fault():
    mission = mission_of(task("p", seats=1), task("t", seats=1, prerequisites=("p",)))
    assert faults(judged(mission, {"a": ["t"], "b": []})) == {"prerequisites": ["t"]}
    assert faults(judged(mission, {"a": ["t"], "b": ["p"]})) == {}


def test_agents_that_wait_for_each_other_are_a_fault_and_so_is_all_behind_them():
    """a stands at t1 and waits for b, b at t2 for a; u is alone, but comes after t1."""
    mission = mission_of(task("t1"), task("t2", 40.0), task("u", seats=1))
    paths = {"a": ["t1", "t2", "u"], "b": ["t2", "t1"]}
    assert faults(judged(mission, paths)) == {"circular": ["t1", "t2", "u"]}


def test_an_agent_that_waits_for_its_own_later_task_waits_in_a_circle():
    mission = mission_of(task("p", seats=1), task("t", seats=1, prerequisites=("p",)))
    assert faults(judged(mission, {"a": ["t", "p"], "b": []})) == {"circular": ["p", "t"]}


def test_the_latest_member_may_be_too_late():
    """b is at u, 40 m away, until 40 s and at t 30 s later, at 70 s; t closes at 69 or 70 s."""
    for end, found in ((69.0, {"late": ["t"]}), (70.0, {})):
        mission = mission_of(task("t", end=end), task("u", 40.0, seats=1))
        assert faults(judged(mission, {"a": ["t"], "b": ["u", "t"]})) == found


def test_joint_starts_wait_for_members_windows_and_prerequisites():
    """p: a is there at 10 s, its window opens at 15 s, and it takes 5 s, so q may begin at 20 s.

    t (20 m): a flies on at 20 s and comes at 30 s; b, straight from q at 20 s and 10 m, comes at 30 s too.
    """
    mission = mission_of(
        task("p", seats=1, start=15.0, duration=5.0),
        task("q", seats=1, prerequisites=("p",)),
        task("t", 20.0),
    )
    assert joint_starts(mission, {"a": ["p", "t"], "b": ["q", "t"]}) == {"p": 15.0, "q": 20.0, "t": 30.0}


def test_who_believes_otherwise_has_not_agreed():
    mission = mission_of(task("t", seats=1))
    negotiators = [Fixed("a", {"t": (("a", 5.0),)}, ["t"]), Fixed("b", {"t": ()}, [])]
    state = judge_state(negotiators, mission)  # type: ignore[arg-type]
    assert (state["agreed"], state["clean"], faults(state)) == (False, False, {})


def test_who_goes_on_changing_is_not_at_rest_and_is_not_touched():
    mission = mission_of(task("t", seats=1))
    one = Fixed("a", {"t": ()}, [], restless=True)
    state = judge_state([one], mission)  # type: ignore[list-item]
    assert (state["quiescent"], state["clean"]) == (False, False)
    assert one.digest == 1


def test_a_real_run_is_judged_as_it_ended():
    """Two tasks for two at the two ends: as printed the agents wait for each other, and all agree on it."""
    mission = Mission(
        agents=(Agent(id="a", position=(0.0, 0.0, 0.0)), Agent(id="b", position=(50.0, 0.0, 0.0))),
        tasks=(task("t1"), task("t2", 40.0)),
    )
    run = simulate(mission, algorithm="cbga_printed", score="distance_cost")
    digests = [one.digest for one in run.negotiators]
    state = judge_state(run.negotiators, mission, {"a": ["b"], "b": ["a"]})
    assert faults(state) == {"circular": ["t1", "t2"]}
    assert state["quiescent"] and state["agreed"]
    assert [one.digest for one in run.negotiators] == digests


def test_a_run_that_would_go_on_is_not_at_rest():
    """Cut off after two rounds: a and b have just heard that c is better, and a will do something else."""
    mission = Mission(
        agents=tuple(Agent(id=name, position=(10.0 * k, 0.0, 0.0)) for k, name in enumerate("abc")),
        tasks=(task("t", 20.0, seats=1), task("u", 25.0, seats=1)),
    )
    cut, done = (
        simulate(mission, algorithm="cbga_printed", score="distance_cost", warp=True, max_rounds=rounds)
        for rounds in (1, 50)
    )
    assert not judge_state(cut.negotiators, mission)["quiescent"]
    assert judge_state(done.negotiators, mission)["clean"]
