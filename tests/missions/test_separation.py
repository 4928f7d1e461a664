"""The separation procedure (Dymkou's slides, "Separation procedure")."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from swarmbid.errors import InputError
from swarmbid.missions.separation import Subgroup, number_of_subgroups, separate

COORDINATE = st.floats(0.0, 1000.0, allow_nan=False)
PLACE = st.tuples(COORDINATE, COORDINATE)


@st.composite
def targets(draw):
    places = draw(st.lists(PLACE, min_size=1, max_size=12, unique=True))
    new = draw(st.integers(1, len(places)))
    named = [(f"t{row}", place) for row, place in enumerate(places)]
    return named[: len(places) - new], named[len(places) - new :]


def spread(places: np.ndarray, labels: np.ndarray) -> float:
    """Sum of squared distances from the centres, m2."""
    total = 0.0
    for label in set(labels.tolist()):
        part = places[labels == label]
        total += float(np.square(part - part.mean(axis=0)).sum())
    return total


def labels_of(groups, ids) -> np.ndarray:
    return np.array([next(row for row, group in enumerate(groups) if name in group.targets) for name in ids])


def test_the_example_of_the_slides():
    """Targets 1 and 2 are assigned, k and N_t are new: Task1 = {1, k}, Task2 = {2, N_t}."""
    old = [("1", (0.0, 0.0)), ("2", (1000.0, 0.0))]
    new = [("k", (100.0, 50.0)), ("n", (900.0, -50.0))]
    first, second = separate(old, new)
    assert first == Subgroup(("1", "k"), (50.0, 25.0))
    assert second == Subgroup(("2", "n"), (950.0, -25.0))


def test_the_order_of_the_new_ones_does_not_matter():
    old = [("1", (0.0, 0.0)), ("2", (1000.0, 0.0))]
    new = [("n", (900.0, -50.0)), ("k", (100.0, 50.0))]
    assert {group.targets for group in separate(old, new)} == {("1", "k"), ("2", "n")}


@pytest.mark.parametrize(
    ("old", "new", "groups"), [(0, 1, 1), (0, 5, 1), (1, 3, 1), (2, 1, 2), (2, 2, 2), (5, 1, 5)]
)
def test_as_many_subgroups_as_there_were_targets_but_at_least_one(old, new, groups):
    """number of subgroups = total static targets - new static targets; at least one."""
    assert number_of_subgroups(old, new) == groups


@pytest.mark.parametrize(("old", "new"), [(-1, 2), (3, 0), (3, -2)])
def test_without_new_targets_there_is_nothing_to_separate(old, new):
    with pytest.raises(ValueError, match="cannot be separated"):
        number_of_subgroups(old, new)


LUMP = [(f"n{row}", (0.0, 1.0 + row)) for row in range(5)]
CORNERS = [("o0", (0.0, 0.0)), ("o1", (900.0, 0.0)), ("o2", (0.0, 900.0))]


@given(targets())
@example((CORNERS, LUMP))  # all that is new lies beside one old target
def test_each_target_is_in_one_subgroup_and_they_are_balanced(case):
    old, new = case
    groups = separate(old, new)
    assert len(groups) == max(len(old), 1)
    named = [name for group in groups for name in group.targets]
    assert sorted(named) == sorted(name for name, _ in (*old, *new))
    sizes = [len(group.targets) for group in groups]
    assert max(sizes) - min(sizes) <= 1 and min(sizes) >= 1


@given(targets())
def test_the_centre_is_the_mean_and_the_order_that_of_the_first_targets(case):
    old, new = case
    place_of = dict((*old, *new))
    ids = list(place_of)
    groups = separate(old, new)
    for group in groups:
        mean = np.mean([place_of[name] for name in group.targets], axis=0)
        assert math.dist(group.centre, mean) <= 1e-6
        assert list(group.targets) == sorted(group.targets, key=ids.index)
    firsts = [ids.index(group.targets[0]) for group in groups]
    assert firsts == sorted(firsts)


@given(targets(), st.tuples(COORDINATE, COORDINATE))
def test_it_is_the_same_each_time_and_wherever_the_origin_is(case, shift):
    old, new = case
    groups = separate(old, new)
    assert groups == separate(old, new)
    moved = [[(name, (x + 1e5, y - 1e5)) for name, (x, y) in part] for part in (old, new)]
    apart = [a for a in (place for _, place in (*old, *new))]
    if min((math.dist(a, b) for a in apart for b in apart if a != b), default=1.0) > 1e-3:
        before = spread(np.array(apart), labels_of(groups, [name for name, _ in (*old, *new)]))
        after = spread(np.array(apart), labels_of(separate(*moved), [name for name, _ in (*old, *new)]))
        assert after == pytest.approx(before, rel=1e-6, abs=1e-3)


@settings(max_examples=30)
@given(targets(), st.integers(0, 2**32 - 1))
def test_they_are_more_compact_than_balanced_groups_at_random(case, seed):
    """Of 40 random partitions with the same sizes the median is never more compact."""
    old, new = case
    groups = separate(old, new)
    places = np.array([place for _, place in (*old, *new)])
    labels = labels_of(groups, [name for name, _ in (*old, *new)])
    rng = np.random.default_rng(seed)
    random = [spread(places, rng.permutation(labels)) for _ in range(40)]
    assert spread(places, labels) <= np.median(random) + 1e-6


@settings(max_examples=30)
@given(st.integers(2, 4), st.integers(0, 2**32 - 1))
def test_clusters_far_apart_are_found(count, seed):
    """One old target in each of some far clusters, one new one beside each: nobody flies across."""
    rng = np.random.default_rng(seed)
    old = [(f"o{row}", (1000.0 * row, float(rng.uniform(0, 50)))) for row in range(count)]
    new = [(f"n{row}", (1000.0 * row + float(rng.uniform(1, 50)), 0.0)) for row in range(count)]
    order = rng.permutation(count)
    groups = separate(old, [new[row] for row in order])
    assert {group.targets for group in groups} == {(f"o{row}", f"n{row}") for row in range(count)}


def test_targets_at_one_place_are_shared_out_too():
    here = (5.0, 5.0)
    groups = separate([("a", here), ("b", here)], [("c", here), ("d", here)])
    assert sorted(len(group.targets) for group in groups) == [2, 2]
    assert all(group.centre == here for group in groups)


def test_without_the_library_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "k_means_constrained", None)
    with pytest.raises(InputError, match=r"swarmbid\[search\]"):
        separate([("a", (0.0, 0.0)), ("b", (9.0, 0.0))], [("c", (1.0, 0.0))])
    assert separate([], [("c", (1.0, 0.0))]) == (Subgroup(("c",), (1.0, 0.0)),)
