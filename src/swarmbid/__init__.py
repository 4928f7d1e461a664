"""swarmbid: a team of robots divides its work among themselves, with no leader."""

from __future__ import annotations

__version__ = "0.1.0"
