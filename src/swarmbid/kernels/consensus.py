"""Phase 2: one message against one agent's beliefs, and what the agent's new bundle changes in them.

The rules themselves are data (`swarmbid.algorithms.cbba.DECISION_RULES`), packed to a table
``int8[sender believes, receiver believes, facts]`` of actions; the names below are its axes.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from swarmbid.arrays import NO_AGENT
from swarmbid.kernels.bundle import BID, BUNDLE, outbids

# What the sender believes about a task's winner, and what the receiver believes.
SENDER, RECEIVER, OTHER, NOBODY, SAME = 0, 1, 2, 3, 4  # SAME: a third agent, the sender's own belief
# Facts, as bits.
BETTER = 1  # the sender's bid outbids the receiver's
NEWER_THEIRS = 2  # the sender has newer news of the agent that the sender believes in
NEWER_MINE = 4  # the sender has newer news of the agent that the receiver believes in
OLDER_THEIRS = 8  # the receiver has newer news of the agent that the sender believes in
NUM_FACTS = 16
# Actions.
LEAVE, UPDATE, RESET = 0, 1, 2

# Flags of a task in the beliefs.
TO_SEND = 1  # changed, or in dispute, since it was last sent
TO_WEIGH = 2  # its bid to beat changed since the bundle was built
NOT_LISTED = -1
"""Stamp of an agent that a message says nothing about."""

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)


@njit(cache=True)
def _scramble(x):
    """The finaliser of SplitMix64: every input bit moves every output bit."""
    x = (x ^ (x >> np.uint64(30))) * _MIX_1
    x = (x ^ (x >> np.uint64(27))) * _MIX_2
    return x ^ (x >> np.uint64(31))


@njit(cache=True)
def belief_hash(task_hash, winner_hash, bid_bits):
    """Hash of one belief: this agent wins this task with this bid."""
    return _scramble(task_hash + _scramble(winner_hash + _GOLDEN * bid_bits))


@njit(cache=True)
def digest_of(task_hash, agent_hash, winner, bid_bits):
    """Sum of the hashes of all beliefs: the same set of beliefs gives the same digest."""
    total = np.uint64(0)
    for j in range(task_hash.shape[0]):
        w = winner[j]
        h = agent_hash[w] if w != NO_AGENT else np.uint64(0)
        total += belief_hash(task_hash[j], h, bid_bits[j])
    return total


@njit(cache=True)
def digest_of_stamps(agent_hash, task_hash, stamps, present, bars, context):
    """Hash of whose record is how new, of who must not bid on what, and of the roster and the tasks.

    Parameters
    ----------
    stamps : int64[num_agents]. present : bool[num_agents], whose records count.
    bars : int64[n, 2], rows of agents and tasks. context : uint64, hash of the roster and the tasks.
    """
    total = context
    for m in range(stamps.shape[0]):
        if present[m]:
            total += belief_hash(agent_hash[m], np.uint64(0), np.uint64(stamps[m]))
    for k in range(bars.shape[0]):
        total += belief_hash(task_hash[bars[k, 1]], agent_hash[bars[k, 0]], np.uint64(1))
    return total


@njit(cache=True)
def believe(j, new_winner, new_bid, winner, bid, bid_bits, task_hash, agent_hash, digest):
    """Set one belief and keep the digest in step."""
    old = agent_hash[winner[j]] if winner[j] != NO_AGENT else np.uint64(0)
    digest[0] -= belief_hash(task_hash[j], old, bid_bits[j])
    winner[j] = new_winner
    bid[j] = new_bid
    new = agent_hash[new_winner] if new_winner != NO_AGENT else np.uint64(0)
    digest[0] += belief_hash(task_hash[j], new, bid_bits[j])


@njit(cache=True, inline="always")
def decide(rules, me, sender, their_winner, their_bid, my_winner, my_bid, their_heard, my_heard):
    """Return the action for one task.

    Parameters
    ----------
    their_heard, my_heard : int64[num_agents], stamps s_k and s_i.
    """
    says, thinks, facts = NOBODY, NOBODY, 0
    # Sums of conditions, not branches: which of them hold is hard to predict.
    if their_winner != NO_AGENT:
        says = SENDER if their_winner == sender else RECEIVER if their_winner == me else OTHER
        theirs, mine = their_heard[their_winner], my_heard[their_winner]
        facts += BETTER * outbids(their_bid, their_winner, my_bid, my_winner)
        facts += NEWER_THEIRS * (theirs > mine)
        facts += OLDER_THEIRS * ((theirs < mine) & (theirs != NOT_LISTED))
    if my_winner != NO_AGENT:
        thinks = OTHER
        if my_winner == me:
            thinks = RECEIVER
        elif my_winner == sender:
            thinks = SENDER
        elif my_winner == their_winner:
            thinks = SAME
        facts += NEWER_MINE * (their_heard[my_winner] > my_heard[my_winner])
    return rules[says, thinks, facts]


@njit(cache=True)
def resolve(
    rules, me, sender, full, winner, bid, bid_bits, heard, flags, task_hash, agent_hash, digest,
    rows, their_winners, their_bids, their_heard,
):  # fmt: skip
    """Apply one message to the beliefs: every listed task by the table, then the stamps.

    Stamps are raised after the rows are applied; before, "newer" would never be true. A task on which
    the two still differ afterwards is flagged to be sent again: the sender has to hear it.

    Parameters
    ----------
    rules : int8[5, 5, NUM_FACTS]. me, sender : agent rows.
    full : whether tasks that are not listed have no winner for the sender (else they are unchanged).
    winner, bid : int32, float64[num_tasks], beliefs (z_i, y_i), in and out. bid_bits : bid as uint64.
    heard : int64[num_agents], stamps (s_i), in and out.
    flags : uint8[num_tasks], in and out. digest : uint64[1], in and out.
    rows, their_winners, their_bids : int32[n], int32[n], float64[n], what the message lists.
    their_heard : int64[num_agents], the sender's stamps, NOT_LISTED where it says none.

    Returns
    -------
    Number of beliefs that changed.
    """
    # Half of a message is old news. To gather the rest first, without a branch, spares the processor
    # as many wrong guesses; of one mind, no row of any table changes anything.
    differ = np.empty(rows.shape[0] + 1, np.int64)
    count = 0
    for i in range(rows.shape[0]):
        j = rows[i]
        differ[count] = i
        count += (winner[j] != their_winners[i]) | (bid[j] != their_bids[i])
    changes = 0
    for k in range(count):
        i = differ[k]
        j = rows[i]
        action = decide(
            rules, me, sender, their_winners[i], their_bids[i], winner[j], bid[j], their_heard, heard
        )
        # The two differ, or did: the sender has to hear of it.
        flags[j] |= TO_SEND
        if action == LEAVE:
            continue
        flags[j] |= TO_WEIGH
        changes += 1
        if action == UPDATE:
            believe(j, their_winners[i], their_bids[i], winner, bid, bid_bits, task_hash, agent_hash, digest)
        else:
            believe(j, NO_AGENT, 0.0, winner, bid, bid_bits, task_hash, agent_hash, digest)
    if full:
        listed = np.zeros(winner.shape[0], np.bool_)
        for i in range(rows.shape[0]):
            listed[rows[i]] = True
        for j in range(winner.shape[0]):
            if listed[j] or winner[j] == NO_AGENT:
                continue
            action = decide(rules, me, sender, NO_AGENT, 0.0, winner[j], bid[j], their_heard, heard)
            if action != LEAVE:
                believe(j, NO_AGENT, 0.0, winner, bid, bid_bits, task_hash, agent_hash, digest)
                flags[j] |= TO_SEND | TO_WEIGH
                changes += 1
            else:
                flags[j] |= TO_SEND
    own = heard[me]
    for m in range(heard.shape[0]):
        heard[m] = max(heard[m], their_heard[m])
    heard[me] = own
    return changes


@njit(cache=True)
def any_flags(flags):
    """All flags of all tasks, joined."""
    joined = np.uint8(0)
    for j in range(flags.shape[0]):
        joined |= flags[j]
    return joined


@njit(cache=True)
def take_flagged(flags, flag):
    """Return the rows that carry `flag`, and take it off them. Eight rows without any cost one look."""
    num_tasks = flags.shape[0]
    words = flags[: num_tasks // 8 * 8].view(np.uint64)
    count = 0
    for j in range(num_tasks):
        count += (flags[j] & flag) != 0
    rows = np.empty(count, np.int32)
    count = 0
    for first in range(0, num_tasks, 8):
        if first // 8 < words.shape[0] and words[first // 8] == np.uint64(0):
            continue
        for j in range(first, min(first + 8, num_tasks)):
            if flags[j] & flag:
                rows[count] = j
                count += 1
                flags[j] &= 255 - flag
    return rows


@njit(cache=True)
def claim(me, before, order, marks, length, winner, bid, bid_bits, flags, task_hash, agent_hash, digest):
    """Make the beliefs agree with the agent's new bundle.

    What it held and does not take again has no winner now; what it takes is its own at its bid.

    Parameters
    ----------
    before : int64[n], the old bundle; order, marks, length : the new one (`swarmbid.kernels.bundle`).

    Returns
    -------
    Number of beliefs that changed.
    """
    changes = 0
    for i in range(before.shape[0]):
        j = before[i]
        if winner[j] != me:
            continue
        held = False
        for k in range(length):
            if order[BUNDLE, k] == j:
                held = True
        if not held:
            believe(j, NO_AGENT, 0.0, winner, bid, bid_bits, task_hash, agent_hash, digest)
            flags[j] |= TO_SEND
            changes += 1
    for k in range(length):
        j = order[BUNDLE, k]
        if winner[j] != me or bid[j] != marks[BID, k]:
            believe(j, me, marks[BID, k], winner, bid, bid_bits, task_hash, agent_hash, digest)
            flags[j] |= TO_SEND
            changes += 1
    return changes
