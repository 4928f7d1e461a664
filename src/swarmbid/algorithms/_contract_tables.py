"""The protocol as two tables: what a manager and a contractor do about whatever comes.

Sources: FIPA Contract Net Interaction Protocol (SC00029H); Smith 1980; Dymkou's slides, "Manager
statecharts" and "Potential contractors statecharts". Both tables are total: there is an entry for every
state and everything that may come, be it an act or something that the agent notices itself. What comes
is looked for in the order of `MANAGER_EVENTS` and `CONTRACTOR_EVENTS`, and the first of which the table
makes anything is acted upon; so an agent may be late, or hear twice, and does the same.
"""

from __future__ import annotations

Table = dict[tuple[str, str], tuple[str, str]]
"""(state, what came) -> (action, next state). The action "nothing" stays in the state."""

NOTHING = "nothing"
ENDINGS = {
    "over: done": "done",
    "over: cancelled": "cancelled",
    "over: failed": "failed",
    "over: unserved": "unserved",
}
"""What ends a task for good -> the last state."""

MANAGER_STATES = (
    "idle", "announced", "awarded", "contracted", "waiting", "unserved", "failed", "yielded", "done",
    "cancelled",
)  # fmt: skip
"""`unserved` and `failed` may be reopened while the task's window is open: somebody can do it after all."""

MANAGER_EVENTS = (
    *ENDINGS,  # inform-done, cancel or a last word: the task is over
    "rival",  # another manager's act of higher epoch, or earlier in the succession, was heard
    "claim",  # this agent takes over a task from another that has not started it
    "hand over",  # this agent holds it and looks for another
    "heir: unserved",
    "heir: failed",  # in charge of what the last manager had parked
    "in charge",  # found by this agent, or everybody before it in the succession is gone
    "holder",  # somebody says that it holds the task, or has started it, under an earlier epoch
    "outdated",  # an epoch was heard of that is higher than the agent's own
    "confirm",
    "failure",  # declined, withdrawn or given back, or failed in execution
    "contractor lost",
    "confirm_by passed",
    "take-over best",  # best for the team if this idle agent flies a bidder's whole path
    "own bid best",
    "proposals",  # all have answered or reply_by passed, and another's proposal is the best
    "kept",  # the holder found nobody for its hand-over
    "refusals",  # all have answered, all refuse
    "failures",  # so, and somebody has tried and failed
    "reply_by passed",  # nobody proposes, and not all have answered
    "can now",  # an agent that had refused proposes
    "latest start passed",
    "back-off over",
)

CONTRACTOR_STATES = (
    "idle", "proposed", "refused", "confirmed", "contracted", "started", "released", "failed", "done",
    "cancelled", "unserved",
)  # fmt: skip

CONTRACTOR_EVENTS = (
    *ENDINGS,
    "taken over",  # who the task was handed to has started it
    "awarded elsewhere",  # a contract or an award of higher epoch names another
    "contract",  # inform by the manager: in force
    "award stands",  # accept-proposal, and what the proposal rested on holds
    "award stale",  # accept-proposal, and it does not
    "start",
    "finish",
    "fail",
    "give back",  # cannot keep it, or hands it over before it has begun
    "can do",  # a call, or a path that changed: the task would gain something
    "cannot do",
)


def _total(states: tuple[str, ...], events: tuple[str, ...], rows: Table) -> Table:
    """Return a table with an entry for every pair: what is not named does nothing."""
    return {
        (state, event): rows.get((state, event), (NOTHING, state)) for state in states for event in events
    }


_OPEN = ("announced", "awarded", "contracted", "waiting", "unserved", "failed")
MANAGER: Table = _total(
    MANAGER_STATES,
    MANAGER_EVENTS,
    {
        **{
            (state, event): ("close", end)
            for state in ("idle", *_OPEN, "yielded")
            for event, end in ENDINGS.items()
        },
        **{(state, "rival"): ("withdraw", "yielded") for state in _OPEN},
        **{
            (state, "hand over"): ("announce", "announced")
            for state in ("idle", "contracted", "yielded", "unserved", "failed", "waiting")
        },
        **{
            (state, f"heir: {end}"): ("park", end)
            for state in ("idle", "yielded")
            for end in ("unserved", "failed")
        },
        ("idle", "in charge"): ("announce", "announced"),
        ("yielded", "in charge"): ("announce", "announced"),
        **{
            (state, "outdated"): ("reopen", "announced")
            for state in ("announced", "awarded", "waiting", "unserved", "failed")
        },
        ("contracted", "outdated"): ("lift", "contracted"),
        **{
            (state, "holder"): ("adopt", "contracted")
            for state in ("announced", "awarded", "contracted", "waiting", "unserved", "failed")
        },
        ("announced", "take-over best"): ("take_over", "contracted"),
        **{
            (state, "claim"): ("claim", "awarded")
            for state in ("idle", "contracted", "yielded", "waiting", "unserved", "failed")
        },
        ("announced", "own bid best"): ("take", "contracted"),
        ("announced", "proposals"): ("award", "awarded"),
        ("announced", "kept"): ("keep", "contracted"),
        ("announced", "refusals"): ("park", "unserved"),
        ("announced", "failures"): ("park", "failed"),
        ("announced", "reply_by passed"): ("back_off", "waiting"),
        ("announced", "latest start passed"): ("give_up", "unserved"),
        ("awarded", "confirm"): ("contract", "contracted"),
        ("awarded", "failure"): ("next_best", "announced"),
        ("awarded", "contractor lost"): ("next_best", "announced"),
        ("awarded", "confirm_by passed"): ("revoke", "announced"),
        ("contracted", "failure"): ("reopen", "announced"),
        ("contracted", "contractor lost"): ("reopen", "announced"),
        ("waiting", "can now"): ("resume", "announced"),
        ("waiting", "back-off over"): ("reopen", "announced"),
        ("waiting", "latest start passed"): ("give_up", "unserved"),
        ("unserved", "can now"): ("resume", "announced"),
        ("unserved", "latest start passed"): ("give_up", "unserved"),
        ("failed", "can now"): ("resume", "announced"),
        ("failed", "latest start passed"): ("give_up", "failed"),
    },
)

_UNBOUND = ("idle", "proposed", "refused", "released", "failed")

CONTRACTOR: Table = _total(
    CONTRACTOR_STATES,
    CONTRACTOR_EVENTS,
    {
        **{
            (state, event): ("close", end)
            for state in CONTRACTOR_STATES
            if state not in ("done", "cancelled", "unserved")
            for event, end in ENDINGS.items()
        },
        ("proposed", "awarded elsewhere"): ("drop", "idle"),
        ("started", "taken over"): ("hand_over", "released"),
        ("confirmed", "awarded elsewhere"): ("release", "released"),
        ("contracted", "awarded elsewhere"): ("release", "released"),
        **{(state, "contract"): ("take", "contracted") for state in ("confirmed", *_UNBOUND)},
        ("contracted", "contract"): ("renew", "contracted"),
        ("started", "contract"): ("renew", "started"),
        **{(state, "award stands"): ("confirm", "confirmed") for state in ("confirmed", *_UNBOUND)},
        **{(state, "award stale"): ("decline", "released") for state in _UNBOUND},
        ("contracted", "start"): ("start", "started"),
        ("started", "finish"): ("finish", "done"),
        ("contracted", "fail"): ("fail", "failed"),
        ("started", "fail"): ("fail", "failed"),
        ("confirmed", "give back"): ("give_back", "released"),
        ("contracted", "give back"): ("give_back", "released"),
        ("started", "give back"): ("give_back", "released"),
        **{(state, "can do"): ("propose", "proposed") for state in _UNBOUND},
        **{(state, "cannot do"): ("refuse", "refused") for state in _UNBOUND if state != "failed"},
        ("failed", "cannot do"): ("refuse", "failed"),
    },
)
