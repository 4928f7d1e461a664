"""The reproduction of the pictures of Dymkou's slides."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from swarmbid.errors import InputError
from swarmbid.experiments import dymkou2019
from swarmbid.experiments.dymkou2019 import Reproduction
from swarmbid.references.optimum import optimum
from swarmbid.scenarios import dymkou2019 as scenario
from swarmbid.scores import make_score


@pytest.fixture(scope="module")
def quick() -> Reproduction:
    return dymkou2019.run(quick=True, runs=3)


def test_every_uav_ends_at_a_location_of_its_own(quick: Reproduction) -> None:
    """Slides, "Simulation": self-assignment without conflict."""
    assert quick.problems() == []
    for outcomes in quick.assigned.values():
        assert len(outcomes) == 3
        for one in outcomes:
            assert len(set(one.places.values())) == 7
            assert one.share <= 1.0 + 1e-9


def test_optimum_agrees_with_the_hungarian_method() -> None:
    from scipy.optimize import linear_sum_assignment

    for seed in range(3):
        mission = scenario.make(seed, agents=7, tasks=7, self_assignment=True)
        gains = [
            [100.0 - float(np.linalg.norm(np.subtract(a.position, t.position))) for t in mission.tasks]
            for a in mission.agents
        ]
        rows, columns = linear_sum_assignment(gains, maximize=True)
        best = float(np.asarray(gains)[rows, columns].sum())
        assert optimum(mission, make_score("distance_cost")).value == pytest.approx(best)


def test_single_item_cbba_is_cbaa(quick: Reproduction) -> None:
    """Choi 2009: with bundles of one, CBBA is CBAA."""
    shares = {name: [one.share for one in found] for name, found in quick.assigned.items()}
    assert shares["cbaa"] == pytest.approx(shares["cbba"])


def test_conflicts_and_miracles_are_problems(quick: Reproduction) -> None:
    broken = [replace(one, conflict_free=False, share=1.2) for one in quick.assigned["cbba"]]
    told = replace(quick, assigned={"cbba": broken}).problems()
    assert told == [
        "cbba: 3 of 3 runs gave a location to two or to none",
        "cbba: 3 of 3 runs scored above the optimum",
    ]


def test_pictures_have_the_same_bytes_each_time(quick: Reproduction) -> None:
    pictures = quick.pictures()
    assert set(pictures) == {"dymkou2019-1.svg", "dymkou2019-2.svg"}
    assert pictures == quick.pictures()


def test_page_admits_that_the_slides_state_no_numbers(quick: Reproduction) -> None:
    page = quick.page()
    assert "state no\nnumbers" in page
    assert "images/dymkou2019-1.svg" in page
    assert "| contract_net |" in page


def test_numbers_are_json_ready_and_follow_from_the_seed(quick: Reproduction) -> None:
    data = json.dumps(quick.to_dict())
    assert json.loads(data)["runs"] == 3
    assert data == json.dumps(dymkou2019.run(quick=True, runs=3).to_dict())


def test_single_figures_and_bad_ones() -> None:
    only = dymkou2019.run(figures=[1])
    assert only.assigned == {}
    assert only.figure_table(1)[1]
    with pytest.raises(InputError, match="figure"):
        dymkou2019.run(figures=[3])
    with pytest.raises(InputError, match="runs"):
        dymkou2019.run(runs=0)
