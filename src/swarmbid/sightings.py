"""What became of the targets of a search mission, read from its trace: who found, bid, tracked, handed over.

Nothing is worked out again: every sentence stands on records of the trace, in their order.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import pairwise
from statistics import median
from typing import Any

from swarmbid.errors import Fault, InputError, did_you_mean
from swarmbid.trace import Act, Crashed, Detected, Ended, Pose, Stage, Trace, Tracked

ACCEPT, ANNOUNCE, BID = "accept-proposal", "cfp", "propose"
_PAUSE = 5.0
"""A track counts as interrupted by a silence of so many of its usual intervals."""


@dataclass(frozen=True)
class Moment:
    """One thing that happened to the task.

    Parameters
    ----------
    t : s. agent : id. kind : detection, announcement, bids, award, track, hand-over, end or other.
    what : a sentence without its subject.
    """

    t: float
    agent: str
    kind: str
    what: str


@dataclass(frozen=True)
class Spell:
    """A time for which one agent tracked the target without a pause; s."""

    agent: str
    begin: float
    end: float


@dataclass(frozen=True)
class Tender:
    """What an agent that was asked has answered.

    Parameters
    ----------
    t : s. bid : score units; None for a refusal. answer : awarded, rejected, refused, or open.
    reason : of the refusal or rejection.
    """

    t: float
    agent: str
    conversation: str
    bid: float | None
    answer: str
    reason: str


@dataclass(frozen=True)
class Life:
    """The records of one task, by kind and in order."""

    task: str
    detections: tuple[Detected, ...]
    acts: tuple[Act, ...]
    stages: tuple[Stage, ...]
    spells: tuple[Spell, ...]
    ended: Ended | None

    @property
    def target(self) -> str:
        """The true target behind it; empty for a false alarm, or if nobody detected it."""
        return next((one.truth for one in self.detections if one.truth), "")

    def first(self, performative: str) -> Act | None:
        """The first act of that kind."""
        return next((act for act in self.acts if act.performative == performative), None)


@dataclass(frozen=True)
class SearchExplanation:
    """The answer.

    Parameters
    ----------
    task : its id. target : the true target's; empty for a false alarm. found, outcome : sentences.
    history : in order of time. tenders : in order of time. spells : who tracked it when.
    untracked : s between the first and the last track without anybody.
    """

    task: str
    target: str
    found: str
    outcome: str
    history: tuple[Moment, ...]
    tenders: tuple[Tender, ...]
    spells: tuple[Spell, ...]
    untracked: float

    def to_dict(self) -> dict[str, Any]:
        """The same, ready for JSON."""
        return asdict(self)

    def __str__(self) -> str:
        lines = [f"{self.task}: {self.found}", self.outcome]
        lines += _block("What happened", [(f"{one.t:.6g} s", one.agent, one.what) for one in self.history])
        lines += _block(
            "Who bid what",
            [
                (f"{one.t:.6g} s", one.agent, " ".join(filter(None, (_offer(one), one.answer, one.reason))))
                for one in self.tenders
            ],
        )
        lines += _block(
            "Who tracked it",
            [(f"{one.begin:.6g} s", one.agent, f"until {one.end:.6g} s") for one in self.spells],
        )
        return "\n".join(lines)


def lives(trace: Trace) -> dict[str, Life]:
    """Return what the trace tells of each task, in order of first mention."""
    kept: dict[str, dict[type[Any], list[Any]]] = {}
    for record in trace.records:
        if isinstance(record, Detected | Act | Stage | Tracked | Ended):
            kept.setdefault(record.task, {}).setdefault(type(record), []).append(record)
    return {
        task: Life(
            task,
            tuple(found.get(Detected, ())),
            tuple(found.get(Act, ())),
            tuple(found.get(Stage, ())),
            _spells(found.get(Tracked, [])),
            next(iter(found.get(Ended, ())), None),
        )
        for task, found in kept.items()
    }


def explain_search(trace: Trace, task_id: str) -> SearchExplanation:
    """Explain what became of one task of a search mission.

    Parameters
    ----------
    trace : of the mission (`swarmbid.trace.read_trace`); one that was stopped will do.
    task_id : a task's, or a true target's, which stands for the task that lasted longest of it.

    Raises
    ------
    InputError : the trace mentions no such task or target.
    """
    life = life_of(trace, task_id)
    history = moments(trace, life)
    return SearchExplanation(
        task=life.task,
        target=life.target,
        found=_found(life),
        outcome=_outcome(life),
        history=history,
        tenders=_tenders(life),
        spells=life.spells,
        untracked=sum(max(0.0, after.begin - before.end) for before, after in pairwise(life.spells)),
    )


def life_of(trace: Trace, name: str) -> Life:
    """Return the life of the task, or of the true target's longest task, of that name.

    Raises
    ------
    InputError : the trace mentions no such task or target.
    """
    known = lives(trace)
    if name in known:
        return known[name]
    of_target = [life for life in known.values() if life.target == name and name]
    if of_target:
        return max(of_target, key=lambda life: sum(spell.end - spell.begin for spell in life.spells))
    mend = did_you_mean(name, known) or f"It has {len(known)} tasks: {', '.join(list(known)[:12])}."
    raise InputError([Fault(trace.source, "task", f"mentions no task or target {name!r}", mend)])


def moments(trace: Trace, life: Life) -> tuple[Moment, ...]:
    """Return all that happened to a task, in order of time."""
    told = [*_of_detections(life), *_of_acts(life), *_of_spells(trace, life)]
    if life.ended is not None:
        told.append(
            Moment(life.ended.t, life.ended.agent, "end", f"knows it to have ended: {_ending(life.ended)}")
        )
    return tuple(sorted(told, key=lambda one: one.t))


def key_moments(trace: Trace, life: Life) -> tuple[Moment, ...]:
    """Return the first moment of each kind that tells the story, at most one a kind, in order of time.

    Of a target that is handed over these are the detection, the announcement, the last bid before the
    award, the award, the first track and the first hand-over; and the end.
    """
    told = moments(trace, life)
    chosen: dict[str, Moment] = {}
    for one in told:
        if one.kind != "other":
            chosen.setdefault(one.kind, one)
    if "award" in chosen:
        bids = [one for one in told if one.kind == "bids" and one.t <= chosen["award"].t]
        if bids:
            chosen["bids"] = bids[-1]
    return tuple(sorted(chosen.values(), key=lambda one: one.t))


def _of_detections(life: Life) -> Iterator[Moment]:
    for number, one in enumerate(life.detections):
        kind = "moving" if one.moving else "static"
        evidence = f" ({one.evidence})" if one.evidence else ""
        verb = "finds it" if number == 0 else "confirms it"
        what = f"{verb} at {one.x:.0f}, {one.y:.0f} m and takes it for a {kind} target{evidence}"
        yield Moment(one.t, one.agent, "other" if number else "detection", what)


INFORMS = {"contracted": "has it under contract", "started": "begins"}
"""What a holder informs of; else it is the manager's word that the contract is in force."""


def _of_acts(life: Life) -> Iterator[Moment]:
    """Tell what was said; one announcement to many receivers at one time is one moment."""
    asked: dict[tuple[float, str, str], list[str]] = {}
    for act in life.acts:
        if act.performative == ANNOUNCE:
            asked.setdefault((act.t, act.agent, act.conversation), []).append(act.to)
    for (t, agent, _), receivers in asked.items():
        whom = ", ".join(one for one in receivers if one) or "everybody in reach"
        yield Moment(t, agent, "announcement", f"asks {whom} for proposals")
    for act in life.acts:
        if act.performative == ANNOUNCE:
            continue
        because = f" ({act.detail})" if act.detail.strip() else ""
        bid = "" if act.bid is None else f" {act.bid:.6g}"
        to = act.to or "everybody"
        kind, what = {
            BID: ("bids", f"bids{bid} to {to}{because}"),
            "refuse": ("other", f"refuses to {to}{because}"),
            ACCEPT: ("award", f"awards it to {to}{' for' + bid if bid else ''}{because}"),
            "reject-proposal": ("other", f"rejects the bid of {to}{because}"),
            "confirm": ("other", f"confirms to {to} that it takes it{because}"),
            "failure": ("other", f"tells {to} that it cannot{because}"),
            "cancel": ("other", f"calls it off with {to}{because}"),
            "inform-done": ("other", "says that it is done"),
            "inform": ("other", INFORMS.get(act.detail, f"puts the contract with {to} in force")),
        }.get(act.performative, ("other", f"says {act.performative} to {to}{because}"))
        if act.performative == ACCEPT and act.to == act.agent:
            what = f"takes it itself{' for' + bid if bid else ''}{because}"
        yield Moment(act.t, act.agent, kind, what)


def _of_spells(trace: Trace, life: Life) -> Iterator[Moment]:
    if life.spells:
        first = life.spells[0]
        yield Moment(first.begin, first.agent, "track", "begins to track it")
    for before, after in pairwise(life.spells):
        gap = after.begin - before.end
        lost = f", after {gap:.0f} s without anybody" if gap > 0.0 else ""
        if before.agent == after.agent:
            yield Moment(after.begin, after.agent, "other", f"tracks it again{lost}")
            continue
        why = _why_given_up(trace, life, before)
        yield Moment(
            after.begin, after.agent, "hand-over", f"takes the track over from {before.agent}{why}{lost}"
        )


def _why_given_up(trace: Trace, life: Life, spell: Spell) -> str:
    """Say why an agent ended its track, as far as the trace shows."""
    if any(one.agent == spell.agent and one.t <= spell.end + 60.0 for one in trace.of(Crashed)):
        return ", which crashed"
    said = [
        act.detail
        for act in life.acts
        if act.agent == spell.agent
        and act.performative == ANNOUNCE
        and act.detail
        and spell.begin < act.t <= spell.end
    ]
    if said:
        return f" ({said[-1]})"
    after = next((one for one in trace.of(Pose) if one.agent == spell.agent and one.t >= spell.end), None)
    if after is None:
        return ""
    going = {"return": " which flies home", "base": " which is at its base"}.get(after.mode, "")
    return f",{going} with fuel for {after.fuel:.0f} s" if going else ""


def _tenders(life: Life) -> tuple[Tender, ...]:
    """Pair each bid with the first answer that followed it in its conversation."""
    found = []
    for place, act in enumerate(life.acts):
        if act.performative == "refuse":
            found.append(Tender(act.t, act.agent, act.conversation, None, "refused", act.detail))
        elif act.performative == BID:
            reply = next(
                (
                    one
                    for one in life.acts[place + 1 :]
                    if one.to == act.agent
                    and one.conversation == act.conversation
                    and one.performative in (ACCEPT, "reject-proposal")
                ),
                None,
            )
            answer = "open" if reply is None else "awarded" if reply.performative == ACCEPT else "rejected"
            reason = "" if reply is None else reply.detail
            found.append(Tender(act.t, act.agent, act.conversation, act.bid, answer, reason))
    return tuple(found)


def _spells(records: list[Tracked]) -> tuple[Spell, ...]:
    by_agent: dict[str, list[float]] = {}
    for record in records:
        by_agent.setdefault(record.agent, []).append(record.t)
    found = []
    for agent, times in by_agent.items():
        steps = [after - before for before, after in pairwise(times) if after > before]
        longest = _PAUSE * median(steps) if steps else 0.0
        begin = last = times[0]
        for time in times[1:]:
            if time - last > longest:
                found.append(Spell(agent, begin, last))
                begin = time
            last = time
        found.append(Spell(agent, begin, last))
    return tuple(sorted(found, key=lambda one: (one.begin, one.end, one.agent)))


def _found(life: Life) -> str:
    if not life.detections:
        return "nobody reported a detection of it"
    one = life.detections[0]
    kind = "moving" if one.moving else "static"
    truth = f"it is {one.truth}" if one.truth else "it was a false alarm"
    return f"found by {one.agent} after {one.t:.6g} s, taken for a {kind} target; {truth}"


def _outcome(life: Life) -> str:
    parts = []
    won = [act for act in life.acts if act.performative == ACCEPT]
    if won:
        parts.append(f"Awarded to {won[0].to}" + "".join(f", then to {act.to}" for act in won[1:]) + ".")
    elif life.spells:
        parts.append(f"{life.spells[0].agent} took it without an award.")
    if life.spells:
        seconds = sum(spell.end - spell.begin for spell in life.spells)
        parts.append(f"Tracked for {seconds:.0f} s in all.")
    parts.append(
        f"It ended {_ending(life.ended)}." if life.ended else "It had not ended when the mission did."
    )
    return " ".join(parts)


def _ending(ended: Ended) -> str:
    by = f" by {ended.by}" if ended.by else ""
    return f"{ended.outcome}{by}" + (f" ({ended.reason})" if ended.reason else "")


def _offer(one: Tender) -> str:
    return "" if one.bid is None else f"{one.bid:.6g}:"


def _block(title: str, rows: list[tuple[str, str, str]]) -> list[str]:
    if not rows:
        return []
    wide = [max(len(row[column]) for row in rows) for column in (0, 1)]
    return ["", title, *(f"  {when:<{wide[0]}}  {who:<{wide[1]}}  {what}" for when, who, what in rows)]
