"""The two statecharts of the search-and-track mission, as tables (Dymkou's slides).

A manager is a UAV that found a target; a potential contractor is one that hears of it. Each chart is a
table over (state, event), given for every pair: what is not listed leaves the state as it is. The Contract
Net (`swarmbid.algorithms.contract_net`) carries the words; the charts say what they mean to the vehicle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

# States of a manager ("Manager statecharts").
SEARCHING = "searching"
DEFINING = "defining type"
PLANNING = "adding to path"
WAITING = "waiting for proposals"
AWARDING = "awarding"
TRACKING = "tracking"
CONTINUING = "continuing"

# Events of a manager.
FOUND = "found target"
MOVING = "is moving"
STATIC = "is static"
ANNOUNCED = "announced"
NO_PROPOSAL = "nobody else proposes"
OWN_BEST = "own bid is best"
OTHER_BEST = "another's bid is best"
ACCEPTED = "accepted"
DECLINED = "declined, none left"
NEXT = "declined, next asked"
TAKEN = "another has it"
OVER = "target is over"

# States and events of a potential contractor ("Potential contractors statecharts").
IDLE = "current job"
BUILDING_ONE = "path with the target"
BUILDING_SEVERAL = "paths over several targets"
OFFERED = "waiting for contract"

ONE_NEW = "one new target"
SEVERAL_NEW = "several new targets"
PROPOSED = "bid and path sent"
UNABLE = "refused"
AWARDED = "awarded"
NOT_AWARDED = "not awarded"

Chart = Mapping[tuple[str, str], str]

MANAGER_STATES = (SEARCHING, DEFINING, PLANNING, WAITING, AWARDING, TRACKING, CONTINUING)
MANAGER_EVENTS = (
    FOUND, MOVING, STATIC, ANNOUNCED, NO_PROPOSAL, OWN_BEST, OTHER_BEST, ACCEPTED, DECLINED, NEXT, TAKEN,
    OVER,
)  # fmt: skip
CONTRACTOR_STATES = (IDLE, BUILDING_ONE, BUILDING_SEVERAL, OFFERED, TRACKING)
CONTRACTOR_EVENTS = (ONE_NEW, SEVERAL_NEW, PROPOSED, UNABLE, AWARDED, NOT_AWARDED, OVER)


def _complete(states: tuple[str, ...], events: tuple[str, ...], moves: Chart) -> Chart:
    return {(state, event): moves.get((state, event), state) for state in states for event in events}


MANAGER_CHART: Chart = _complete(
    MANAGER_STATES,
    MANAGER_EVENTS,
    {
        (SEARCHING, FOUND): DEFINING,
        (DEFINING, MOVING): TRACKING,
        (DEFINING, STATIC): PLANNING,
        (DEFINING, TAKEN): CONTINUING,
        (DEFINING, OVER): CONTINUING,
        (PLANNING, ANNOUNCED): WAITING,
        (PLANNING, OVER): CONTINUING,
        (WAITING, NO_PROPOSAL): TRACKING,
        (WAITING, OWN_BEST): TRACKING,
        (WAITING, OTHER_BEST): AWARDING,
        (WAITING, TAKEN): CONTINUING,
        (WAITING, OVER): CONTINUING,
        (AWARDING, ACCEPTED): CONTINUING,
        (AWARDING, NEXT): AWARDING,
        (AWARDING, DECLINED): TRACKING,
        (AWARDING, OWN_BEST): TRACKING,
        (AWARDING, TAKEN): CONTINUING,
        (AWARDING, OVER): CONTINUING,
        (TRACKING, OTHER_BEST): AWARDING,  # a hand-over
        (TRACKING, TAKEN): CONTINUING,
        (TRACKING, OVER): CONTINUING,
        (CONTINUING, OWN_BEST): TRACKING,
        (CONTINUING, OTHER_BEST): AWARDING,
    },
)
"""A manager, for one target: from its discovery to somebody's tracking it ("Manager statecharts")."""

CONTRACTOR_CHART: Chart = _complete(
    CONTRACTOR_STATES,
    CONTRACTOR_EVENTS,
    {
        (IDLE, ONE_NEW): BUILDING_ONE,
        (IDLE, SEVERAL_NEW): BUILDING_SEVERAL,
        (BUILDING_ONE, PROPOSED): OFFERED,
        (BUILDING_SEVERAL, PROPOSED): OFFERED,
        (BUILDING_ONE, UNABLE): IDLE,
        (BUILDING_SEVERAL, UNABLE): IDLE,
        (OFFERED, UNABLE): IDLE,
        (OFFERED, AWARDED): TRACKING,
        (OFFERED, NOT_AWARDED): IDLE,
        (OFFERED, OVER): IDLE,
        (TRACKING, NOT_AWARDED): IDLE,
        (TRACKING, OVER): IDLE,
    },
)
"""A potential contractor, for one target ("Potential contractors statecharts")."""


@dataclass
class Progress:
    """Where one UAV is in a chart, for each target.

    Parameters
    ----------
    chart : `MANAGER_CHART` or `CONTRACTOR_CHART`. first : the state before anything happened.
    """

    chart: Chart
    first: str
    states: dict[str, str] = field(default_factory=dict)

    def step(self, task: str, event: str) -> str | None:
        """Let something happen to a target; return the new state if it is another."""
        old = self.states.get(task, self.first)
        new = self.chart[old, event]
        if new == old:
            return None
        self.states[task] = new
        return new

    def state(self, task: str) -> str:
        """Where the UAV is with a target."""
        return self.states.get(task, self.first)
