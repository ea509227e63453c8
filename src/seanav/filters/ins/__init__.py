"""Inertial navigation aided by a speed log: 18-state error-state EKF, and IMM of several.

Read `reference` first: one run in plain numpy, in the paper's equations. The other modules do
the same for `LANES` runs at once, compiled:

``layout``
    names for the numbers: where states, coefficients and covariance elements stand;
``states``
    from error states to nominal states and back;
``predict``, ``update``
    the two halves of one EKF step, the adaptive fading between them;
``mission``
    the loop over the seconds, and `fly`, which is called;
``score``
    what is kept: `Flight`.

A batch of nominal states is x, shape (17, LANES): latitude, longitude (rad), v_N, v_E (m/s),
quaternion body to n (4, scalar first), accelerometer bias (3, m/s²), gyro bias (3, rad/s),
sea current (3, m/s).

Source: Cha, Hwang and Park, *The Journal of Navigation*, 2022, equations (6)-(26).
"""

from seanav.filters.ins.layout import KEPT, LANES, NOMINAL, PACKED, N, pack_diagonal, unpack
from seanav.filters.ins.mission import fly
from seanav.filters.ins.score import Flight, MeanSquares, Series
from seanav.filters.ins.states import shift
from seanav.filters.ins.update import LINEARISED

__all__ = [
    "KEPT",
    "LANES",
    "LINEARISED",
    "NOMINAL",
    "PACKED",
    "Flight",
    "MeanSquares",
    "N",
    "Series",
    "fly",
    "pack_diagonal",
    "shift",
    "unpack",
]
