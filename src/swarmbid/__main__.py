"""``python -m swarmbid``."""

from __future__ import annotations

from swarmbid.cli import main

main()
