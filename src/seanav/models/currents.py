"""Sea current as a first-order Gauss-Markov process, and the speed logs that feel it.

References
----------
Cha, Hwang and Park, *The Journal of Navigation*, 2022, equations (1)-(5).
R. G. Brown and P. Y. C. Hwang, *Introduction to Random Signals and Applied Kalman
Filtering*, 4th ed., Wiley, 2012, section 4.5.
"""

import math

import numpy as np


def decay(dt, correlation_time):
    """Return a and 1 − a² with a = exp(−dt/T_c): one step of the process with unit variance."""
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
    """
    a, variance = decay(dt, correlation_time)
    sigma = np.broadcast_to(np.asarray(sigma, dtype=float), (len(noise),))
    path = np.empty((len(noise) + 1, *noise.shape[1:]))
    path[0] = start
    for k in range(len(noise)):
        path[k + 1] = a * path[k] + sigma[k] * math.sqrt(variance) * noise[k]
    return path


def log_velocity(C_bn, v_n, current_n):
    """Return the velocity relative to the water in body axes, (…, 3) m/s: equation (11)."""
    relative = np.asarray(v_n) - np.asarray(current_n)
    return np.einsum("...ji,...j->...i", C_bn, relative)


def doppler_shift(speed, frequency, sound_speed=1500.0):
    """Return the Doppler shift of an echo off the ground, equation (2), Hz."""
    return frequency * ((sound_speed + speed) / (sound_speed - speed) - 1.0)


def doppler_speed(shift, frequency, sound_speed=1500.0):
    """Return the speed by equation (3), which takes speed ≪ sound speed, m/s."""
    return sound_speed * shift / (2.0 * frequency)


def electromotive_force(speed, current, field, gap):
    """Return E = B l (v − v_c), equation (1), in volts."""
    return field * gap * (speed - current)
