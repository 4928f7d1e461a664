"""The separation procedure: known static targets into subgroups (Dymkou's slides, "Separation procedure").

With as many subgroups as there were targets before the new ones, no more UAVs are engaged than before.
Subgroups are compact and of equal size but for one: k-means with bounds on the sizes of the clusters,
by the library k-means-constrained (Bradley, Bennett and Demiriz 2000), from the old targets as first centres.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swarmbid.errors import Fault, InputError

Point = tuple[float, float]


@dataclass(frozen=True)
class Subgroup:
    """Targets that one UAV is to visit in turn.

    Parameters
    ----------
    targets : ids, old ones first, each in the order given. centre : m.
    """

    targets: tuple[str, ...]
    centre: Point


def number_of_subgroups(old: int, new: int) -> int:
    """Total static targets less the new ones, but at least one."""
    if old < 0 or new < 1:
        raise ValueError(f"{old} old and {new} new targets cannot be separated; give 0 or more, 1 or more")
    return max(old, 1)


def separate(old: Sequence[tuple[str, Point]], new: Sequence[tuple[str, Point]]) -> tuple[Subgroup, ...]:
    """Divide all known static targets into subgroups.

    Parameters
    ----------
    old, new : (id, (x, y) in m): those that were known, and those just found; at least one new.

    Returns
    -------
    As many subgroups as there are old targets, at least one, in the order of their first target.

    Raises
    ------
    InputError : the library is not installed.
    """
    groups = number_of_subgroups(len(old), len(new))
    ids = [name for name, _ in (*old, *new)]
    places = np.array([place for _, place in (*old, *new)], dtype=np.float64)
    labels = _clustered(places, groups, len(old)) if groups > 1 else np.zeros(len(ids), np.int64)
    found = []
    for label in dict.fromkeys(labels.tolist()):
        rows = np.flatnonzero(labels == label)
        x, y = places[rows].mean(axis=0).tolist()
        found.append(Subgroup(tuple(ids[row] for row in rows.tolist()), (x, y)))
    return tuple(found)


def _clustered(places: np.ndarray, groups: int, old: int) -> np.ndarray:
    try:
        from k_means_constrained import KMeansConstrained
    except ImportError:
        mend = "Install it: pip install 'swarmbid[search]'."
        raise InputError([Fault("separation", "", "needs the library k-means-constrained", mend)]) from None
    size = len(places)
    if len(np.unique(places, axis=0)) < groups:  # clusters of equal places have no centres to tell apart
        return np.arange(size) % groups
    model = KMeansConstrained(
        n_clusters=groups,
        size_min=size // groups,
        size_max=math.ceil(size / groups),
        init=places[:old] - places.mean(axis=0),
        n_init=1,
        random_state=0,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found: np.ndarray = np.asarray(model.fit_predict(places - places.mean(axis=0)), np.int64)
    return found
