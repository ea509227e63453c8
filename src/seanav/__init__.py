"""State estimation in marine navigation: five papers, reproduced.

Conventions, the same in every module
-------------------------------------
Units
    SI inside: metres, seconds, radians, m/s² (1 mGal = 1e-5 m/s²). Degrees, knots,
    mGal and kilometres appear only at the edges and carry their unit in the name
    (``rudder_deg``, ``noise_mgal``).
Frames
    e (earth), i (inertial), n (local level, north-east-down), b (body,
    forward-right-down). ``C_bn`` maps b to n; vectors are ``v_n``, angles ``rpy``.
    A planar map uses (east, north) in metres from its lower left corner.
Errors
    Estimate minus truth, one sign everywhere.
Names
    x, P, F, Phi, Q, H, R, K, S, innovation, NIS, NEES, mode probability, as in the
    literature; Greek letters are spelled out.
Shapes
    Time first: ``(runs, steps, states)``. Inside compiled kernels the runs are
    innermost, so that the compiler vectorises over them.
Arguments
    What has no underscore may be called by anybody: it checks shape, type and finiteness
    (`seanav.checks`). Compiled kernels check nothing and begin with an underscore.
Randomness
    One stream per run and purpose, spawned from one seed (`seanav.montecarlo`);
    compared filters see the same noise.
Imports
    Downward only: notebooks, studies, filters, models. `seanav.montecarlo`,
    `seanav.report` and `seanav.checks` know no paper.
"""

__version__ = "1.0.0"
