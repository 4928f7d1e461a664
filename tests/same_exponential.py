"""One exponential for twin and kernel: the kernel's differs from `math.exp` in the last bit now and then.

A last bit decides between candidates that gain the same, and then all that follows is another story. That
exponential is judged by itself (`kernels/test_lanes.py`); with it, twin and kernel do the same arithmetic.
"""

from __future__ import annotations

import math
import types

import pytest

from swarmbid.kernels.lanes import exp_lane
from swarmbid.scores import revisit, time_discounted

SHARED = types.SimpleNamespace(**{**vars(math), "exp": lambda power: float(exp_lane(float(power)))})


def share_exponential(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let `Score.value`, which the twin asks, use the kernels' exponential."""
    for module in (time_discounted, revisit):
        monkeypatch.setattr(module, "math", SHARED)
