"""Compiled code: arrays in, arrays out; no ids, no objects, no callbacks.

Each module runs unchanged with ``NUMBA_DISABLE_JIT=1``, so that coverage and a debugger see inside.
"""

from __future__ import annotations
