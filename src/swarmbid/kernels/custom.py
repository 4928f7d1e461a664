"""Phase 1 compiled again with a user's own score in place of the coefficients.

The kernel source is the same: `build_bundle`, `path_state` and `evaluate` are rebuilt from their code
with other functions under the names `visit_value` and `timeless`. Nothing of it is cached on disk, for
Numba would keep it under the name of the original.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from types import FunctionType
from typing import Any

from numba import njit, typeof
from numba.core.errors import NumbaError

from swarmbid.arrays import VisitRecord
from swarmbid.errors import Fault, InputError
from swarmbid.kernels import bundle, insertion


@lru_cache(maxsize=16)
def phase_with(function: Callable[[VisitRecord], float]) -> Callable[..., Any]:
    """Return `build_bundle` for the score that `function` gives (some seconds, once).

    Raises
    ------
    InputError : the function does what cannot be compiled.
    """
    score = _compiled(function)

    @njit
    def visit_value(
        start, leg, cost, reward, decay, reference, peak, inverse_width, window_start, window_end, duration
    ):
        return score(
            VisitRecord(
                reward, decay, window_start, window_end, duration, peak, inverse_width, start, leg, cost
            )
        )

    @njit
    def timeless(decay, inverse_width):
        return False

    parts = {"visit_value": visit_value, "timeless": timeless}
    path_state = _rebuilt(insertion.path_state, parts)
    evaluate = _rebuilt(insertion.evaluate, parts)
    weigh = _rebuilt(bundle.weigh, {"evaluate": evaluate})
    return _rebuilt(bundle.build_bundle, {"path_state": path_state, "evaluate": evaluate, "weigh": weigh})


def _compiled(function: Callable[[VisitRecord], float]) -> Any:
    compiled = njit(function)
    if hasattr(compiled, "compile"):  # with the compiler off there is nothing to try
        try:
            compiled.compile((typeof(VisitRecord(*[0.0] * len(VisitRecord._fields))),))
        except NumbaError as error:
            source = Path(function.__code__.co_filename).name
            # The first line only says which step of the compiler failed.
            why = next((line.strip() for line in str(error).splitlines()[1:] if line.strip()), str(error))
            mend = "Use numbers, arithmetic and math only, and the fields of VisitRecord."
            raise InputError([Fault(f"score {source}", "", f"cannot be compiled: {why}", mend)]) from None
    return compiled


def _rebuilt(kernel: Any, parts: dict[str, Any]) -> Callable[..., Any]:
    plain = getattr(kernel, "py_func", kernel)  # with the compiler off a kernel is its own source
    function = FunctionType(plain.__code__, {**plain.__globals__, **parts}, plain.__name__)
    return njit(error_model="numpy")(function)
