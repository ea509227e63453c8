"""Where a gravity map comes from: one function for a geoid, a random field or a file."""

import numpy as np
from scipy import fft

from seanav.checks import integer, number
from seanav.models.gravity.files import from_file
from seanav.models.gravity.geoid import from_geoid
from seanav.models.gravity.map import MOST_NODES, GravityMap


def synthetic(
    seed: int = 1,
    correlation_length: float = 14e3,
    standard_deviation_mgal: float = 14.0,
    size: int = 101,
    spacing: float = 1000.0,
) -> GravityMap:
    """Stationary Gaussian random field with a Gaussian covariance.

    The covariance is σ² exp(−r²/2ℓ²), so each component of the gradient has the variance
    σ²/ℓ². The field is drawn in the Fourier domain on a periodic grid that is 6ℓ longer
    than the map: opposite sides are then correlated by less than 2e-8. The defaults give
    the deviation and the gradient of the default map of the geoid.

    Parameters
    ----------
    seed : int
        The same seed gives the same map.
    correlation_length : float
        ℓ, m: the correlation falls to exp(−1/2) there.
    standard_deviation_mgal : float
        σ, mGal. The defaults span about 4.7 σ from lowest to highest node.
    size : int
        Nodes per side.
    spacing : float
        Distance between nodes, m.

    Returns
    -------
    GravityMap

    Raises
    ------
    ParameterError
        If a parameter is out of range; ℓ must lie between the spacing and the map's side.
    """
    seed = integer("map_seed", seed, at_least=0)
    size = integer("map_size", size, at_least=3, at_most=MOST_NODES)
    spacing = number("map_spacing", spacing, above=0)
    deviation = number("map_standard_deviation_mgal", standard_deviation_mgal, above=0)
    length = number(
        "map_correlation_length",
        correlation_length,
        at_least=spacing,
        at_most=(size - 1) * spacing,
    )
    nodes = fft.next_fast_len(size + int(np.ceil(6 * length / spacing)), real=True)
    # The covariance is a product of one factor per axis, and so is its transform. The
    # distance runs round the periodic grid; rounding leaves tiny negative powers.
    offset = np.minimum(np.arange(nodes), nodes - np.arange(nodes)) * spacing
    power = fft.fft(np.exp(-0.5 * (offset / length) ** 2)).real
    amplitude = np.sqrt(np.maximum(power, 0))
    white = np.random.default_rng(np.random.SeedSequence(seed)).standard_normal((nodes, nodes))
    spectrum = fft.fft2(white) * amplitude[:, None] * amplitude
    return GravityMap.from_mgal(
        deviation * fft.ifft2(spectrum).real[:size, :size],
        spacing,
        name=f"synthetic, seed {seed}",
        source=(
            f"Gaussian random field, standard deviation {deviation:g} mGal, "
            f"correlation length {length / 1e3:g} km, seed {seed}"
        ),
    )


def load(
    source: str = "geoid",
    *,
    latitude_deg: float = 18.8,
    longitude_deg: float = 128.0,
    size: int = 101,
    spacing: float = 1000.0,
    variable: str | None = None,
    unit: str = "file",
    correlation_length: float = 14e3,
    standard_deviation_mgal: float = 14.0,
    seed: int = 1,
) -> GravityMap:
    """Gravity map from whichever source a notebook names.

    The notebook's parameters are these with ``map_`` before them, and so the errors say.

    Parameters
    ----------
    source : str or path
        ``"geoid"``, ``"synthetic"`` or the path of a NetCDF or GeoTIFF grid.
    latitude_deg, longitude_deg : float
        Middle of the map, degrees; not used by a synthetic map.
    size : int
        Nodes per side.
    spacing : float
        Distance between nodes, m.
    variable : str, optional
        Variable or band of a file that has several.
    unit : str
        Unit of a file that states none, see `seanav.models.gravity.files.from_file`.
    correlation_length, standard_deviation_mgal, seed
        Of a synthetic map: see `synthetic`.

    Returns
    -------
    GravityMap

    Raises
    ------
    ParameterError
        As `from_geoid`, `synthetic` and `from_file` do.
    """
    if source == "synthetic":
        return synthetic(seed, correlation_length, standard_deviation_mgal, size, spacing)
    if source == "geoid":
        return from_geoid(latitude_deg, longitude_deg, size, spacing)
    return from_file(source, latitude_deg, longitude_deg, size, spacing, variable, unit)
