"""The world that a search mission happens in: an area, vehicles with sensors, targets that move.

Pure physics in local metres, east and north, and seconds. Nothing here reads a clock; random numbers
come from a generator or a seed handed in, so that a world steps the same way from the same seed.
"""

from __future__ import annotations

from swarmbid.world.area import Area, Point
from swarmbid.world.sensor import Glimpse, Sensor
from swarmbid.world.targets import Target, Targets
from swarmbid.world.vehicle import Vehicle, VehicleState

__all__ = ["Area", "Glimpse", "Point", "Sensor", "Target", "Targets", "Vehicle", "VehicleState"]
