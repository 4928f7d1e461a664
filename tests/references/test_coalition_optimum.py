"""The optimum with groups is the optimum: hand examples, and brute force written another way."""

from __future__ import annotations

import dataclasses
import itertools
import math
import random

import pytest

from generators import random_mission
from swarmbid.errors import InputError
from swarmbid.model import Agent, Mission, Task
from swarmbid.plan import make_plan
from swarmbid.references.coalition_optimum import coalition_optimum
from swarmbid.references.optimum import optimum
from swarmbid.scores import Score, make_score
from swarmbid.scores._custom import Custom
from swarmbid.verify import verify

METRES = make_score("distance_cost", second_cost=0.0)
CAMERA, WINCH = frozenset({"camera"}), frozenset({"winch"})


def at(x: float, y: float = 0.0) -> tuple[float, float, float]:
    return (x, y, 0.0)


def coupled(seed: int, mission: Mission, *, step: float = 0.0) -> Mission:
    """The mission with seats, equipment and prerequisites drawn from `seed`."""
    rng = random.Random(seed)
    agents = tuple(
        dataclasses.replace(agent, equipment=rng.choice([CAMERA, WINCH, CAMERA | WINCH]))
        for agent in mission.agents
    )
    tasks: list[Task] = []
    for task in mission.tasks:
        needs = rng.choice([frozenset(), CAMERA, CAMERA | WINCH])
        tasks.append(
            dataclasses.replace(
                task,
                agents_required=rng.choice([0, 1, 2, 2, 3] if needs else [1, 2, 2, 3]),
                equipment=needs,
                prerequisites=(rng.choice(tasks).id,) if tasks and rng.random() < 0.4 else (),
            )
        )
    return Mission(agents=agents, tasks=tuple(tasks), distance_step=step)


def brute_force(mission: Mission, score: Score) -> float:
    """Give every agent every order of every set of tasks, and keep the best of what can be executed."""
    ids = [task.id for task in mission.tasks]
    tasks = {task.id: task for task in mission.tasks}
    orders = [order for size in range(len(ids) + 1) for order in itertools.permutations(ids, size)]
    best = 0.0
    for choice in itertools.product(orders, repeat=len(mission.agents)):
        crews = {
            one: [agent for agent, order in zip(mission.agents, choice, strict=True) if one in order]
            for one in ids
        }
        if all(complete(mission, tasks[one], crew) for one, crew in crews.items() if crew):
            best = max(best, worth(mission, score, dict(zip(mission.agents, choice, strict=True)), crews))
    return best


def complete(mission: Mission, task: Task, crew: list[Agent]) -> bool:
    brought = [item for agent in crew for item in agent.equipment]
    if not all(mission.can_do(agent, task) for agent in crew) or not task.equipment <= set(brought):
        return False
    if task.agents_required:
        return len(crew) == task.agents_required
    return all(any(brought.count(item) == 1 for item in agent.equipment & task.equipment) for agent in crew)


def worth(
    mission: Mission,
    score: Score,
    orders: dict[Agent, tuple[str, ...]],
    crews: dict[str, list[Agent]],
) -> float:
    """Total score when everything starts as early as it can; -inf if it cannot be executed."""
    tasks = {task.id: task for task in mission.tasks}
    if any(not crews[need] for one, crew in crews.items() if crew for need in tasks[one].prerequisites):
        return -math.inf
    starts: dict[str, float] = {}
    while True:  # settle whatever has everything before it settled
        ready = {}
        for one, crew in crews.items():
            if one in starts or not crew:
                continue
            bounds = [tasks[one].start]
            before = list(tasks[one].prerequisites)
            for agent in crew:
                spot = orders[agent].index(one)
                place, free = agent.position, agent.available_at
                if spot:
                    last = tasks[orders[agent][spot - 1]]
                    before.append(last.id)
                    place, free = last.position, starts.get(last.id, math.inf) + last.duration
                bounds.append(free + mission.distance(place, tasks[one].position) / agent.speed)
            bounds += [starts.get(need, math.inf) + tasks[need].duration for need in before]
            if max(bounds) < math.inf:
                ready[one] = max(bounds)
        if not ready:
            break
        starts |= ready
    if any(crew and one not in starts for one, crew in crews.items()):
        return -math.inf  # they wait for each other
    if any(start > tasks[one].end for one, start in starts.items()):
        return -math.inf
    total = 0.0
    for agent, order in orders.items():
        place, metres, clock = agent.position, 0.0, agent.available_at
        for one in order:
            leg = mission.distance(place, tasks[one].position)
            total += score.value(mission, agent, tasks[one], starts[one], leg)
            place, metres, clock = tasks[one].position, metres + leg, starts[one] + tasks[one].duration
        if order and agent.base is not None:
            home = mission.distance(place, agent.base)
            metres, clock = metres + home, clock + home / agent.speed
        if metres > agent.range or clock > agent.available_at + agent.endurance:
            return -math.inf
        if agent.bundle_limit is not None and len(order) > agent.bundle_limit:
            return -math.inf
    return total


@pytest.mark.parametrize(("agents", "tasks"), [(3, 3), (2, 4)])
@pytest.mark.parametrize("name", ["time_discounted", "time_window", "distance_cost"])
def test_equal_to_brute_force(name, agents, tasks, effort):
    """Seats, open seats, equipment, prerequisites, windows, ranges, bases, limits, ties; 60 missions each."""
    score = make_score(name)
    grouped = 0
    for seed in range(60 * effort):
        plain = random_mission(
            seed, ties=seed % 2 == 0, agents=(2, agents), tasks=(2, tasks), ranges=True, reward_scale=12.0
        )
        mission = coupled(seed, plain, step=7.0 if seed % 4 == 3 else 0.0)
        found = coalition_optimum(mission, score)
        assert found.proven
        assert found.value == pytest.approx(brute_force(mission, score), rel=1e-9, abs=1e-9)
        plan = make_plan(mission, found.paths, score, "optimum", "shift")
        assert verify(mission, plan, score) == []
        assert plan.total_score == pytest.approx(found.value, rel=1e-9)
        held = [task_id for path in found.paths.values() for task_id, _ in path]
        grouped += len(held) > len(set(held))
    assert grouped >= 15 * effort


def grown_in_every_way(mission: Mission, score: Score) -> float:
    """Put one task after the other at the end of its group's paths, in every order and by every group."""
    groups = {
        task.id: [
            crew
            for size in range(1, len(mission.agents) + 1)
            for crew in itertools.combinations(mission.agents, size)
            if complete(mission, task, list(crew))
        ]
        for task in mission.tasks
    }
    # Agent id -> where it is, when, s, metres flown, number of tasks.
    State = dict[str, tuple[tuple[float, float, float], float, float, int]]

    def grow(state: State, ends: dict[str, float]) -> float:
        home = True
        for agent in mission.agents:
            place, free, metres, count = state[agent.id]
            back = mission.distance(place, agent.base) if agent.base is not None and count else 0.0
            fits = (
                metres + back <= agent.range
                and free + back / agent.speed <= agent.available_at + agent.endurance
            )
            home = home and (fits or not count)
        best = 0.0 if home else -math.inf
        for task in mission.tasks:
            if task.id in ends or any(need not in ends for need in task.prerequisites):
                continue
            for crew in groups[task.id]:
                start = max([task.start, *(ends[need] for need in task.prerequisites)])
                legs = {agent: mission.distance(state[agent.id][0], task.position) for agent in crew}
                start = max([start, *(state[agent.id][1] + leg / agent.speed for agent, leg in legs.items())])
                if start > task.end:
                    continue
                after = dict(state)
                for agent, leg in legs.items():
                    _, _, metres, count = state[agent.id]
                    after[agent.id] = (task.position, start + task.duration, metres + leg, count + 1)
                limits = [math.inf if agent.bundle_limit is None else agent.bundle_limit for agent in crew]
                if any(after[agent.id][3] > limit for agent, limit in zip(crew, limits, strict=True)):
                    continue
                gain = sum(score.value(mission, agent, task, start, leg) for agent, leg in legs.items())
                best = max(best, gain + grow(after, ends | {task.id: start + task.duration}))
        return best

    return grow({one.id: (one.position, one.available_at, 0.0, 0) for one in mission.agents}, {})


def tight(seed: int) -> Mission:
    """On a line of 20 m: what earns most is often late, far from home or full for the rest."""
    rng = random.Random(seed)
    team = []
    for name in "abc":
        home = at(rng.uniform(0, 20))
        team.append(
            Agent(
                id=name,
                position=home,
                fuel_per_metre=0.2,
                bundle_limit=rng.choice([None, 2, 3]),
                range=rng.choice([math.inf, rng.uniform(10, 50)]),
                endurance=rng.choice([math.inf, rng.uniform(20, 50)]),
                base=rng.choice([None, home]),
            )
        )
    work = []
    for row in range(5):
        opens = rng.choice([0.0, rng.uniform(0, 20)])
        work.append(
            Task(
                id=f"t{row}",
                position=at(rng.uniform(0, 20)),
                reward=rng.uniform(3, 20),
                start=opens,
                end=opens + rng.choice([6.0, 15.0, math.inf]),
                duration=rng.choice([0.0, 8.0]),
                discount=rng.choice([0.0, 0.05]),
            )
        )
    return Mission(agents=tuple(team), tasks=tuple(work))


@pytest.mark.parametrize("name", ["time_discounted", "time_window"])
def test_nothing_better_was_dropped(name, effort):
    """Of larger missions most partial plans are never grown: growing all of them finds no better one."""
    score = make_score(name)
    # After some hundreds: those in which a detour saves metres, an early agent is worth more than a rich
    # one, and the way home is short by rounding.
    for seed in (*range(80 * effort), 329, 665, 671, 750, 1118, 1235):
        mission = tight(seed)
        if seed % 4 == 0:  # a team of one kind, spread out
            first = mission.agents[0]
            team = tuple(
                dataclasses.replace(first, id=one.id, position=one.position) for one in mission.agents
            )
            mission = dataclasses.replace(mission, agents=team)
        if seed % 3:
            mission = coupled(seed, mission, step=6.0 if seed % 3 == 2 else 0.0)
        found = coalition_optimum(mission, score)
        assert found.value == pytest.approx(grown_in_every_way(mission, score), rel=1e-9, abs=1e-9), seed


def who_goes_on(right: Agent, other: Agent, score: Score) -> None:
    """p and q open at 10 s, r comes after both, by 26 s, 15 m from q at 1 m/s: the agent on q does r as well.

    Where the two agents stand alike, whichever of them is on q, only one of these ways is followed up.
    """
    tasks = (
        Task(id="p", position=at(0, 5), reward=90.0, start=10.0, end=11.0),
        Task(id="q", position=at(0, -5), reward=90.0, start=10.0, end=11.0),
        Task(id="r", position=at(15, -5), reward=90.0, end=26.0, prerequisites=("p", "q")),
    )
    for names in ("ab", "ba"):
        team = tuple(
            dataclasses.replace(one, id=name) for one, name in zip((right, other), names, strict=True)
        )
        found = coalition_optimum(Mission(agents=team, tasks=tasks), score)
        assert [task_id for task_id, _ in found.paths[names[0]]] == ["q", "r"]
        assert [task_id for task_id, _ in found.paths[names[1]]] == ["p"]


def test_only_agents_that_are_alike_stand_in_for_each_other():
    """Not the slower one, not one that is back by 20 s, and not where fuel counts from where one began."""
    one = Agent(id="a", position=at(-5))
    reward = make_score("time_window")
    who_goes_on(one, dataclasses.replace(one, speed=0.8), reward)
    who_goes_on(one, dataclasses.replace(one, endurance=20.0), reward)
    one = dataclasses.replace(one, fuel_per_metre=1.0)
    from_start = make_score("time_discounted", fuel="start")
    # From (5, 0) it is 10 m east and 5 m south to r, from (-5, 0) 20 m and 5 m; p and q are alike for both.
    who_goes_on(dataclasses.replace(one, position=at(5)), one, from_start)


@pytest.mark.parametrize("name", ["time_discounted", "time_window", "distance_cost", "revisit"])
def test_equal_to_the_other_optimum_where_nobody_needs_another(name, effort):
    """Found by whole paths and a set packing there, by partial plans here."""
    score = make_score(name)
    for seed in range(20 * effort):
        mission = random_mission(
            seed,
            ties=seed % 2 == 0,
            agents=(2, 3),
            tasks=(3, 5),
            ranges=True,
            revisits=True,
            reward_scale=8.0,
        )
        found = coalition_optimum(mission, score)
        other = optimum(mission, score)
        assert found.value == pytest.approx(other.value, rel=1e-9, abs=1e-9)
        assert found.proven == other.proven


def test_both_members_of_a_group_are_paid_and_wait_for_the_later():
    """10 m for a, 2 m for b, reward 20 each, a metre costs 1: 10 + 18; both start at 10 s."""
    mission = Mission(
        agents=(Agent(id="a", position=at(0)), Agent(id="b", position=at(12))),
        tasks=(Task(id="t", position=at(10), reward=20.0, agents_required=2),),
    )
    found = coalition_optimum(mission, METRES)
    assert (found.value, found.paths) == (28.0, {"a": [("t", 10.0)], "b": [("t", 10.0)]})
    assert found.proven


def test_an_order_in_which_nobody_waits_in_a_circle_is_found():
    """s at 0 and t at 10 m, both for two; a stands at s, b at t, so alone each would begin where it is.

    a first s then t and b first t then s would be 10 m each, and neither would ever start. In one order:
    one of them goes 10 + 10 m, the other 10 m: 4 rewards of 100 less 30 m.
    """
    mission = Mission(
        agents=(Agent(id="a", position=at(0)), Agent(id="b", position=at(10))),
        tasks=tuple(
            Task(id=one, position=at(x), reward=100.0, agents_required=2) for one, x in (("s", 0), ("t", 10))
        ),
    )
    found = coalition_optimum(mission, METRES)
    assert found.value == 370.0
    assert verify(mission, make_plan(mission, found.paths, METRES, "optimum", "shift"), METRES) == []


def test_a_poor_prerequisite_is_done_for_the_sake_of_what_follows():
    """p pays 1 and costs 5 m; t, beside it, pays 50."""
    tasks = (
        Task(id="p", position=at(5), reward=1.0, duration=3.0),
        Task(id="t", position=at(5), reward=50.0, prerequisites=("p",)),
    )
    mission = Mission(agents=(Agent(id="a", position=at(0)),), tasks=tasks)
    found = coalition_optimum(mission, METRES)
    assert (found.value, found.paths) == (46.0, {"a": [("p", 5.0), ("t", 8.0)]})


def test_when_a_prerequisite_ends_matters_to_who_was_never_there():
    """a does p (until 5 s) and waits for q at 20 s; b may do t as soon as p ends, and no later than 6 s.

    A slower way to the same end of a's path, p until 9 s, would be forgotten by who keeps one of the two.
    """
    tasks = (
        Task(id="p", position=at(0), duration=5.0),
        Task(id="q", position=at(0), start=20.0),
        Task(id="t", position=at(0), end=6.0, prerequisites=("p",), type="b"),
        Task(id="r", position=at(0), duration=4.0),
    )
    mission = Mission(
        agents=(
            Agent(id="a", type="a", position=at(0)),
            Agent(id="b", type="b", position=at(0)),
        ),
        tasks=tasks,
        compatible={"a": frozenset({"task"}), "b": frozenset({"b"})},
    )
    found = coalition_optimum(mission, METRES)
    assert found.value == 4.0
    assert dict(found.paths["b"]) == {"t": 5.0}
    assert [one for one, _ in found.paths["a"]] in (["p", "r", "q"], ["p", "q", "r"])


def test_who_is_not_needed_is_not_paid_where_equipment_decides():
    """a alone brings all; with b, who brings a part, there would be two rewards of 10."""
    task = Task(id="t", position=at(0), reward=10.0, agents_required=0, equipment=CAMERA | WINCH)
    team = (
        Agent(id="a", position=at(0), equipment=CAMERA | WINCH),
        Agent(id="b", position=at(0), equipment=CAMERA),
        Agent(id="c", position=at(1), equipment=WINCH),
    )
    found = coalition_optimum(Mission(agents=team, tasks=(task,)), METRES)
    # b and c, who must come 1 m: 19, more than a's 10.
    assert (found.value, found.paths) == (19.0, {"a": [], "b": [("t", 1.0)], "c": [("t", 1.0)]})
    found = coalition_optimum(Mission(agents=team[:2], tasks=(task,)), METRES)
    assert (found.value, found.paths) == (10.0, {"a": [("t", 0.0)], "b": []})


def test_nothing_to_do_and_nobody_to_do_it():
    task = Task(id="t", position=at(0))
    nothing = coalition_optimum(Mission(agents=(), tasks=(task,)), METRES)
    assert (nothing.value, nothing.paths, nothing.proven) == (0.0, {}, True)
    idle = coalition_optimum(Mission(agents=(Agent(id="a", position=at(0)),), tasks=()), METRES)
    assert (idle.value, idle.paths) == (0.0, {"a": []})


def test_a_score_of_ones_own_that_mixes_time_and_way(effort):
    """Who comes from far loses less by being late: what time costs at 0 m says nothing of other ways."""
    score = Custom(lambda visit: visit.reward - visit.start * max(0.0, 0.5 - 0.03 * visit.leg))
    for seed in range(30 * effort):
        mission = coupled(seed, tight(seed))
        found = coalition_optimum(mission, score)
        assert found.value == pytest.approx(grown_in_every_way(mission, score), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(("near", "far"), [("p", "q"), ("q", "p")])
def test_the_order_that_leaves_more_range_is_kept(near, far):
    """2, 4, 6 and then 12 m, which is the range; 4, 2, 6 is 10 m already. Both are there at 50 s, as rich."""
    tasks = (
        Task(id=near, position=at(2)),
        Task(id=far, position=at(4)),
        Task(id="r", position=at(6), start=50.0, end=60.0),
        Task(id="s", position=at(12), start=55.0),
    )
    mission = Mission(agents=(Agent(id="a", position=at(0), range=12.0),), tasks=tasks)
    found = coalition_optimum(mission, make_score("time_window"))
    assert [task_id for task_id, _ in found.paths["a"]] == [near, far, "r", "s"]


def test_waiting_for_a_revisit_is_tried_but_not_proven():
    """Worth 10 at 50 s, e^-1 of it at 40 s and at 60 s; b is there at 55 s, a at 5 s waits for it."""
    task = Task(id="t", position=at(5), reward=10.0, revisit_at=50.0, revisit_width=10.0, agents_required=2)
    mission = Mission(
        agents=(Agent(id="a", position=at(0)), Agent(id="b", position=at(0), speed=1.0)), tasks=(task,)
    )
    found = coalition_optimum(mission, make_score("revisit"))
    assert (found.value, found.paths) == (20.0, {"a": [("t", 50.0)], "b": [("t", 50.0)]})
    assert not found.proven


def test_what_is_too_large_is_refused():
    mission = random_mission(1, agents=(3, 3), tasks=(6, 6))
    with pytest.raises(
        InputError, match="too large for the exact optimum: 3 agents and 6 tasks took more than 20"
    ):
        coalition_optimum(mission, make_score("time_window"), max_parts=20)
