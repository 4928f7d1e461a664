"""What one UAV makes of its detections: type by evidence, one contact a target, estimates that are shared."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmbid.messages.survey import Contact
from swarmbid.missions._contacts import (
    FORESIGHT,
    PATIENCE,
    SLOWEST,
    SURE_LOOKS,
    TOGETHER,
    Candidate,
    Contacts,
)
from swarmbid.rng import stream

SIGMA, MINIMUM, RADIUS = 3.0, 50.0, 100.0
NOTHING = np.empty((0, 2))


def contacts(agent: str = "u1") -> Contacts:
    return Contacts(agent, SIGMA, MINIMUM)


def places(*points) -> np.ndarray:
    return np.array(points, dtype=float).reshape(-1, 2)


def watch(book: Contacts, path, first: int, last: int, seed: int = 0, at=(0.0, 0.0)) -> list:
    """Look once a second at a target on `path`, from above `at`; return what is decided, with the time."""
    rng = stream(seed, "test", "contacts")
    found = []
    for now in range(first, last + 1):
        x, y = path(now)
        seen = places((x, y)) + SIGMA * rng.standard_normal((1, 2))
        book.look(float(now), seen, *at, RADIUS)
        found += [(now, *one) for one in book.decided(float(now))]
    return found


def known(task: str, x: float, y: float, **more: object) -> Contact:
    """A contact of the UAV that its task's id names, at rest at 10 s unless told otherwise."""
    usual = {"by": task[:2], "found_at": 0.0, "moving": False, "t": 10.0, "vx": 0.0, "vy": 0.0, "sigma": 2.0}
    return Contact(**({"task": task, "x": x, "y": y} | usual | more))


class TestType:
    """Static or moving "takes evidence, not an oracle"."""

    @pytest.mark.parametrize("seed", range(5))
    def test_a_target_that_rests_is_static_once_rest_was_not_refused_for_long(self, seed):
        found = watch(contacts(), lambda now: (20.0, 30.0), 0, 60, seed)
        now, _, moving, evidence = found[0]
        assert moving is False and now <= 2 + PATIENCE
        assert "m/s" in evidence and "detections" in evidence

    @pytest.mark.parametrize("seed", range(5))
    @pytest.mark.parametrize("speed", [3.0, 8.0])
    def test_a_target_that_moves_is_found_to_move(self, seed, speed):
        found = watch(contacts(), lambda now: (speed * (now - 20), 10.0), 0, 35, seed)
        now, _, moving, _ = found[0]
        assert moving is True and now < PATIENCE

    def test_one_look_is_not_enough_to_call_it_moving(self):
        """A test at 99 % is wrong now and then: several looks in a row must say so."""
        book = contacts()
        watch(book, lambda now: (5.0 * now, 0.0), 0, 2)
        assert all(one.moved < SURE_LOOKS for one in book.candidates.values())
        first = watch(contacts(), lambda now: (8.0 * (now - 10), 0.0), 0, 20)[0]
        assert first[0] >= 2 + SURE_LOOKS - 1

    def test_four_looks_in_a_row_must_say_that_it_moves(self):
        says = iter([True, True, True, None, True, True, True, True])
        track = SimpleNamespace(
            moves=lambda slow: next(says), mean=np.zeros(4), covariance=np.eye(4), hits=9, number=0
        )
        book = contacts()
        book.candidates[0] = Candidate(track, 0.0)
        assert [len(book.decided(float(now))) for now in range(8)] == [0, 0, 0, 0, 0, 0, 0, 1]

    def test_targets_at_rest_are_rarely_taken_for_moving(self, effort):
        """Asked every second, for all runs: below 1 in 10, of a test at 99 % a look."""
        runs = 40 * effort
        wrong = sum(watch(contacts(), lambda now: (0.0, 0.0), 0, 45, seed)[0][2] for seed in range(runs))
        assert wrong <= 0.1 * runs + 3.0 * math.sqrt(0.09 * runs)

    def test_the_estimate_of_a_static_one_has_no_speed(self):
        book = contacts()
        number = watch(book, lambda now: (20.0, 30.0), 0, 60)[0][1]
        one = book.open(number, False, 60.0)
        assert (one.vx, one.vy) == (0.0, 0.0) and one.task == "u1-t1" and one.by == "u1"
        assert math.dist((one.x, one.y), (20.0, 30.0)) <= 3.0 * SIGMA
        assert one.found_at <= 5.0  # when it was confirmed, not when its type was known

    def test_the_estimate_of_a_moving_one_has_its_speed(self):
        book = contacts()
        number = watch(book, lambda now: (4.0 * (now - 15), -10.0), 0, 30)[0][1]
        one = book.open(number, True, 30.0)
        assert math.dist((one.vx, one.vy), (4.0, 0.0)) <= 1.5 and SLOWEST < 4.0


class TestTracks:
    def test_a_single_false_alarm_is_looked_at_and_forgotten(self):
        book = contacts()
        book.look(0.0, places((30.0, 0.0)), 0.0, 0.0, RADIUS)
        assert book.unclear(0.0) == (30.0, 0.0) and not book.candidates
        for now in range(1, 20):
            book.look(float(now), NOTHING, 0.0, 0.0, RADIUS)
        assert book.unclear(20.0) is None and book.decided(20.0) == [] and not book.tracker.tracks

    def test_what_is_out_of_sight_is_not_missed(self):
        """Looks that do not reach a track say nothing against it."""
        book = contacts()
        watch(book, lambda now: (0.0, 0.0), 0, 5)
        for now in range(6, 14):
            book.look(float(now), NOTHING, 500.0, 0.0, RADIUS)
        assert len(book.tracker.tracks) == 1 and book.tracker.tracks[0].misses == 0

    def test_but_after_long_it_says_nothing_any_more(self):
        book = contacts()
        watch(book, lambda now: (0.0, 0.0), 0, 5)
        for now in range(6, 400):
            book.look(float(now), NOTHING, 500.0, 0.0, RADIUS)
        assert not book.tracker.tracks and not book.candidates

    def test_two_targets_are_two_contacts(self):
        book = contacts()
        rng = stream(0, "test", "two")
        for now in range(50):
            book.look(
                float(now),
                places((-60.0, 0.0), (60.0, 0.0)) + SIGMA * rng.standard_normal((2, 2)),
                0.0,
                0.0,
                RADIUS,
            )
        found = book.decided(50.0)
        assert len(found) == 2
        tasks = [book.open(number, moving, 50.0) for number, moving, _ in found]
        assert [one.task for one in tasks] == ["u1-t1", "u1-t2"]
        assert sorted(round(one.x / 60.0) for one in tasks) == [-1, 1]

    @pytest.mark.parametrize("seed", range(12))
    def test_one_target_is_one_contact(self, seed):
        """However the measurements fall, a UAV makes one contact of one target."""
        book = contacts()
        rng = stream(seed, "test", "one")
        opened = 0
        for now in range(90):
            book.look(float(now), SIGMA * rng.standard_normal((1, 2)), 0.0, 0.0, RADIUS)
            book.matched(float(now))
            for number, moving, _ in book.decided(float(now)):
                if (
                    number in book.candidates
                    and book.match(book.candidates[number].track, float(now)) is None
                ):
                    book.open(number, moving, float(now))
                    opened += 1
        assert opened == 1


class TestKnown:
    def test_what_another_told_of_is_no_new_contact(self):
        book = contacts()
        book.merge([known("u2-t1", 2.0, 1.0, t=0.0)], 0.0)
        assert watch(book, lambda now: (0.0, 0.0), 0, 60) == []
        assert not book.candidates and list(book.known) == ["u2-t1"]
        one = book.known["u2-t1"]
        assert one.t == 60.0 and one.by == "u2"  # estimated anew; still the finder's
        assert math.dist((one.x, one.y), (0.0, 0.0)) <= 3.0 * SIGMA

    def test_a_candidate_that_another_tells_of_meanwhile_is_given_up(self):
        book = contacts()
        watch(book, lambda now: (0.0, 0.0), 0, 10)
        assert len(book.candidates) == 1
        book.merge([known("u2-t1", 2.0, 1.0)], 10.0)
        book.matched(10.0)
        assert not book.candidates and book.unclear(10.0) is None
        assert book.track("u2-t1") is not None

    def test_a_contact_that_is_over_hides_nothing(self):
        book = contacts()
        book.merge([known("u2-t1", 2.0, 1.0, over=True)], 0.0)
        assert watch(book, lambda now: (0.0, 0.0), 0, 60)

    def test_a_target_far_from_all_that_is_known_is_new(self):
        book = contacts()
        book.merge([known("u2-t1", 300.0, 0.0, t=0.0)], 0.0)
        assert watch(book, lambda now: (0.0, 0.0), 0, 60)

    def test_a_moving_contact_is_looked_for_where_it_should_be_by_now(self):
        book = contacts()
        book.merge([known("u2-t1", 0.0, 0.0, t=10.0, moving=True, vx=2.0, vy=-1.0)], 10.0)
        assert book.where("u2-t1", 30.0) == (40.0, -20.0)
        assert book.where("u2-t1", 1000.0) == (2.0 * FORESIGHT, -FORESIGHT)  # no farther ahead
        book.merge([known("u3-t1", 7.0, 7.0)], 10.0)
        assert book.where("u3-t1", 1000.0) == (7.0, 7.0)

    def test_only_changes_are_news(self):
        book = contacts()
        book.merge([known("u2-t1", 7.0, 7.0, t=1.0)], 1.0)
        book.merge([known("u2-t1", 7.5, 7.0, t=5.0)], 5.0)
        assert book.changed["u2-t1"] == 1.0  # a static one that is seen again
        book.close("u2-t1", 9.0)
        book.close("u2-t1", 20.0)
        assert book.changed["u2-t1"] == 9.0 and book.known["u2-t1"].over
        book.merge([known("u3-t1", 0.0, 0.0, t=1.0, moving=True)], 1.0)
        book.merge([known("u3-t1", 5.0, 0.0, t=5.0, moving=True)], 5.0)
        assert book.changed["u3-t1"] == 5.0


class TestDoubles:
    """Two UAVs may find one target: the earlier discovery counts, then the lower id of the finder."""

    @staticmethod
    def pairs(*told: Contact, times: int = 1) -> list[tuple[str, str]]:
        """Return what counts as one, looked at so often, a second apart."""
        book = contacts("u9")
        book.merge(told, 20.0)
        for now in range(times - 1):
            assert book.doubles(20.0 + now) == []
        return book.doubles(19.0 + times)

    def test_the_earlier_one_counts(self):
        assert self.pairs(known("u1-t1", 0, 0, found_at=9.0), known("u2-t1", 3, 0, found_at=5.0)) == [
            ("u2-t1", "u1-t1")
        ]

    def test_at_the_same_time_the_lower_id_of_the_finder(self):
        assert self.pairs(known("u2-t1", 0, 0), known("u1-t1", 3, 0)) == [("u1-t1", "u2-t1")]

    def test_of_three_one_counts(self):
        told = [known(f"u{k}-t1", 2.0 * k, 0, found_at=float(k)) for k in (1, 2, 3)]
        assert self.pairs(*told) == [("u1-t1", "u2-t1"), ("u1-t1", "u3-t1")]

    def test_what_is_far_apart_or_over_is_no_double(self):
        assert self.pairs(known("u1-t1", 0, 0), known("u2-t1", MINIMUM + 1.0, 0)) == []
        assert self.pairs(known("u1-t1", 0, 0), known("u2-t1", 3, 0, over=True)) == []

    def test_a_moving_one_is_compared_at_the_same_time(self):
        first = known("u1-t1", 0, 0, moving=True, vx=10.0, t=10.0, found_at=1.0)
        there = known("u2-t1", 100.0, 0, moving=True, vx=10.0, t=20.0, found_at=2.0)
        not_there = known("u2-t1", 0.0, 0, moving=True, vx=10.0, t=20.0, found_at=2.0)
        assert self.pairs(first, there, times=TOGETHER) == [("u1-t1", "u2-t1")]
        assert self.pairs(first, not_there, times=TOGETHER) == []

    def test_two_that_cross_are_two(self):
        first = known("u1-t1", 0, 0, moving=True, vx=10.0, t=10.0, found_at=1.0)
        crossing = known("u2-t1", 0, 0, moving=True, vy=10.0, t=10.0, found_at=2.0)
        assert self.pairs(first, crossing, times=TOGETHER) == []

    def test_one_that_passes_a_static_one_is_another(self):
        """A slow target near a static one for a moment is no double of it."""
        rests = known("u1-t1", 0, 0, found_at=1.0)
        passes = known("u2-t1", 20, 0, moving=True, vx=2.0, found_at=2.0)
        assert self.pairs(rests, passes) == []

    def test_everybody_sees_the_same_pairs(self):
        told = [
            known("u1-t1", 0, 0, found_at=3.0),
            known("u2-t1", 9, 0, found_at=3.0),
            known("u3-t1", 400, 0),
        ]
        assert self.pairs(*told) == self.pairs(*told[::-1])


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_the_same_looks_give_the_same_contacts(seed):
    def once():
        book = contacts()
        found = watch(book, lambda now: (1.5 * (now - 10), 4.0), 0, 25, seed)
        return found[:1], [(one.number, one.mean.tolist()) for one in book.tracker.tracks]

    assert once() == once()
