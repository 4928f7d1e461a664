"""Why a task went to whom it went: who bid, who won, who was outbid, and why the others did not bid.

What happened is read from the trace. What each agent could gain in the end is worked out again from the
mission and the final plan in plain Python, so that the answer does not depend on the negotiation.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from swarmbid.errors import Fault, InputError, did_you_mean
from swarmbid.model import Mission, Task
from swarmbid.plan import Plan
from swarmbid.scores import Score, make_score
from swarmbid.trace import Outbid, Quit, Released, Taken, Trace
from swarmbid.unserved import offers


@dataclass(frozen=True)
class Step:
    """One thing that happened to the task.

    Parameters
    ----------
    t : s. agent : id. what : a sentence without its subject.
    """

    t: float
    agent: str
    what: str


@dataclass(frozen=True)
class Other:
    """An agent that does not do the task.

    Parameters
    ----------
    agent : id. best_bid : the highest that it ever bid, score units; None if it never did.
    gain : what adding the task to its final path would gain; None if it cannot be added.
    why : a sentence.
    """

    agent: str
    best_bid: float | None
    gain: float | None
    why: str


@dataclass(frozen=True)
class Explanation:
    """The answer.

    Parameters
    ----------
    task : its id. needs : what it asks for, in words.
    winner : the agent's id, or its group's, joined by ", "; None if nobody does it.
    bid : the winning bid, the lowest of a group, score units. start : s, planned. outcome : a sentence.
    history : in order of time. others : in order of id. in_rounds : whether the run counted rounds.
    """

    task: str
    needs: str
    winner: str | None
    bid: float | None
    start: float | None
    outcome: str
    history: tuple[Step, ...]
    others: tuple[Other, ...]
    in_rounds: bool

    def to_dict(self) -> dict[str, Any]:
        """The same, ready for JSON."""
        return asdict(self)

    def __str__(self) -> str:
        lines = [f"{self.task}: {self.needs}", self.outcome]
        if self.history:
            lines += ["", "What happened"]
            when = [
                f"round {int(step.t) + 1}" if self.in_rounds else f"{step.t:.6g} s" for step in self.history
            ]
            width = max(map(len, when))
            lines += [
                f"  {time:<{width}}  {step.agent} {step.what}"
                for time, step in zip(when, self.history, strict=True)
            ]
        if self.others:
            lines += ["", "The others, given what they do in the end"]
            width = max(len(other.agent) for other in self.others)
            lines += [f"  {other.agent:<{width}}  {other.why}" for other in self.others]
        return "\n".join(lines)


def explain(trace: Trace, task_id: str, *, score: str | Score | None = None) -> Explanation:
    """Explain what became of one task.

    Parameters
    ----------
    trace : of a run that ended (`swarmbid.trace.read_trace`).
    score : what the agents bid by, if it is a user's own: a trace may come from anybody, so code that it
        names is not run. By default what the trace says.

    Raises
    ------
    InputError : there is no such task, the run did not end, or it needs `score`.
    """
    mission = trace.mission()
    tasks = {task.id: task for task in mission.tasks}
    if task_id not in tasks:
        mend = did_you_mean(task_id, tasks) or f"It has {len(tasks)} tasks; the plan lists them."
        raise InputError([Fault(trace.source, "task", f"has no task {task_id!r}", mend)])
    task = tasks[task_id]
    plan = Plan.from_dict(trace.finished().plan, where=trace.source)
    history = _history(trace, task_id)
    bids = _best_bids(trace, task_id)
    doers, start = _doers(plan, task)
    won = {doer: _last_bid(trace, task_id, doer) for doer in doers}
    bid = min((one for one in won.values() if one is not None), default=None)
    return Explanation(
        task=task_id,
        needs=_needs(task),
        winner=", ".join(doers) or None,
        bid=bid,
        start=start,
        outcome=_outcome(plan, task_id, won, start) + _doubt(trace),
        history=history,
        others=_others(mission, plan, trace, task, bids, bid, _score(trace, score)),
        in_rounds=trace.header.mode == "rounds",
    )


def _needs(task: Task) -> str:
    parts = [f"type {task.type}", f"reward {task.reward:g}"]
    if task.start > 0.0 or task.end != float("inf"):
        end = "" if task.end == float("inf") else f" to {task.end:g}"
        parts.append(f"start of service {task.start:g}{end} s" if end else f"not before {task.start:g} s")
    if task.duration:
        parts.append(f"{task.duration:g} s of service")
    if task.equipment:
        parts.append("needs " + ", ".join(sorted(task.equipment)))
    if task.is_group:
        parts.append(
            f"{task.agents_required} agents" if task.agents_required else "as many agents as bring that"
        )
    if task.prerequisites:
        parts.append("after " + ", ".join(task.prerequisites))
    return ", ".join(parts)


def _history(trace: Trace, task_id: str) -> tuple[Step, ...]:
    steps = []
    quit_at = (-1.0, "")
    for record in trace.records:
        if isinstance(record, Taken) and record.task == task_id:
            steps.append(
                Step(record.t, record.agent, f"bids {record.bid:.6g} (as stop {record.position + 1})")
            )
        elif isinstance(record, Outbid) and record.task == task_id:
            by = f"by {record.by} with {record.by_bid:.6g}"
            steps.append(Step(record.t, record.agent, f"is outbid {by} (had bid {record.bid:.6g})"))
        elif isinstance(record, Quit) and record.task == task_id:
            what = f"quits: with {record.filled} in it, its group is not complete"
            steps.append(Step(record.t, record.agent, what))
            quit_at = (record.t, record.agent)
        elif isinstance(record, Released) and record.task == task_id and (record.t, record.agent) != quit_at:
            because = f", having lost {record.because}" if record.because else " for a better bundle"
            steps.append(Step(record.t, record.agent, f"gives it up{because}"))
    return tuple(steps)


def _best_bids(trace: Trace, task_id: str) -> dict[str, float]:
    best: dict[str, float] = {}
    for record in trace.of(Taken):
        if record.task == task_id:
            best[record.agent] = max(record.bid, best.get(record.agent, record.bid))
    return best


def _last_bid(trace: Trace, task_id: str, doer: str) -> float | None:
    bids = [record.bid for record in trace.of(Taken) if record.task == task_id and record.agent == doer]
    return bids[-1] if bids else None


def _doers(plan: Plan, task: Task) -> tuple[list[str], float | None]:
    """Who does the task, in order of id, and from when on, s."""
    found = {one.agent: visit.start for one in plan.agents for visit in one.visits if visit.task == task.id}
    # Agents that did not agree may each mean to do it; one of them will.
    names = list(found) if task.is_group else list(found)[:1]
    return names, max((found[name] for name in names), default=None)


def _outcome(plan: Plan, task_id: str, won: dict[str, float | None], start: float | None) -> str:
    bids = [f"{bid:.6g}" for bid in won.values() if bid is not None]
    if len(won) == 1 and start is not None:
        because = f"; its bid of {bids[0]} won" if bids else ""
        return f"Done by {next(iter(won))}, from {start:.6g} s{because}."
    if won and start is not None:
        because = f"; their bids of {', '.join(bids)} won" if bids else ""
        return f"Done by {', '.join(won)} together, from {start:.6g} s{because}."
    for left in plan.unserved:
        if left.task == task_id:
            return f"Done by nobody ({left.reason}). {left.detail}"
    return "Done by nobody."


def _doubt(trace: Trace) -> str:
    result = trace.finished()
    return "" if result.status == "converged" else f" But the agents did not agree: {result.reason}."


def _others(
    mission: Mission,
    plan: Plan,
    trace: Trace,
    task: Task,
    bids: dict[str, float],
    won: float | None,
    score: Score,
) -> tuple[Other, ...]:
    tasks = {one.id: one for one in mission.tasks}
    paths = {one.agent: [(tasks[visit.task], visit.start) for visit in one.visits] for one in plan.agents}
    header = trace.header
    insertion = str(header.options.get("insertion", score.insertion))
    ceilings = _ceilings(trace, plan)
    found = []
    for offer in offers(mission, paths, score, task, algorithm=header.algorithm, insertion=insertion):
        why = offer.detail
        if offer.gain is not None and offer.gain <= 0.0:
            why += ": not worth a bid"
        elif offer.gain is not None and won is not None:
            why += _beside(offer.gain, won, ceilings.get(offer.agent, math.inf))
        best = bids.get(offer.agent)
        if best is not None:
            why += f"; it once bid {best:.6g}"
        found.append(Other(offer.agent, best, offer.gain, why))
    return tuple(found)


def _beside(gain: float, won: float, ceiling: float) -> str:
    """Compare what an agent could gain with the bid that won."""
    if math.isclose(gain, won, rel_tol=1e-9):
        return f", as much as the bid of {won:.6g}"
    if gain < won:
        return f", less than the bid of {won:.6g}"
    more = f", more than the bid of {won:.6g}"
    if ceiling <= won * (1.0 + 1e-9):
        more += f", but with what it has taken it may bid {ceiling:.6g} at most (bids never rise)"
    return more


def _ceilings(trace: Trace, plan: Plan) -> dict[str, float]:
    """The lowest bid in each agent's bundle, above which warped bids may not rise; empty without warp."""
    if not trace.header.options.get("warp", True):
        return {}
    bids = {(record.agent, record.task): record.bid for record in trace.of(Taken)}
    held = {
        one.agent: [bids.get((one.agent, visit.task), math.inf) for visit in one.visits]
        for one in plan.agents
    }
    return {agent: min(found, default=math.inf) for agent, found in held.items()}


def _score(trace: Trace, given: str | Score | None) -> Score:
    if given is not None:
        return make_score(given)
    options = dict(trace.header.score)
    name = options.pop("name", None)
    if not isinstance(name, str):
        mend = "Run it again: its first line must name the score."
        raise InputError([Fault(trace.source, "score", "has no name", mend)])
    if name == "custom" or name.endswith(".py"):
        source = options.get("source") or "FILE.py"
        mend = f"Give that score, if you trust it: --score {source}."
        raise InputError([Fault(trace.source, "score", "is somebody's own, which is not run unasked", mend)])
    return make_score(name, **options)
