"""A search mission in a simulated world: physics, sensors, radio, and the behaviours that will fly.

A driver like `swarmbid.simulator`: virtual time, one seed, everything in the trace. The behaviours are told
what their sensors saw and what they heard, and nothing else; the truth goes to the trace alone.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from os import PathLike
from typing import IO, Any

import numpy as np

from swarmbid import __version__
from swarmbid.errors import Fault, InputError
from swarmbid.messages import Broadcast, decode, encode
from swarmbid.missionfile import mission_to_dict
from swarmbid.missions._allocation import Allocation, ByCentre, ByConsensus, ByContract, Centre
from swarmbid.missions._charting import TargetFound, TargetServed
from swarmbid.missions._standing import Standing, StandingDone
from swarmbid.missions.search_track import SearchTrack
from swarmbid.network import Network, RangeTopology, make_topology
from swarmbid.rng import stream
from swarmbid.searchmeasures import Measures, Watch
from swarmbid.trace import EVENT_RECORDS, Crashed, Header, Pose, Result, Sent, TraceWriter, Tracked, Truth
from swarmbid.world.grid import Grid
from swarmbid.world.mission import SearchMission
from swarmbid.world.targets import Targets
from swarmbid.world.vehicle import Vehicle, advance, at_base, fly_home, land, remaining, start, take_off

ALLOCATIONS = ("contract_net", "cbba", "central")
STEP = 1.0
"""s."""
POSE_EVERY = 5.0
"""s between two poses of a vehicle in the trace, and between two true places of a target."""


@dataclass(frozen=True)
class Sortie:
    """How a search mission went.

    Parameters
    ----------
    measures : see `swarmbid.searchmeasures.Measures`. events : how many of each kind.
    behaviours : as they were at the end, in order of id.
    """

    mission: SearchMission
    strategy: str
    allocation: str
    seed: int
    measures: Measures
    messages: int
    bytes: int
    behaviours: tuple[SearchTrack, ...] = field(repr=False, compare=False, default=())


def fly(
    mission: SearchMission,
    *,
    seed: int = 0,
    strategy: str = "ours",
    allocation: str = "contract_net",
    loss: float = 0.0,
    delay: float = 0.0,
    crashes: Mapping[str, float] | None = None,
    trace: str | PathLike[str] | IO[str] | IO[bytes] | None = None,
    through_bytes: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Sortie:
    """Fly a search mission in a simulated world.

    Parameters
    ----------
    seed : of sensors, targets and radio.
    strategy : "ours", "greedy", "lawnmower" or "random_walk".
    allocation : "contract_net", "cbba" or "central".
    loss, delay : share of messages lost, and mean further delay in s.
    crashes : vehicle's id -> s at which it fails in flight.
    trace : where to write the record. through_bytes : send every message through its bytes.
    progress : called with the time, s.

    Raises
    ------
    InputError : an unknown strategy, allocation or vehicle, or a bad number.
    """
    known = [vehicle.id for vehicle in mission.vehicles]
    faults = []
    if allocation not in ALLOCATIONS:
        mend = "Choose one of: " + ", ".join(ALLOCATIONS) + "."
        faults.append(Fault("search", "allocation", f"is {allocation!r}", mend))
    for name, when in (crashes or {}).items():
        if name not in known:
            faults.append(
                Fault(
                    "search",
                    "crashes",
                    f"names {name!r}, which is no vehicle",
                    f"Use one of {', '.join(known)}.",
                )
            )
        if not 0.0 <= when < math.inf:
            faults.append(Fault("search", "crashes", f"has {when} s for {name}", "Give 0 s or more."))
    if faults:
        raise InputError(faults)
    flight = _Flight(mission, seed, strategy, allocation, loss, delay, dict(crashes or {}), through_bytes)
    if trace is None:
        return flight.go(None, progress)
    with TraceWriter(trace) as writer:
        writer.write(
            Header(
                swarmbid=__version__,
                mission=mission_to_dict(mission.roster()),
                algorithm=allocation,
                options={"strategy": strategy, "crashes": dict(sorted((crashes or {}).items()))},
                score={"name": "time_discounted"},
                network=flight.network.describe(),
                seed=seed,
                mode="world",
                world=mission.to_dict() | {"strategy": strategy},
            )
        )
        sortie = flight.go(writer, progress)
        writer.write(Result(t=flight.now, status="flown", measures=sortie.measures.to_dict()))
    return sortie


class _Flight:
    """One mission under way."""

    def __init__(
        self,
        mission: SearchMission,
        seed: int,
        strategy: str,
        allocation: str,
        loss: float,
        delay: float,
        crashes: dict[str, float],
        through_bytes: bool,
    ) -> None:
        self.mission = mission
        self.seed, self.strategy, self.allocation = seed, strategy, allocation
        self.crashes = crashes
        self.through_bytes = through_bytes
        self.now = 0.0
        self.vehicles = tuple(sorted(mission.vehicles, key=lambda one: one.id.encode()))
        self.states = [start(vehicle) for vehicle in self.vehicles]
        self.targets = Targets(mission.targets, seed, mission.drift)
        self.grid = Grid(mission.area, mission.cell)
        # Tanks are filled on the way and targets handed over: each UAV judges its own fuel (`refusal`).
        roster = mission.roster()
        agents = tuple(replace(one, base=None, endurance=math.inf) for one in roster.agents)
        roster = replace(roster, agents=agents)
        centre = Centre(roster)
        self.behaviours = [
            SearchTrack(
                mission, vehicle, self.grid, self._allocation(vehicle.id, roster, centre),
                strategy=strategy, rng=stream(seed, "search", vehicle.id), standing=self._standing(vehicle),
            )
            for vehicle in self.vehicles
        ]  # fmt: skip
        self.sensors = [stream(seed, "sensor", vehicle.id) for vehicle in self.vehicles]
        count = len(self.vehicles)
        if math.isinf(mission.radio_range):
            topology: Any = make_topology("complete", count)
        else:
            topology = RangeTopology(self._positions, communication_range=mission.radio_range)
        self.network = Network(topology, seed=seed, loss=loss, delay=delay, latency=STEP)
        self.alive = [True] * count
        self.arrivals: list[tuple[float, int, int, Broadcast]] = []
        self._count = self._messages = self._bytes = 0

    def _positions(self, now: float) -> np.ndarray:
        return np.array([(state.x, state.y, 0.0) for state in self.states])

    def _allocation(self, agent: str, roster: Any, centre: Centre) -> Allocation:
        if self.allocation == "central":
            return ByCentre(agent, centre)
        if self.allocation == "cbba":
            return ByConsensus(agent, roster, self._task_of)
        count = len(self.vehicles)
        return ByContract(
            agent,
            roster,
            reply_within=8.0 * STEP,
            heartbeat=max(10.0, float(count)),
            idle_every=max(4, count // 3),
        )

    def _standing(self, vehicle: Vehicle) -> Standing | None:
        if not self.mission.identify and self.mission.revisit <= 0.0:
            return None
        radius = vehicle.sensor.radius(vehicle.position[2])
        return Standing(self.mission, vehicle, radius, groups=self.allocation == "cbba")

    def _task_of(self, contact: Any) -> Any:
        return next(iter(self.behaviours)).task_of(contact)

    def go(self, writer: TraceWriter | None, progress: Callable[[float], None] | None) -> Sortie:
        """Fly until the mission's time is over."""
        watch = Watch(self.mission)
        steps = round(self.mission.duration / STEP)
        for step in range(steps + 1):
            self.now = step * STEP
            self._step(watch, writer)
            if progress is not None and step % 10 == 0:
                progress(self.now)
        measures = watch.measures(
            [one.flown for one in self.states], messages=self._messages, bytes=self._bytes,
            unserved=self._unserved(),
        )  # fmt: skip
        return Sortie(
            self.mission, self.strategy, self.allocation, self.seed, measures, self._messages, self._bytes,
            tuple(self.behaviours),
        )  # fmt: skip

    def _step(self, watch: Watch, writer: TraceWriter | None) -> None:
        now, xy = self.now, self.targets.xy
        told = writer is not None and now % POSE_EVERY == 0.0
        self._crash(writer)
        self._deliver()
        for row, behaviour in enumerate(self.behaviours):
            if not self.alive[row]:
                continue
            vehicle, state = self.vehicles[row], self.states[row]
            measured = np.empty((0, 2))
            if state.landed_until is None and now % vehicle.sensor.period == 0.0:
                seen = vehicle.sensor.glimpse(self.sensors[row], state.x, state.y, vehicle.position[2], xy)
                measured = seen.places()
            behaviour.sense(state, measured, now)
            for message in behaviour.tick(now):
                self._send(row, message, writer)
            for event in behaviour.events():
                truth = {}
                if isinstance(event, TargetFound):
                    truth = {"truth": watch.detected(now, event, xy)}
                elif isinstance(event, TargetServed):
                    watch.finished(event.x, event.y, xy)
                    continue
                elif isinstance(event, StandingDone):
                    watch.stood(now, event.x, event.y, self._equipment_at(event.x, event.y), xy)
                    continue
                if writer is not None:
                    record = EVENT_RECORDS[event.kind]
                    writer.write(record(t=now, agent=behaviour.id, **vars(event), **truth))
            if told:
                self._tell(row, writer)
        self._watch(watch, xy)
        if told and writer is not None:
            for target, (x, y) in zip(self.mission.targets, xy.tolist(), strict=True):
                writer.write(Truth(t=now, target=target.id, x=x, y=y))
        for row, behaviour in enumerate(self.behaviours):
            if self.alive[row]:
                self._move(row, behaviour)
        threats = np.array([(one.x, one.y) for one, up in zip(self.states, self.alive, strict=True) if up])
        self.targets.advance(STEP, self.mission.area, threats.reshape(-1, 2))

    def _equipment_at(self, x: float, y: float) -> frozenset[str]:
        """What the UAVs have with them that are at a place and busy there."""
        found: frozenset[str] = frozenset()
        for row, (vehicle, state) in enumerate(zip(self.vehicles, self.states, strict=True)):
            near = math.dist((x, y), (state.x, state.y)) <= vehicle.sensor.radius(vehicle.position[2])
            if near and self.alive[row] and self.behaviours[row].mode == "visit":
                found |= vehicle.equipment
        return found

    def _watch(self, watch: Watch, xy: np.ndarray) -> None:
        live = [one for one, up in zip(self.behaviours, self.alive, strict=True) if up]
        following = [
            one.contacts.known[one.following]
            for one in live
            if one.following is not None and one.mode == "track"
        ]
        view = [contact for one in live[:1] for contact in one.contacts.known.values()]
        watch.step(self.now, following, view, self._linked(), xy)

    def _linked(self) -> bool:
        station, reach = self.mission.ground_station, self.mission.radio_range
        if station is None:
            return True
        return any(
            up and math.dist(station, (one.x, one.y)) <= reach
            for one, up in zip(self.states, self.alive, strict=True)
        )

    def _move(self, row: int, behaviour: SearchTrack) -> None:
        vehicle, state, area = self.vehicles[row], self.states[row], self.mission.area
        if state.landed_until is not None:
            if take_off(vehicle, state, self.now):
                behaviour.refuelled()
        elif behaviour.mode == "return" and vehicle.base is not None:
            if at_base(vehicle, state):
                land(vehicle, state, self.now)
                behaviour.landed()
            else:
                fly_home(vehicle, state, area, STEP)
        else:
            goal = behaviour.goal
            if goal is not None and area.exclusions:
                goal = (area.route((state.x, state.y), area.nearest(goal)) or (goal,))[0]
            advance(vehicle, state, goal, STEP)

    def _crash(self, writer: TraceWriter | None) -> None:
        for row, vehicle in enumerate(self.vehicles):
            if self.alive[row] and self.crashes.get(vehicle.id, math.inf) <= self.now:
                self.alive[row] = False
                if writer is not None:
                    writer.write(Crashed(t=self.now, agent=vehicle.id))

    def _send(self, row: int, message: Broadcast, writer: TraceWriter | None) -> None:
        data = encode(message)
        self._messages += 1
        self._bytes += len(data)
        if self.through_bytes:
            message = decode(data)
        for arrival, receivers in self.network.deliveries(row, self.now):
            for receiver in receivers:
                self._count += 1
                heapq.heappush(self.arrivals, (arrival, self._count, receiver, message))
        if writer is not None:
            writer.write(
                Sent(
                    t=self.now, agent=self.vehicles[row].id, sequence=message.sequence,
                    entries=message.entries,
                    bytes=len(data), full=message.full, receivers=len(self.network.neighbours(row, self.now)),
                    lost=self.network.last_lost,
                )
            )  # fmt: skip

    def _deliver(self) -> None:
        while self.arrivals and self.arrivals[0][0] <= self.now:
            _, _, receiver, message = heapq.heappop(self.arrivals)
            if self.alive[receiver]:
                self.behaviours[receiver].receive(message, self.now)

    def _tell(self, row: int, writer: TraceWriter | None) -> None:
        assert writer is not None
        behaviour, state = self.behaviours[row], self.states[row]
        fuel = remaining(self.vehicles[row], state)
        writer.write(
            Pose(
                t=self.now, agent=behaviour.id, x=state.x, y=state.y, heading=state.heading,
                mode=behaviour.mode, fuel=fuel if math.isfinite(fuel) else 1e9,
            )
        )  # fmt: skip
        task = behaviour.following
        if task is not None and behaviour.mode == "track":
            one = behaviour.contacts.known[task]
            writer.write(
                Tracked(
                    t=self.now,
                    agent=behaviour.id,
                    task=task,
                    x=one.x,
                    y=one.y,
                    vx=one.vx,
                    vy=one.vy,
                    sigma=one.sigma,
                )
            )

    def _unserved(self) -> int:
        """Targets found that nobody has served, follows or is to serve, as the team knows at the end."""
        known: dict[str, bool] = {}
        for behaviour, up in zip(self.behaviours, self.alive, strict=True):
            for task, contact in behaviour.contacts.known.items():
                if up and not contact.over:
                    known[task] = known.get(task, False) or behaviour.allocation.served(task)
        return sum(not served for served in known.values())
