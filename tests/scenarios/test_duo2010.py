"""Solo, preferred and required duo tasks mean what the paper's words say, and what the docstring admits."""

from __future__ import annotations

import dataclasses
import math

import pytest

from swarmbid.errors import InputError
from swarmbid.references.coalition_optimum import coalition_optimum
from swarmbid.scenarios import duo2010
from swarmbid.scores import make_score

REWARD = make_score("time_window")
FADING = make_score("time_discounted")


def paid(kind: str, *agents: str) -> float:
    """The most that these agents earn where the one task of a kind is; 10 for one, 30 for two."""
    mission = duo2010.make(agents=4, discount=0.0, **({"solo": 0, "preferred": 0, "required": 0} | {kind: 1}))
    place = mission.tasks[0].position
    team = tuple(dataclasses.replace(agent, position=place) for agent in mission.agents if agent.id in agents)
    return coalition_optimum(dataclasses.replace(mission, agents=team), REWARD).value


def test_a_solo_task_is_for_one_type():
    assert paid("solo", "a00") == 10.0
    assert paid("solo", "b00") == 0.0
    assert paid("solo", "a00", "b00") == 10.0


def test_a_preferred_duo_pays_one_and_pays_two_of_unlike_type_more():
    assert paid("preferred", "a00") == 10.0
    assert paid("preferred", "b00") == 10.0
    assert paid("preferred", "a00", "a01") == 10.0
    assert paid("preferred", "a00", "b00") == 30.0
    # What is not exact pays no more: three could share it.
    assert paid("preferred", "a00", "a01", "b00", "b01") == 30.0


def test_a_required_duo_pays_two_of_unlike_type_only():
    assert paid("required", "a00") == 0.0
    assert paid("required", "b00", "b01") == 0.0
    assert paid("required", "a00", "b01") == 30.0
    assert paid("required", "a00", "a01", "b00", "b01") == 30.0


def test_the_two_of_a_preferred_duo_are_together_when_the_service_ends():
    """5 s of service from 0 s; the bonus starts at 5 s, or as soon as the other one has come."""
    mission = duo2010.make(agents=2, solo=0, preferred=1, required=0, duration=5.0)
    service, bonus = mission.tasks
    assert (bonus.position, bonus.duration) == (service.position, 0.0)
    east, north, up = service.position
    near = dataclasses.replace(mission.agents[0], position=service.position)
    for metres, start in ((10.0, 5.0), (40.0, 20.0)):
        other = dataclasses.replace(mission.agents[1], position=(east + metres, north, up), speed=2.0)
        found = coalition_optimum(dataclasses.replace(mission, agents=(near, other)), FADING)
        assert found.paths["a00"] == [(service.id, 0.0), (bonus.id, pytest.approx(start))]
        assert found.paths["b00"] == [(bonus.id, pytest.approx(start))]


def test_a_bonus_fades_and_closes_with_its_service():
    """Whoever starts the service at t ends it at t + 5: the bonus counts from 5 s later, to 5 s later."""
    mission = duo2010.make(seed=3, window=20.0, horizon=60.0, duration=5.0)
    tasks = {task.id: task for task in mission.tasks}
    bonuses = [task for task in mission.tasks if task.id.endswith(".bonus")]
    assert len(bonuses) == 6
    for bonus in bonuses:
        service = tasks[bonus.id.removesuffix(".bonus")]
        assert bonus.prerequisites == (service.id,)
        assert bonus.start == service.start + 5.0
        assert bonus.end == pytest.approx(service.end + 5.0)
        assert bonus.end - bonus.start == pytest.approx(20.0)


def test_types_take_turns_and_numbers_are_as_asked():
    mission = duo2010.make(seed=1)
    assert [agent.id for agent in mission.agents] == ["a00", "b00", "a01", "b01", "a02", "b02"]
    assert {agent.id[0] for agent in mission.agents if agent.type == "a"} == {"a"}
    kinds = [task.type for task in mission.tasks]
    assert {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)} == {
        "solo_a": 4,
        "solo_b": 4,
        "preferred": 12,  # a service and a bonus each
        "required": 6,
    }
    assert all(math.isinf(task.end) for task in mission.tasks)
    assert all(0.0 <= task.position[0] < 100.0 for task in mission.tasks)


def test_same_seed_same_mission_and_kinds_do_not_disturb_each_other():
    assert duo2010.make(7) == duo2010.make(7)
    assert duo2010.make(7).tasks != duo2010.make(8).tasks
    fewer = duo2010.make(7, preferred=0)
    assert set(fewer.tasks) == {task for task in duo2010.make(7).tasks if task.type != "preferred"}


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"agents": 0}, "agents: is 0"),
        ({"solo": -1}, "solo: is -1"),
        ({"speed": 0.0}, "speed: is 0.0"),
        ({"window": math.inf}, "window: is inf"),
        ({"duo_reward": 10.0}, "Two are to earn more than one, who earns 10"),
        ({"prefered": 1}, "Did you mean 'preferred'"),
    ],
)
def test_options_that_make_no_sense_are_refused(options, says):
    with pytest.raises(InputError, match=says):
        duo2010.make(**options)
