"""Which proposal a manager should award (Dymkou's slides, "Compare bids"): pure functions.

Proposal k is agent k's path with the new task in it. The table has a row for each agent and a column for
each proposal. A manager with tasks of its own compares what each agent bids on its own proposal, the
diagonal. One that has none also counts what every other's whole proposal would be worth flown by itself:
the other would be free then, and what its old path was worth is lost. What is awarded is the largest
improvement of the team's total. (The slides compare costs; these are scores, and larger is better.)
"""

from __future__ import annotations

from collections.abc import Callable

from swarmbid.messages.acts import Act

Comparison = dict[tuple[int, int], float]
"""(row of the agent that would fly, row of the proposer) -> improvement of the team's total, score units."""


def diagonal(proposals: dict[int, Act]) -> Comparison:
    """What each agent bids on its own proposal (c_11, c_22, c_33)."""
    return {(row, row): act.bid for row, act in proposals.items()}


def with_take_overs(proposals: dict[int, Act], manager: int, worth: Callable[[Act], float]) -> Comparison:
    """The diagonal, and the row of a manager without tasks: what it gains by flying a whole proposal.

    Parameters
    ----------
    worth : score of the path of a proposal, its task included, flown by the manager; -inf if it cannot.
    """
    table = diagonal(proposals)
    for row, act in proposals.items():
        if row != manager and act.path:
            table[manager, row] = worth(act) - act.worth
    return table


def best(table: Comparison) -> tuple[int, int]:
    """Who is to fly whose proposal: largest improvement; then no take-over; then the higher id. (-1, -1)
    if there is nothing to award."""
    return max(table, key=lambda cell: (table[cell], cell[0] == cell[1], cell), default=(-1, -1))
