"""The maritime scenario: what drifts, what is known of it, and whether it is found and followed."""

from __future__ import annotations

import math
from io import BytesIO

import numpy as np
import pytest

from swarmbid.errors import InputError
from swarmbid.scenarios import maritime
from swarmbid.scenarios.maritime import OPTIONS
from swarmbid.trace import Detected, Truth, read_trace
from swarmbid.world.grid import Grid
from swarmbid.world.mission import SearchMission
from swarmbid.worldsim import Sortie, fly

SMALL = {"uavs": 3, "ships": 1, "width": 5000.0, "duration": 1200.0, "elapsed": 600.0, "sigma": 300.0}


@pytest.fixture(scope="module")
def mission() -> SearchMission:
    return maritime.make(2, **SMALL)


@pytest.fixture(scope="module")
def flight(mission: SearchMission) -> tuple[Sortie, bytes]:
    kept = BytesIO()
    return fly(mission, seed=2, trace=kept), kept.getvalue()


def test_one_raft_drifts_and_uavs_and_a_ship_set_out_from_one_harbour() -> None:
    mission = maritime.make(5)
    assert [target.kind for target in mission.targets] == ["drifting"]
    assert mission.kind == "one"
    assert [vehicle.type for vehicle in mission.vehicles] == ["uav", "uav", "uav", "ship"]
    harbour = (0.5 * OPTIONS.width, 0.02 * OPTIONS.width)
    assert all(math.dist(vehicle.position[:2], harbour) <= 150.0 for vehicle in mission.vehicles)
    reach = [vehicle.sensor.radius(vehicle.position[2]) for vehicle in mission.vehicles]
    assert reach == pytest.approx([OPTIONS.reach] * 4)


def test_several_rafts_are_not_known_to_be_one() -> None:
    mission = maritime.make(5, rafts=3)
    assert (mission.kind, mission.expected, len(mission.targets)) == ("independent", 3.0, 3)


def test_same_seed_same_mission_and_one_more_raft_moves_no_other() -> None:
    assert maritime.make(5) == maritime.make(5)
    assert maritime.make(5) != maritime.make(6)
    assert maritime.make(5, rafts=3).targets[:2] == maritime.make(5, rafts=2).targets


def test_rafts_are_where_the_datum_says_and_drift_as_is_believed() -> None:
    """Mean and variance of places and leeways over many seeds, within 3 (and for variances 4) sigma."""
    count = 300
    missions = [maritime.make(seed) for seed in range(count)]
    x, y, sigma = missions[0].datum or (0.0, 0.0, 0.0)
    assert sigma == pytest.approx(math.hypot(OPTIONS.sigma, OPTIONS.leeway_sigma * OPTIONS.elapsed))
    at = np.array([one.targets[0].position for one in missions]) - (x, y)
    off = np.array([one.targets[0].velocity for one in missions])
    for values, spread in ((at, sigma), (off, OPTIONS.leeway_sigma)):
        assert np.all(np.abs(values.mean(axis=0)) <= 3.0 * spread / math.sqrt(count))
        # The variance of a variance is 2 sigma^4 / n, so the deviation's is sigma / sqrt(2 n).
        assert values.std() == pytest.approx(spread, abs=4.0 * spread / math.sqrt(4.0 * count))


def test_the_belief_grows_as_wide_as_the_places_do() -> None:
    """Prior N(datum, s0^2) and diffusion D give s0^2 + 2 D T = sigma^2 + s_leeway^2 (elapsed + T)^2."""
    mission = maritime.make(1)
    assert mission.datum is not None
    variance = mission.datum[2] ** 2 + 2.0 * mission.diffusion * mission.duration
    total = OPTIONS.elapsed + OPTIONS.duration
    assert variance == pytest.approx(OPTIONS.sigma**2 + (OPTIONS.leeway_sigma * total) ** 2)


def test_the_belief_drifts_with_the_sea() -> None:
    mission = maritime.make(1)
    grid = Grid(mission.area, mission.cell)
    belief = mission.belief(grid)
    means = []
    for seconds in (0.0, 600.0):
        belief.advance(seconds)
        mass = belief.probability / belief.probability.sum()
        means.append((float((mass * grid.x[None, :]).sum()), float((mass * grid.y[:, None]).sum())))
    moved = (means[1][0] - means[0][0], means[1][1] - means[0][1])
    # Upwind drift keeps the mean; what the shore holds back is far from the datum. A tenth of a cell.
    assert moved == pytest.approx(
        (600.0 * mission.drift[0], 600.0 * mission.drift[1]), abs=0.1 * mission.cell
    )


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"uavs": 0}, "uavs"),
        ({"rafts": 0}, "rafts"),
        ({"leeway_sigma": -0.1}, "leeway_sigma"),
        ({"reach": 0.0}, "reach"),
        ({"width": 5000.0}, "width"),
        ({"boats": 1}, "boats"),
    ],
)
def test_bad_options_are_told(options: dict[str, float], field: str) -> None:
    with pytest.raises(InputError) as caught:
        maritime.make(0, **options)
    assert field in [fault.field for fault in caught.value.faults]


def test_the_raft_really_drifts_with_the_sea_and_its_own_leeway(
    mission: SearchMission, flight: tuple[Sortie, bytes]
) -> None:
    truth = [(one.t, one.x, one.y) for one in read_trace(BytesIO(flight[1])).of(Truth)]
    (begin, x, y), (end, far_x, far_y) = truth[0], truth[-1]
    own = mission.targets[0].velocity
    assert (x, y) == mission.targets[0].position
    assert far_x - x == pytest.approx((mission.drift[0] + own[0]) * (end - begin))
    assert far_y - y == pytest.approx((mission.drift[1] + own[1]) * (end - begin))


def test_the_raft_is_found_taken_for_moving_and_followed_to_the_end(flight: tuple[Sortie, bytes]) -> None:
    measures = flight[0].measures
    found = next(read_trace(BytesIO(flight[1])).of(Detected))
    assert found.moving
    assert found.truth == "raft1"
    assert measures.found == 1.0
    assert measures.tracked_since_found >= 0.9
    assert measures.unserved == 0


def test_same_seed_same_bytes(mission: SearchMission, flight: tuple[Sortie, bytes]) -> None:
    kept = BytesIO()
    fly(mission, seed=2, trace=kept)
    assert kept.getvalue() == flight[1]
