"""The bundle kernel against the slow twin, built afresh and rebuilt as the bids of others change."""

from __future__ import annotations

import dataclasses
import random

import numpy as np
import pytest

from generators import random_mission
from naive import SCORES, Bundle, Judge, extend_bundle
from swarmbid.algorithms import _bundle
from swarmbid.arrays import NO_AGENT, MissionArrays
from swarmbid.kernels import bundle as kernel
from swarmbid.scores import make_score

RULES = ("hold", "shift", "append")
SEEDS = 30
REBUILDS = 6
Bids = dict[str, tuple[str | None, float]]


class Builder:
    """One agent's bundle, with what it keeps between builds."""

    def __init__(self, judge: Judge, label: str) -> None:
        name, _, option = label.partition(" ")
        score = make_score(name, **dict([option.split("=")] if option else []))
        self.arrays = arrays = MissionArrays(judge.mission)
        self.judge, self.score = judge, score
        self.limit = arrays.bundle_limit(judge.agent)
        self.kept: _bundle.Bundle | None = None

    def build(self, bids: Bids, changed: list[str], *, warp: bool, kept: int = 0) -> None:
        """Build against `bids`, of which `changed` differ from the last call's."""
        arrays, judge = self.arrays, self.judge
        if self.kept is None:
            self.kept = _bundle.Bundle(
                arrays, arrays.agent_row[judge.agent.id], self.score,
                limit=self.limit, insertion=judge.rule, warp=warp,
            )  # fmt: skip
        ranks = [arrays.agent_row.get(bids[t][0] or "", NO_AGENT) for t in arrays.task_ids]
        self.kept.build(
            np.array([bids[t][1] for t in arrays.task_ids]),
            np.array(ranks, np.int32),
            np.array([arrays.task_row[t] for t in changed], np.int64),
            kept,
        )

    def tasks(self) -> list[str]:
        assert self.kept is not None
        return [self.arrays.task_ids[row] for row in self.kept.tasks]

    def path(self) -> list[tuple[str, float]]:
        assert self.kept is not None
        return [(self.arrays.task_ids[row], start) for row, start in self.kept.path]

    def bids(self) -> list[float]:
        assert self.kept is not None
        return self.kept.marks[kernel.BID, : self.kept.length].tolist()

    def unused(self) -> set[int]:
        assert self.kept is not None
        return set(self.kept.order[kernel.BUNDLE, self.kept.length :].tolist())


def redraw(rng: random.Random, judge: Judge, bids: Bids) -> list[str]:
    """Change some of the bids to beat: withdrawn, raised, or equal to the agent's own gain (a tie).

    Ties with gains that go through an exponential are left out: twin and kernel round them differently.
    """
    others = [agent.id for agent in judge.mission.agents if agent.id != judge.agent.id]
    changed = [task_id for task_id in bids if rng.random() < 0.4]
    for task_id in changed:
        alone = judge.best_insertion([], judge.tasks[task_id])
        worth = judge.tasks[task_id].reward
        flat = judge.terms[task_id].decay == judge.terms[task_id].inverse_width == 0.0
        tie = alone[0] if flat and alone is not None and alone[0] > 0 else worth / 2
        bids[task_id] = rng.choice(
            [(None, 0.0), (rng.choice(others), rng.uniform(0.1, worth)), (rng.choice(others), tie)]
        )
    return changed


def same_bids(ours: list[float], twins: list[float]) -> bool:
    return ours == pytest.approx(twins, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("gain_bytes", [_bundle.GAIN_BYTES, 0])
@pytest.mark.parametrize("warp", [False, True])
@pytest.mark.parametrize(
    ("label", "rule"),
    [
        ("time_discounted fuel=start", "hold"),
        ("time_discounted fuel=start", "append"),
        ("time_discounted", "hold"),
        ("time_discounted", "shift"),
        ("distance_cost", "shift"),
        ("revisit", "shift"),
    ],
)
def test_rebuilding_against_changed_bids_gives_what_building_afresh_gives(
    label: str, rule: str, warp: bool, gain_bytes: int, monkeypatch: pytest.MonkeyPatch
):
    """Gains that were kept from earlier builds must never show: all that are needed, or two rows of them.

    With ties only where twin and kernel do the same arithmetic: rounding may part two equal bids else.
    """
    monkeypatch.setattr(_bundle, "GAIN_BYTES", gain_bytes)
    exact = rule != "shift" and label == "time_discounted fuel=start"
    taken = 0
    for seed in range(SEEDS):
        rng = random.Random(seed)
        mission = random_mission(
            seed,
            ties=exact and seed % 2 == 0,
            tasks=(1, 9),
            revisits=label == "revisit",
            reward_scale=10.0 if label == "distance_cost" else 1.0,
        )
        if seed % 3 == 0:  # no discount: equal gains and equal bids abound
            mission = dataclasses.replace(
                mission, tasks=tuple(dataclasses.replace(task, discount=0.0) for task in mission.tasks)
            )
        judge = Judge(mission, rng.choice(mission.agents), SCORES[label], rule)
        builder = Builder(judge, label)
        bids: Bids = {task.id: (None, 0.0) for task in mission.tasks}
        changed: list[str] = []
        for step in range(REBUILDS):
            builder.build(bids, changed, warp=warp)
            twin = Bundle([], [], [])
            extend_bundle(judge, twin, dict(bids), warp=warp)
            where = f"seed {seed}, step {step}"
            assert builder.tasks() == twin.tasks, where
            assert builder.path() == twin.path, where
            if exact:
                assert builder.bids() == pytest.approx(twin.bids, rel=1e-14), where
            assert same_bids(builder.bids(), twin.bids), where
            assert builder.unused() <= {NO_AGENT}, where
            taken += len(twin.tasks)
            changed = redraw(rng, judge, bids)
    assert taken > SEEDS


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize(
    "label", ["time_discounted fuel=start", "time_discounted", "distance_cost", "revisit"]
)
def test_no_task_of_many_is_passed_over(label: str, rule: str):
    """300 tasks fill several batches of lanes, and most are never looked at, by their bound. None matters."""
    for seed in range(4):
        rng = random.Random(seed)
        mission = random_mission(
            seed,
            agents=(3, 3),
            tasks=(300, 300),
            revisits=label == "revisit",
            ranges=seed % 2 == 0,
            reward_scale=10.0 if label == "distance_cost" else 1.0,
        )
        agent = dataclasses.replace(mission.agents[0], bundle_limit=4)
        mission = dataclasses.replace(mission, agents=(agent, *mission.agents[1:]))
        judge = Judge(mission, agent, SCORES[label], rule)
        builder = Builder(judge, label)
        bids: Bids = {task.id: (None, 0.0) for task in mission.tasks}
        changed: list[str] = []
        for step in range(3):
            builder.build(bids, changed, warp=True)
            twin = Bundle([], [], [])
            extend_bundle(judge, twin, dict(bids), warp=True)
            assert builder.tasks() == twin.tasks, (seed, step)
            assert builder.path() == twin.path, (seed, step)
            assert same_bids(builder.bids(), twin.bids), (seed, step)
            changed = redraw(rng, judge, bids)


@pytest.mark.parametrize("rule", RULES)
def test_what_is_kept_stays_in_front_and_the_rest_is_taken_after_it(rule: str):
    """The paper's incremental bundle: the first tasks stay, even if something better came free."""
    label = "time_discounted fuel=start"
    extended = 0
    for seed in range(SEEDS):
        rng = random.Random(seed)
        mission = random_mission(seed, tasks=(4, 9), limits=False)
        judge = Judge(mission, mission.agents[0], SCORES[label], rule)
        builder = Builder(judge, label)
        bids: Bids = {task.id: (None, 0.0) for task in mission.tasks}
        redraw(rng, judge, bids)
        builder.build(bids, [], warp=False)
        twin = Bundle([], [], [])
        extend_bundle(judge, twin, dict(bids), warp=False)
        kept = rng.randint(0, len(twin.tasks))
        # Rebuilt by the twin from its kept prefix: insertions are replayed, then it goes on bidding.
        path = []
        for task_id in twin.tasks[:kept]:
            best = judge.best_insertion(path, judge.tasks[task_id])
            assert best is not None
            path = best[2]
        front = Bundle(twin.tasks[:kept], twin.bids[:kept], path)
        changed = [t for t in redraw(rng, judge, bids) if t not in front.tasks]
        beliefs = {t: (judge.agent.id, 1e9) if t in front.tasks else bids[t] for t in bids}
        for task_id in front.tasks:
            bids[task_id] = (None, 0.0)
        extend_bundle(judge, front, beliefs, warp=False)
        builder.build(bids, [*changed, *front.tasks], warp=False, kept=kept)
        assert builder.tasks() == front.tasks, seed
        assert builder.path() == front.path, seed
        assert builder.tasks()[:kept] == twin.tasks[:kept], seed
        extended += len(front.tasks) > kept
    assert extended > SEEDS // 2


def test_a_tie_goes_to_the_higher_rank_and_nobody_loses_to_a_positive_bid():
    assert kernel.outbids(5.0, 2, 5.0, 1)
    assert not kernel.outbids(5.0, 1, 5.0, 2)
    assert kernel.outbids(5.0, 0, 4.0, 9)
    assert kernel.outbids(0.5, 0, 0.0, NO_AGENT)


def test_a_bid_of_nothing_is_never_taken():
    for gain in (0.0, -1.0, -np.inf):
        assert not kernel.eligible(gain, np.inf, 1, 0.0, NO_AGENT)
    assert kernel.eligible(1e-9, np.inf, 1, 0.0, NO_AGENT)


def test_a_warped_bid_is_capped_and_the_cap_decides():
    """A gain of 9 behind a bid of 4 is a bid of 4: it does not beat 5, though 9 would."""
    assert not kernel.eligible(9.0, 4.0, 1, 5.0, 0)
    assert kernel.eligible(9.0, np.inf, 1, 5.0, 0)
