"""Names on the map: each goes where it covers nothing, or nowhere."""

from __future__ import annotations

import math
from collections.abc import Iterator

_CELL = 40.0


class LabelPlacer:
    """Finds free room for labels, first come, first served.

    Parameters
    ----------
    width, height : px of the drawing; labels stay inside.
    """

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = width, height
        # Taken boxes by cell, so that a crowded map costs no quadratic time.
        self._cells: dict[tuple[int, int], list[tuple[float, float, float, float]]] = {}
        self._lines: dict[tuple[int, int], list[tuple[float, float]]] = {}

    def block(self, left: float, top: float, right: float, bottom: float) -> None:
        """Keep labels out of a box."""
        for cell in self._covered(left, top, right, bottom):
            self._cells.setdefault(cell, []).append((left, top, right, bottom))

    def avoid(self, x1: float, y1: float, x2: float, y2: float) -> None:
        """Keep labels off a straight line where they have a choice."""
        pieces = max(1, math.ceil(math.hypot(x2 - x1, y2 - y1) / 5.0))
        for piece in range(pieces + 1):
            x, y = x1 + (x2 - x1) * piece / pieces, y1 + (y2 - y1) * piece / pieces
            self._lines.setdefault((int(x // _CELL), int(y // _CELL)), []).append((x, y))

    def place(self, x: float, y: float, room: float, width: float, size: float) -> tuple[float, float] | None:
        """Find a place for a label beside a point, and take it.

        Parameters
        ----------
        x, y : px, the point.
        room : px that the point's own marker reaches out.
        width, size : px, the text's length and font size.

        Returns
        -------
        Left end of the text's baseline, px; None where everything near is taken.
        """
        gap = room + 4.0
        rise = size * 0.36
        spots = (
            (x + gap, y + rise),
            (x - gap - width, y + rise),
            (x - width / 2, y - gap - 1.0),
            (x - width / 2, y + gap + size * 0.8),
            (x + gap * 0.75, y - gap * 0.75),
            (x + gap * 0.75, y + gap * 0.75 + size * 0.7),
            (x - gap * 0.75 - width, y - gap * 0.75),
            (x - gap * 0.75 - width, y + gap * 0.75 + size * 0.7),
        )
        boxes = [(left, base - size * 0.8, left + width, base + size * 0.25) for left, base in spots]
        free = [place for place, box in enumerate(boxes) if self._free(*box)]
        if not free:
            return None
        # The first of those that cover least of the lines.
        best = min(free, key=lambda place: (self._covers(*boxes[place]), place))
        self.block(*boxes[best])
        return spots[best]

    def _covers(self, left: float, top: float, right: float, bottom: float) -> int:
        return sum(
            left < x < right and top < y < bottom
            for cell in self._covered(left, top, right, bottom)
            for x, y in self._lines.get(cell, ())
        )

    def _free(self, left: float, top: float, right: float, bottom: float) -> bool:
        if left < 2.0 or top < 2.0 or right > self.width - 2.0 or bottom > self.height - 2.0:
            return False
        return not any(
            left < other[2] and other[0] < right and top < other[3] and other[1] < bottom
            for cell in self._covered(left, top, right, bottom)
            for other in self._cells.get(cell, ())
        )

    @staticmethod
    def _covered(left: float, top: float, right: float, bottom: float) -> Iterator[tuple[int, int]]:
        for column in range(int(left // _CELL), int(right // _CELL) + 1):
            for row in range(int(top // _CELL), int(bottom // _CELL) + 1):
                yield column, row
