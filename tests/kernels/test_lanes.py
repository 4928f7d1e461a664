"""The lane arithmetic against the standard library."""

from __future__ import annotations

import math

import numpy as np

from swarmbid.kernels import lanes


def lane_exp(values: list[float]) -> list[float]:
    """Run `exp_lane` over any number of values."""
    return [float(lanes.exp_lane(x)) for x in values]


def test_exponential_agrees_with_the_library_to_two_units_in_the_last_place():
    values = np.concatenate(
        [np.linspace(-700.0, 50.0, 20_001), np.linspace(-1.0, 1.0, 20_001), [0.0]]
    ).tolist()
    for x, y in zip(values, lane_exp(values), strict=True):
        assert abs(y - math.exp(x)) <= 2 * math.ulp(math.exp(x)), x


def test_exponential_of_zero_is_exactly_one():
    assert lane_exp([0.0, -0.0]) == [1.0, 1.0]


def test_exponential_is_clamped_far_below_and_above():
    assert lane_exp([-1e9, 1e9]) == lane_exp([-708.0, 708.0])


def test_distances_are_rounded_down_to_the_step():
    """A 1-1 diagonal is 1.414 m: 1.4 with a step of 0.1, 3-4-5 stays 5."""
    xs, ys, zs = np.array([1.0, 3.0]), np.array([1.0, 4.0]), np.zeros(2)
    out = np.empty(2)
    lanes.distance_lanes(0.0, 0.0, 0.0, xs, ys, zs, 2, 0.1, out)
    assert out.tolist() == [14 * 0.1, 50 * 0.1]
    lanes.distance_lanes(0.0, 0.0, 0.0, xs, ys, zs, 2, 0.0, out)
    assert out.tolist() == [math.sqrt(2.0), 5.0]
