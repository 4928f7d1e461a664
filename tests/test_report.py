"""The report page and the map: what is drawn is what the plan says, and nothing a user names gets out."""

from __future__ import annotations

import base64
import hashlib
import io
import math
import re
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmbid.missionfile import mission_to_dict
from swarmbid.model import Agent, Mission, Task
from swarmbid.network import Network, make_topology
from swarmbid.plan import AgentPlan, Plan, Unserved, Visit, make_plan
from swarmbid.report import render_map_svg, render_report
from swarmbid.report.charts import MOST_BARS, bids_over_time, messages_over_time, render_bars_svg
from swarmbid.report.labels import LabelPlacer
from swarmbid.report.scene import Scene
from swarmbid.report.svg import (
    DARK_COLOURS,
    LIGHT_COLOURS,
    clock,
    metres,
    nice_step,
    number,
    octets,
    shorten,
    span_of,
    tag,
    time_step,
)
from swarmbid.report.timeline import LEFT, MOST_ROWS, render_timeline_svg, timeline_rows
from swarmbid.scores import make_score
from swarmbid.simulator import simulate
from swarmbid.trace import Agreed, Header, Result, Sent, Taken, TraceWriter, read_trace
from swarmbid.verify import Violation, verify

SVG = "{http://www.w3.org/2000/svg}"
VOID = {"meta", "br", "link", "img", "input", "hr"}


def agent(name: str, x: float = 0.0, y: float = 0.0, **more: Any) -> Agent:
    return Agent(id=name, position=(x, y, 0.0), speed=10.0, **more)


def task(name: str, x: float, y: float = 0.0, **more: Any) -> Task:
    return Task(id=name, position=(x, y, 0.0), **more)


def visit(name: str, arrival: float, start: float, end: float, leg: float) -> Visit:
    return Visit(task=name, arrival=arrival, start=start, end=end, leg=leg, score=1.0)


def plan_of(*agents: AgentPlan, unserved: tuple[Unserved, ...] = (), name: str = "field") -> Plan:
    total = float(sum(one.score for one in agents))
    return Plan(
        mission=name, algorithm="cbba", score_name="time_discounted", agents=agents, unserved=unserved,
        total_score=total, honest_score=total,
    )  # fmt: skip


def one_agent() -> tuple[Mission, Plan]:
    """At 10 m/s, 100 m to t1, there from 10 s, waits until 15 s, works until 25 s, 100 m back: 35 s."""
    mission = Mission(
        name="field",
        agents=(agent("uav1", base=(0.0, 0.0, 0.0)),),
        tasks=(task("t1", 100.0, duration=10.0, start=15.0, end=30.0), task("t2", 50.0, 50.0)),
    )
    does = AgentPlan("uav1", (visit("t1", 10.0, 15.0, 25.0, 100.0),), 200.0, 35.0, 1.0)
    return mission, plan_of(does, unserved=(Unserved("t2", "no_room", "Nobody has a place for it."),))


def trace_of(mission: Mission, plan: Plan, *records: Any, mode: str = "rounds", **result: Any):
    file = io.BytesIO()
    with TraceWriter(file) as writer:
        writer.write(
            Header(
                swarmbid="0",
                mission=mission_to_dict(mission),
                algorithm="cbba",
                score={"name": "time_discounted"},
                mode=mode,
            )
        )
        for record in records:
            writer.write(record)
        told = {
            "t": 4.0,
            "status": "converged",
            "rounds": 2,
            "declared_round": 4,
            "last_bid_round": 2,
            **result,
        }
        writer.write(Result(plan=plan.to_dict(), **told))
    file.seek(0)
    return read_trace(file)


def taken(t: float, name: str = "uav1", what: str = "t1") -> Taken:
    return Taken(t=t, agent=name, task=what, bid=1.0, position=0, start=1.0)


def sent(t: float, lost: int = 0) -> Sent:
    return Sent(t=t, agent="uav1", sequence=1, entries=1, bytes=100, lost=lost)


class Page(HTMLParser):
    """What a browser makes of a page: elements, attributes, text, and whether every element is closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text: dict[str, str] = {}
        self.open: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, name: str, attributes: list[tuple[str, str | None]]) -> None:
        self.elements.append((name, dict(attributes)))
        if name not in VOID:
            self.open.append(name)

    def handle_startendtag(self, name: str, attributes: list[tuple[str, str | None]]) -> None:
        self.elements.append((name, dict(attributes)))

    def handle_endtag(self, name: str) -> None:
        assert self.open.pop() == name

    def handle_data(self, data: str) -> None:
        if self.open:
            self.text[self.open[-1]] = self.text.get(self.open[-1], "") + data


def tree(svg: str) -> ElementTree.Element:
    """Parse one drawing of the page, which leaves the XML namespace to its host."""
    return ElementTree.fromstring(
        svg if "xmlns" in svg else svg.replace("<svg ", f'<svg xmlns="{SVG[1:-1]}" ', 1)
    )


def by_class(root: ElementTree.Element, css: str) -> list[ElementTree.Element]:
    return [item for item in root.iter() if css in item.get("class", "").split()]


# --- the page


def test_the_page_is_whole_and_loads_nothing():
    mission, plan = one_agent()
    text = render_report(mission, plan, trace_of(mission, plan, taken(0.0), sent(0.0)), [])
    page = Page(text)
    assert page.open == []
    links = [
        value
        for _, attributes in page.elements
        for key, value in attributes.items()
        if key in ("src", "href", "xlink:href", "action", "data")
    ]
    assert links == []
    assert "//" not in re.sub(r"<!--.*?-->", "", text).replace("</", "")


def test_only_our_own_script_may_run():
    page = Page(render_report(*one_agent()))
    policy = next(found["content"] for name, found in page.elements if found.get("http-equiv"))
    digest = base64.b64encode(hashlib.sha256(page.text["script"].encode()).digest()).decode()
    assert policy == f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"
    assert not [key for _, found in page.elements for key in found if key.startswith("on")]


def test_whatever_is_named_stays_text():
    """Names and types are any printable text: none may become an element or leave its attribute."""
    nasty = "</script></title><img src=x onerror=alert(1)>\"'&<b>"
    mission = Mission(
        name=nasty,
        agents=(agent("uav1", type=nasty),),
        tasks=(task("t1", 100.0, type=nasty), task("t2", 5.0, type=nasty + "2")),
    )
    does = AgentPlan("uav1", (visit("t1", 10.0, 10.0, 10.0, 100.0),), 100.0, 10.0, 1.0)
    plan = plan_of(does, unserved=(Unserved("t2", "no_room", nasty),), name=nasty)
    trace = trace_of(mission, plan, status="not_converged", reason=nasty)
    page = Page(render_report(mission, plan, trace, [Violation("uav1", "t1", nasty, nasty)]))
    names = [name for name, _ in page.elements]
    assert "img" not in names
    assert names.count("script") == 1
    assert page.open == []
    assert page.text["h1"] == nasty
    assert nasty in page.text["td"]
    assert "onerror" not in {key for _, found in page.elements for key in found}
    ElementTree.fromstring(render_map_svg(mission, plan))


def test_it_says_what_was_agreed_and_checked():
    mission, plan = one_agent()
    page = Page(render_report(mission, plan, trace_of(mission, plan, taken(0.0), sent(0.0)), []))
    assert page.text["li"].startswith("AgreedChecked: can be flown as is1 task not served")
    assert "The only agent does 1 of 2 tasks." in page.text["p"]
    assert "The last task ends after 25\u00a0s; the last way home after 35\u00a0s." in page.text["p"]
    assert "Nobody has a place for it." in page.text["td"]
    assert "Rounds to agreement" in page.text["dt"]


def test_it_says_who_agreed_in_how_many_rounds():
    mission = Mission(agents=(agent("a"), agent("b")), tasks=(task("t1", 10.0),))
    plan = plan_of(AgentPlan("a", (visit("t1", 1.0, 1.0, 1.0, 10.0),), 10.0, 1.0, 1.0))
    page = Page(render_report(mission, plan, trace_of(mission, plan)))
    assert "1 of 2 agents does the only task." in page.text["p"]
    assert "They agreed on it among themselves, without a leader, in 2 rounds." in page.text["p"]


def test_it_says_that_they_did_not_agree_and_why():
    mission, plan = one_agent()
    trace = trace_of(
        mission, plan, sent(0.0, lost=3), status="not_converged", reason="the network is in pieces"
    )
    page = Page(render_report(mission, plan, trace, []))
    assert page.text["li"].startswith("Not agreedChecked: breaks no rule")
    assert "the network is in pieces" in page.text["p"]
    assert "3 receptions lost by the network" in page.text["p"]
    assert "Rounds to agreement" not in page.text["dt"]
    assert "all agree" not in page.text["text"]


def test_it_lists_what_the_check_found():
    mission, plan = one_agent()
    page = Page(render_report(mission, plan, None, [Violation("uav1", "t1", "window", "too late by 3 s")]))
    assert "Checked: 1 violation" in page.text["li"]
    assert "too late by 3 s" in page.text["td"]


def test_it_says_nothing_of_what_it_was_not_told():
    page = Page(render_report(*one_agent()))
    assert "Agreed" not in page.text["li"]
    assert "Checked" not in page.text["li"]
    assert "How they agreed" not in page.text["h2"]


def test_the_table_has_every_visit_with_its_times():
    page = Page(render_report(*one_agent()))
    assert "uav11t110 s5 s15 s25 s100 m1.0back at base35 s200 m1.0" in page.text["td"]


@pytest.mark.parametrize(
    ("agents", "tasks", "says"),
    [
        ((), (), "There is nothing to do."),
        ((agent("a"),), (), "There is nothing to do."),
        ((), (task("t1", 0.0),), "Nobody does anything; 1 task left."),
        ((agent("a"),), (task("t1", 0.0), task("t2", 0.0)), "Nobody does anything; 2 tasks left."),
    ],
)
def test_nobody_and_nothing_have_a_page(agents: tuple[Agent, ...], tasks: tuple[Task, ...], says: str):
    mission = Mission(agents=agents, tasks=tasks)
    plan = plan_of(unserved=tuple(Unserved(one.id, "no_room", "") for one in tasks))
    page = Page(render_report(mission, plan, trace_of(mission, plan), []))
    assert page.open == []
    assert says in page.text["p"]
    ElementTree.fromstring(render_map_svg(mission, plan))


def test_the_same_plan_makes_the_same_bytes():
    mission, plan = one_agent()
    trace = trace_of(mission, plan, taken(0.0), sent(0.0))
    assert render_report(mission, plan, trace, []) == render_report(mission, plan, trace, [])


def test_a_page_of_many_stays_readable():
    """Of 120 agents with work the timeline shows 80: those that finish last, in order of id."""
    agents = tuple(agent(f"a{row:03}", float(row)) for row in range(120))
    tasks = tuple(task(f"t{row:03}", float(row), 10.0) for row in range(120))
    plans = tuple(
        AgentPlan(f"a{row:03}", (visit(f"t{row:03}", 1.0, 1.0, 1.0, 10.0),), 10.0, float(row), 1.0)
        for row in range(120)
    )
    scene = Scene(Mission(agents=agents, tasks=tasks), plan_of(*plans))
    assert [row.agent.id for row in timeline_rows(scene)] == [f"a{row:03}" for row in range(40, 120)]
    page = Page(render_report(scene.mission, scene.plan))
    assert f"Of 120 agents with work, the {MOST_ROWS} that finish last." in page.text["p"]


# --- the page of a real run


CHARTS = ("chart-map", "chart-time")
NASTY = "</script><b>\"&'"


def team(**mission: Any) -> Mission:
    """Two agents with room for one task each; t1 and t2 lie beside them, t3 between, t4 needs an arm."""
    fades = {"discount": 0.01}
    return Mission(
        agents=(agent("left", bundle_limit=1), agent("right", 300.0, bundle_limit=1)),
        tasks=(
            task("t1", 10.0, **fades),
            task("t2", 290.0, **fades),
            task("t3", 150.0, **fades),
            task("t4", 150.0, 40.0, type=NASTY, equipment=frozenset({"arm"})),
        ),
        **mission,
    )


def page_of(mission: Mission, **options: Any) -> str:
    """What ``swarmbid simulate --report`` writes."""
    file = io.BytesIO()
    run = simulate(mission, trace=file, **options)
    file.seek(0)
    return render_report(mission, run.plan, read_trace(file), verify(mission, run.plan, run.score))


def drawings(text: str) -> list[ElementTree.Element]:
    """Every inline drawing of a page, parsed as the XML that it must be."""
    found = re.findall(r"<svg\b.*?</svg>", text, re.DOTALL)
    assert len(found) == text.count("<svg") == text.count("</svg>")
    return [tree(one) for one in found]


def cells(text: str, heading: str) -> list[list[str]]:
    """The rows of the table under a heading, as text."""
    section = text.split(f"<h2>{heading}</h2>")[1].split("</section>")[0]
    return [
        [re.sub(r"<[^>]*>", "", cell) for cell in re.findall(r"<td\b.*?</td>", row)]
        for row in re.findall(r"<tr\b.*?</tr>", section)
        if "<td" in row
    ]


def test_a_real_run_shows_every_agent_every_task_and_why_some_are_left():
    """Each agent takes the task 10 m away; nobody has room for t3, nobody the arm for t4."""
    text = page_of(team())
    listed = re.findall(r'<li class="a\d" data-agent="([^"]*)" tabindex="0">', text)
    assert listed == ["left", "right"]
    chart, timeline = (next(one for one in drawings(text) if one.get("class") == css) for css in CHARTS)
    told = [item.text.split(" (")[0] for item in chart.iter(f"{SVG}title") if ", reward " in item.text]
    assert told == ["t1", "t2", "t3", "t4"]
    assert [item.text for item in by_class(timeline, "row")] == ["left", "right"]
    assert [row[2] for row in cells(text, "Who, what, when")] == ["t1", "done", "t2", "done"]
    assert [(row[0], row[3], row[4]) for row in cells(text, "Not served")] == [
        ("t3", "no room", "Agents able to do it: 2 with a full bundle."),
        ("t4", "no capable agent", "It needs arm; no agent that may do it carries all of that."),
    ]
    assert Page(text).text["li"].startswith("AgreedChecked: can be flown as is2 tasks not served")


def test_a_real_run_that_is_stopped_early_says_so():
    """At the ends of a line of three, nobody has heard of the other end after one round."""
    mission = Mission(agents=tuple(agent(name) for name in "abc"), tasks=(task("t1", 10.0), task("t2", 20.0)))
    page = Page(page_of(mission, network=Network(make_topology("line", 3)), max_rounds=1))
    assert page.text["li"].startswith("Not agreedChecked: breaks no rule")
    assert "the beliefs still differed" in page.text["p"]
    assert "They had not agreed when they were stopped" in page.text["p"]
    assert "They agreed" not in page.text["p"]
    assert "Rounds to agreement" not in page.text["dt"]


def test_a_real_plan_that_breaks_a_window_is_shown_with_the_violation():
    """100 m at 10 m/s are 10 s, 5 s after the window has closed."""
    mission = Mission(agents=(agent("a"),), tasks=(task("t1", 100.0, end=5.0),))
    score = make_score("time_discounted")
    plan = make_plan(mission, {"a": [("t1", 10.0)]}, score, "cbba", "hold")
    text = render_report(mission, plan, None, verify(mission, plan, score))
    assert cells(text, "Check") == [["a", "t1", "window", "starts at 10.0 s, the window is 0.0 to 5.0 s"]]
    assert '<li class="badge bad">Checked: 1 violation</li>' in text


@pytest.mark.parametrize("names", ["field", NASTY])
def test_every_drawing_of_every_page_is_well_formed(names: str):
    """The map, the timeline, two charts, and a swatch for each agent and sign."""
    one = drawings(page_of(team(name=names)))
    # 4 charts, 2 agents, and 4 signs: two types of task, what is not served, where agents start.
    assert len(one) == 10
    ElementTree.fromstring(render_map_svg(team(name=names), simulate(team(name=names)).plan))


def test_a_real_run_with_nasty_names_keeps_them_text():
    page = Page(page_of(team(name=NASTY)))
    names = [name for name, _ in page.elements]
    assert names.count("script") == 1
    # The <b> of the name would be one more than agents in the list and tasks in the table of what is left.
    assert names.count("b") == 2 + 2
    assert page.open == []
    assert page.text["h1"] == NASTY
    assert NASTY in page.text["title"]
    assert NASTY in page.text["td"]


@pytest.mark.parametrize(
    ("num_agents", "num_tasks", "says"),
    [
        (0, 0, "There is nothing to do."),
        (1, 0, "There is nothing to do."),
        (0, 1, "Nobody does anything; 1 task left."),
        (1, 1, "The only agent does the only task."),
    ],
)
def test_real_runs_of_none_and_one_have_a_page(num_agents: int, num_tasks: int, says: str):
    mission = Mission(agents=(agent("a"),) * num_agents, tasks=(task("t1", 10.0),) * num_tasks)
    text = page_of(mission)
    page = Page(text)
    assert page.open == []
    assert says in page.text["p"]
    assert len(drawings(text)) >= 2
    assert text.count('data-agent="a" tabindex') == num_agents
    assert ("t1 (task), reward 1" in text) == (num_tasks == 1)


def test_two_runs_with_one_seed_have_equal_pages():
    assert page_of(team(), mode="asynchronous", seed=5) == page_of(team(), mode="asynchronous", seed=5)


# --- the map


def test_the_map_is_to_scale_with_north_up():
    """From a at (0, 0): t1 is 100 m east, t2 50 m east and 50 m north."""
    mission, plan = one_agent()
    root = tree(render_map_svg(mission, plan))
    line = by_class(root, "leg")[0].get("points")
    (x0, y0), (x1, y1) = (tuple(map(float, point.split(","))) for point in line.split())
    assert y1 == y0
    missed = by_class(root, "missed")[0]
    x2, y2 = float(missed.get("cx")), float(missed.get("cy"))
    assert (x2 - x0, y0 - y2) == pytest.approx(((x1 - x0) / 2, (x1 - x0) / 2), abs=0.2)


def test_the_map_shows_every_path_every_stop_and_every_way_home():
    mission, plan = one_agent()
    root = tree(render_map_svg(mission, plan, standalone=False))
    assert [item.get("data-agent") for item in root.iter(f"{SVG}g") if by_class(item, "leg")] == ["uav1"]
    assert [item.text for item in by_class(root, "order")] == ["1"]
    assert len(by_class(root, "home")) == len(by_class(root, "base")) == 1
    assert len(by_class(root, "window")) == 1
    told = [item.text for item in root.iter(f"{SVG}title")]
    assert "t1 (task), reward 1\nstart of service from 15 s to 30 s\nuav1, stop 1: 15 s to 25 s" in told
    assert "t2 (task), reward 1\nnot served. Nobody has a place for it." in told


def test_a_picture_alone_brings_its_colours_and_its_legend():
    mission, plan = one_agent()
    alone = tree(render_map_svg(mission, plan))
    assert "--a0:" in alone.find(f"{SVG}style").text
    texts = [item.text for item in alone.iter(f"{SVG}text")]
    assert "uav1: 1 task, 200 m" in texts
    assert "crossed out: 1 task not served" in texts
    within = tree(render_map_svg(mission, plan, standalone=False))
    assert within.find(f"{SVG}style") is None
    assert "uav1: 1 task, 200 m" not in [item.text for item in within.iter(f"{SVG}text")]


@pytest.mark.parametrize("spread", [1e-6, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("aspect", [0.01, 1.0, 20.0])
def test_everything_lies_on_the_sheet(spread: float, aspect: float):
    places = [(0.0, 0.0), (spread, 0.3 * spread * aspect), (-0.2 * spread, spread * aspect)]
    mission = Mission(
        agents=(agent("a"),), tasks=tuple(task(f"t{k}", x, y) for k, (x, y) in enumerate(places))
    )
    root = tree(render_map_svg(mission, plan_of(), standalone=False))
    _, _, wide, high = map(float, root.get("viewBox").split())
    markers = by_class(root, "missed")
    assert len(markers) == 3
    for item in markers:
        assert 20 < float(item.get("cx")) < wide - 20
        assert 20 < float(item.get("cy")) < high - 20


def test_types_have_shapes_and_agents_beyond_eight_have_dashes():
    agents = tuple(agent(f"a{row}", float(row)) for row in range(9))
    tasks = (task("t0", 50.0, type="look"), task("t1", 60.0, type="look"), task("t2", 70.0, type="lift"))
    does = AgentPlan("a8", (visit("t0", 1.0, 1.0, 1.0, 1.0), visit("t2", 2.0, 2.0, 2.0, 1.0)), 2.0, 2.0, 2.0)
    root = tree(render_map_svg(Mission(agents=agents, tasks=tasks), plan_of(does)))
    assert by_class(root, "leg")[0].get("stroke-dasharray") == "9 4"
    # The commonest type is the circle, the next the square.
    assert [item.tag.removeprefix(SVG) for item in by_class(root, "stop")] == ["circle", "rect"]


points = st.tuples(st.floats(0.0, 400.0), st.floats(0.0, 300.0))


@given(st.lists(points, min_size=1, max_size=30), st.floats(10.0, 90.0))
def test_labels_cover_neither_each_other_nor_markers_nor_the_edge(
    places: list[tuple[float, float]], width: float
):
    placer = LabelPlacer(400.0, 300.0)
    boxes = [(x - 5.0, y - 5.0, x + 5.0, y + 5.0) for x, y in places]
    for box in boxes:
        placer.block(*box)
    for x, y in places:
        spot = placer.place(x, y, 5.0, width, 10.0)
        if spot is None:
            continue
        left, base = spot
        label = (left, base - 8.0, left + width, base + 2.5)
        assert label[0] >= 2.0
        assert label[1] >= 2.0
        assert label[2] <= 398.0
        assert label[3] <= 298.0
        for box in boxes:
            assert label[0] >= box[2] or label[2] <= box[0] or label[1] >= box[3] or label[3] <= box[1]
        boxes.append(label)


def test_a_name_stays_clear_of_the_outline_of_a_window():
    """Its half diagonal is (8.5 + 3.2) * 1.22 = 14.3 px, and a gap of 4 px follows."""
    windows = [task(f"t{k}", 100.0 * k, type=kind, end=90.0) for k, kind in enumerate(["a", "a", "b", "c"])]
    mission = Mission(agents=(agent("uav1", 0.0, 50.0),), tasks=tuple(windows))
    stops = (visit("t3", 31.0, 31.0, 31.0, 304.0),)
    root = tree(
        render_map_svg(mission, plan_of(AgentPlan("uav1", stops, 304.0, 31.0, 1.0)), standalone=False)
    )
    [outline] = by_class(root, "window")
    corners = [tuple(map(float, point.split(","))) for point in outline.get("points").split()]
    [name] = [item for item in by_class(root, "name") if item.text == "t3"]
    middle = sum(x for x, _ in corners) / 4
    assert max(x for x, _ in corners) - middle == pytest.approx(14.3, abs=0.1)
    assert float(name.get("x")) - middle == pytest.approx(18.3, abs=0.1)


def test_a_name_to_the_left_of_its_point_ends_there():
    """The only leg goes right, from x = 0 to 100 m: the agent's name stands to the left of it."""
    mission = Mission(agents=(agent("uav1"),), tasks=(task("t1", 100.0), task("t2", -50.0)))
    does = AgentPlan("uav1", (visit("t1", 10.0, 10.0, 10.0, 100.0),), 100.0, 10.0, 1.0)
    root = tree(render_map_svg(mission, plan_of(does), standalone=False))
    [start] = by_class(root, "origin")
    [name] = by_class(root, "place")[:1]
    assert name.text == "uav1"
    assert name.get("text-anchor") == "end"
    # 9 px that the sign reaches out, and a gap of 4 px.
    assert float(name.get("x")) == pytest.approx(float(start.get("cx")) - 13.0, abs=0.1)


@pytest.mark.parametrize(("base", "shown"), [((0.0, 0.0, 0.0), False), ((9.0, 0.0, 0.0), True), (None, True)])
def test_the_signs_tell_a_start_that_is_no_base(base: tuple[float, float, float] | None, shown: bool):
    mission = Mission(agents=(agent("a", base=base),), tasks=(task("t1", 100.0),))
    assert ("start of an agent" in render_report(mission, plan_of())) == shown


def test_a_label_leaves_a_line_free_where_it_can():
    """To the right is the first choice; with a line leading there, the left."""
    free, crossed = LabelPlacer(400.0, 300.0), LabelPlacer(400.0, 300.0)
    crossed.avoid(200.0, 150.0, 400.0, 150.0)
    assert free.place(200.0, 150.0, 5.0, 40.0, 10.0)[0] > 200.0
    assert crossed.place(200.0, 150.0, 5.0, 40.0, 10.0)[0] < 160.0


# --- the timeline


def test_the_timeline_draws_travel_waiting_and_service_to_scale():
    """35 s are 890 px wide: 25.43 px a second, and 0 s is at 118 px."""
    root = tree(render_timeline_svg(Scene(*one_agent())))
    scale = (1120.0 - 118.0 - 112.0) / 35.0
    service, waiting, window = (by_class(root, css)[0] for css in ("service", "waiting", "open"))

    def stretch(item: ElementTree.Element) -> tuple[float, float]:
        return float(item.get("x")), float(item.get("width"))

    assert LEFT == 118.0
    assert stretch(service) == pytest.approx((118.0 + 15 * scale, 10 * scale), abs=0.1)
    assert stretch(waiting) == pytest.approx((118.0 + 10 * scale, 5 * scale), abs=0.1)
    assert stretch(window) == pytest.approx((118.0 + 15 * scale, 15 * scale), abs=0.1)
    travel, back = by_class(root, "travel")[0], by_class(root, "back")[0]
    assert (float(travel.get("x1")), float(travel.get("x2"))) == pytest.approx(
        (118.0, 118.0 + 10 * scale), abs=0.1
    )
    assert (float(back.get("x1")), float(back.get("x2"))) == pytest.approx(
        (118.0 + 25 * scale, 118.0 + 35 * scale), abs=0.1
    )
    assert [item.text for item in by_class(root, "inside")] == ["t1"]


def test_a_stop_too_short_for_its_name_shows_its_number_or_nothing():
    """Of 1000 s, 890 px wide, 20 s are 17.8 px: room for a digit, not for a name; 5 s for neither."""
    mission = Mission(agents=(agent("a"),), tasks=tuple(task(f"long-name-{k}", 1.0) for k in range(3)))
    visits = (
        visit("long-name-0", 0.0, 0.0, 20.0, 0.0),
        visit("long-name-1", 100.0, 100.0, 105.0, 0.0),
        visit("long-name-2", 800.0, 800.0, 1000.0, 0.0),
    )
    root = tree(render_timeline_svg(Scene(mission, plan_of(AgentPlan("a", visits, 0.0, 1000.0, 0.0)))))
    assert [item.text for item in by_class(root, "inside")] == ["1", "long-name-2"]


# --- the charts


def test_the_bars_count_bids_and_broadcasts_by_round():
    """Rounds 0 to 4, of which the last is that of the result."""
    mission, plan = one_agent()
    trace = trace_of(mission, plan, taken(0.0), taken(0.0), sent(0.0), taken(2.0), sent(2.0), sent(3.0))
    assert bids_over_time(trace).counts == (2, 0, 1, 0, 0)
    assert messages_over_time(trace).counts == (1, 0, 1, 1, 0)
    root = tree(render_bars_svg(bids_over_time(trace), css="bar", told="bids", marks=[(2.0, "all agree")]))
    assert [item.find(f"{SVG}title").text for item in root.iter(f"{SVG}g")] == ["Round 1: 2", "Round 3: 1"]
    assert by_class(root, "mark-name")[0].text == "all agree"


def test_many_rounds_share_bars_and_none_is_lost():
    """200 rounds (and the result's, 0 to 200) over at most 60 bars: 4 rounds a bar, 51 bars."""
    mission, plan = one_agent()
    trace = trace_of(mission, plan, *[taken(float(t)) for t in range(200)], t=200.0)
    bars = bids_over_time(trace)
    assert (len(bars.counts), bars.width, sum(bars.counts)) == (51, 4.0, 200)
    assert len(bars.counts) <= MOST_BARS
    assert "Rounds 1 to 4: 4" in render_bars_svg(bars, css="bar", told="bids")


def test_without_rounds_time_is_cut_into_equal_stretches():
    mission, plan = one_agent()
    trace = trace_of(
        mission, plan, taken(0.1), taken(29.9), Agreed(t=30.0, agent="uav1"), mode="asynchronous", t=30.0
    )
    bars = bids_over_time(trace)
    assert bars.width == 1.0
    assert bars.counts[0] == bars.counts[29] == 1
    assert "29 s to 30 s: 1" in render_bars_svg(bars, css="bar", told="bids")


# --- small change


def test_attributes_and_numbers_are_written_plainly():
    assert tag("a", "x", b='"<', c=None, class_="d", text_anchor="end", w=2.0) == (
        '<a b="&quot;&lt;" class="d" text-anchor="end" w="2">x</a>'
    )
    assert [number(value) for value in (-0.04, 1.25, 3.0, -2.5)] == ["0", "1.2", "3", "-2.5"]


@given(st.floats(1e-6, 1e9), st.integers(1, 20))
def test_a_nice_step_is_the_smallest_round_one_that_suffices(span: float, most: int):
    step = nice_step(span, most)
    mantissa = step / 10.0 ** math.floor(math.log10(step) + 1e-9)
    assert min(abs(mantissa - nice) for nice in (1.0, 2.0, 5.0, 10.0)) < 1e-6
    assert span / step <= most * (1.0 + 1e-6)
    assert span / (step / 2.5) > most * (1.0 - 1e-6)


def test_times_lengths_and_sizes_read_well():
    assert [clock(t) for t in (0.0, 47.46, 59.96, 750.0, 3750.0)] == [
        "0 s",
        "47.5 s",
        "1:00",
        "12:30",
        "1:02:30",
    ]
    assert [span_of(t) for t in (47.5, 59.97, 60.0, 750.0, 3600.0, 3750.0)] == [
        "47.5 s", "1 min", "1 min", "12 min 30 s", "1 h", "1 h 2 min",
    ]  # fmt: skip
    assert [metres(d) for d in (8.54, 640.4, 999.6, 12400.0, 123456.0)] == [
        "8.5 m", "640 m", "1 km", "12.4 km", "123 km",
    ]  # fmt: skip
    assert [octets(size) for size in (640, 12400, 3.1e6)] == ["640 B", "12.4 kB", "3.1 MB"]
    assert [time_step(span, 10) for span in (5.0, 100.0, 2400.0, 86400.0, 1e6)] == [
        0.5,
        10.0,
        300.0,
        10800.0,
        172800.0,
    ]
    assert (shorten("abcdef", 6), shorten("abcdef", 5)) == ("abcdef", "abcd…")


def luminance(colour: str) -> float:
    parts = [int(colour[place : place + 2], 16) / 255.0 for place in (1, 3, 5)]
    red, green, blue = (p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


@pytest.mark.parametrize(("colours", "paper"), [(LIGHT_COLOURS, "#ffffff"), (DARK_COLOURS, "#161d25")])
def test_every_agent_s_colour_stands_out_from_the_paper(colours: tuple[str, ...], paper: str):
    """Contrast of at least 3 to 1, what WCAG 2.2 asks of graphics; numbers inside have the paper's."""
    for colour in colours:
        high, low = sorted((luminance(colour), luminance(paper)), reverse=True)
        assert (high + 0.05) / (low + 0.05) >= 3.0, colour
