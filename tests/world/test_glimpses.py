"""The glimpse log: any order, loss and repetition end alike."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmbid.world.glimpses import GlimpseBatch, GlimpseLog


def content(log):
    return log.missing({}, 10**9)


def same(a: GlimpseBatch, b: GlimpseBatch) -> bool:
    return a.agents == b.agents and all(
        getattr(a, name).tobytes() == getattr(b, name).tobytes()
        for name in ("first", "counts", "t", "x", "y")
    )


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3), st.integers(0, 5), st.booleans()), max_size=60)
)
def test_gossip_ends_alike_and_counts_once(steps):
    logs = [GlimpseLog(f"u{k}") for k in range(4)]
    taken = [[] for _ in logs]
    stray = []
    for number, (a, b, most, kept) in enumerate(steps):
        logs[a].add(float(number), float(a), float(b))
        batch = logs[a].missing(logs[b].known(), most)
        stray.append((b, batch))
        if kept:
            taken[b].append(logs[b].merge(batch))
    for b, batch in stray + stray[::-1]:  # late, reordered and twice
        taken[b].append(logs[b].merge(batch))
    for _ in range(3):
        for a in range(4):
            for b in range(4):
                if a != b:
                    taken[b].append(logs[b].merge(logs[a].missing(logs[b].known(), 10**6)))
    assert all(same(content(log), content(logs[0])) for log in logs)
    for k, log in enumerate(logs):
        rows = [tuple(row) for part in taken[k] for row in part]
        foreign = sum(count for agent, count in log.known().items() if agent != log.agent)
        assert len(rows) == len(set(rows)) == foreign


def test_a_gap_is_ignored_until_repaired_or_lost():
    source, sink = GlimpseLog("a"), GlimpseLog("b")
    for k in range(6):
        source.add(k, 10.0 * k, 0.0)
    late = source.missing({"a": 3}, 10)
    assert len(sink.merge(late)) == 0
    assert len(sink.merge(source.missing({}, 3))) == 3
    assert len(sink.merge(late)) == 3 and sink.known() == {"a": 6}


def test_memory_is_bounded_and_what_is_lost_holds_nobody_up():
    source, sink = GlimpseLog("a", keep=8), GlimpseLog("b")
    for k in range(100):
        source.add(k, float(k), 0.0)
    new = sink.merge(source.missing(sink.known(), 50))
    assert 8 <= len(new) <= 10 and new[-1, 0] == 99.0 and sink.known() == {"a": 100}


def test_thinning_and_malformed():
    log = GlimpseLog("a", stride=10.0)
    assert [log.add(k, 4.0 * k, 0.0) for k in range(7)] == [True, False, False, True, False, False, True]
    bad = content(log)
    broken = GlimpseBatch(bad.agents, bad.first, bad.counts + 1, bad.t, bad.x, bad.y, bad.floors)
    other = GlimpseLog("b")
    assert len(other.merge(broken)) == 0 and other.known() == {}
    assert len(other.merge(bad)) == 3 == np.sum(bad.counts)
