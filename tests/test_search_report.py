"""The report of a search mission, its film strip, and the story of one target, from a made-up trace."""

from __future__ import annotations

import io
import json
import math
import re
import xml.etree.ElementTree as ET

import pytest

from swarmbid.errors import InputError
from swarmbid.report.search_film import choose_frames, render_film_strip, wrapped
from swarmbid.report.search_page import render_search_report
from swarmbid.report.search_replay import replay_data
from swarmbid.report.search_scene import Line, SearchScene
from swarmbid.sightings import explain_search, key_moments, life_of, lives
from swarmbid.trace import (
    Act,
    Crashed,
    Detected,
    Ended,
    Header,
    Pose,
    Result,
    Stage,
    Trace,
    TraceWriter,
    Tracked,
    Truth,
    read_trace,
)

END = 900
FOUND, CALLED, BIDDEN, AWARDED, REACHED, LEFT, TAKEN = 200, 202, 204, 206, 240, 600, 630


def synthetic(*, hostile: str = "", gap: int = TAKEN - LEFT) -> Trace:
    """Three UAVs and two targets: uav1 finds one, uav2 is awarded it, and hands it over to uav3.

    Parameters
    ----------
    hostile : put into names, to see it escaped. gap : s between the two tracks of the target.
    """
    vehicles = [
        {"id": f"uav{one}", "type": "wing", "speed": 15.0, "turn_radius": 30.0, "endurance": 1200.0,
         "reserve": 60.0, "base": [0.0, 0.0], "radius": 60.0, "radio_range": None, "equipment": []}
        for one in (1, 2, 3)
    ]  # fmt: skip
    world = {
        "area": {
            "boundary": [[0, 0], [1000, 0], [1000, 800], [0, 800]],
            "exclusions": [[[420, 300], [560, 320], [500, 430]]],
        },
        "vehicles": vehicles,
        "targets": [
            {"id": "walker", "kind": "moving", "type": "person"},
            {"id": "hut" + hostile, "kind": "static", "type": "house"},
        ],
        "duration": END,
        "strategy": "ours",
        "ground_station": [20.0, -20.0],
    }
    file = io.BytesIO()
    with TraceWriter(file) as trace:
        mission = {"name": "harbour" + hostile, "agents": [], "tasks": []}
        trace.write(
            Header(swarmbid="0", mission=mission, algorithm="contract_net", mode="world", world=world, seed=4)
        )
        again = LEFT + gap
        for t in range(0, END + 1, 5):
            walker = (300.0 + 0.5 * t, 500.0 + 60.0 * math.sin(t / 90.0))
            trace.write(Truth(t=t, target="walker", x=walker[0], y=walker[1]))
            trace.write(Truth(t=t, target="hut" + hostile, x=820.0, y=180.0))
            for row in (1, 2, 3):
                along = (t * 12.0 + row * 190.0) % 1800.0
                x, y = 50.0 + min(along, 1800.0 - along), 130.0 * row + 0.25 * t
                mode = "search"
                tracker = (row == 2 and REACHED <= t <= LEFT) or (row == 3 and t >= again)
                if tracker:
                    (x, y), mode = walker, "track"
                elif row == 2 and t > LEFT:
                    share = min(1.0, (t - LEFT) / 60.0)
                    x, y = 600.0 * (1.0 - share), 500.0 * (1.0 - share)
                    mode = "return" if share < 1.0 else "base"
                elif (row == 2 and AWARDED <= t < REACHED) or (row == 3 and LEFT - 5 <= t < again):
                    mode = "transit"
                trace.write(Pose(t=t, agent=f"uav{row}", x=x, y=y, heading=0.0, mode=mode, fuel=1200.0 - t))
                if tracker:
                    trace.write(Tracked(t=t, agent=f"uav{row}", task="k1", x=x, y=y, sigma=4.0))
            if t == FOUND:
                _negotiation(trace, walker)
            if t == 400:
                trace.write(Detected(t=t, agent="uav3", task="k2", x=640.0, y=700.0, moving=False))
                trace.write(Ended(t=t, agent="uav3", task="k2", outcome="cancelled", reason="nothing there"))
            if t == LEFT - 10:
                told = "short of fuel"
                trace.write(_act(t, "uav2", "cfp", "", "k1.2", detail=told))
                trace.write(_act(t + 1, "uav3", "propose", "uav2", "k1.2", 55.5))
                trace.write(_act(t + 1, "uav1", "refuse", "uav2", "k1.2", detail="busy"))
                trace.write(_act(t + 2, "uav2", "accept-proposal", "uav3", "k1.2", 55.5))
        trace.write(Crashed(t=END - 20, agent="uav1"))
        trace.write(Ended(t=END, agent="uav3", task="k1", outcome="done", by="uav3"))
        measures = {"found_share": 0.5, "first_detection_s": 200.0, "messages": 9, "coverage": {"end": 0.8}}
        trace.write(Result(t=END, status="flown", measures=measures))
    file.seek(0)
    return read_trace(file)


def _negotiation(trace: TraceWriter, walker: tuple[float, float]) -> None:
    x, y = walker
    evidence = "moved 14 m in 20 s"
    trace.write(
        Detected(t=FOUND, agent="uav1", task="k1", x=x, y=y, moving=True, evidence=evidence, truth="walker")
    )
    trace.write(Stage(t=CALLED, agent="uav1", task="k1", role="manager", state="waiting"))
    for other in ("uav2", "uav3"):
        trace.write(_act(CALLED, "uav1", "cfp", other, "k1.1"))
    trace.write(_act(CALLED + 1, "uav3", "propose", "uav1", "k1.1", 40.0))
    trace.write(_act(BIDDEN, "uav2", "propose", "uav1", "k1.1", 70.25))
    trace.write(_act(AWARDED, "uav1", "accept-proposal", "uav2", "k1.1", 70.25))
    trace.write(_act(AWARDED, "uav1", "reject-proposal", "uav3", "k1.1", detail="outbid"))


def _act(
    t: float, agent: str, said: str, to: str, conversation: str, bid: float | None = None, detail: str = ""
) -> Act:
    return Act(
        t=t,
        agent=agent,
        task="k1",
        performative=said,
        to=to,
        conversation=conversation,
        bid=bid,
        detail=detail,
    )


@pytest.fixture(scope="module")
def trace() -> Trace:
    return synthetic()


def test_story_tells_who_found_bid_refused_and_tracked(trace: Trace) -> None:
    told = explain_search(trace, "k1")
    assert told.target == "walker"
    assert told.found == "found by uav1 after 200 s, taken for a moving target; it is walker"
    assert [(one.agent, one.bid, one.answer, one.reason) for one in told.tenders] == [
        ("uav3", 40.0, "rejected", "outbid"),
        ("uav2", 70.25, "awarded", ""),
        ("uav3", 55.5, "awarded", ""),
        ("uav1", None, "refused", "busy"),
    ]
    assert [(one.agent, one.begin, one.end) for one in told.spells] == [
        ("uav2", REACHED, LEFT),
        ("uav3", TAKEN, END),
    ]
    assert told.untracked == TAKEN - LEFT
    said = str(told)
    assert "moved 14 m in 20 s" in said
    assert "asks uav2, uav3 for proposals" in said
    assert "takes the track over from uav2 (short of fuel), after 30 s without anybody" in said
    assert "Awarded to uav2, then to uav3. Tracked for 630 s in all. It ended done by uav3." in said


def test_story_is_json_ready_and_in_order(trace: Trace) -> None:
    told = explain_search(trace, "k1")
    assert json.loads(json.dumps(told.to_dict()))["tenders"][1]["bid"] == 70.25
    times = [one.t for one in told.history]
    assert times == sorted(times)


def test_target_stands_for_its_task_and_unknown_names_are_refused(trace: Trace) -> None:
    assert life_of(trace, "walker").task == "k1"
    assert "false alarm" in explain_search(trace, "k2").found
    with pytest.raises(InputError, match="k9"):
        explain_search(trace, "k9")


def test_short_silence_is_one_track_and_long_silence_two() -> None:
    # Reports come every 5 s: five of these intervals are the longest silence that is no pause.
    records = [Tracked(t=t, agent="u", task="k", x=0.0, y=0.0) for t in (0.0, 5.0, 10.0, 35.0, 40.0, 66.0)]
    trace = Trace("made", Header(swarmbid="0", mission={}, algorithm="x"), tuple(records))
    assert [(one.begin, one.end) for one in lives(trace)["k"].spells] == [(0.0, 40.0), (66.0, 66.0)]


def test_overlapping_tracks_leave_no_gap() -> None:
    assert explain_search(synthetic(gap=-20), "k1").untracked == 0.0


def test_film_has_each_key_moment_in_order(trace: Trace) -> None:
    scene = SearchScene(trace)
    life = life_of(trace, "walker")
    kinds = [one.kind for one in choose_frames(scene, life)]
    assert kinds == ["before", "detection", "announcement", "bids", "award", "track", "hand-over", "end"]
    bids = next(one for one in key_moments(trace, life) if one.kind == "bids")
    assert (bids.t, bids.agent) == (BIDDEN, "uav2")


def test_film_of_a_target_tracked_by_its_finder_has_six_frames() -> None:
    records = [
        Detected(t=100.0, agent="u", task="k", x=0.0, y=0.0, moving=True, truth="w"),
        *(Tracked(t=100.0 + t, agent="u", task="k", x=0.0, y=0.0) for t in range(200)),
    ]
    world = {"targets": [{"id": "w"}], "vehicles": [{"id": "u"}]}
    made = Trace("made", Header(swarmbid="0", mission={}, algorithm="x", world=world), tuple(records))
    frames = choose_frames(SearchScene(made), life_of(made, "w"))
    assert len(frames) == 6
    assert [one.t for one in frames] == sorted(one.t for one in frames)


def test_film_strip_is_a_picture_that_stands_alone(trace: Trace) -> None:
    picture = render_film_strip(trace, "walker")
    root = ET.fromstring(picture)
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    words = "".join(root.itertext())
    for heading in ("1  Search", "2  Detection", "5  Award", "7  Hand-over"):
        assert heading in words
    assert picture == render_film_strip(trace, "walker")


def test_report_is_one_file_that_loads_nothing(trace: Trace) -> None:
    page = render_search_report(trace)
    assert not re.search(r'(?:src|href)="', page)
    assert "http://" not in page.replace("http://www.w3.org/2000/svg", "")
    for heading in ("Map", "Replay", "Timeline", "Measures", "The story of walker", "Tasks"):
        assert f"<h2>{heading}</h2>" in page
    assert "1 of 2 targets found" in page
    assert '<td>first detection</td><td class="n">200 s</td>' in page
    assert page == render_search_report(synthetic())


def test_names_cannot_break_out_of_the_page() -> None:
    page = render_search_report(synthetic(hostile="</script><b>x"))
    assert "</script><b>" not in page
    assert page.count("</script>") == 3


def test_timeline_shows_the_gap_and_the_time_undetected(trace: Trace) -> None:
    page = render_search_report(trace)
    assert "untracked from 10:00 to 10:30" in page
    assert "undetected from 0 s to 3:20" in page
    assert "tracked by uav3 from 10:30 to 15:00" in page


def test_replay_holds_places_at_even_times(trace: Trace) -> None:
    scene = SearchScene(trace)
    data = replay_data(scene)
    walker = data["targets"][0]["places"]
    assert len(walker) == 600
    assert walker[0] == [300.0, 500.0]
    assert walker[-1] == [750.0, pytest.approx(500.0 + 60.0 * math.sin(10.0), abs=0.051)]
    assert data["vehicles"][0]["crash"] == END - 20


def test_page_of_a_stopped_run_without_a_world() -> None:
    records = (Pose(t=0.0, agent="u<", x=1.0, y=2.0, heading=0.0, mode="search", fuel=9.0),)
    made = Trace("made", Header(swarmbid="0", mission={}, algorithm="x", mode="world"), records)
    page = render_search_report(made)
    assert "stopped before its end" in page
    assert "u&lt;" in page


def test_line_is_straight_between_records() -> None:
    line = Line([0.0, 10.0], [(0.0, 0.0), (100.0, 50.0)], ["search", "track"])
    assert line.at(-1.0) is None
    assert line.at(4.0) == (40.0, 20.0)
    assert line.at(99.0) == (100.0, 50.0)
    assert line.mode_at(9.9) == "search"
    assert line.runs() == [("search", 0.0, 10.0), ("track", 10.0, 10.0)]


def test_captions_are_broken_at_blanks() -> None:
    assert wrapped("one two three", 7) == ["one two", "three"]
    assert wrapped("overlongword x", 5) == ["overlongword", "x"]
