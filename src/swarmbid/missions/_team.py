"""What one UAV knows of the others of its team, and what it tells them: surveys in and out."""

from __future__ import annotations

import math

import numpy as np

from swarmbid.messages import Survey
from swarmbid.messages.survey import Status
from swarmbid.missions._contacts import Contacts
from swarmbid.world.glimpses import GlimpseBatch, GlimpseLog
from swarmbid.world.mission import SearchMission

SURVEY_EVERY = 3.0
"""s between two surveys of one UAV, at least; 0.4 s for each UAV of a larger team."""
MOST_GLIMPSES = 400
"""Glimpses in one message."""

Point = tuple[float, float]


class Team:
    """The statuses of all, who is lost, and who lacks which glimpses.

    Parameters
    ----------
    agent : whose view it is. patience : s without any news of a UAV after which it counts as lost.

    Attributes
    ----------
    statuses : the newest known of each UAV. lost : who counts as lost.
    """

    def __init__(self, agent: str, mission: SearchMission, patience: float) -> None:
        self.agent = agent
        self.patience = patience
        self.roster = {one.id: one.position[:2] for one in mission.vehicles}
        self.survey_every = max(SURVEY_EVERY, 0.4 * len(self.roster))
        self.lost: set[str] = set()
        self.statuses: dict[str, Status] = {}
        self._known_of: dict[str, dict[str, int]] = {}
        self._settled: dict[str, int] = {}
        self._settling: dict[str, int] = {}
        self._sequence = 0
        self._spoke_at = self._full_at = -math.inf

    def hear(self, survey: Survey) -> GlimpseBatch | None:
        """Take in what another knows of all; return its glimpses, None if it is not of the team."""
        if survey.sender not in self.roster or survey.sender == self.agent:
            return None
        for status in survey.statuses:
            if status.agent in self.roster:
                self.note(status)
        self._known_of[survey.sender] = dict(zip(survey.known_agents, survey.known.tolist(), strict=True))
        t, x, y = survey.glimpses
        return GlimpseBatch(survey.agents, survey.first, survey.counts, t, x, y, survey.floors)

    def note(self, status: Status) -> None:
        """Take in what one does; what it said later counts."""
        mine = self.statuses.get(status.agent)
        if mine is None or status.t > mine.t:
            self.statuses[status.agent] = status

    def newly_lost(self, now: float) -> list[str]:
        """Return who has been silent for too long since the last call."""
        found = []
        for name in self.roster:
            status = self.statuses.get(name)
            silent = now - (status.t if status is not None else 0.0)
            if name == self.agent or silent <= self.patience:
                self.lost.discard(name)
            elif name not in self.lost:
                self.lost.add(name)
                found.append(name)
        return found

    def searchers(self) -> dict[str, Point]:
        """Return where the others are that search, in order of the roster."""
        found: dict[str, Point] = {}
        for name, place in self.roster.items():
            status = self.statuses.get(name)
            if name == self.agent or name in self.lost:
                continue
            if status is None:  # not heard yet: it starts from where everybody knows it to be
                found[name] = place
            elif status.mode == "search":
                found[name] = (status.x, status.y)
        return found

    def survey(self, now: float, contacts: Contacts, log: GlimpseLog) -> Survey | None:
        """Return what to tell, None if it is not time."""
        if now - self._spoke_at < self.survey_every:
            return None
        self._spoke_at = now
        self._sequence += 1
        known = log.known()
        heard = [self._known_of[name] for name in sorted(self._known_of) if name not in self.lost]
        # What was heard lately the others are hearing too: only who still lacks it is told again.
        behind = dict(known)
        for name in known:
            least = min((one.get(name, 0) for one in heard), default=0)
            if name == self.agent or least < self._settled.get(name, 0):
                behind[name] = least
        self._settled, self._settling = self._settling, known
        batch = log.missing(behind, MOST_GLIMPSES)
        everything = now - self._full_at >= 10.0 * self.survey_every
        if everything:
            self._full_at = now
        told = tuple(
            one
            for name, one in sorted(contacts.known.items())
            if everything or now - contacts.changed[name] <= 4.0 * self.survey_every
        )
        return Survey(
            sender=self.agent,
            sequence=self._sequence,
            statuses=tuple(self.statuses[name] for name in sorted(self.statuses)),
            contacts=told,
            agents=batch.agents,
            first=batch.first,
            counts=batch.counts,
            floors=batch.floors,
            glimpses=np.stack([batch.t, batch.x, batch.y]),
            known_agents=tuple(known),
            known=np.array(list(known.values()), np.int64),
        )
