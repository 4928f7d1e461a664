"""Means, Welch's t, ratios with intervals: what stands between a sample and a sentence."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swarmbid.arrays import FloatArray
from swarmbid.rng import stream

RESAMPLES = 2000
COVERAGE = 0.95


@dataclass(frozen=True)
class Level:
    """Mean, standard deviation (n - 1) and size of a sample; nan where it is too small."""

    mean: float
    sd: float
    count: int

    @classmethod
    def of(cls, sample: Sequence[float] | FloatArray) -> Level:
        """Summarise a sample."""
        values = np.asarray(sample, dtype=np.float64)
        if values.size == 0:
            return cls(math.nan, math.nan, 0)
        sd = float(values.std(ddof=1)) if values.size > 1 else math.nan
        return cls(float(values.mean()), sd, int(values.size))


@dataclass(frozen=True)
class Effect:
    """How much one sample differs from another.

    Parameters
    ----------
    ratio : of the means. low, high : its interval, `COVERAGE` wide.
    size : difference of the means in pooled standard deviations (Cohen's d).
    p : of Welch's two-sided t test.
    count : the smaller of the two samples' sizes.
    """

    ratio: float
    low: float
    high: float
    size: float
    p: float
    count: int


def effect(of: FloatArray, against: FloatArray, seed: int, *names: str) -> Effect:
    """Compare two samples; the interval is bootstrapped from the stream called `names`."""
    first, second = Level.of(of), Level.of(against)
    count = min(first.count, second.count)
    if count < 2 or second.mean == 0.0:
        return Effect(math.nan, math.nan, math.nan, math.nan, math.nan, count)
    rng = stream(seed, "hunt2014", "bootstrap", *names)
    tops = of[rng.integers(of.size, size=(RESAMPLES, of.size))].mean(axis=1)
    bottoms = against[rng.integers(against.size, size=(RESAMPLES, against.size))].mean(axis=1)
    tail = 50.0 * (1.0 - COVERAGE)
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = np.percentile(tops / bottoms, [tail, 100.0 - tail])
    return Effect(
        ratio=first.mean / second.mean,
        low=float(low),
        high=float(high),
        size=_cohen(first, second),
        p=_welch(first, second),
        count=count,
    )


def stated_effect(first: Level, second: Level) -> Effect:
    """The same from what a paper states: means and standard deviations of normal samples."""
    ratio = first.mean / second.mean
    # By the delta method, the logarithm of a ratio of means has this standard deviation.
    spread = math.sqrt(
        (first.sd / first.mean) ** 2 / first.count + (second.sd / second.mean) ** 2 / second.count
    )
    reach = math.exp(1.959964 * spread)
    return Effect(
        ratio=ratio,
        low=ratio / reach,
        high=ratio * reach,
        size=_cohen(first, second),
        p=_welch(first, second),
        count=min(first.count, second.count),
    )


def _cohen(first: Level, second: Level) -> float:
    pooled = math.sqrt((first.sd**2 + second.sd**2) / 2.0)
    return (first.mean - second.mean) / pooled if pooled > 0.0 else math.nan


def _welch(first: Level, second: Level) -> float:
    from scipy.stats import ttest_ind_from_stats

    if first.sd == 0.0 and second.sd == 0.0:  # no spread at all: equal or not, there is no doubt
        return 1.0 if first.mean == second.mean else 0.0
    found = ttest_ind_from_stats(
        first.mean, first.sd, first.count, second.mean, second.sd, second.count, equal_var=False
    )
    return float(found.pvalue)


VERDICTS = {
    "as reported": "significant the way the paper says; where it states a size, the intervals meet",
    "same direction": "significant the way the paper says, but of another size",
    "not significant": "no difference that these runs can tell from chance",
    "opposite": "significant the other way",
    "not measured": "fewer than two runs that count",
}
"""Verdict -> what it means."""


def verdict(found: Effect, says: str, level: float, stated: Effect | None = None, within: float = 1.0) -> str:
    """Judge an effect against the paper's statement; a key of `VERDICTS`.

    Parameters
    ----------
    says : ``"less"``, ``"more"`` or ``"similar"``. level : of significance.
    stated : the size that the paper states. within : the factor that still counts as similar.
    """
    if math.isnan(found.ratio) or math.isnan(found.p):
        return "not measured"
    if says == "similar":
        if found.low >= 1.0 / within and found.high <= within:
            return "as reported"
        return "opposite" if found.low > within or found.high < 1.0 / within else "not significant"
    if not found.p < level:
        return "not significant"
    if (found.ratio < 1.0) != (says == "less"):
        return "opposite"
    if stated is not None and (found.low > stated.high or found.high < stated.low):
        return "same direction"
    return "as reported"
