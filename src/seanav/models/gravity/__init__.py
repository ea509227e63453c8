"""Gravity anomaly maps: what one is and how it is read, and where it comes from.

``map``
    `GravityMap`, its gradient, values between its nodes, degrees to local kilometres;
``geoid``, ``files``
    a map from the geoid around Japan, from a user's own grid;
``grids``, ``netcdf``, ``coordinates``, ``packing``, ``geotiff``, ``quality``
    what ``files`` needs: a grid of any format, each format, whether its values can be so;
``sources``
    a random field, and one function for all of these.
"""

from seanav.models.gravity.map import (
    EARTH_RADIUS,
    FLATTENING,
    MOST_NODES,
    GravityMap,
    geodetic_to_local,
    gradient,
    interpolate,
    local_to_geodetic,
    square_nodes,
)

__all__ = [
    "EARTH_RADIUS",
    "FLATTENING",
    "MOST_NODES",
    "GravityMap",
    "geodetic_to_local",
    "gradient",
    "interpolate",
    "local_to_geodetic",
    "square_nodes",
]
