"""Latitude and longitude to local metres and back, through the exact WGS 84 ellipsoid.

Local positions are the true east-north-up frame at the origin, not a flat-Earth approximation, so
straight-line distances are right. It follows that a point 10 km away at the origin's altitude lies
7.8 m below the origin's horizontal plane.

Altitudes are never converted from one reference to another, for that takes a geoid or a terrain
model. Point and origin count from the same reference, and their difference is what matters: taking mean
sea level for the ellipsoid stretches the map by less than 0.02 m per km.
"""

from __future__ import annotations

from collections.abc import Sequence

from swarmbid.model import Origin, Position

FARTHEST = 200_000.0
"""m from the origin. Beyond, straight lines run through the ground, and the usual cause is latitude and
longitude in the wrong order."""


def to_local(points: Sequence[tuple[float, float, float]], origin: Origin) -> list[Position]:
    """Convert latitude, longitude (degrees) and altitude (m) to east, north, up in m.

    Parameters
    ----------
    points : latitude, longitude, altitude, the altitude counted from `origin.altitude_reference`.
    origin : where (0, 0, 0) is.

    Examples
    --------
    >>> origin = Origin(latitude=48.4, longitude=7.8, altitude=150.0, altitude_reference="amsl")
    >>> [round(x, 6) for x in to_local([(48.4, 7.8, 250.0)], origin)[0]]
    [0.0, 0.0, 100.0]
    """
    if not points:
        return []
    import numpy as np
    import pymap3d

    columns = np.array(points, dtype=np.float64).T
    enu = pymap3d.geodetic2enu(*columns, origin.latitude, origin.longitude, origin.altitude)
    return [(float(e), float(n), float(u)) for e, n, u in zip(*enu, strict=True)]


def to_geodetic(position: Position, origin: Origin) -> tuple[float, float, float]:
    """Convert east, north, up in m to latitude, longitude (degrees) and altitude (m); undoes `to_local`."""
    import pymap3d

    latitude, longitude, altitude = pymap3d.enu2geodetic(
        *position, origin.latitude, origin.longitude, origin.altitude
    )
    return float(latitude), float(longitude), float(altitude)
