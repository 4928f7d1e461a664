"""Slow twins of the protocols: the decision table as if/elif, CBAA and CBBA in synchronous rounds.

Written from the description of the algorithms alone; see `naive` for the arithmetic.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from naive import Bundle, Judge, Path, Score, extend_bundle, outbids
from swarmbid.model import Mission

Graph = dict[str, list[str]]  # agent id -> ids it can hear, in order
Beliefs = dict[str, tuple[str | None, float]]  # task id -> (winning agent, winning bid)


def decide(
    me: str,
    sender: str,
    theirs: str | None,
    their_bid: float,
    mine: str | None,
    my_bid: float,
    their_heard: Mapping[str, float],
    my_heard: Mapping[str, float],
    *,
    row_12: str = "paper",
) -> str:
    """What to do about one task of one message: "update", "reset" or "leave". One branch a row.

    `theirs` and `mine` are whom sender and receiver believe in; `*_heard` are their stamps. `row_12`
    says what happens when the sender has news of n and news equally old of m: "paper" leaves the belief,
    "settling" takes the sender's.
    """

    def newer(agent: str) -> bool:
        return their_heard[agent] > my_heard[agent]

    better = outbids(their_bid, theirs, my_bid, mine)
    m, n = theirs, mine
    if m == sender:
        if n == me:  # row 1
            return "update" if better else "leave"
        elif n == sender:  # row 2
            return "update"
        elif n is not None:  # row 3
            return "update" if newer(n) or better else "leave"
        else:  # row 4
            return "update"
    elif m == me:
        if n == me:  # row 5
            return "leave"
        elif n == sender:  # row 6
            return "reset"
        elif n is not None:  # row 7
            return "reset" if newer(n) else "leave"
        else:  # row 8
            return "leave"
    elif m is not None:
        if n == me:  # row 9
            return "update" if newer(m) and better else "leave"
        elif n == sender:  # row 10
            return "update" if newer(m) else "reset"
        elif n == m:  # row 11
            return "update" if newer(m) else "leave"
        elif n is not None:  # row 12
            # Three clauses as the paper has them, for readers to compare.
            if newer(m) and newer(n):  # noqa: SIM114
                return "update"
            elif newer(m) and better:
                return "update"
            elif newer(n) and my_heard[m] > their_heard[m]:
                return "reset"
            elif newer(n) and row_12 == "settling":
                return "update"
            else:
                return "leave"
        else:  # row 13
            return "update" if newer(m) else "leave"
    else:
        if n == me:  # row 14
            return "leave"
        elif n == sender:  # row 15
            return "update"
        elif n is not None:  # row 16
            return "update" if newer(n) else "leave"
        else:  # row 17
            return "leave"


def row_of(me: str, sender: str, theirs: str | None, mine: str | None) -> int:
    """Number of the table's row, 1 to 17, for what sender and receiver believe."""
    if theirs == sender:
        return 1 if mine == me else 2 if mine == sender else 3 if mine is not None else 4
    if theirs == me:
        return 5 if mine == me else 6 if mine == sender else 7 if mine is not None else 8
    if theirs is not None:
        if mine == me:
            return 9
        if mine == sender:
            return 10
        if mine is None:
            return 13
        return 11 if mine == theirs else 12
    return 14 if mine == me else 15 if mine == sender else 16 if mine is not None else 17


@dataclass
class Outcome:
    """How a run in synchronous rounds ended.

    `rounds` is the last round in which any belief or bundle changed (0 if none ever did).
    """

    converged: bool
    rounds: int
    bundles: dict[str, Bundle]
    beliefs: dict[str, Beliefs]

    @property
    def paths(self) -> dict[str, Path]:
        return {agent_id: bundle.path for agent_id, bundle in self.bundles.items()}


class _Node:
    """One agent of the synchronous CBBA."""

    def __init__(self, mission: Mission, judge: Judge) -> None:
        self.judge, self.id = judge, judge.agent.id
        self.beliefs: Beliefs = {task.id: (None, 0.0) for task in mission.tasks}
        self.heard = {agent.id: 0.0 for agent in mission.agents}
        self.bundle = Bundle([], [], [])
        self.dirty = True

    def build(self, *, rebuild: bool, warp: bool) -> None:
        if rebuild:
            if not self.dirty:
                return
            for task_id in self.bundle.tasks:
                if self.beliefs[task_id][0] == self.id:
                    self.beliefs[task_id] = (None, 0.0)
            self.bundle = Bundle([], [], [])
        extend_bundle(self.judge, self.bundle, self.beliefs, warp=warp)
        self.dirty = False

    def take_in(self, sender: str, beliefs: Beliefs, heard: Mapping[str, float], row_12: str) -> None:
        """Apply the rows to every task, then the stamps: never the other way round."""
        for task_id, (theirs, their_bid) in beliefs.items():
            mine, my_bid = self.beliefs[task_id]
            action = decide(
                self.id, sender, theirs, their_bid, mine, my_bid, heard, self.heard, row_12=row_12
            )
            if action != "leave":
                told = (theirs, their_bid) if action == "update" else (None, 0.0)
                self.dirty |= told != self.beliefs[task_id]
                self.beliefs[task_id] = told
        for agent_id, stamp in heard.items():
            self.heard[agent_id] = max(self.heard[agent_id], stamp)

    def release(self) -> None:
        """From the first lost task on, everything leaves the bundle; later ones become nobody's."""
        for place, task_id in enumerate(self.bundle.tasks):
            if self.beliefs[task_id][0] != self.id:
                for later in self.bundle.tasks[place + 1 :]:
                    if self.beliefs[later][0] == self.id:
                        self.beliefs[later] = (None, 0.0)
                gone = set(self.bundle.tasks[place:])
                self.bundle = Bundle(
                    self.bundle.tasks[:place],
                    self.bundle.bids[:place],
                    [visit for visit in self.bundle.path if visit[0] not in gone],
                )
                self.dirty = True
                return


def cbba(
    mission: Mission,
    graph: Graph,
    score: Score,
    rule: str,
    *,
    rebuild: bool = True,
    warp: bool = False,
    stamps: str = "own",
    row_12: str = "settling",
    max_rounds: int = 200,
) -> Outcome:
    """CBBA with full states in synchronous rounds: build, send, resolve, release.

    Parameters
    ----------
    stamps : "own": news about an agent carries its own round counter, relayed unchanged; "reception":
        a neighbour's stamp is the round in which its message came, as printed in the papers.
    row_12 : as in `decide`.
    """
    order = sorted((agent.id for agent in mission.agents), key=str.encode)
    agents = {agent.id: agent for agent in mission.agents}
    nodes = {i: _Node(mission, Judge(mission, agents[i], score, rule)) for i in order}
    patience = 2 * len(order) + 2  # quiet rounds before the outcome is believed
    last_change = 0
    for now in range(1, max_rounds + 1):
        before = {i: (dict(node.beliefs), list(node.bundle.path)) for i, node in nodes.items()}
        for node in nodes.values():
            node.build(rebuild=rebuild, warp=warp)
            node.heard[node.id] = float(now)
        said = {i: (dict(node.beliefs), dict(node.heard)) for i, node in nodes.items()}
        for i in order:
            for k in graph[i]:
                beliefs, heard = said[k]
                nodes[i].take_in(k, beliefs, heard if stamps == "own" else {**heard, k: now, i: 0}, row_12)
            nodes[i].release()
        after = {i: (dict(node.beliefs), list(node.bundle.path)) for i, node in nodes.items()}
        if after != before:
            last_change = now
        elif now - last_change >= patience:
            break
    first = nodes[order[0]].beliefs
    agreed = all(node.beliefs == first for node in nodes.values())
    quiet = now - last_change >= patience
    return Outcome(
        quiet and agreed,
        last_change,
        {i: node.bundle for i, node in nodes.items()},
        {i: node.beliefs for i, node in nodes.items()},
    )


def cbaa(mission: Mission, graph: Graph, score: Score, *, max_rounds: int = 200) -> Outcome:
    """CBAA in synchronous rounds: whoever has no task bids on one; the larger (bid, agent) is kept."""
    order = sorted((agent.id for agent in mission.agents), key=str.encode)
    agents = {agent.id: agent for agent in mission.agents}
    judges = {i: Judge(mission, agents[i], score, "append") for i in order}
    beliefs: dict[str, Beliefs] = {i: {task.id: (None, 0.0) for task in mission.tasks} for i in order}
    bundles = {i: Bundle([], [], []) for i in order}
    patience = 2 * len(order) + 2
    last_change = 0
    for now in range(1, max_rounds + 1):
        before = {i: dict(known) for i, known in beliefs.items()}
        for i in order:
            if bundles[i].tasks:
                continue
            for gain, task_id, path in judges[i].candidates([], beliefs[i]):
                winner, winning_bid = beliefs[i][task_id]
                if gain > 0 and outbids(gain, i, winning_bid, winner):
                    bundles[i] = Bundle([task_id], [gain], path)
                    beliefs[i][task_id] = (i, gain)
                    break
        said = {i: dict(known) for i, known in beliefs.items()}
        for i in order:
            for k in graph[i]:
                for task_id, (winner, bid) in said[k].items():
                    mine, my_bid = beliefs[i][task_id]
                    if outbids(bid, winner, my_bid, mine):
                        beliefs[i][task_id] = (winner, bid)
            if bundles[i].tasks and beliefs[i][bundles[i].tasks[0]][0] != i:
                bundles[i] = Bundle([], [], [])
        if before != beliefs:
            last_change = now
        elif now - last_change >= patience:
            break
    agreed = all(known == beliefs[order[0]] for known in beliefs.values())
    return Outcome(agreed and now - last_change >= patience, last_change, bundles, beliefs)


def diameter(graph: Graph) -> int:
    """Most hops between any two agents; every agent must reach every other."""
    longest = 0
    for source in graph:
        hops = {source: 0}
        queue = [source]
        for here in queue:
            for there in graph[here]:
                if there not in hops:
                    hops[there] = hops[here] + 1
                    queue.append(there)
        if len(hops) < len(graph):
            raise ValueError("not connected")
        longest = max(longest, max(hops.values()))
    return longest


def n_min(mission: Mission) -> int:
    """Most tasks that can be assigned: the lesser of their number and the sum of the bundle limits."""
    places = sum(
        len(mission.tasks) if agent.bundle_limit is None else agent.bundle_limit for agent in mission.agents
    )
    return min(len(mission.tasks), places)
