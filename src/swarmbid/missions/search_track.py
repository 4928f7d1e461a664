"""Search and track: what one UAV does, from take-off to landing (Dymkou's slides).

Search until something is found; decide by evidence whether it moves. Who finds a moving target follows it;
who finds a static one announces it, and the best bid visits it. Whoever follows a target has left the
search, which is divided anew among those who remain, and again when it returns. A follower hands its
target over before its fuel runs short.

The behaviour has no clock and no sensor of its own: a driver calls `sense` with what the sensor saw, then
`tick`, flies towards `goal`, and carries the messages.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from swarmbid.arrays import FloatArray
from swarmbid.messages import Broadcast, Message, Survey
from swarmbid.messages.survey import Contact, Status
from swarmbid.missions._allocation import Allocation
from swarmbid.missions._charting import Charting, TargetServed
from swarmbid.missions._contacts import Contacts
from swarmbid.missions._searching import Searching
from swarmbid.missions._standing import Standing
from swarmbid.missions._team import Team
from swarmbid.missions.separation import separate
from swarmbid.model import Task
from swarmbid.negotiator import Event, Stage
from swarmbid.world.grid import Grid
from swarmbid.world.mission import SearchMission
from swarmbid.world.vehicle import TURN, Vehicle, VehicleState, must_return, remaining, time_home

LOST_AFTER = 45.0
"""s without a detection after which a followed target is given up."""
BLINKS = 5
"""Looks in a row that may miss a target which is still followed."""
FUEL_MARGIN = 60.0
"""s of fuel, beyond what a task and the way home take, with which a UAV takes one on."""
HANDOVER_LEAD = 150.0
"""s of fuel, beyond the way home, at which a follower looks for somebody to hand over to."""
CHECK_EVERY = 3.0
"""s between two looks for contacts that are one target."""
SPELL = 60.0
"""s for which a follower is sure to be busy; it stays for as long as its fuel lasts."""

Point = tuple[float, float]


class SearchTrack:
    """The behaviour aboard one UAV.

    Parameters
    ----------
    mission : what all know before take-off; its targets are not looked at.
    vehicle : which UAV. grid : of the beliefs, shared between UAVs of one process.
    allocation : who does what. strategy : see `_searching.STRATEGIES`.
    patience : s without any news of a UAV after which it counts as lost.
    standing : what is negotiated beside the contracts, if anything.
    """

    def __init__(
        self,
        mission: SearchMission,
        vehicle: Vehicle,
        grid: Grid,
        allocation: Allocation,
        *,
        strategy: str = "ours",
        rng: np.random.Generator,
        patience: float = 120.0,
        standing: Standing | None = None,
    ) -> None:
        self.id = vehicle.id
        self.vehicle = vehicle
        self.mission = mission
        self.allocation = allocation
        allocation.may = self.refusal
        self.standing = standing
        self.team = Team(vehicle.id, mission, patience)
        self.searching = Searching(mission, vehicle, grid, strategy, rng)
        self.radius = self.searching.footprint.radius
        self.contacts = Contacts(
            vehicle.id, vehicle.sensor.sigma, max(2.0 * vehicle.sensor.sigma, 0.5 * self.radius)
        )
        self.charting = Charting(vehicle.id)
        self.mode = "search"
        self.goal: Point | None = None
        self.dwelling: tuple[str, float] | None = None
        self.following: str | None = None
        self._followed_at = -math.inf
        self._events: list[Event] = []
        self._state: VehicleState | None = None
        self._offered: set[str] = set()

    # --- in

    def receive(self, message: Broadcast, now: float) -> None:
        """Take in what was heard; never raises on a peer's fault."""
        if isinstance(message, Survey):
            batch = self.team.hear(message)
            if batch is not None:
                self.contacts.merge(message.contacts, now)
                self.searching.hear(batch, now)
        elif isinstance(message, Message) and not (self.standing and self.standing.receive(message, now)):
            self.allocation.receive(message, now)

    def sense(self, state: VehicleState, measured: FloatArray, now: float) -> None:
        """Take in where the UAV is and what its sensor saw, float64[n, 2] in m; nothing while at base."""
        self._state = state
        if self.mode == "base":
            return
        self.contacts.look(now, measured, state.x, state.y, self.radius)
        self.searching.glimpse(now, state.x, state.y)

    def landed(self) -> None:
        """The driver says that the UAV is on the ground at its base."""
        self.mode = "base"

    def refuelled(self) -> None:
        """The driver says that it is in the air again with a full tank."""
        self.mode = "search"
        self.searching.forget_goal()

    # --- out

    def events(self) -> list[Event]:
        """Return what happened since the last call, and forget it."""
        drained, self._events = self._events, []
        return drained

    def tick(self, now: float) -> list[Broadcast]:
        """Decide what to do and return what to say. Call once a second, after `sense`."""
        state = self._state
        assert state is not None, "call sense first"
        self.searching.advance(now)
        self._watch_others(now)
        self._end_doubles(now)
        self._identify(now)
        self.allocation.at(state, self._free_at, now, self.contacts)
        if self.standing:
            contracts = [task for task, _ in self.allocation.path]
            self.standing.at(now, state, self.mode, self.contacts, contracts)
        self._choose(state, now)
        self._divide(state, now)
        if self.mode == "search":
            self.goal = self.searching.goal(now, state.x, state.y, state.heading)
        said: list[Broadcast] = list(self.allocation.tick(now))
        for event in self.allocation.events():
            if not isinstance(event, Stage):
                self._events.append(event)
            else:  # of a stage the trace has what it means to the vehicle
                self._events += self.charting.follow(event, *self.allocation.standing_of(event.task))
        if self.standing:
            said += self.standing.tick(now)
            self._events += self.standing.events()
        self.team.note(Status(self.id, now, self.mode, state.x, state.y))
        survey = self.team.survey(now, self.contacts, self.searching.log)
        return said if survey is None else [*said, survey]

    # --- what is going on elsewhere

    def _watch_others(self, now: float) -> None:
        for name in self.team.newly_lost(now):
            self.allocation.lose(name)
            if self.standing:
                self.standing.lose(name)

    def _divide(self, state: VehicleState, now: float) -> None:
        if self.mode != "search":
            return
        searchers = self.team.searchers() | {self.id: (state.x, state.y)}
        if self.searching.divide(now, searchers):
            self._events.append(self.charting.divided(sorted(searchers)))

    # --- what was found

    def _identify(self, now: float) -> None:
        """Announce or take what turned out to be a target, once its type is known."""
        self.contacts.matched(now)
        new: list[Contact] = []
        for number, moving, evidence in self.contacts.decided(now):
            moving = moving or self.mission.drift != (0.0, 0.0)  # where all drifts, nothing rests
            self.contacts.matched(now)
            if number not in self.contacts.candidates:
                continue  # a second track of what has just been opened
            contact = self.contacts.open(number, moving, now)
            self._events += self.charting.found(contact, evidence)
            self.searching.belief.found(contact.x, contact.y, self.radius)
            if moving:
                free = self.mode not in ("return", "base")
                self.allocation.announce(self.task_of(contact), now, keep=free)
            else:
                new.append(contact)
        if new:
            self._announce(new, now)

    def _announce(self, new: Sequence[Contact], now: float) -> None:
        """Announce static targets, several new ones in the order of the subgroups of the separation.

        Our reading: each is announced by its finder, who is its manager, and as a task of its own, so that
        a UAV which can do only one of a subgroup may bid for that one. Of two finders of one target the
        earlier stays the manager (`_end_doubles`).
        """
        old = [
            (name, (one.x, one.y))
            for name, one in sorted(self.contacts.known.items())
            if not one.moving and not one.over and one not in new and self.allocation.is_open(name)
        ]
        if len(old) >= 2 and len(new) >= 2:
            groups = separate(old, [(one.task, (one.x, one.y)) for one in new])
            order = [name for group in groups for name in group.targets]
            new = sorted(new, key=lambda one: order.index(one.task))
            self._events.append(self.charting.separated(groups))
        for contact in new:
            self.allocation.announce(self.task_of(contact), now)

    def task_of(self, contact: Contact) -> Task:
        """Return the task that a contact is; the same aboard every UAV."""
        now = min(max(contact.found_at, 0.0), self.mission.duration)
        return Task(
            id=contact.task,
            type="moving" if contact.moving else "static",
            position=(contact.x, contact.y, 0.0),
            reward=self.mission.reward,
            start=now,
            end=self.mission.duration,
            duration=SPELL if contact.moving else self.mission.dwell,
            discount=0.002,
        )

    def _end_doubles(self, now: float) -> None:
        """Of two contacts that are one target, the earlier counts; who found the later one yields."""
        if now % CHECK_EVERY:
            return
        for _, second in self.contacts.doubles(now):
            if self.contacts.known[second].by == self.id or self.following == second:
                self.contacts.close(second, now)
                self.allocation.cancel(second)
                if self.following == second:
                    self._release()

    # --- what to do

    def _choose(self, state: VehicleState, now: float) -> None:
        """Set the mode, and unless it is searching the goal."""
        vehicle, area = self.vehicle, self.mission.area
        before = self.mode
        if self.mode in ("base", "return"):
            return
        if must_return(vehicle, state, area, 2.0):
            self._give_back(now)
            self.mode, self.goal = "return", vehicle.base
            return
        standing = self.standing
        begun = standing is not None and standing.begun is not None  # what a group began is not left
        task = None if begun else self._job(state, now)
        order = standing.step(now, state, self.team.statuses) if standing and task is None else None
        if order is not None:
            self.mode, self.goal = order
        elif task is None:
            unclear = self.contacts.unclear(now)
            if unclear is not None:
                self.mode, self.goal = "visit", unclear
            else:
                self.mode = "search"
        if before != "search" and self.mode == "search":
            self.searching.forget_goal()

    def _job(self, state: VehicleState, now: float) -> str | None:
        """Do what is under contract; return the task, None if there is none."""
        for task, _ in self.allocation.path:
            contact = self.contacts.known.get(task)
            if contact is None:
                continue  # the contract was heard of before the contact: it comes with the next survey
            if contact.over:
                self.allocation.cancel(task)
                continue
            if contact.moving:
                return self._follow(task, contact, state, now)
            return self._visit(task, contact, state, now)
        self._release()
        return None

    def _visit(self, task: str, contact: Contact, state: VehicleState, now: float) -> str | None:
        self.goal = (contact.x, contact.y)
        near = math.dist(self.goal, (state.x, state.y)) <= max(
            0.6 * self.radius, 2.2 * self.vehicle.turn_radius
        )
        if self.dwelling is None or self.dwelling[0] != task:
            self.dwelling = None
            self.mode = "transit"
            if near:
                self.allocation.start(task, now)
                self.dwelling = (task, now)
                self.mode = "visit"
            return task
        self.mode = "visit"
        if now - self.dwelling[1] >= self.mission.dwell:
            self.allocation.finish(task, now)
            self._events.append(TargetServed(task, contact.x, contact.y))
            self.dwelling = None
        return task

    def _free_at(self, now: float) -> float:
        """When the UAV is free for something new, s; never, for whoever follows a target or refuels."""
        if self.dwelling is not None:
            return self.dwelling[1] + self.mission.dwell
        started = self.following is not None and self.allocation.is_started(self.following)
        if started or self.mode in ("return", "base"):
            return math.inf
        state = self._state
        assert state is not None
        spare = remaining(self.vehicle, state) - time_home(self.vehicle, state, self.mission.area)
        return now if spare - self.vehicle.reserve > 2.0 * FUEL_MARGIN else math.inf

    def refusal(self, task: Task) -> str | None:
        """Why the UAV cannot take a task on, or None: what the Contract Net answers with."""
        state, vehicle = self._state, self.vehicle
        if state is None or self.mode in ("return", "base"):
            return "no_fuel"
        if self.following is not None and self.following != task.id:
            return "busy"
        if vehicle.base is None or math.isinf(vehicle.endurance):
            return None
        place = task.position[:2]
        way = math.dist((state.x, state.y), place) + math.dist(place, vehicle.base)
        turns = 3.0 * TURN * vehicle.turn_radius
        needed = (way + turns) / vehicle.speed + task.duration
        return "no_fuel" if remaining(vehicle, state) - vehicle.reserve < needed + FUEL_MARGIN else None

    def _follow(self, task: str, contact: Contact, state: VehicleState, now: float) -> str | None:
        if self.following != task:
            self.following, self._followed_at = task, now
        track = self.contacts.track(task)
        seen = track is not None and track.misses <= BLINKS
        if seen:
            self._followed_at = now
            if not self.allocation.is_started(task):
                self.allocation.start(task, now)
        elif math.dist((state.x, state.y), self.contacts.where(task, now)) > self.radius:
            self._followed_at = now  # it is not there yet
        elif now - self._followed_at > LOST_AFTER:
            self.contacts.close(task, now)
            self.allocation.cancel(task)
            self._release()
            return None
        self.mode = "track" if seen else "transit"
        self.goal = self.contacts.where(task, now)
        spare = remaining(self.vehicle, state) - time_home(self.vehicle, state, self.mission.area)
        if spare - self.vehicle.reserve < HANDOVER_LEAD and task not in self._offered:
            self._offered.add(task)
            self.allocation.hand_over(task, now)
        return task

    def _release(self) -> None:
        self.following = None
        self.dwelling = None

    def _give_back(self, now: float) -> None:
        """Before flying home: what cannot be done any more is for somebody else."""
        for task, _ in list(self.allocation.path):
            self.allocation.give_back(task, now)
        self._offered.clear()
        self._release()
