"""Names for the numbers: where states, coefficients and covariance elements stand.

Many runs at once: every array has `LANES` runs innermost. The kernels of the covariance
take flat arrays, element (i, run) at i · LANES + run: with that constant in the index the
compiler sees that rows do not overlap, and vectorises over runs; with two subscripts it does
not, and they are three times slower. Names in capitals that are offsets into a flat array
say so; all others count rows.
"""

import numpy as np
from numpy.typing import ArrayLike

from seanav._compile import kernel
from seanav.checks import array
from seanav.models import inertial

LANES = 16  # runs side by side

# ---------------------------------------------------------------- error state, 16 rows

# Height and vertical velocity are held by the depth gauge: of the 18 states of
# `seanav.models.inertial` their errors are zero, and the kernels carry the others.
KEPT = np.array([i for i in range(inertial.STATES) if i not in inertial.SLAVED])
N = len(KEPT)


def _first(block: slice) -> int:
    return KEPT.tolist().index(block.start)


LATITUDE, V_N = _first(inertial.P_), _first(inertial.V_)
LONGITUDE, V_E = LATITUDE + 1, V_N + 1
PHI, B_A, B_G, CURRENT = map(_first, (inertial.PHI, inertial.BA, inertial.BG, inertial.VC))
HEADING = PHI + 2
NAVIGATION = B_A  # rows above the biases: those that the transition changes, but the current

# Columns where a row of H is not zero; offsets of the blocks in a flat array of these alone.
LOOKED = np.r_[V_N, V_E, PHI : PHI + 3, CURRENT : CURRENT + 3]
ENTRIES = len(LOOKED)
LOOKED_V, LOOKED_PHI, LOOKED_CURRENT = 0, 2 * LANES, 5 * LANES

# ---------------------------------------------------------------- nominal state, 17 rows

# As the error state, with the quaternion body to n (4, scalar first) in the place of phi (3).
QUATERNION = PHI
X_B_A, X_B_G, X_CURRENT = B_A + 1, B_G + 1, CURRENT + 1
NOMINAL = N + 1

# The truth has the rows of the nominal state up to its quaternion, then metres per radian.
METRES_N = X_B_A
METRES_E = METRES_N + 1
TRUTH = METRES_E + 1

# ---------------------------------------------------------------- packed covariances

PACKED = N * (N + 1) // 2  # upper triangle, row by row: symmetric for ever

# Place of element (i, j) in a packed upper triangle.
AT = np.zeros((N, N), dtype=np.int64)
AT[np.triu_indices(N)] = np.arange(PACKED)
AT = np.maximum(AT, AT.T)

# Offsets into flat arrays: of a row, of a covariance element. Unsigned: no check for negative
# subscripts stands in the way of the compiler's vectorising.
ROW = np.arange(PACKED, dtype=np.uint64) * np.uint64(LANES)
PLACE = ROW[AT]


def pack_diagonal(variances: ArrayLike) -> np.ndarray:
    """Return a packed diagonal covariance, (136, LANES), from variances of the 16 states."""
    P = np.zeros((PACKED, LANES))
    P[np.diagonal(AT)] = array("variances", variances, (N,), at_least=0)[:, None]
    return P


def unpack(P: ArrayLike) -> np.ndarray:
    """Return covariances (18, 18, runs) from packed ones (136, runs); held states are zero."""
    P = array("P", P, (PACKED, "runs"))
    full = np.zeros((inertial.STATES, inertial.STATES, P.shape[1]))
    full[np.ix_(KEPT, KEPT)] = P[AT]
    return full


@kernel
def _three(rows, first, r):
    """Return run `r` of three rows of a flat array that begin at offset `first`."""
    return rows[first + r], rows[first + LANES + r], rows[first + 2 * LANES + r]


@kernel
def _put(rows, first, r, vector):
    """Put a vector into run `r` of three rows of a flat array."""
    rows[first + r], rows[first + LANES + r], rows[first + 2 * LANES + r] = vector


# ---------------------------------------------------------------- coefficients of F

# Offsets into the flat array that `predict.predict_state` fills, at mid-interval. A vector
# or a row of a matrix takes three rows; PHI_N_L is the entry of F that takes the error of
# the latitude into phi_N.
COEFFICIENTS = 30  # rows
C_N, C_E, C_D = (3 * row * LANES for row in range(3))  # rows of C_bn
FORCE, OMEGA = 9 * LANES, 12 * LANES  # specific force f_n; omega_in
_FREE = range(15 * LANES, COEFFICIENTS * LANES, LANES)
PHI_N_L, PHI_E_L, PHI_D_L, PHI_E_VN, PHI_N_VE, PHI_D_VE = _FREE[:6]
VN_L, VE_L, VN_VE, VE_VN, VE_VE = _FREE[6:11]
LATITUDE_L, LONGITUDE_L, LATITUDE_VN, LONGITUDE_VE = _FREE[11:]

# Offsets of the error states in a flat column, and of the rows of a flat matrix of N columns.
PHI_ROW, B_A_ROW, B_G_ROW = PHI * LANES, B_A * LANES, B_G * LANES
COLUMNS = N * LANES
HALF = NAVIGATION * COLUMNS  # seven such rows
WORKSPACE = 2 * HALF + COLUMNS  # of `predict.predict_covariance`
