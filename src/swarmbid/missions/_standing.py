"""What stands beside the contracts: targets to be identified by a group, and visits that are to be repeated.

Contracts answer to one event each; what is known to all and stays to be done is negotiated by consensus:
by CBGA where a group must come together, else by CBBA. The path that results is flown when the UAV has no
contract. A group begins when all of its members are there, so each waits for the last.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from swarmbid.algorithms.cbba import CBBA
from swarmbid.algorithms.cbga import CBGA
from swarmbid.messages import Beliefs, Message, Records
from swarmbid.messages.survey import Contact, Status
from swarmbid.missions._contacts import Contacts
from swarmbid.model import Mission, Task
from swarmbid.negotiator import Agreed, Doubted, Event, Negotiator, TaskEnded
from swarmbid.world.area import Point
from swarmbid.world.mission import SearchMission
from swarmbid.world.vehicle import Vehicle, VehicleState, remaining, time_home

RESTATE_EVERY = 30.0
"""s between two times at which others are told where the UAV is though its job is the same: as long as that
the team needs to agree, and where nothing changes it can."""
EARLY = 30.0
"""s before the planned start by which a UAV means to be there. Until it must leave it searches on."""
FRESH = 10.0
"""s for which the last word of another is taken for where it is; at least, for large teams speak seldom."""
MOST_WAIT = 60
"""s beyond the planned start for which a UAV waits for the others: who has done its part comes no more."""
SPARE = 60.0
"""s of fuel beyond the service and the way home without which a UAV does not count as free before landing."""


@dataclass(frozen=True)
class StandingDone(Event):
    """The UAV has been where a standing task is for as long as was wanted. x, y : m, estimated."""

    kind = "stood"
    task: str
    x: float
    y: float


class Standing:
    """The standing tasks of one UAV.

    Parameters
    ----------
    vehicle : which UAV. radius : m, how far its sensor reaches on the ground.
    groups : whether to use CBGA even if no task needs a group, where CBBA's messages are somebody else's.
    """

    def __init__(
        self, mission: SearchMission, vehicle: Vehicle, radius: float, *, groups: bool = False
    ) -> None:
        self.id = vehicle.id
        self.mission = mission
        self.vehicle = vehicle
        self.begun: tuple[str, float] | None = None
        self._reach = max(0.6 * radius, 2.2 * vehicle.turn_radius)
        self._fresh = max(FRESH, float(len(mission.vehicles)))
        # Fuel comes back at the base; until when a UAV is bound to be there is told with its place.
        free = tuple(replace(one, base=None, endurance=math.inf) for one in mission.roster().agents)
        roster = Mission(agents=free, tasks=(), name=mission.name)
        score = "revisit" if mission.revisit > 0.0 else "time_discounted"
        self.negotiator: Negotiator
        self._hears: type[Message]
        if mission.identify or groups:
            # A group that cannot be completed now stays open: who is busy or at its base comes back.
            self.negotiator, self._hears = CBGA(vehicle.id, roster, score, quitting=False), Records
        else:
            self.negotiator, self._hears = CBBA(vehicle.id, roster, score), Beliefs
        self._tasks: dict[str, Task] = {}
        self._of: dict[str, tuple[str, ...]] = {}
        self._ended: set[str] = set()
        self._heading_for: str | None = None
        self._overdue = 0
        self._told: tuple[object, ...] = ()
        self._told_at = -math.inf
        self._events: list[Event] = []

    # --- what is to be done

    @property
    def path(self) -> list[tuple[str, float]]:
        """Tasks that this UAV is to do, in order, with their planned starts, s."""
        if not self._tasks:
            return []
        return [item for item in self.negotiator.path if item[0] not in self._ended]

    def tasks_of(self, contact: Contact) -> list[Task]:
        """Return the standing tasks that a static contact makes; the same ids aboard every UAV."""
        mission = self.mission
        latest = max(mission.duration - mission.dwell, contact.found_at)
        visit = Task(
            id=contact.task,
            type="static",
            position=(contact.x, contact.y, 0.0),
            reward=mission.reward,
            start=contact.found_at,
            end=latest,
            duration=mission.dwell,
            discount=0.002,
        )
        found = []
        if mission.identify:
            needs = frozenset(mission.identify)
            found.append(replace(visit, id=f"{visit.id}.identify", agents_required=0, equipment=needs))
        if mission.revisit > 0.0:
            for k in range(1, math.floor((latest - contact.found_at) / mission.revisit) + 1):
                due = contact.found_at + k * mission.revisit
                found.append(
                    replace(
                        visit,
                        id=f"{visit.id}.r{k}",
                        start=due - 0.5 * mission.revisit,
                        end=min(due + 0.5 * mission.revisit, latest),
                        revisit_at=due,
                        revisit_width=0.25 * mission.revisit,
                    )
                )
        return found

    def _learn(self, contacts: Contacts) -> None:
        for name, contact in sorted(contacts.known.items()):
            if contact.moving:
                continue
            if name not in self._of and not contact.over:
                tasks = self.tasks_of(contact)
                self._of[name] = tuple(task.id for task in tasks)
                for task in tasks:
                    self._tasks[task.id] = task
                    self.negotiator.add_task(task)
            if contact.over:
                for task_id in self._of.get(name, ()):
                    self._cancel(task_id)

    def _cancel(self, task_id: str) -> None:
        if task_id not in self._ended:
            self._ended.add(task_id)
            self.negotiator.cancel_task(task_id)
            if self.begun is not None and self.begun[0] == task_id:
                self.begun = None

    # --- where the UAV is

    def at(
        self, now: float, state: VehicleState, mode: str, contacts: Contacts, contracts: Sequence[str]
    ) -> None:
        """Take in what the UAV knows and does; contracts go first, so it is free after them.

        Parameters
        ----------
        mode : one of `messages.survey.MODES`. contracts : tasks under contract, in order.
        """
        self._learn(contacts)
        if self.begun is not None and mode not in ("return", "base"):
            return
        bound = mode in ("return", "base") or self._spare(state) < self.mission.dwell + SPARE
        told = (bound, *contracts, len(self._tasks), len(self._ended))
        if told == self._told and now - self._told_at < RESTATE_EVERY:
            return
        self._told, self._told_at = told, now
        (x, y), free_at = self._free(now, state, bound, contacts, contracts)
        self.negotiator.set_position((x, y, 0.0), free_at)

    def _spare(self, state: VehicleState) -> float:
        home = time_home(self.vehicle, state, self.mission.area)
        return remaining(self.vehicle, state) - home - self.vehicle.reserve

    def _free(
        self,
        now: float,
        state: VehicleState,
        bound: bool,
        contacts: Contacts,
        contracts: Sequence[str],
    ) -> tuple[Point, float]:
        """Return where the UAV will be when it is free to go on, and when."""
        vehicle, here, at = self.vehicle, (state.x, state.y), now
        if bound:
            if vehicle.base is None:
                return here, self.mission.duration
            if state.landed_until is not None:
                return vehicle.base, max(state.landed_until, now)
            return vehicle.base, now + time_home(vehicle, state, self.mission.area) + vehicle.turnaround
        for name in contracts:
            contact = contacts.known.get(name)
            if contact is None or contact.over:
                continue
            if contact.moving:  # followed until the end, or until somebody takes over
                return contacts.where(name, now), self.mission.duration
            place = (contact.x, contact.y)
            at += math.dist(here, place) / vehicle.speed + self.mission.dwell
            here = place
        return here, at

    # --- what to do

    def step(
        self, now: float, state: VehicleState, statuses: Mapping[str, Status]
    ) -> tuple[str, Point] | None:
        """Return the mode and where to fly; None if there is nothing to do yet.

        Call each second while the UAV has no contract, and in any case while something has `begun`.

        Parameters
        ----------
        statuses : the last word of each UAV.
        """
        if self.begun is not None:
            task, since = self._tasks[self.begun[0]], self.begun[1]
            if now - since >= self.mission.dwell:
                self._finish(task, now)
            return "visit", task.position[:2]
        for name, start in self.path:
            task = self._tasks[name]
            place = task.position[:2]
            away = math.dist(place, (state.x, state.y))
            if self._heading_for != name and now + away / self.vehicle.speed + EARLY < start:
                break
            if self._heading_for != name:
                self._heading_for, self._overdue = name, 0
            if away > self._reach:
                return "transit", place
            # Who is there on another errand is not there for this one: not before its planned start.
            due = start - FRESH if task.revisit_at is None else task.revisit_at
            self._overdue += now >= due
            if now >= due and (self._overdue > MOST_WAIT or self._all_there(task, statuses, now)):
                self.negotiator.start_task(name, now)
                self.begun = (name, now)
            return "visit", place
        self._heading_for = None
        return None

    def _all_there(self, task: Task, statuses: Mapping[str, Status], now: float) -> bool:
        """Whether every other member of a task's group waits at it, by its last word."""
        for member, _ in self.negotiator.beliefs()[task.id]:
            if member == self.id:
                continue
            status = statuses.get(member)
            if status is None or status.mode != "visit" or now - status.t > self._fresh:
                return False
            if math.dist(task.position[:2], (status.x, status.y)) > 2.0 * self._reach:
                return False
        return True

    def _finish(self, task: Task, now: float) -> None:
        self.begun = self._heading_for = None
        self._ended.add(task.id)
        self.negotiator.finish_task(task.id, now)
        self._events += [
            StandingDone(task.id, task.position[0], task.position[1]),
            TaskEnded(task.id, "done", self.id, ""),
        ]

    # --- in and out

    def lose(self, agent: str) -> None:
        """Another UAV is gone."""
        self.negotiator.lose_agent(agent)

    def receive(self, message: Message, now: float) -> bool:
        """Take in a message if it is of this negotiation; return whether it is."""
        if not isinstance(message, self._hears):
            return False
        self.negotiator.receive(message, now)
        return True

    def tick(self, now: float) -> list[Message]:
        """Return what to say."""
        due = self.negotiator.next_tick()
        return self.negotiator.tick(now) if due is not None and due <= now else []

    def events(self) -> list[Event]:
        """Return what happened, and forget it; agreement is told of by the contracts alone."""
        drained, self._events = self._events, []
        heard = [one for one in self.negotiator.events() if not isinstance(one, Agreed | Doubted)]
        return heard + drained
