"""The network: which links there are, and what the air does to messages."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmbid.errors import InputError
from swarmbid.model import Agent, Mission
from swarmbid.network import (
    Cut,
    FixedTopology,
    Network,
    Partition,
    RangeTopology,
    Topology,
    agent_positions,
    connected_positions,
    connecting_range,
    make_topology,
    positions_with_mean_degree,
    range_for_mean_degree,
)
from swarmbid.network.faults import SenderStreams


def degrees(topology: Topology) -> list[int]:
    return [len(near) for near in topology.links()]


def is_symmetric(links: list[tuple[int, ...]]) -> bool:
    return all(row in links[k] for row, near in enumerate(links) for k in near)


def naive_diameter(links: list[tuple[int, ...]]) -> int:
    """Floyd and Warshall's all-pairs distances: shares nothing with the bits of the real one."""
    rows = range(len(links))
    hops = [[0.0 if i == k else 1.0 if k in links[i] else math.inf for k in rows] for i in rows]
    for via in rows:
        for i in rows:
            for k in rows:
                hops[i][k] = min(hops[i][k], hops[i][via] + hops[via][k])
    longest = max(max(row) for row in hops)
    return -1 if math.isinf(longest) else int(longest)


def within_sigmas(count: int, trials: int, probability: float, sigmas: float = 4.0) -> bool:
    spread = math.sqrt(trials * probability * (1.0 - probability))
    return abs(count - trials * probability) <= sigmas * spread


# Topologies -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("num", [1, 2, 3, 4, 9, 64, 65, 130])
def test_degrees_and_diameters_follow_the_formulas(num: int) -> None:
    # Everybody hears all n - 1 others: one hop.
    complete = make_topology("complete", num)
    assert degrees(complete) == [num - 1] * num
    assert Network(complete).diameter() == min(1, num - 1)
    # A ring of n: two neighbours each, half way round is floor(n / 2) hops. Two agents share one link.
    ring = make_topology("ring", num)
    assert degrees(ring) == [min(2, num - 1)] * num
    assert Network(ring).diameter() == num // 2
    # A line of n: both ends have one neighbour, n - 1 hops apart.
    line = make_topology("line", num)
    assert sum(degrees(line)) == 2 * (num - 1)
    assert max(degrees(line)) <= 2
    assert Network(line).diameter() == num - 1
    # A star: the centre hears all, the others only the centre; leaf to leaf is two hops.
    star = make_topology("star", num)
    assert degrees(star) == [num - 1, *[1] * (num - 1)]
    assert Network(star).diameter() == min(2, num - 1)
    for topology in (complete, ring, line, star):
        assert is_symmetric(topology.links())
        assert Network(topology).components() == [list(range(num))]


@pytest.mark.parametrize("num", [1, 2, 3, 30])
@pytest.mark.parametrize("seed", range(5))
def test_tree_has_one_link_less_than_agents_and_is_connected(num: int, seed: int) -> None:
    tree = make_topology("tree", num, seed=seed)
    assert sum(degrees(tree)) == 2 * (num - 1)
    assert is_symmetric(tree.links())
    assert Network(tree).components() == [list(range(num))]


def test_trees_are_drawn_evenly() -> None:
    # Cayley: 4^2 = 16 trees on four agents. Four are stars (one per centre), twelve are lines.
    trees = Counter(tuple(make_topology("tree", 4, seed=seed).links()) for seed in range(1600))
    assert len(trees) == 16
    stars = sum(count for links, count in trees.items() if max(map(len, links)) == 3)
    assert within_sigmas(stars, 1600, 4 / 16)


@pytest.mark.parametrize(("num", "mean_degree"), [(20, 3.0), (20, 5.0), (100, 2.5), (100, 8.0), (400, 8.0)])
@pytest.mark.parametrize("seed", range(3))
def test_geometric_is_connected_with_the_mean_degree_asked(num: int, mean_degree: float, seed: int) -> None:
    topology = make_topology("geometric", num, mean_degree=mean_degree, seed=seed)
    assert is_symmetric(topology.links())
    assert Network(topology).components() == [list(range(num))]
    assert np.mean(degrees(topology)) == pytest.approx(mean_degree, rel=0.05)


def test_geometric_has_eight_neighbours_unless_there_are_fewer_agents() -> None:
    assert np.mean(degrees(make_topology("geometric", 200))) == pytest.approx(8.0, rel=0.05)
    assert degrees(make_topology("geometric", 4)) == [3, 3, 3, 3]
    assert degrees(make_topology("geometric", 1)) == [0]


def test_seeds_change_random_topologies_and_nothing_else_does() -> None:
    for name in ("tree", "geometric"):
        assert make_topology(name, 30, seed=1).links() == make_topology(name, 30, seed=1).links()
        assert make_topology(name, 30, seed=1).links() != make_topology(name, 30, seed=2).links()


def test_range_topology_follows_moving_agents() -> None:
    # Agent 1 flies away from agent 0 at 2 m/s along the way to agent 2, 10 m off; range 4 m:
    # at 0 s it hears 0; at 2 s exactly 4 m away, still; at 2.5 s (5 m from both) nobody; at 3 s 2 only.
    topology = RangeTopology(
        lambda now: np.array([[0.0, 0, 0], [2.0 * now, 0, 0], [10.0, 0, 0]]), communication_range=4.0
    )
    network = Network(topology)
    assert not topology.static
    assert network.links(0.0) == [(1,), (0,), ()]
    assert network.links(2.0) == [(1,), (0,), ()]
    assert network.links(2.5) == [(), (), ()]
    assert network.links(3.0) == [(), (2,), (1,)]
    assert network.deliveries(1, now=3.0) == [(4.0, (2,))]
    assert network.deliveries(1, now=2.5) == []
    assert network.components(3.0) == [[0], [1, 2]]
    assert network.diameter(3.0) == -1


def test_range_counts_height() -> None:
    # 3, 4 and 12 m apart in east, north and up: 13 m in all.
    positions = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 12.0]])
    assert RangeTopology(positions, communication_range=13.0).links() == [(1,), (0,)]
    assert RangeTopology(positions, communication_range=12.9).links() == [(), ()]


def test_range_can_be_asked_for_by_mean_degree() -> None:
    # A square of side 1: four sides of 1 m, two diagonals. Mean degree 2 needs the sides, 3 the diagonals.
    square = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    assert degrees(make_topology("range", 4, positions=square, mean_degree=2.0)) == [2, 2, 2, 2]
    assert degrees(make_topology("range", 4, positions=square, mean_degree=3.0)) == [3, 3, 3, 3]


def test_range_by_mean_degree_connects_even_those_far_away() -> None:
    # Three agents 1 m apart and one 50 m further: mean degree 2 (four links) is met only with 51 m.
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [52, 0, 0]])
    assert connecting_range(positions) == 50.0
    assert range_for_mean_degree(positions, 1.5) == 50.0
    assert range_for_mean_degree(positions, 2.5) == 51.0


@given(
    num=st.integers(1, 40),
    width=st.floats(1.0, 1e5),
    share=st.floats(1e-3, 2.0),
    seed=st.integers(0, 2**32),
)
def test_placed_agents_are_connected_and_inside(num: int, width: float, share: float, seed: int) -> None:
    positions = connected_positions(num, width, width * share, seed)
    assert positions.shape == (num, 3)
    assert ((positions >= 0.0) & (positions <= width)).all()
    assert connecting_range(positions) <= width * share
    assert len(Network(RangeTopology(positions, communication_range=width * share)).components()) == 1


def test_placing_by_mean_degree_gives_range_and_positions_that_fit() -> None:
    positions, communication_range = positions_with_mean_degree(300, 5000.0, 8.0, seed=3)
    topology = RangeTopology(positions, communication_range=communication_range)
    assert np.mean(degrees(topology)) == pytest.approx(8.0, rel=0.02)
    assert Network(topology).components() == [list(range(300))]
    # The positions alone are enough to find the range again.
    assert range_for_mean_degree(positions, 8.0) == communication_range


def test_agents_are_placed_in_order_of_row() -> None:
    mission = Mission(
        agents=(Agent(id="b", position=(2.0, 0.0, 0.0)), Agent(id="a", position=(1.0, 5.0, 6.0))), tasks=()
    )
    assert agent_positions(mission).tolist() == [[1.0, 5.0, 6.0], [2.0, 0.0, 0.0]]
    assert agent_positions(Mission(agents=(), tasks=())).shape == (0, 3)


@st.composite
def directed_links(draw: st.DrawFn) -> list[tuple[int, ...]]:
    num = draw(st.integers(1, 9))
    present = draw(st.lists(st.booleans(), min_size=num * num, max_size=num * num))
    return [tuple(k for k in range(num) if k != row and present[row * num + k]) for row in range(num)]


@given(directed_links())
def test_diameter_and_components_equal_a_naive_twin(links: list[tuple[int, ...]]) -> None:
    network = Network(FixedTopology(links))
    assert network.diameter() == naive_diameter(links)
    rows = range(len(links))
    reach = [{k for k in rows if k == i or _walk(links, i, k)} for i in rows]
    groups = {tuple(k for k in rows if k in reach[i] and i in reach[k]) for i in rows}
    assert network.components() == [list(group) for group in sorted(groups)]


def _walk(links: list[tuple[int, ...]], source: int, target: int) -> bool:
    reached = {source}
    for _ in links:
        reached |= {k for row in reached for k in links[row]}
    return target in reached


def test_diameter_of_many_agents_is_found_in_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    # 130 agents take three words each; a budget of one word makes every row a chunk of its own.
    monkeypatch.setattr("swarmbid.network.graph._WORDS_AT_ONCE", 1)
    assert Network(make_topology("ring", 130)).diameter() == 65
    assert Network(make_topology("complete", 130)).diameter() == 1


# Ideal deliveries -----------------------------------------------------------------------------------


def test_faultless_broadcast_reaches_all_neighbours_one_round_later() -> None:
    network = Network(make_topology("line", 4))
    assert network.deliveries(1, now=5.0) == [(6.0, (0, 2))]
    assert network.deliveries(3, now=5.25) == [(6.25, (2,))]
    assert network.last_lost == 0
    assert Network(make_topology("line", 4), latency=0.25).deliveries(0, now=1.0) == [(1.25, (1,))]


def test_nobody_in_reach_means_no_deliveries() -> None:
    for faults in ({}, {"loss": 0.5}, {"delay": 1.0}):
        assert Network(make_topology("ring", 1), **faults).deliveries(0, now=0.0) == []


def test_links_may_lead_one_way() -> None:
    network = Network(FixedTopology([(1,), (2,), (0,)]))
    assert network.deliveries(2, now=0.0) == [(1.0, (0,))]
    # Back to the agent before is all the way round: two hops.
    assert network.diameter() == 2


# Loss -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("loss", [0.1, 0.3, 0.9])
def test_loss_rate_is_the_one_asked(loss: float) -> None:
    network = Network(make_topology("complete", 21), loss=loss, seed=5)
    lost = 0
    for number in range(1000):
        groups = network.deliveries(number % 21, now=float(number))
        arrived = sum(len(receivers) for _, receivers in groups)
        assert arrived + network.last_lost == 20
        lost += network.last_lost
    assert within_sigmas(lost, 20_000, loss)


def test_loss_strikes_each_link_alike_and_alone() -> None:
    network = Network(make_topology("star", 4), loss=0.4, seed=1)
    arrived: Counter[int] = Counter()
    pairs = 0
    for number in range(5000):
        heard = [k for _, receivers in network.deliveries(0, now=float(number)) for k in receivers]
        arrived.update(heard)
        pairs += 1 in heard and 2 in heard
    assert all(within_sigmas(arrived[k], 5000, 0.6) for k in (1, 2, 3))
    # Independent: both hear it with 0.6 · 0.6.
    assert within_sigmas(pairs, 5000, 0.36)


def test_total_loss_and_no_loss_are_exact() -> None:
    deaf = Network(make_topology("complete", 5), loss=1.0)
    assert [deaf.deliveries(0, now=float(t)) for t in range(50)] == [[]] * 50
    assert deaf.last_lost == 4
    # A delay of 0 and a freeze in the far future: the slow way round, and still nothing lost.
    fine = Network(make_topology("complete", 5), loss=0.0, freeze=[(1e6, 1e6 + 1)])
    assert [fine.deliveries(0, now=float(t)) for t in range(50)] == [
        [(t + 1.0, (1, 2, 3, 4))] for t in range(50)
    ]


@pytest.mark.parametrize(("loss", "burst"), [(0.31, 5.0), (0.31, 20.0), (0.8, 4.0), (0.2, 1.0)])
def test_bursts_have_the_mean_loss_and_length_asked(loss: float, burst: float) -> None:
    network = Network(make_topology("star", 31), loss=loss, burst=burst, seed=2)
    fates = np.zeros((4000, 30), dtype=bool)
    for number in range(len(fates)):
        for _, receivers in network.deliveries(0, now=float(number)):
            fates[number, np.array(receivers) - 1] = True
    lost = ~fates
    # Each link's losses are correlated over r = 1 - 1/burst - turns_bad messages, which widens the spread
    # of the mean by sqrt((1 + r) / (1 - r)).
    trials = lost.size
    correlation = 1.0 - 1.0 / burst - loss / ((1.0 - loss) * burst)
    sigma = math.sqrt(loss * (1.0 - loss) / trials * (1.0 + correlation) / (1.0 - correlation))
    assert abs(lost.mean() - loss) <= 4.0 * sigma
    # Runs of losses that begin and end inside the record: geometric with mean `burst`.
    runs: list[int] = []
    for link in lost.T:
        edges = np.flatnonzero(np.diff(link.astype(int)))
        ends = edges[np.flatnonzero(link[edges])]
        starts = edges[np.flatnonzero(~link[edges])]
        ends = ends[np.searchsorted(ends, starts[0]) :]
        runs += (ends - starts[: len(ends)]).tolist()
    spread = burst * math.sqrt(1.0 - 1.0 / burst) / math.sqrt(len(runs))
    assert abs(np.mean(runs) - burst) <= 4.0 * spread + 1e-12


def test_links_begin_as_bad_as_they_go_on() -> None:
    # The very first message on each link is lost with the mean probability, even with long bursts.
    lost = 0
    for seed in range(100):
        network = Network(make_topology("star", 41), loss=0.3, burst=100.0, seed=seed)
        network.deliveries(0, now=0.0)
        lost += network.last_lost
    assert within_sigmas(lost, 4000, 0.3)


# Delay, duplicates, replays, freezes ----------------------------------------------------------------


def test_delay_has_the_mean_asked_and_lets_messages_overtake() -> None:
    network = Network(make_topology("line", 2), delay=3.0, latency=0.5, seed=4)
    arrivals = [network.deliveries(0, now=0.5 * number)[0][0] for number in range(4000)]
    waits = np.array(arrivals) - 0.5 * np.arange(4000)
    assert waits.min() > 0.5
    # One round of 0.5 s, and 3 more on average; the spread of an exponential is its mean.
    assert abs(waits.mean() - 2.0) <= 4.0 * 1.5 / math.sqrt(4000)
    assert (np.diff(arrivals) < 0.0).any()
    # Nothing is lost, however late.
    assert network.last_lost == 0


def test_delayed_copies_come_one_by_one_in_order_of_arrival() -> None:
    network = Network(make_topology("complete", 8), delay=2.0, seed=4)
    groups = network.deliveries(0, now=10.0)
    assert [len(receivers) for _, receivers in groups] == [1] * 7
    assert groups == sorted(groups)
    assert {k for _, receivers in groups for k in receivers} == set(range(1, 8))
    assert len({arrival for arrival, _ in groups}) == 7


def test_duplicates_arrive_twice() -> None:
    network = Network(make_topology("complete", 4), duplicate=1.0)
    assert network.deliveries(2, now=0.0) == [(1.0, (0, 1, 3)), (1.0, (0, 1, 3))]
    network = Network(make_topology("complete", 11), duplicate=0.2, seed=9)
    copies = sum(
        len(receivers) for number in range(1000) for _, receivers in network.deliveries(0, now=float(number))
    )
    assert within_sigmas(copies - 10_000, 10_000, 0.2)


def test_lost_copies_are_not_duplicated() -> None:
    network = Network(make_topology("complete", 11), loss=0.5, duplicate=1.0, seed=9)
    for number in range(100):
        heard = Counter(k for _, receivers in network.deliveries(0, now=float(number)) for k in receivers)
        assert set(heard.values()) == {2}
        assert len(heard) == 10 - network.last_lost


def test_replays_come_back_long_after() -> None:
    network = Network(make_topology("line", 2), replay=1.0, seed=3)
    waits = []
    for _ in range(2000):
        (first, _), (second, receivers) = network.deliveries(0, now=0.0)
        assert first == 1.0
        assert receivers == (1,)
        waits.append(second - first)
    # 10 rounds on average, exponential.
    assert abs(np.mean(waits) - 10.0) <= 4.0 * 10.0 / math.sqrt(2000)


def test_freeze_delivers_everything_at_its_end() -> None:
    network = Network(make_topology("line", 2), freeze=[(10.0, 40.0), (50.0, 51.0)])
    arrivals = {sent: network.deliveries(0, now=sent)[0][0] for sent in (8.5, 9.0, 20.0, 39.0, 39.1, 49.5)}
    assert arrivals == {8.5: 9.5, 9.0: 40.0, 20.0: 40.0, 39.0: 40.0, 39.1: 40.1, 49.5: 51.0}


# Partitions and cuts --------------------------------------------------------------------------------


def test_partition_cuts_exactly_and_heals() -> None:
    network = Network(make_topology("ring", 6), partitions=[Partition(groups=[(0, 1, 2)], start=10, end=60)])
    whole = [list(range(6))]
    halves = [[0, 1, 2], [3, 4, 5]]
    assert [network.components(now) for now in (0.0, 9.9, 10.0, 59.9, 60.0)] == [
        whole,
        whole,
        halves,
        halves,
        whole,
    ]
    assert [network.diameter(now) for now in (0.0, 10.0, 60.0)] == [3, -1, 3]
    assert network.deliveries(0, now=9.9) == [(10.9, (1, 5))]
    assert network.deliveries(0, now=10.0) == [(11.0, (1,))]
    # A cut link has no copy to lose.
    assert network.last_lost == 0
    assert network.deliveries(0, now=60.0) == [(61.0, (1, 5))]


def test_partition_of_three_groups_and_the_rest() -> None:
    network = Network(make_topology("complete", 7), partitions=[Partition(groups=[(0, 1), (2,), (5, 3)])])
    assert network.components(0.0) == [[0, 1], [2], [3, 5], [4, 6]]


def test_one_way_partition_lets_news_out_only() -> None:
    network = Network(make_topology("complete", 4), partitions=[Partition(groups=[(0, 1)], one_way=True)])
    assert network.links(0.0) == [(1, 2, 3), (0, 2, 3), (3,), (2,)]
    assert network.diameter() == -1


def test_cut_stops_one_direction() -> None:
    network = Network(make_topology("ring", 4), cuts=[Cut(links=[(0, 1)], start=2.0, end=3.0)])
    assert network.neighbours(0, 2.0) == (3,)
    assert network.neighbours(1, 2.0) == (0, 2)
    # From 0 to 1 the news now goes the other way round.
    assert (network.diameter(2.0), network.diameter(3.0)) == (3, 2)


def test_overlapping_barriers_add_up() -> None:
    network = Network(
        make_topology("complete", 4),
        partitions=[Partition(groups=[(0, 1)], start=0, end=10), Partition(groups=[(0, 2)], start=5, end=15)],
    )
    # Asked twice: the second time from what is kept.
    for _ in range(2):
        assert [network.neighbours(0, now) for now in (0.0, 5.0, 10.0, 15.0)] == [(1,), (), (2,), (1, 2, 3)]


def test_partition_cuts_moving_agents_too() -> None:
    # Agent 1 leaves the range of 0 after 3 s, agent 2 never; 0 and 3 are apart from 1 and 2 until 5 s.
    topology = RangeTopology(
        lambda now: np.array([[0.0, 0, 0], [now, 0, 0], [0, 1, 0], [0, now, 0]]), communication_range=3.0
    )
    network = Network(topology, partitions=[Partition(groups=[(0, 3)], start=1, end=5)])
    assert [network.neighbours(0, now) for now in (0.0, 1.0, 3.0, 4.0, 5.0)] == [
        (1, 2, 3),
        (3,),
        (3,),
        (),
        (2,),
    ]
    # Agents that move may miss messages.


def test_final_components_count_only_what_stays_cut() -> None:
    passing = Partition(groups=[(0, 1, 2)], start=0, end=60)
    endless = Partition(groups=[(0,)], start=20)
    network = Network(make_topology("complete", 6), partitions=[passing, endless])
    # Three against three passes; agent 0 against the rest, from 20 s on, does not.
    assert [len(network.components(now)) for now in (0.0, 20.0, 60.0)] == [2, 3, 2]
    assert [network.final_components(now) for now in (0.0, 20.0, 60.0, 0.0)] == [1, 2, 2, 1]
    # A link that is deaf one way for ever breaks a line in two.
    deaf = Network(make_topology("line", 4), cuts=[Cut(links=[(1, 2)])])
    assert deaf.final_components(0.0) == 2
    assert Network(FixedTopology([(1,), (0,), ()])).final_components(0.0) == 2
    assert Network(make_topology("ring", 5), loss=1.0).final_components(0.0) == 5
    assert Network(make_topology("ring", 5), loss=0.9).final_components(0.0) == 1
    # Agents that move may meet again, however far apart they are now.
    far = np.array([[0.0, 0, 0], [100, 0, 0]])
    assert Network(RangeTopology(lambda now: far, communication_range=1.0)).final_components(0.0) == 1
    assert Network(RangeTopology(far, communication_range=1.0)).final_components(0.0) == 2


# Same seed, same fate -------------------------------------------------------------------------------

EVERY_FAULT = {"loss": 0.3, "burst": 4.0, "delay": 1.5, "duplicate": 0.2, "replay": 0.1}


def record(seed: int, senders: list[int], **faults: float) -> list[list[tuple[float, tuple[int, ...]]]]:
    network = Network(make_topology("geometric", 30, mean_degree=5.0, seed=1), seed=seed, **faults)
    return [network.deliveries(sender, now=float(number)) for number, sender in enumerate(senders)]


def test_same_seed_means_same_deliveries() -> None:
    senders = [number % 30 for number in range(300)]
    assert record(7, senders, **EVERY_FAULT) == record(7, senders, **EVERY_FAULT)
    assert record(7, senders, **EVERY_FAULT) != record(8, senders, **EVERY_FAULT)


def test_a_senders_fate_does_not_depend_on_who_else_sends() -> None:
    alone = record(7, [3] * 20, **EVERY_FAULT)
    # Everybody else speaks between two broadcasts of agent 3; subtract the time to compare.
    crowd = record(7, [row for _ in range(20) for row in (3, *range(4, 30))], **EVERY_FAULT)[::27]
    fates = [
        [
            [(round(arrival - now * step, 9), near) for arrival, near in groups]
            for now, groups in enumerate(run)
        ]
        for run, step in ((alone, 1), (crowd, 27))
    ]
    assert fates[0] == fates[1]


def test_switching_on_a_fault_leaves_the_others_draws_alone() -> None:
    senders = [number % 30 for number in range(200)]
    plain = record(7, senders, loss=0.3)
    late = record(7, senders, loss=0.3, delay=1.0)
    heard = [[sorted(k for _, near in groups for k in near) for groups in run] for run in (plain, late)]
    assert heard[0] == heard[1]
    # Replays come after all else here, as nothing is delayed: the rest is as it was.
    twice = record(7, senders, duplicate=0.3)
    again = record(7, senders, duplicate=0.3, replay=0.3)
    prompt = [[group for group in run if group[0] == now + 1.0] for now, run in enumerate(again)]
    assert prompt == twice
    assert again != twice


def test_senders_and_faults_draw_from_different_streams() -> None:
    streams = [SenderStreams(7, 2, kind)[row] for kind in ("loss", "delay") for row in (0, 1)]
    assert len({rng.random() for rng in streams}) == 4
    both = Network(make_topology("complete", 40), duplicate=0.5, replay=0.5)
    arrivals = both.deliveries(0, now=0.0)
    twice = set(arrivals[1][1])
    again = {k for arrival, near in arrivals for k in near if arrival > 1.0}
    assert twice
    assert again
    assert twice != again


def test_hash_seed_changes_nothing() -> None:
    program = (
        "from swarmbid.network import Network, make_topology\n"
        "net = Network(make_topology('geometric', 25, seed=3), seed=3, loss=.3, delay=1., duplicate=.2)\n"
        "print([net.deliveries(row, 1.0) for row in range(25)])"
    )
    outputs = {
        subprocess.run(
            [sys.executable, "-c", program],
            env=os.environ | {"PYTHONHASHSEED": salt},
            capture_output=True,
            check=True,
        ).stdout
        for salt in ("0", "123")
    }
    assert len(outputs) == 1
    assert b"(" in outputs.pop()


# What it says of itself, and what it refuses --------------------------------------------------------


def test_description_is_complete_json() -> None:
    network = Network(
        make_topology("geometric", 5, mean_degree=3.0, seed=2),
        seed=7,
        loss=0.3,
        burst=5.0,
        partitions=[Partition(groups=[(0, 1)], start=3.0)],
        cuts=[Cut(links=[(2, 1)], end=4.0)],
        freeze=[(1.0, 2.0)],
    )
    described = json.loads(json.dumps(network.describe(), allow_nan=False))
    assert described == {
        "topology": {"name": "geometric", "num_agents": 5, "mean_degree": 3.0, "seed": 2},
        "seed": 7,
        "latency": 1.0,
        "loss": 0.3,
        "burst": 5.0,
        "delay": 0.0,
        "duplicate": 0.0,
        "replay": 0.0,
        "partitions": [{"groups": [[0, 1]], "start": 3.0, "end": None, "one_way": False}],
        "cuts": [{"links": [[2, 1]], "start": 0.0, "end": 4.0}],
        "freeze": [[1.0, 2.0]],
    }
    still = RangeTopology(np.zeros((2, 3)), communication_range=5.0)
    assert still.describe() == {"name": "range", "num_agents": 2, "communication_range": 5.0, "moving": False}


@pytest.mark.parametrize(
    ("faults", "said"),
    [
        ({"loss": 1.5}, "loss: is 1.5. Give a probability from 0 to 1"),
        ({"loss": math.nan}, "loss: is nan"),
        ({"duplicate": -0.1}, "duplicate: is -0.1"),
        ({"replay": 2.0}, "replay: is 2.0"),
        ({"delay": -1.0}, "delay: is -1.0 rounds. Give 0 or more"),
        ({"delay": math.inf}, "delay: is inf"),
        ({"latency": 0.0}, "latency: is 0.0 s. Give more than 0 s"),
        ({"seed": -1}, "seed: is -1"),
        ({"burst": 5.0}, "burst: is 5.0 with a loss of 0.0. Give a loss between 0 and 1"),
        # At a loss of 0.9 even a link that turns bad at once needs bursts of 0.9 / 0.1 = 9 messages.
        ({"loss": 0.9, "burst": 8.0}, "burst: is 8.0 messages. Give 9 or more for a loss of 0.9"),
        ({"loss": 0.1, "burst": 0.5}, "burst: is 0.5 messages. Give 1 or more"),
        ({"partitions": [Partition(groups=[(0, 3)])]}, "partitions[0]: names row 3. Name rows from 0 to 2"),
        ({"cuts": [Cut(links=[(0, -1)])]}, "cuts[0]: names row -1"),
        ({"freeze": [(5.0, 4.0)]}, "freeze: has 5.0 s to 4.0 s"),
        ({"freeze": [(0.0, 3.0), (2.0, 4.0)]}, "freeze: has 2.0 s to 4.0 s"),
        ({"freeze": [(0.0, math.inf)]}, "freeze: has 0.0 s to inf s"),
    ],
)
def test_impossible_faults_are_refused_with_the_mend(faults: dict, said: str) -> None:
    with pytest.raises(InputError) as caught:
        Network(make_topology("line", 3), **faults)
    assert said in str(caught.value)


def test_all_impossible_faults_are_reported_together() -> None:
    with pytest.raises(InputError) as caught:
        Network(make_topology("line", 3), loss=2.0, delay=-1.0)
    assert [found.field for found in caught.value.faults] == ["loss", "delay"]


def test_impossible_partitions_and_cuts_are_refused() -> None:
    for make in (
        lambda: Partition(groups=[(0, 1), (1, 2)]),
        lambda: Partition(groups=[(0,)], start=5.0, end=5.0),
        lambda: Cut(links=[(0, 1)], start=-1.0),
    ):
        with pytest.raises(InputError):
            make()


@pytest.mark.parametrize(
    ("name", "num", "options", "said"),
    [
        ("mesh", 5, {}, "topology: is 'mesh'. Use one of complete, ring, line, star, tree, geometric, range"),
        ("ring", 0, {}, "num_agents: is 0. Give 1 or more"),
        ("ring", 5, {"mean_degree": 3.0}, "mean_degree: means nothing to 'ring'"),
        ("geometric", 5, {"communication_range": 3.0}, "communication_range: means nothing to 'geometric'"),
        ("geometric", 5, {"mean_degree": 5.0}, "mean_degree: is 5.0. Give 1.6 to 4"),
        ("geometric", 5, {"mean_degree": 1.5}, "mean_degree: is 1.5. Give 1.6 to 4"),
        ("geometric", 5, {"mean_degree": math.nan}, "mean_degree: is nan"),
        ("range", 5, {"communication_range": 3.0}, "positions: is missing"),
        ("range", 5, {"positions": np.zeros((4, 3)), "communication_range": 3.0}, "positions: has 4 rows"),
        ("range", 4, {"positions": np.zeros((4, 2)), "communication_range": 3.0}, "has shape (4, 2)"),
        ("range", 1, {"positions": np.full((1, 3), np.nan), "communication_range": 3.0}, "not finite"),
        ("range", 4, {"positions": np.zeros((4, 3))}, "Give either communication_range or mean_degree"),
        (
            "range",
            4,
            {"positions": np.zeros((4, 3)), "communication_range": 1.0, "mean_degree": 2.0},
            "communication_range: comes with a mean_degree",
        ),
        ("range", 4, {"positions": np.zeros((4, 3)), "communication_range": 0.0}, "range of more than 0 m"),
    ],
)
def test_impossible_topologies_are_refused_with_the_mend(
    name: str, num: int, options: dict, said: str
) -> None:
    with pytest.raises(InputError) as caught:
        make_topology(name, num, **options)
    assert said in str(caught.value)


@pytest.mark.parametrize("links", [[(1,), (2,)], [(0,), (0,)], [(1, 1), (0,)]])
def test_impossible_links_are_refused(links: list[tuple[int, ...]]) -> None:
    with pytest.raises(InputError, match="links"):
        FixedTopology(links)


@pytest.mark.parametrize(
    ("num", "width", "communication_range"),
    [(0, 1.0, 1.0), (3, 0.0, 1.0), (3, math.nan, 1.0), (3, 1.0, 0.0), (3, 1.0, math.inf)],
)
def test_impossible_squares_are_refused(num: int, width: float, communication_range: float) -> None:
    with pytest.raises(InputError):
        connected_positions(num, width, communication_range, seed=0)
