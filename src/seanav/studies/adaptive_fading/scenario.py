"""Paper 3: what can be chosen. Hajiyev, Vural and Hajiyeva."""

from collections.abc import Sequence

import attrs
import numpy as np

from seanav.checks import ParameterError
from seanav.models import vehicles
from seanav.scenario import Choice, File, Integer, List, Number, Parameters, parameter, tenth

PLANES = {"steering": vehicles.steering(), "diving": vehicles.diving()}
FAULTS = ("loss", "reversal", "half", "bias", "stuck")
HEALTHY_FROM = 5.0  # s, when the start is forgotten
SETTLING = 2.0  # s after the fault that no score counts
STEPS = 20_000  # of one run, at most
SAMPLES = 4_000_000  # runs times steps, at most: what is stored of them fits in a few GB

_VARIANCE = Number(at_least=1e-20, at_most=1e6)
_FIN = Number(at_least=-0.6, at_most=0.6)
_STEERING, _DIVING = PLANES["steering"].states, PLANES["diving"].states


def _none_or_variance(name, value):
    # Smaller ones leave an H G Q Gᵀ Hᵀ that double precision cannot invert.
    return 0.0 if Number()(name, value) == 0 else _VARIANCE(name, value)


def _variances(count, kind=_VARIANCE):
    return List(kind, count)


def _states(names):
    return List(Choice(names), distinct=True)


@attrs.frozen(kw_only=True)
class Scenario(Parameters):
    """Everything that can be chosen, checked at once; units are in the names.

    Raises
    ------
    seanav.checks.ParameterError
        One line that names the parameter, its value and what is allowed.
    """

    runs: int = parameter(100, Integer(2, 100_000), origin="assumed", quick=tenth(20))
    seed: int = parameter(3, Integer(0), origin="assumed")
    dt: float = parameter(0.1, Number(above=0, at_most=SETTLING), unit="s", origin="assumed")
    duration: float = parameter(100.0, Number(at_least=40, at_most=1e4), unit="s", origin="assumed")
    fault_time: float = parameter(50.0, Number(at_least=0), unit="s", origin="assumed")
    fault: str = parameter("loss", Choice(FAULTS), origin="assumed")
    discretisation: str = parameter(
        "euler", Choice(("euler", "exact")), origin="text", note="(7) and (13)"
    )
    fin: str = parameter("sine", Choice(("sine", "step")), origin="assumed", note="the command")
    fin_rad: float = parameter(0.2, _FIN, unit="rad", origin="assumed", note="its size")
    fin_period: float = parameter(
        20.0, Number(at_least=1e-3, at_most=1e6), unit="s", origin="assumed", note="of the sine"
    )
    bias_rad: float = parameter(0.1, _FIN, unit="rad", origin="assumed", note='of the fault "bias"')
    stuck_rad: float = parameter(
        0.2, _FIN, unit="rad", origin="assumed", note='where a fin that is "stuck" jams'
    )
    Q_steering: tuple = parameter(
        (1e-5,) * 3,
        _variances(3, _none_or_variance),
        unit="SI²",
        origin="assumed",
        note="variances per step of v, r, psi",
    )
    R_steering: tuple = parameter(
        (1e-4,) * 3, _variances(3), unit="SI²", origin="assumed", note="of v, r, psi"
    )
    Q_diving: tuple = parameter(
        (1e-5,) * 4,
        _variances(4, _none_or_variance),
        unit="SI²",
        origin="assumed",
        note="variances per step of w, q, theta, z",
    )
    R_diving: tuple = parameter(
        (1e-4,) * 4, _variances(4), unit="SI²", origin="assumed", note="of w, q, theta, z"
    )
    measured_steering: tuple = parameter(_STEERING, _states(_STEERING), origin="assumed")
    measured_diving: tuple = parameter(_DIVING, _states(_DIVING), origin="assumed")
    initial_variance: float = parameter(
        1e-2, _VARIANCE, unit="SI²", origin="assumed", note="of every state"
    )
    alpha: float = parameter(
        0.05, Number(at_least=1e-12, below=1), origin="assumed", note="level of significance"
    )
    window: int = parameter(
        20, Integer(1, 1000), unit="steps", origin="assumed", note="the paper's mu"
    )
    trigger: str = parameter(
        "chi2", Choice(("chi2", "trace")), origin="text", note="(39)–(41), or (24)"
    )
    larger_Q: float = parameter(
        10.0,
        Number(at_least=1, at_most=1e9),
        origin="ours",
        note="factor of the baseline: the best of 1, 3, 10, 30, 100 after the fault (exercise 3.6)",
    )
    bias_walk_rad: float = parameter(
        0.01,
        Number(at_least=1e-9, at_most=10),
        unit="rad per step",
        origin="ours",
        note="of the baseline with an input bias",
    )
    log_file: str = parameter(
        "", File(), origin="ours", note="a log of your own ship, see Your own data; empty: none"
    )
    log_model: str = parameter(
        "nomoto", Choice(("nomoto", "remus")), origin="ours", note="of the log: identified, or (8)"
    )
    log_share: float = parameter(
        0.4,
        Number(at_least=0.05, at_most=0.95),
        origin="ours",
        note="of the log, from which a model is identified",
    )
    settings: int = parameter(
        300, Integer(4, 100_000), origin="ours", note="random settings of the sweep", quick=tenth(4)
    )
    sweep_runs: int = parameter(20, Integer(2, 1000), origin="ours", note="runs for each of them")

    def __attrs_post_init__(self):
        first, last = HEALTHY_FROM + 10, self.duration - SETTLING - 10
        Number(at_least=first, at_most=last)("fault_time", self.fault_time)
        most = min(STEPS, SAMPLES // self.runs)
        if self.duration / self.dt > most:
            allowed = f"must be at least {self.duration / most:.3g} s: {most} steps at most"
            raise ParameterError("dt", self.dt, f"{allowed} in each of {self.runs} runs")
        for plane in PLANES:
            self._check_plane(plane)

    def _check_plane(self, plane):
        limit = PLANES[plane].euler_limit()
        if self.discretisation == "euler" and self.dt >= limit:
            allowed = f"must be below {limit:.3f} s, where Euler's rule makes {plane} unstable"
            raise ParameterError("dt", self.dt, allowed)
        # Multiple factors need an H G Q Gᵀ Hᵀ that can be inverted. Every state of the
        # steering plane is measured somewhere in the study, whatever `measured_steering` says.
        name, states = f"Q_{plane}", PLANES[plane].states
        needed = states if plane == "steering" else getattr(self, f"measured_{plane}")
        values = getattr(self, name)
        if min(values[states.index(state)] for state in needed) == 0:
            allowed = f"must be above 0 for {', '.join(needed)}, which are measured"
            raise ParameterError(name, list(values), allowed)

    def measurement(self, plane: str, measured: Sequence[str] | None = None) -> np.ndarray:
        """Return H of a plane, (measured, states): the rows of the measured states."""
        states = PLANES[plane].states
        chosen = measured or getattr(self, f"measured_{plane}")
        return np.eye(len(states))[[states.index(state) for state in chosen]]
