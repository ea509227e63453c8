"""Numbers of the papers, read a second time: line by line as they are printed."""

import numpy as np

from seanav.models import vehicles
from seanav.studies.gravity_planning import printed as planning
from seanav.studies.imm_sea_current import printed as current

# Paper 5, Tables 2 and 3: R (mGal), then the sums of RMSE (km), a column a path.
SUMS = {
    1: """Planned Direct L3 L4 L5 L6 L7 L8 L9
          1  8.1 12.8 21.6 19.5 13.8 10.0  9.5  9.0  9.6
          2 14.4 22.8 38.0 34.3 24.6 17.7 16.7 15.7 16.8
          3 20.9 33.4 56.0 50.4 36.3 25.7 24.0 22.5 24.2
          4 27.4 44.6 75.6 67.1 49.2 34.0 31.4 29.3 31.7""",
    2: """Planned Direct L3 L4 L5 L6 L7 L8 L9 L10 L11 L12
          1 30.4  66.4 40.0 31.3 35.8 41.5  54.1 52.5  53.9  49.3  44.7  50.0
          2 41.8  78.5 55.4 43.4 46.7 54.3  67.6 64.2  68.6  62.8  63.0  67.7
          3 54.6  93.3 73.2 56.6 59.0 68.7  84.5 79.4  86.3  80.5  84.3  89.0
          4 68.1 110.0 92.5 70.7 72.2 84.7 104.0 97.1 106.0 101.0 108.0 112.2""",
}
# Paper 4, Tables 2 and 3: position (m), velocity (m/s), levelling and heading (deg).
CELLS = {
    2: """362 0.411 0.00353 0.0221
          375 0.418 0.00361 0.0222
          749 0.483 0.00421 0.0241
          750 0.485 0.00424 0.0241
          477 0.435 0.00374 0.0228""",
    3: """2990 1.41 0.0119 0.0511
          1820 0.998 0.00770 0.0285
          1370 0.889 0.00712 0.0263
          1330 0.888 0.00695 0.0255
          1370 0.905 0.00716 0.0257""",
}
FILTERS = ["EKF 0.1", "AFEKF 0.1", "EKF 0.5", "AFEKF 0.5", "IMM-AFEKF 0.1,0.5"]


def test_tables_of_paper_5():
    for test, text in SUMS.items():
        head, *lines = text.splitlines()
        numbers = np.array([line.split() for line in lines], dtype=float)
        assert tuple(numbers[:, 0]) == planning.NOISE_MGAL
        columns = zip(head.split(), map(tuple, numbers[:, 1:].T), strict=True)
        assert list(planning.SUMS_KM[test].items()) == list(columns)
    assert planning.RUNS == 1000


def test_tables_of_paper_4():
    for table, text in CELLS.items():
        rows = [tuple(map(float, line.split())) for line in text.splitlines()]
        assert dict(zip(FILTERS, rows, strict=True)) == current.CELLS[table]
    assert current.SIGMA == {2: 0.05, 3: 1.0}
    assert current.RUNS == 100


# Paper 3, the REMUS vehicle in SI units.
STEERING = "m 30.48 I_z 3.45 Y_vdot -35.5 Y_rdot 1.93 N_vdot 1.93 N_rdot -4.88 Y_v -66.6 Y_r 2.2"
STEERING += " N_v -4.47 N_r -6.87"
DIVING = "I_y 3.45 Z_wdot -35.5 Z_qdot -1.93 M_wdot -1.93 M_qdot -4.88 Z_w -66.6 Z_q 2.2 M_w -9.3"
DIVING += " M_q -6.87 Z_delta -50.6 M_delta -34.6 z_G 0.0196 U 1.54 W 299"


def test_coefficients_of_paper_3():
    words = f"{STEERING} {DIVING}".split()
    read = dict(zip(words[::2], map(float, words[1::2]), strict=True))
    read |= {"Y_delta": 50.6 / 3.5, "N_delta": -34.6 / 3.5}
    assert read == {name: one.value for name, one in vehicles.COEFFICIENTS.items()}
