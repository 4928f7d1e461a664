"""One self-contained HTML page, and the picture of a map, from a mission and its plan.

Drawn by our own code as inline SVG: no plotting library, no script from elsewhere, nothing loaded.
"""

from __future__ import annotations

from swarmbid.report.map import render_map_svg
from swarmbid.report.page import render_report
from swarmbid.report.search_film import render_film_strip
from swarmbid.report.search_page import render_search_report

__all__ = ["render_film_strip", "render_map_svg", "render_report", "render_search_report"]
