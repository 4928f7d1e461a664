"""What happens to a UAV on its mission, followed through the two statecharts and told as events.

The Contract Net tells of its conversations stage by stage; the charts say what each means to the vehicle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from swarmbid.messages.survey import Contact
from swarmbid.missions import charts
from swarmbid.missions.charts import CONTRACTOR_CHART, MANAGER_CHART, Progress
from swarmbid.missions.separation import Subgroup
from swarmbid.negotiator import Event, Stage

TO_CHART = {
    ("announced", "contracted"): charts.OWN_BEST,
    ("announced", "awarded"): charts.OTHER_BEST,
    ("awarded", "contracted"): charts.ACCEPTED,
    ("idle", "announced"): charts.ANNOUNCED,
    ("idle", "contracted"): charts.OWN_BEST,
}
"""(stage of the conversation before, stage now) -> what that is to a manager."""
ENDED = ("done", "failed", "cancelled", "unserved")


@dataclass(frozen=True)
class TargetFound(Event):
    """The UAV has confirmed a contact and decided its type.

    Parameters
    ----------
    x, y : m, estimated. moving : what it is taken for. evidence : what that rests on.
    """

    kind = "detected"
    task: str
    x: float
    y: float
    moving: bool
    evidence: str


@dataclass(frozen=True)
class TargetServed(Event):
    """The UAV has been at a static target for as long as was wanted. x, y : m, estimated."""

    kind = "served"
    task: str
    x: float
    y: float


@dataclass(frozen=True)
class AreaDivided(Event):
    """The UAV has divided the area anew. searchers : ids. because : of whom, or of what."""

    kind = "divided"
    searchers: tuple[str, ...]
    because: str


class Charting:
    """The charts of one UAV."""

    def __init__(self, agent: str) -> None:
        self.agent = agent
        self.manager = Progress(MANAGER_CHART, charts.SEARCHING)
        self.contractor = Progress(CONTRACTOR_CHART, charts.IDLE)
        self._stage: dict[tuple[str, str], str] = {}
        self._searchers: tuple[str, ...] = ()
        self._calls = 0

    def found(self, contact: Contact, evidence: str) -> list[Event]:
        """The UAV found a target and knows its type."""
        told: list[Event] = [TargetFound(contact.task, contact.x, contact.y, contact.moving, evidence)]
        told += self._manage(contact.task, charts.FOUND)
        return told + self._manage(contact.task, charts.MOVING if contact.moving else charts.STATIC)

    def divided(self, searchers: Sequence[str]) -> AreaDivided:
        """The area was divided among `searchers`."""
        before, self._searchers = self._searchers, tuple(searchers)
        left = [name for name in before if name not in searchers]
        came = [name for name in searchers if name not in before]
        words = [f"{name} left the search" for name in left] + [f"{name} joined" for name in came if before]
        return AreaDivided(tuple(searchers), ", ".join(words) or "the search begins")

    def separated(self, groups: Sequence[Subgroup]) -> AreaDivided:
        """Known static targets were separated into subgroups."""
        words = "; ".join(" and ".join(group.targets) for group in groups)
        return AreaDivided(self._searchers, f"targets separated: {words}")

    def follow(self, event: Stage, holder: str, others: tuple[str, ...]) -> list[Event]:
        """Follow what the Contract Net tells; return the changes of the charts.

        Parameters
        ----------
        holder : who holds the task now. others : which others have proposed for it.
        """
        key = (event.task, event.role)
        before, self._stage[key] = self._stage.get(key, "idle"), event.state
        if event.role == "manager":
            return self._as_manager(event.task, before, event.state, holder, others)
        return self._as_contractor(event.task, event.state)

    def _as_manager(
        self, task: str, before: str, state: str, holder: str, others: tuple[str, ...]
    ) -> list[Event]:
        now = self.manager.state(task)
        if state in ENDED:
            return self._manage(task, charts.OVER)
        if state == "yielded":
            return self._manage(task, charts.TAKEN)
        meaning = TO_CHART.get((before, state))
        if meaning == charts.OTHER_BEST and now == charts.AWARDING:
            meaning = charts.NEXT
        elif meaning == charts.OWN_BEST:
            if holder not in ("", self.agent):
                meaning = charts.TAKEN
            elif now == charts.AWARDING:
                meaning = charts.DECLINED
            elif not others:
                meaning = charts.NO_PROPOSAL
        return [] if meaning is None else self._manage(task, meaning)

    def _as_contractor(self, task: str, state: str) -> list[Event]:
        told: list[Event] = []
        if state in ("proposed", "refused"):
            waiting = [
                one for one, at in self.contractor.states.items() if at == charts.OFFERED and one != task
            ]
            told += self._contract(task, charts.SEVERAL_NEW if waiting else charts.ONE_NEW)
            return told + self._contract(task, charts.PROPOSED if state == "proposed" else charts.UNABLE)
        if state == "contracted":
            if self.contractor.state(task) == charts.IDLE:
                told += self._contract(task, charts.ONE_NEW) + self._contract(task, charts.PROPOSED)
            return told + self._contract(task, charts.AWARDED)
        if state in ("idle", "released"):
            return self._contract(task, charts.NOT_AWARDED)
        return self._contract(task, charts.OVER) if state in ENDED else []

    def _manage(self, task: str, event: str) -> list[Event]:
        new = self.manager.step(task, event)
        return [] if new is None else [Stage(task, "manager", new)]

    def _contract(self, task: str, event: str) -> list[Event]:
        new = self.contractor.step(task, event)
        return [] if new is None else [Stage(task, "contractor", new)]
