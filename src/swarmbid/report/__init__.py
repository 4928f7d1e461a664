"""One self-contained HTML page, and the picture of a map, from a mission and its plan.

Drawn by our own code as inline SVG: no plotting library, no script from elsewhere, nothing loaded.
"""

from __future__ import annotations

from swarmbid.report.map import render_map_svg
from swarmbid.report.page import render_report

__all__ = ["render_map_svg", "render_report"]
