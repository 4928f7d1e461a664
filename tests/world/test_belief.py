"""Belief: Bayes by hand, a naive twin of the kernel, conservation, order."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmbid.errors import InputError
from swarmbid.rng import stream
from swarmbid.world.belief import Belief, Footprint
from swarmbid.world.grid import Grid


class Box:
    """A rectangle with a rectangular hole."""

    def __init__(self, width, height, hole=(0.0, 0.0, 0.0, 0.0)):
        self.bounds = (0.0, 0.0, width, height)
        self.hole = hole

    def contains(self, x, y):
        west, south, east, north = self.hole
        return ~((x > west) & (x < east) & (y > south) & (y < north))


class Cookie:
    """Sees everything within `reach` m with one probability."""

    def __init__(self, reach, detection):
        self.reach, self.detection = reach, detection

    def radius(self, altitude):
        return self.reach

    def probability(self, distance, altitude):
        return np.where(distance <= self.reach, self.detection, 0.0)


# Five cells of 10 m in a row. A sensor of 17.2 m reach above cell 1 (x = 15) sees cells 0, 1 and 2 whole at
# every bearing (corner at 10 + 5 sqrt 2 = 17.07 m) and a sliver of cell 3 that starts at x = 30. The hand
# case therefore takes d from the footprint for cell 3.


def test_five_cells_by_hand_independent():
    grid = Grid(Box(50.0, 10.0), 10.0)
    footprint = Footprint(Cookie(17.2, 0.5), 100.0, grid)
    belief = Belief(grid, "independent", np.array([[0.1, 0.2, 0.5, 0.3, 0.4]]))
    belief.glimpse(footprint, 15.0, 5.0)
    sliver = float(footprint.probability(20.0))
    # 0.1 * 0.5 / (1 - 0.05) = 1/19; 0.2 * 0.5 / (1 - 0.1) = 1/9; 0.5 * 0.5 / (1 - 0.25) = 1/3
    expected = [1 / 19, 1 / 9, 1 / 3, 0.3 * (1 - sliver) / (1 - 0.3 * sliver), 0.4]
    assert belief.probability[0] == pytest.approx(expected, abs=1e-9)
    belief.glimpse(footprint, 15.0, 5.0)
    # once more: 1/19 * 0.5 / (1 - 1/38) = 1/37; 1/9 -> 1/17; 1/3 -> 1/5
    assert belief.probability[0, :3] == pytest.approx([1 / 37, 1 / 17, 1 / 5], abs=1e-9)


def test_five_cells_by_hand_one_target():
    grid = Grid(Box(50.0, 10.0), 10.0)
    footprint = Footprint(Cookie(5.0 * math.sqrt(2.0) + 1e-6, 0.6), 100.0, grid)
    belief = Belief(grid, "one", np.array([[0.1, 0.2, 0.4, 0.2, 0.1]]))
    belief.glimpse(footprint, 25.0, 5.0)
    side = float(footprint.probability(10.0))
    # cell 2 seen whole: 0.4 * 0.4 = 0.16; its neighbours by a sliver each; the rest as before
    raw = np.array([0.1, 0.2 * (1 - side), 0.16, 0.2 * (1 - side), 0.1])
    assert belief.probability[0] == pytest.approx(raw / raw.sum(), abs=1e-9)


def test_order_does_not_matter_to_the_last_bit():
    grid = Grid(Box(500.0, 300.0, (200.0, 100.0, 300.0, 200.0)), 20.0)
    footprint = Footprint(Cookie(45.0, 0.37), 100.0, grid)
    rng = stream(1, "order")
    places = rng.uniform(0.0, 500.0, (200, 2))
    one, other = Belief(grid), Belief(grid)
    one.glimpses(footprint, places)
    for x, y in places[rng.permutation(200)]:
        other.glimpse(footprint, x, y)
    assert one.probability.tobytes() == other.probability.tobytes()
    assert one.probability.min() == 0.0 and not one.probability[~grid.mask].any()


def test_kernel_equals_naive_twin():
    grid = Grid(Box(200.0, 130.0, (60.0, 60.0, 110.0, 90.0)), 10.0)
    footprint = Footprint(Cookie(33.0, 0.4), 100.0, grid)
    places = stream(2, "twin").uniform(-20.0, 220.0, (40, 2))
    belief = Belief(grid, "independent", 0.3)
    belief.glimpses(footprint, places)
    for row, y in enumerate(grid.y):
        for col, x in enumerate(grid.x):
            p = 0.3 if grid.mask[row, col] else 0.0
            for gx, gy in places:
                d = float(footprint.probability(math.hypot(x - gx, y - gy)))
                p = p * (1 - d) / (1 - p * d)
            assert belief.probability[row, col] == pytest.approx(p, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("kind", ["independent", "one"])
def test_drift_and_diffusion_keep_the_mass_in_the_free_area(kind):
    grid = Grid(Box(300.0, 200.0, (100.0, 50.0, 200.0, 150.0)), 10.0)
    prior = stream(3, "prior").uniform(0.0, 0.9, grid.shape)
    belief = Belief(grid, kind, prior, drift=(2.0, -1.0), diffusion=3.0)
    before = belief.probability.sum()
    for _ in range(100):
        belief.advance(5.0)
    after = belief.probability
    assert after.sum() == pytest.approx(before, rel=1e-9)
    assert not after[~grid.mask].any() and after.min() >= 0.0 and (after.max() <= 1.0)
    assert after[:10, 15:].sum() > prior[:10, 15:].sum() / prior.sum() * before


def test_diffusion_has_the_right_variance():
    grid = Grid(Box(1010.0, 1010.0), 10.0)
    prior = np.zeros(grid.shape)
    prior[50, 50] = 1.0
    belief = Belief(grid, "one", prior, diffusion=20.0)
    for _ in range(20):
        belief.advance(5.0)
    # variance 2 D t = 2 * 20 * 100 s = 4000 m2 on each axis, exact for the explicit scheme
    spread = (belief.probability.sum(axis=0) * (grid.x - 505.0) ** 2).sum()
    assert spread == pytest.approx(4000.0, rel=1e-6)


def test_alarm_raises_and_found_clears():
    grid = Grid(Box(200.0, 200.0), 10.0)
    footprint = Footprint(Cookie(50.0, 0.8), 100.0, grid)
    belief = Belief(grid, "independent", 0.01)
    belief.alarm(footprint, (100.0, 100.0), (105.0, 105.0), 5.0, 1e-4)
    # d = 0.8, variance 25 + 100/12, N = 1 / (2 pi 33.333) = 0.0047746; ratio 0.2 + 0.8 * 47.746 = 38.397
    odds = 0.01 / 0.99 * 38.3972
    assert belief.probability[10, 10] == pytest.approx(odds / (1 + odds), rel=1e-4)
    belief.found(105.0, 105.0, 12.0)
    assert belief.probability[10, 10] == 0.0 == belief.probability[10, 11]
    assert belief.probability[0, 0] == pytest.approx(0.01)


def test_every_fault_is_told_at_once():
    grid = Grid(Box(50.0, 10.0), 10.0)
    with pytest.raises(InputError) as caught:
        Belief(grid, "two", 2.0, diffusion=-1.0)
    assert {"kind", "diffusion", "prior"} <= {fault.field for fault in caught.value.faults}


def test_one_target_outlives_any_number_of_looks():
    grid = Grid(Box(20.0, 10.0), 10.0)
    footprint = Footprint(Cookie(100.0, 0.9), 100.0, grid)
    belief = Belief(grid, "one", np.array([[0.25, 0.75]]))
    belief.glimpse(Footprint(Cookie(1.0, 0.9), 100.0, grid), 5.0, 5.0)
    before = belief.probability.copy()
    belief.glimpses(footprint, np.full((2000, 2), 10.0))  # alike on both cells: 2000 * 2.3 = 4605 nats
    assert belief.probability == pytest.approx(before, abs=1e-12)
    assert before[0, 0] < 0.25
