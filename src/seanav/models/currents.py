"""Sea current as a first-order Gauss-Markov process, and the speed logs that feel it.

References
----------
Cha, Hwang and Park, *The Journal of Navigation*, 2022, equations (1)-(5).
R. G. Brown and P. Y. C. Hwang, *Introduction to Random Signals and Applied Kalman
Filtering*, 4th ed., Wiley, 2012, section 4.5.
"""

import math
from numbers import Real

import numpy as np

from seanav.checks import array, number


def decay(dt, correlation_time):
    """Return a and 1 − a² with a = exp(−dt/T_c): one step of the process with unit variance."""
    dt = number("dt", dt, above=0)
    correlation_time = number("correlation_time", correlation_time, above=0)
    a = math.exp(-dt / correlation_time)
    return a, -math.expm1(-2.0 * dt / correlation_time)


def gauss_markov(noise, start, dt, correlation_time, sigma=1.0):
    """Return a Gauss-Markov path, v' = −v/T_c + w, with stationary standard deviation `sigma`.

    Parameters
    ----------
    noise : (steps, …)
        Standard normal numbers.
    start : (…)
        Value at time 0, m/s.
    dt, correlation_time : float
        s.
    sigma : float or (steps,)
        Standard deviation, m/s; a sequence lets the strength change during the run.

    Returns
    -------
    path : (steps + 1, …), m/s

    Raises
    ------
    seanav.checks.ParameterError
        If shapes do not fit, a number is not finite, or one is out of its bounds.
    """
    a, variance = decay(dt, correlation_time)
    sizes = {}
    noise = array("noise", noise, ("steps", ...), sizes)
    start = array("start", start, (...,), sizes)
    if isinstance(sigma, Real):
        sigma = np.full(len(noise), number("sigma", sigma, at_least=0))
    sigma = array("sigma", sigma, ("steps",), sizes, at_least=0)
    path = np.empty((len(noise) + 1, *noise.shape[1:]))
    path[0] = start
    for k in range(len(noise)):
        path[k + 1] = a * path[k] + sigma[k] * math.sqrt(variance) * noise[k]
    return path


def log_velocity(C_bn, v_n, current_n):
    """Return the velocity relative to the water in body axes, (…, 3) m/s: equation (11)."""
    sizes = {}
    C_bn = array("C_bn", C_bn, (..., 3, 3), sizes)
    relative = array("v_n", v_n, (..., 3), sizes) - array("current_n", current_n, (..., 3), sizes)
    return np.einsum("...ji,...j->...i", C_bn, relative)


def doppler_shift(speed, frequency, sound_speed=1500.0):
    """Return the Doppler shift of an echo off the ground, equation (2), Hz; speeds in m/s."""
    sound_speed = number("sound_speed", sound_speed, above=0)
    speed = number("speed", speed, above=-sound_speed, below=sound_speed)
    frequency = number("frequency", frequency, above=0)
    return frequency * ((sound_speed + speed) / (sound_speed - speed) - 1.0)


def doppler_speed(shift, frequency, sound_speed=1500.0):
    """Return the speed by equation (3), which takes speed ≪ sound speed, m/s."""
    shift, frequency = number("shift", shift), number("frequency", frequency, above=0)
    sound_speed = number("sound_speed", sound_speed, above=0)
    return sound_speed * shift / (2.0 * frequency)


def electromotive_force(speed, current, field, gap):
    """Return E = B l (v − v_c), equation (1), in volts."""
    speed, current = number("speed", speed), number("current", current)
    field, gap = number("field", field), number("gap", gap, above=0)
    return field * gap * (speed - current)
