"""Whose record is known how new, who lacks it, and what is said of it: the gossip of CBGA.

A record is written by its owner alone and relayed unchanged; the newer stamp counts. So messages need no
order, and nothing that is lost, late, doubled or overtaken does harm. What a neighbour lacks shows in the
stamps that it tells of: it is sent again. A record that came from an agent whose neighbours include all
of one's own need not be relayed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from swarmbid.algorithms._agreement import Agreement
from swarmbid.algorithms._voice import NO_ROWS, NO_STAMPS, Voice
from swarmbid.arrays import MissionArrays, StampArray
from swarmbid.messages import NOT_LISTED, MessageError, Records
from swarmbid.messages.records import Record

Bar = tuple[int, int]
"""(agent row, task row): who must not bid on what."""


class RecordsVoice(Voice):
    """Keeps track of what the neighbours know, and makes messages of what they lack.

    Attributes
    ----------
    stamps : int64[num_agents], of the newest record known of each agent, 0 for none.
    owed : bool[num_agents], whose record some neighbour seems to lack.
    bars_owed : whether some neighbour may lack a bar.
    """

    def __init__(self, agent_id: str, arrays: MissionArrays, me: int, *, incarnation: int) -> None:
        super().__init__(agent_id, incarnation=incarnation)
        self.me = me
        self.stamps: StampArray = np.zeros(arrays.num_agents, np.int64)
        self.owed: NDArray[np.bool_] = np.zeros(arrays.num_agents, np.bool_)
        self.bars_owed = False
        self._near: NDArray[np.bool_] = np.zeros(arrays.num_agents, np.bool_)
        self._near_of: dict[int, NDArray[np.bool_]] = {}
        self._tell_known = False
        self._told_near = 0

    def has_news(self, digest: int) -> bool:
        """Whether something is wanted or untold."""
        return bool(self.owed.any()) or self.bars_owed or self._tell_known or super().has_news(digest)

    def hear(self, sender: int, message: Records) -> list[int]:
        """Note who knows what; return the places of records in the message that are news."""
        self._near[sender] = True
        news = []
        newest = self.stamps
        if message.full:
            newest = self.stamps.copy()
        for place, owner in enumerate(message.owners.tolist()):
            stamp, mine = message.records[place].stamp, self.stamps[owner]
            if stamp > mine:
                news.append(place)
                newest[owner] = stamp if message.full else mine
            elif stamp < mine:
                self.owed[owner] = True
        if message.full:
            near = np.zeros(self._near.size, np.bool_)
            near[message.near] = True
            near[sender] = True
            self._near_of[sender] = near
            self.owed |= message.known < self.stamps
            # Whoever is behind says so, and is told.
            self._tell_known |= bool((message.known > newest).any())
        return news

    def learn(self, sender: int, owner: int, stamp: int) -> None:
        """Note a newer record, to be relayed unless all neighbours have it from the same sender."""
        self.stamps[owner] = stamp
        others = self._near.copy()
        others[owner] = others[sender] = False
        heard = self._near_of.get(sender)
        if heard is not None:
            others &= ~heard
        self.owed[owner] |= bool(others.any())

    def say(
        self,
        now: float,
        arrays: MissionArrays,
        records: list[Record],
        agreement: Agreement,
        left: dict[int, int],
        bars: set[Bar],
        *,
        context: int,
        digest: int,
        settled: bool,
        heartbeat: bool,
    ) -> Records:
        """Return the next message: what some neighbour lacks, or else how new one's own knowledge is.

        Parameters
        ----------
        left : rows of agents that are gone, with the last stamp that this covers.
        bars : who must not bid on what; context : hash of what they are for.
        settled : whether all agree. heartbeat : whether it is time to say everything anyway.
        """
        owners = np.flatnonzero(self.owed & (self.stamps > 0))
        near = int(np.count_nonzero(self._near))
        status = (
            heartbeat or self.full_for > 0 or self._tell_known or near != self._told_near or not owners.size
        )
        stamp, digest_at = self.next_stamp(now, digest)
        self.owed[:] = False
        self._tell_known = False
        if status:
            self._told_near = near
        tell_bars = sorted(bars) if status or self.bars_owed else []
        self.bars_owed = False
        holders, held_at = agreement.tell(digest, everything=status)
        return Records(
            sender=self.agent_id,
            sequence=stamp,
            agent_ids=arrays.agent_ids,
            task_ids=arrays.task_ids,
            owners=owners.astype(np.int32),
            records=tuple(records[row] for row in owners.tolist()),
            known=self.stamps.copy() if status else NO_STAMPS,
            near=np.flatnonzero(self._near).astype(np.int32) if status else NO_ROWS,
            barred_tasks=np.array([task for _, task in tell_bars], np.int32),
            barred_agents=np.array([agent for agent, _ in tell_bars], np.int32),
            context=context,
            digest=digest,
            digest_at=digest_at,
            agreed=holders,
            agreed_at=held_at,
            settled=settled,
            left=np.array(list(left), np.int32) if left else NO_ROWS,
            left_at=np.array(list(left.values()), np.int64) if left else NO_STAMPS,
        )


def translated(message: Records, arrays: MissionArrays) -> Records:
    """Return `message` in the rows of `arrays`; itself if it is in them already.

    Raises
    ------
    MessageError : it names a task or an agent that is not known here.
    """
    if message.task_ids is arrays.task_ids and message.agent_ids is arrays.agent_ids:
        return message
    try:
        agents = np.array([arrays.agent_row[name] for name in message.agent_ids] + [NOT_LISTED], np.int32)
        tasks = np.array([arrays.task_row[name] for name in message.task_ids], np.int32)
    except KeyError as error:
        raise MessageError("unknown_id", f"{error.args[0]!r} is not known here") from None
    known = NO_STAMPS
    if message.full:
        known = np.zeros(arrays.num_agents, np.int64)
        known[agents[:-1]] = message.known
    return Records(
        sender=message.sender,
        sequence=message.sequence,
        agent_ids=arrays.agent_ids,
        task_ids=arrays.task_ids,
        owners=agents[message.owners],
        records=tuple(
            replace(record, tasks=tasks[record.tasks], leads=agents[record.leads])
            for record in message.records
        ),
        known=known,
        near=agents[message.near],
        barred_tasks=tasks[message.barred_tasks],
        barred_agents=agents[message.barred_agents],
        context=message.context,
        digest=message.digest,
        digest_at=message.digest_at,
        agreed=agents[message.agreed],
        agreed_at=message.agreed_at,
        settled=message.settled,
        left=agents[message.left],
        left_at=message.left_at,
    )
