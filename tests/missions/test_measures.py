"""What is counted of a search mission, in cases small enough for the hand."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from smallworlds import small_world
from swarmbid.missions._charting import TargetFound
from swarmbid.searchmeasures import CUT_OFF, Watch

TARGETS = "mission duration=100\nuav u1 10 10\n"
XY = np.array([(100.0, 100.0), (500.0, 500.0), (700.0, 100.0)])


def watch(*kinds: str) -> Watch:
    lines = [
        f"target t{row} {x:g} {y:g}" + (" vx=1" if kind == "moving" else "")
        for row, (kind, (x, y)) in enumerate(zip(kinds, XY, strict=False))
    ]
    return Watch(small_world(TARGETS + "\n".join(lines)).mission)


def found(x: float, y: float, task: str = "u1-t1") -> TargetFound:
    return TargetFound(task, x, y, False, "")


def estimate(x: float, y: float, over: bool = False) -> SimpleNamespace:
    return SimpleNamespace(x=x, y=y, moving=True, over=over)


def measures(one: Watch, flown=(0.0,)):
    return one.measures(list(flown), messages=7, bytes=70, unserved=1)


def test_a_mission_in_which_nothing_is_found():
    one = watch("static", "moving")
    for now in range(5):
        one.step(float(now), [], [], now < 2, XY[:2])
    told = measures(one, (30.0, 12.5))
    assert (told.targets, told.moving, told.found, told.detections) == (2, 1, 0.0, ())
    assert told.first_detection == told.mean_detection == 100.0  # the duration
    assert (told.served, told.tracked, told.tracked_since_found, told.gaps, told.longest_gap) == (
        0,
        0,
        0,
        0,
        0,
    )
    assert told.metres == 42.5 and (told.messages, told.bytes, told.unserved) == (7, 70, 1)
    assert told.linked == pytest.approx(0.4)


def test_without_targets_there_is_nothing_to_miss():
    one = watch()
    one.step(0.0, [], [], True, XY[:0])
    told = measures(one)
    assert (told.targets, told.found, told.served, told.gospa, told.linked) == (0, 0.0, 0.0, 0.0, 1.0)
    assert one.detected(1.0, found(0.0, 0.0), XY[:0]) == ""


def test_detections_are_given_to_the_nearest_target():
    one = watch("static", "static")
    assert one.detected(20.0, found(110.0, 100.0), XY[:2]) == "t0"
    assert one.detected(40.0, found(500.0, 480.0, "u1-t2"), XY[:2]) == "t1"
    told = measures(one)
    assert told.detections == (20.0, 40.0) and told.found == 1.0
    assert told.first_detection == 20.0 and told.mean_detection == 30.0
    assert told.false_targets == 0


def test_one_target_found_counts_the_other_with_the_duration():
    one = watch("static", "static")
    one.detected(20.0, found(100.0, 100.0), XY[:2])
    assert measures(one).mean_detection == 60.0 and measures(one).found == 0.5


def test_what_is_nothing_and_what_is_known_already_are_false_targets():
    one = watch("static")
    assert one.detected(5.0, found(100.0 + CUT_OFF + 1.0, 100.0), XY[:1]) == ""
    assert one.detected(10.0, found(100.0, 100.0), XY[:1]) == "t0"
    assert one.detected(30.0, found(101.0, 100.0, "u2-t1"), XY[:1]) == "t0"
    told = measures(one)
    assert told.false_targets == 2 and told.detections == (10.0,)


def test_the_cut_off_itself_still_counts():
    one = watch("static")
    assert one.detected(5.0, found(100.0 + CUT_OFF, 100.0), XY[:1]) == "t0"


def test_served_counts_static_targets_once_each():
    one = watch("static", "static", "moving")
    one.finished(100.0, 100.0, XY)
    one.finished(101.0, 100.0, XY)
    one.finished(300.0, 300.0, XY)  # nothing there
    assert measures(one).served == 0.5


def test_gaps_are_counted_from_the_first_time_it_was_followed():
    """Found at 0 s; followed in 3, 4, then not for 2 s, followed in 7, then not for the last 3 s."""
    one = watch("moving")
    one.detected(0.0, found(100.0, 100.0), XY[:1])
    for now in range(11):
        one.step(float(now), [estimate(100.0, 100.0)] if now in (3, 4, 7) else [], [], True, XY[:1])
    told = measures(one)
    assert told.gaps == 2.0 and told.longest_gap == 3.0
    assert told.tracked == pytest.approx(3 / 11) == told.tracked_since_found


def test_a_target_found_late_is_followed_all_the_time_since():
    one = watch("moving")
    for now in range(10):
        if now == 6:
            one.detected(6.0, found(100.0, 100.0), XY[:1])
        one.step(float(now), [estimate(100.0, 100.0)] if now >= 6 else [], [], True, XY[:1])
    told = measures(one)
    assert told.tracked == pytest.approx(0.4) and told.tracked_since_found == 1.0 and told.gaps == 0.0


def test_two_that_follow_one_target_count_once():
    one = watch("moving")
    one.detected(0.0, found(100.0, 100.0), XY[:1])
    one.step(0.0, [estimate(100.0, 100.0), estimate(103.0, 100.0)], [], True, XY[:1])
    assert measures(one).tracked == 1.0


def test_gospa_of_one_missed_and_one_placed_wrong():
    """sqrt(30^2 + cut_off^2 / 2), counted every ten seconds, what is over left out."""
    one = watch("static", "static")
    view = [estimate(130.0, 100.0), estimate(0.0, 700.0, over=True)]
    for now in range(10):
        one.step(float(now), [], [] if now else view, True, XY[:2])
    assert measures(one).gospa == pytest.approx(math.sqrt(30.0**2 + CUT_OFF**2 / 2.0))


def test_it_is_ready_for_json():
    told = measures(watch("static"))
    assert told.to_dict()["targets"] == 1 and set(told.to_dict()) == set(vars(told))


EVENTS = st.lists(
    st.tuples(
        st.sampled_from(["step", "follow", "find", "finish"]), st.integers(0, 2), st.floats(0.0, 250.0)
    ),
    max_size=40,
)


@given(EVENTS)
@example(
    [("follow", 2, 0.0), ("follow", 2, 0.0), ("find", 2, 0.0)]
)  # followed for another before it is found
def test_every_share_is_a_share(events):
    """Whatever is found, followed and finished, near a target or nowhere, shares stay from 0 to 1."""
    one = watch("moving", "static", "moving")
    near = XY.copy()
    near[2] = near[0] + (50.0, 0.0)  # close to the first
    for now, (what, row, off) in enumerate(events):
        x, y = near[row, 0] + off, near[row, 1]
        if what == "find":
            one.detected(float(now), found(x, y), near)
        elif what == "finish":
            one.finished(x, y, near)
        one.step(float(now), [estimate(x, y)] if what == "follow" else [], [], off < 99.0, near)
    told = measures(one)
    for share in (told.found, told.served, told.tracked, told.tracked_since_found, told.linked):
        assert 0.0 <= share <= 1.0
    assert list(told.detections) == sorted(told.detections) and told.longest_gap >= 0.0
    assert len(told.detections) == round(told.found * 3)
