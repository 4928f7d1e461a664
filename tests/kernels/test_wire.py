"""The columns of a message, and its size without encoding it."""

from __future__ import annotations

import numpy as np
import pytest

from generators import random_mission
from swarmbid.arrays import NO_AGENT, MissionArrays
from swarmbid.kernels import wire
from swarmbid.kernels.consensus import NOT_LISTED, TO_SEND, TO_WEIGH
from swarmbid.messages import Beliefs, decode, encode
from swarmbid.messages.beliefs import encoded_size
from swarmbid.simulator import counts_of


def beliefs() -> tuple[np.ndarray, ...]:
    """Five tasks: won by agents 1, nobody, 2, 1, 0; tasks 1 and 2 are to be sent."""
    winner = np.array([1, NO_AGENT, 2, 1, 0], np.int32)
    bid = np.array([5.0, 0.0, 7.0, 3.0, 9.0])
    flags = np.array([0, TO_SEND, TO_SEND | TO_WEIGH, 0, 0], np.uint8)
    heard, told = np.array([4, 6, 8]), np.array([4, 5, 8])
    return winner, bid, flags, heard, told


def test_a_change_lists_what_is_flagged_with_new_stamps_and_those_of_its_winners():
    """Agent 0's stamp is old and nobody's claim needs it; agent 2's is old too, but task 2 is its."""
    winner, bid, flags, heard, told = beliefs()
    tasks, winners, bids, stamps = wire.compose(False, winner, bid, flags, heard, told)
    assert tasks.tolist() == [1, 2]
    assert winners.tolist() == [NO_AGENT, 2]
    assert bids.tolist() == [0.0, 7.0]
    assert stamps.tolist() == [NOT_LISTED, 6, 8]
    assert flags.tolist() == [0, 0, TO_WEIGH, 0, 0]
    assert told.tolist() == [4, 6, 8]


def test_a_full_state_lists_every_winner_and_every_stamp():
    winner, bid, flags, heard, told = beliefs()
    tasks, winners, _, stamps = wire.compose(True, winner, bid, flags, heard, told)
    assert tasks.tolist() == [0, 2, 3, 4]
    assert winners.tolist() == [1, 2, 1, 0]
    assert stamps.tolist() == [4, 6, 8]
    assert not (flags & TO_SEND).any()


@pytest.mark.parametrize("seed", range(40))
def test_the_size_counted_is_the_size_encoded_and_nothing_is_lost_on_the_way(seed: int):
    rng = np.random.default_rng(seed)
    arrays = MissionArrays(random_mission(seed))
    num_agents, num_tasks = arrays.num_agents, arrays.num_tasks
    listed = int(rng.integers(0, num_tasks + 1))
    heard = np.full(num_agents, NOT_LISTED, np.int64)
    stamped = rng.random(num_agents) < rng.random()
    heard[stamped] = rng.integers(0, [9, 300, 1 << 40][seed % 3], int(stamped.sum()))
    winners = rng.integers(NO_AGENT, num_agents, listed).astype(np.int32)
    some = np.flatnonzero(rng.random(num_agents) < 0.3).astype(np.int32)
    sequence = int(rng.integers(1, 1 << 40))
    message = Beliefs(
        sender=arrays.agent_ids[0],
        sequence=sequence,
        since=sequence // 2,
        agent_ids=arrays.agent_ids,
        task_ids=arrays.task_ids,
        heard=heard,
        tasks=rng.choice(num_tasks, listed, replace=False).astype(np.int32),
        winners=winners,
        bids=np.where(winners == NO_AGENT, 0.0, rng.random(listed) + 0.1),
        digest=int(rng.integers(0, 1 << 63)),
        digest_at=sequence // 3,
        agreed=some,
        agreed_at=rng.integers(0, 1 << 33, some.size),
        asked=some[:2],
        left=some[:1],
        left_at=rng.integers(0, 9, some[:1].size),
        settled=bool(seed % 2),
    )
    data = encode(message)
    assert len(data) == encoded_size(message, counts_of(message, arrays))
    copy = decode(data)
    assert encode(copy) == data
    named = [copy.task_ids[row] for row in copy.tasks.tolist()]
    assert named == [arrays.task_ids[row] for row in message.tasks.tolist()]
    assert copy.bids.tolist() == message.bids.tolist()
