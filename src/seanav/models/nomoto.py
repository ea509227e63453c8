"""How a ship turns: Nomoto's first-order model, linear or with a cubic damping, in a zigzag."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from seanav import checks


class Ship(NamedTuple):
    """T r' + r + cubic r³ = K δ, with the yaw rate r (rad/s) and the rudder angle δ (rad).

    Attributes
    ----------
    K, T : float
        Gain (1/s) and time constant (s).
    cubic : float
        s²/rad², at least 0; 0 is the linear model.
    rudder_rate : float
        Fastest motion of the rudder, rad/s.
    """

    K: float
    T: float
    cubic: float = 0.0
    rudder_rate: float = math.inf


def zigzag(
    ship: Ship, angles: ArrayLike, dt: float, pushes: ArrayLike, fine: int = 20
) -> tuple[np.ndarray, np.ndarray]:
    """Return commanded rudder (steps,) and yaw rate (steps,) of a zigzag, rad and rad/s.

    The rudder is put to one side until the heading has turned there by as much, then to the
    other. A command is given at the begin of a step; the ship moves between by `fine` Euler
    steps, the rudder no faster than it can.

    Parameters
    ----------
    ship : Ship
    angles : (steps,) array
        Rudder angle and change of heading of the zigzag at that time, rad.
    dt : float
        Step, s.
    pushes : (steps,) array
        What waves add to the yaw rate at the end of each step, rad/s.

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit, or a number is not finite or out of its bounds.

    References
    ----------
    K. Nomoto et al., International Shipbuilding Progress 4 (1957), 354-370,
    https://doi.org/10.3233/ISP-1957-43504; N. H. Norrbin's cubic term as in T. I. Fossen,
    Handbook of Marine Craft Hydrodynamics and Motion Control, Wiley, 2011,
    https://doi.org/10.1002/9781119994138.
    """
    sizes: dict = {}
    angles = checks.array("angles", angles, ("steps",), sizes)
    pushes = checks.array("pushes", pushes, ("steps",), sizes)
    dt = checks.number("dt", dt, above=0)
    fine = checks.integer("fine", fine, at_least=1, at_most=10_000)
    h, side = dt / fine, 1.0
    heading = rate = rudder = 0.0
    commands, rates = np.empty(len(angles)), np.empty(len(angles))
    for k, angle in enumerate(angles):
        if side * heading >= angle:
            side = -side
        commands[k], rates[k] = side * angle, rate
        for _ in range(fine):
            away = commands[k] - rudder
            rudder += math.copysign(min(abs(away), ship.rudder_rate * h), away)
            heading += h * rate
            rate += h * (ship.K * rudder - rate - ship.cubic * rate**3) / ship.T
        rate += pushes[k]
    return commands, rates
