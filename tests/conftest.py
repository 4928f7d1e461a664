"""What every test shares: the hypothesis profile, the way to longer runs and `--rewrite`."""

from __future__ import annotations

import os

import pytest
from hypothesis import HealthCheck, settings

# SWARMBID_TEST_EFFORT=20 runs twenty times as many examples and seeds as a plain `make test`.
EFFORT = max(1, int(os.environ.get("SWARMBID_TEST_EFFORT", "1")))

settings.register_profile(
    "swarmbid",
    derandomize=True,  # the same examples on every machine: a red test is red for everybody
    deadline=None,
    max_examples=60 * EFFORT,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
settings.load_profile("swarmbid")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--rewrite",
        action="store_true",
        help="write what the golden conversations really say; read the diff before you commit it",
    )


@pytest.fixture
def rewrite(request: pytest.FixtureRequest) -> bool:
    """Whether golden files are to be written instead of compared."""
    return bool(request.config.getoption("--rewrite"))


@pytest.fixture
def effort() -> int:
    """How many times the usual number of seeds a test should run."""
    return EFFORT
