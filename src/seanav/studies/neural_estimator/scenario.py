"""Paper 2: what can be chosen. Stateczny (2000)."""

import attrs

from seanav.checks import ParameterError
from seanav.filters import neural
from seanav.scenario import Choice, File, Integer, List, Number, Parameters, parameter, tenth

STEP = 3.0  # s, twenty steps a minute
COURSES = ("steady", "one turn", "two turns", "turn while teaching", "zigzag")
VARIANTS = ("frozen", "re-taught", "self-taught", "hybrid")
INPUTS = ("measurement", "estimate")
MOST_STEPS = 20_000
MOST = 20_000_000  # runs times steps, neurons or epochs: what is stored fits in a few GB

_WEIGHT = Number(at_least=0, at_most=1)
_NEURONS = Integer(1, 2000)


@attrs.frozen(kw_only=True)
class Scenario(Parameters):
    """Everything that can be chosen, checked at once; speeds in m/s.

    Raises
    ------
    seanav.checks.ParameterError
        One line that names the parameter, its value and what is allowed.
    """

    speed: float = parameter(
        6.0, Number(at_least=0.01, below=10), unit="m/s", origin="assumed", note="a merchant ship"
    )
    heading_deg: float = parameter(
        30.0,
        Number(at_least=-360, at_most=360),
        unit="deg",
        origin="assumed",
        note="at the start; no component is zero",
    )
    steps: int = parameter(
        200, Integer(1, MOST_STEPS), origin="assumed", note="of 3 s (text): ten minutes"
    )
    settle: int = parameter(20, Integer(1, MOST_STEPS), unit="steps", origin="text", note="stage 1")
    pairs: int = parameter(
        20, Integer(2, MOST_STEPS), unit="steps", origin="text", note="teaching pairs, stage 2"
    )
    noise: float = parameter(
        0.3, Number(at_least=1e-6, at_most=10), unit="m/s", origin="assumed", note="per component"
    )
    q: float = parameter(
        0.005,
        Number(at_least=1e-12, at_most=100),
        unit="(m/s)² per step",
        origin="assumed",
        note="process noise of the numerical filter, per component",
    )
    w1: float = parameter(
        0.3, _WEIGHT, origin="assumed", note="weight of the running measurement; no value in print"
    )
    innovation: str = parameter(
        "blended", Choice(("blended", "printed")), origin="derived", note="the text: w2 = 0 is GLS"
    )
    hidden: int = parameter(100, _NEURONS, unit="neurons", origin="text", note="20 to 200")
    rate: float = parameter(
        0.1, Number(at_least=1e-6, at_most=100), origin="assumed", note="learning rate"
    )
    spread: float = parameter(
        0.5,
        Number(at_least=1e-6, at_most=100),
        origin="assumed",
        note="of the initial weights; random: text",
    )
    delta: float = parameter(
        0.001,
        Number(at_least=1e-12, at_most=1),
        unit="scaled",
        origin="text",
        note="where the teaching stops",
    )
    reading: str = parameter(
        "max", Choice(neural.READINGS), origin="assumed", note="of Δ; the text: a difference"
    )
    max_epochs: int = parameter(
        500, Integer(1, 100_000), origin="assumed", note="cap of the first teaching; none in print"
    )
    examination_input: str = parameter(
        "measurement", Choice(INPUTS), origin="assumed", note="the text is ambiguous"
    )
    interval: int = parameter(
        5,
        Integer(1),
        unit="steps",
        origin="assumed",
        note="between re-teachings; cyclic: text",
    )
    reteach_epochs: int = parameter(
        30, Integer(1, 100_000), origin="assumed", note="cap of a re-teaching"
    )
    learner: str = parameter(
        "delta rule",
        Choice(("delta rule", "MLPRegressor")),
        origin="text",
        note="scikit-learn's MLPRegressor teaches the frozen network only",
    )
    hidden_sizes: tuple = parameter(
        (20, 50, 100, 200), List(_NEURONS, distinct=True), unit="neurons", origin="text"
    )
    weights: tuple = parameter(
        (0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0),
        List(_WEIGHT, distinct=True),
        origin="ours",
        note="grid of w1",
    )
    intervals: tuple = parameter(
        (5, 10, 20), List(Integer(1), distinct=True), unit="steps", origin="ours"
    )
    turn_rates_deg_s: tuple = parameter(
        (0.0, 0.003, 0.006, 0.01, 0.02, 0.05, 0.1, 0.2),
        List(Number(at_least=0, at_most=90), distinct=True),
        unit="deg/s",
        origin="ours",
    )
    track_file: str = parameter(
        "", File(), origin="ours", note="fixes of your own ship, see Your own data; empty: none"
    )
    reference_file: str = parameter(
        "", File(), origin="ours", note="a better track of the same time; empty: smoothed"
    )
    reference_window_s: float = parameter(
        60.0,
        Number(at_least=9, at_most=3600),
        unit="s",
        origin="ours",
        note="over which track_file is smoothed",
    )
    track_gap_s: float = parameter(
        10.0,
        Number(at_least=0.01, at_most=600),
        unit="s",
        origin="ours",
        note="longest gap between fixes",
    )
    runs: int = parameter(
        320, Integer(2, 1_000_000), origin="ours", note="the paper tells of none", quick=tenth(2)
    )
    seed: int = parameter(2, Integer(0), origin="assumed", note="the first one tried")

    def __attrs_post_init__(self):
        if self.steps <= self.examination:
            allowed = f"must exceed settle + pairs = {self.examination}: no examination is left"
            raise ParameterError("steps", self.steps, allowed)
        for name, size in (
            ("steps", self.steps),
            ("hidden", self.hidden),
            ("hidden_sizes", max(self.hidden_sizes)),
            ("max_epochs", self.max_epochs),
        ):
            if size * self.runs > MOST:
                allowed = f"must be at most {MOST // self.runs} with {self.runs} runs"
                raise ParameterError(name, getattr(self, name), allowed)

    @property
    def R(self) -> float:
        """Measurement variance per component, (m/s)²."""
        return self.noise**2

    @property
    def examination(self) -> int:
        """First step of the examination."""
        return self.settle + self.pairs

    @property
    def w1_grid(self) -> tuple:
        """Weights of the running measurement to compare: KF, the default and GLS among them."""
        return tuple(sorted({*self.weights, 0.0, self.w1, 1.0}))
