"""Streams are reproducible and apart."""

from __future__ import annotations

import pytest

from swarmbid.rng import stream


def test_stream_is_pinned():
    """The first numbers never change, on any machine: traces depend on it."""
    assert stream(7, "network", 3).integers(0, 10**9, 3).tolist() == PINNED


def test_names_are_not_concatenated():
    assert stream(7, "a", "b").random() != stream(7, "ab").random()


def test_negative_seed_is_refused():
    with pytest.raises(ValueError, match="seed must be >= 0"):
        stream(-1)


PINNED = [68815443, 333219437, 76485512]
