"""The conformance suite: does an algorithm, or a score, keep its contract?

Give it your class. It raises one `ConformanceError` that says what did not hold, and what to look for:

    from swarmbid.testing import check_negotiator, check_score

    def test_my_algorithm_keeps_the_contract():
        check_negotiator(MyAlgorithm)

    def test_my_score_keeps_its_word():
        check_score(MyScore(weight=2.0))

Each check can also be run by itself: ``for check in NEGOTIATOR_CHECKS: check(MyAlgorithm)``.
"""

from __future__ import annotations

from swarmbid.scores import Score
from swarmbid.testing._commands import CHECKS as _COMMANDS
from swarmbid.testing._negotiators import CHECKS as _CONVERSATION
from swarmbid.testing._scores import CHECKS as _SCORES
from swarmbid.testing._team import Check, ConformanceError, Failure, Make, run_all

__all__ = [
    "NEGOTIATOR_CHECKS",
    "SCORE_CHECKS",
    "Check",
    "ConformanceError",
    "Failure",
    "Make",
    "check_negotiator",
    "check_score",
]

NEGOTIATOR_CHECKS: tuple[Check, ...] = (*_CONVERSATION, *_COMMANDS)
"""What `check_negotiator` runs, in order."""
SCORE_CHECKS: tuple[Check, ...] = _SCORES
"""What `check_score` runs, in order."""


def check_negotiator(make: Make) -> None:
    """Run every check of the contract `swarmbid.negotiator.Negotiator`; about ten seconds.

    Parameters
    ----------
    make : called with an agent's id and a mission; the class itself will do.

    Raises
    ------
    ConformanceError : with everything that did not hold.
    """
    run_all(NEGOTIATOR_CHECKS, make)


def check_score(score: Score) -> None:
    """Check that what a score says in words, in numbers and about itself is the same.

    Parameters
    ----------
    score : with the parameters to be tested.

    Raises
    ------
    ConformanceError : with everything that did not hold.
    """
    run_all(SCORE_CHECKS, score)
