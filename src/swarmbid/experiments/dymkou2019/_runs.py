"""The runs: one of the sample's setting, and self-assignment by each algorithm beside the optimum."""

from __future__ import annotations

from dataclasses import dataclass

from swarmbid.references.optimum import optimum
from swarmbid.scenarios import dymkou2019
from swarmbid.scores import make_score
from swarmbid.simulator import Run, simulate

ALGORITHMS = ("cbaa", "cbba", "contract_net")
UAVS = 7
PLAN_SCORE = "time_discounted"
"""The slides' score: value that fades, less fuel."""
PLACE_SCORE = "distance_cost"


@dataclass(frozen=True)
class Assigned:
    """How one algorithm divided the locations of one mission.

    Parameters
    ----------
    seed : of the mission. share : of the optimum's score. places : UAV -> location.
    conflict_free : whether every location has one UAV and every UAV one location.
    """

    seed: int
    settled: bool
    share: float
    conflict_free: bool
    rounds: int
    messages: int
    bytes: int
    places: dict[str, str]


def fly(seed: int) -> Run:
    """Run CBBA on the sample's setting."""
    return simulate(dymkou2019.make(seed), algorithm="cbba", score=PLAN_SCORE)


def assign(seed: int) -> dict[str, Assigned]:
    """Let each algorithm divide the locations of one mission; on the complete graph."""
    mission = dymkou2019.make(seed, agents=UAVS, tasks=UAVS, self_assignment=True)
    best = optimum(mission, make_score(PLACE_SCORE)).value
    found = {}
    for name in ALGORITHMS:
        run = simulate(mission, algorithm=name, score=PLACE_SCORE)
        places = {agent: path[0][0] for agent, path in run.paths.items() if path}
        found[name] = Assigned(
            seed=seed,
            settled=run.converged,
            share=run.plan.total_score / best,
            conflict_free=len(places) == len(set(places.values())) == UAVS,
            rounds=run.rounds,
            messages=run.messages,
            bytes=run.bytes,
            places=places,
        )
    return found
