"""The page of the documentation."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from swarmbid.experiments.dymkou2019 import Reproduction

_HEAD = """# Dymkou's slides

The slides "Distributed tasking problem for track and search" show two results as pictures: the paths of a
simulation, and seven UAVs that divide seven locations among themselves without conflict. **They state no
numbers, and neither the positions nor the parameters behind the pictures.** So no number below confirms
or contradicts one of theirs. The setting is that of the author's public sample code; the drawings of
positions are ours; what is judged is judged against the exact optimum.
"""

_SIMULATION = """## Simulation

![Paths in x, y and time](images/dymkou2019-1.svg)

2 QUAD and 3 CAR, 3 TRACK and 4 RESCUE tasks, ±30 m, 2 m/s, fuel 1 a metre, value 100 that fades with
0.1 1/s, 600 s of service, starts even over 1009 s; CBBA on the complete graph. A vertical bar is the
window in which service may start; thin lines travel and wait, thick lines are service. Our reading of the
sample: z, drawn from -10 m to -2 m there, counts downwards, so tasks lie 2 m to 10 m up.
"""

_ASSIGNMENT = """## Self-assignment

![Who goes where, and the share of the optimum](images/dymkou2019-2.svg)

7 UAVs and 7 locations, one each, reward 100 less a point a metre, on the complete graph. The optimum is
exact: every assignment is in the reach of the solver. An auction by the highest bid is greedy, so that it
is conflict-free is guaranteed, that it is optimal is not.
"""


def page(found: Reproduction) -> str:
    """Write the page, in Markdown."""
    again = (
        f"swarmbid reproduce dymkou2019 --runs {found.runs} --seed {found.seed} --write docs/dymkou2019.md"
    )
    parts = [_HEAD, f"    {again}\n"]
    if found.flown is not None:
        parts += [_SIMULATION, _markdown(*found.figure_table(1))]
    if found.assigned:
        parts += [_ASSIGNMENT, f"Over {found.runs} missions:\n", _markdown(*found.table())]
    return "\n".join(parts)


def _markdown(headings: list[str], rows: list[list[str]]) -> str:
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"
