"""swarmbid: a team of robots divides its work among themselves, with no leader.

>>> from swarmbid import Agent, Mission, Task, simulate
>>> mission = Mission(
...     agents=(Agent(id="uav1", position=(0, 0, 0)), Agent(id="uav2", position=(90, 0, 0))),
...     tasks=(
...         Task(id="mast", position=(10, 0, 0), discount=0.01),
...         Task(id="roof", position=(80, 0, 0), discount=0.01),
...     ),
... )
>>> simulate(mission).paths
{'uav1': [('mast', 10.0)], 'uav2': [('roof', 10.0)]}

The names below are imported when they are first used, so that `import swarmbid` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from swarmbid.errors import InputError as InputError
    from swarmbid.errors import SwarmbidError as SwarmbidError
    from swarmbid.missionfile import load_mission as load_mission
    from swarmbid.model import Agent as Agent
    from swarmbid.model import Mission as Mission
    from swarmbid.model import Origin as Origin
    from swarmbid.model import Task as Task
    from swarmbid.network import Network as Network
    from swarmbid.network import make_topology as make_topology
    from swarmbid.plan import Plan as Plan
    from swarmbid.scores import make_score as make_score
    from swarmbid.simulator import Run as Run
    from swarmbid.simulator import simulate as simulate
    from swarmbid.trace import read_trace as read_trace
    from swarmbid.verify import verify as verify
    from swarmbid.worldsim import fly as fly

__version__ = "0.1.0"

_HOMES = {
    "Agent": "model",
    "InputError": "errors",
    "Mission": "model",
    "Network": "network",
    "Origin": "model",
    "Plan": "plan",
    "Run": "simulator",
    "SwarmbidError": "errors",
    "Task": "model",
    "fly": "worldsim",
    "load_mission": "missionfile",
    "make_score": "scores",
    "make_topology": "network",
    "read_trace": "trace",
    "simulate": "simulator",
    "verify": "verify",
}


def __getattr__(name: str) -> Any:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'swarmbid' has no attribute {name!r}")
    return getattr(importlib.import_module(f"swarmbid.{home}"), name)


def __dir__() -> list[str]:
    return sorted([*_HOMES, "__version__"])
