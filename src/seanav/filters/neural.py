"""The neural estimator: a 2-H-2 logistic network, taught by `seanav.filters.blended`.

Stateczny, "Neural state estimation in sea navigation" (2000), section 3. Networks
of many runs are taught together, runs innermost.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from seanav import checks
from seanav._compile import kernel

READINGS = ("mean square", "rms", "max")  # of the teaching error that Δ bounds

# ---------------------------------------------------------------- the network


@dataclass(frozen=True, eq=False)
class Network:
    """The weights of one network per run.

    Attributes
    ----------
    hidden : ndarray, shape (5, H, runs)
        Per hidden neuron: weights from the two inputs, its threshold, weights to the
        two outputs.
    output : ndarray, shape (2, runs)
        Thresholds of the output neurons.
    """

    hidden: np.ndarray
    output: np.ndarray

    def __post_init__(self):
        sizes = {}
        hidden = checks.array("hidden", self.hidden, (5, "neurons", "runs"), sizes)
        output = checks.array("output", self.output, (2, "runs"), sizes)
        object.__setattr__(self, "hidden", hidden)
        object.__setattr__(self, "output", output)

    def __call__(self, x: ArrayLike) -> np.ndarray:
        """Return the output for `x` in m/s, shape (points, 2, runs), in m/s."""
        scaled = _scale(checks.array("x", x, ("points", 2, self.output.shape[1])))
        result = np.empty_like(scaled)
        _answers(self.hidden, self.output, scaled, result)
        return _unscale(result)

    def runs(self, part: slice) -> Self:
        """Return the networks of the runs in the slice `part`."""
        return type(self)(self.hidden[:, :, part], self.output[:, part])


@dataclass(frozen=True, eq=False)
class Teaching:
    """What a teaching session did; history has shape (epochs, 3, runs), order `READINGS`.

    Errors are in scaled units, each pair's before its own correction; `epochs` counts
    the epochs that changed the weights (runs,), `met` says that Δ was reached (runs,):
    where it is false the cap on the epochs was the stop. After its stop a run's
    history goes on with frozen weights while other runs of the batch learn.
    """

    network: Network
    epochs: np.ndarray
    met: np.ndarray
    history: np.ndarray


def scale(v: ArrayLike) -> np.ndarray:
    """Return speed components, of any shape, scaled into [0, 1]: -10 m/s is 0, 10 m/s is 1."""
    return _scale(checks.array("v", v, (...,)))


def unscale(s: ArrayLike) -> np.ndarray:
    """Return the speed components in m/s, the inverse of `scale`."""
    return _unscale(checks.array("s", s, (...,)))


def _scale(v):
    return v / 20.0 + 0.5


def _unscale(s):
    return (s - 0.5) * 20.0


def random_network(
    generators: list[np.random.Generator], hidden: int, spread: float = 0.5
) -> Network:
    """Return one network per generator, weights uniform in [-spread, spread].

    Parameters
    ----------
    generators : list of numpy.random.Generator
        One per run.
    hidden : int
        Neurons of the hidden layer, from 1 to 100 000.
    spread : float
        Largest initial weight, above 0.
    """
    hidden = checks.integer("hidden", hidden, at_least=1, at_most=10**5)
    spread = checks.number("spread", spread, above=0)
    drawn = np.stack([g.uniform(-spread, spread, 5 * hidden + 2) for g in generators], axis=-1)
    return Network(drawn[:-2].reshape(hidden, 5, -1).transpose(1, 0, 2).copy(), drawn[-2:].copy())


def teach(
    network: Network,
    inputs: ArrayLike,
    targets: ArrayLike,
    *,
    rate: float = 0.1,
    delta: float = 0.001,
    reading: str = "max",
    max_epochs: int = 500,
) -> Teaching:
    """Teach by the delta rule with backpropagation, pair after pair, until the error < Δ.

    Parameters
    ----------
    network : Network
        Where the teaching starts; it is not changed.
    inputs, targets : array, shape (pairs, 2, runs)
        Teaching sequence in m/s: running measurement, the teacher's answer.
    rate : float
        Learning rate, above 0.
    delta : float
        Bound on the teaching error of an epoch, in scaled units, above 0.
    reading : {"mean square", "rms", "max"}
        Which error: over pairs and components.
    max_epochs : int
        Cap on the number of epochs, from 1 to a million: the history holds them all.

    Returns
    -------
    Teaching

    Raises
    ------
    seanav.checks.ParameterError
        If the teaching sequence is empty or does not fit the runs of the network, a number
        is not finite or out of its bounds, or the rate so large that the weights overflow.

    Notes
    -----
    Paper, section 3. Each pair lowers half the sum of squares of its two errors.
    """
    rate = checks.number("rate", rate, above=0)
    delta = checks.number("delta", delta, above=0)
    checks.choice("reading", reading, READINGS)
    max_epochs = checks.integer("max_epochs", max_epochs, at_least=1, at_most=10**6)
    hidden, output = network.hidden.copy(), network.output.copy()
    runs = output.shape[1]
    sizes = {}
    inputs = checks.array("inputs", inputs, ("pairs", 2, runs), sizes)
    targets = checks.array("targets", targets, ("pairs", 2, runs), sizes)
    history = np.empty((max_epochs, 3, runs))
    epochs = np.zeros(runs, dtype=np.int64)
    met = np.zeros(runs, dtype=np.bool_)
    done = _teach(
        hidden,
        output,
        _scale(inputs),
        _scale(targets),
        rate,
        delta,
        READINGS.index(reading),
        history,
        epochs,
        met,
    )
    if not (np.isfinite(hidden).all() and np.isfinite(output).all()):
        raise checks.ParameterError("rate", rate, "must be smaller: the weights overflow")
    return Teaching(Network(hidden, output), epochs, met, history[:done])


# An exponential of our own, for two reasons: the mathematical libraries of two machines
# differ in the last bit, and a call to one keeps the compiler from vectorising over runs.
_LOG2E = 1.4426950408889634
_LN2_HIGH = 0.693147180369123816490  # 32 bits of ln 2, so that k times it is exact
_LN2_LOW = 1.90821492927058770002e-10
_SHIFT = 6755399441055744.0 + 1023.0  # 1.5 · 2⁵²: adding it leaves an integer in the low bits


@kernel
def _logistic(v):
    # 1 / (1 + exp(-v)) in place. -v = k ln 2 + r, and exp(r) is its Padé quotient of order
    # [6/6], (even + odd) / (even - odd), 2e-19 off at most: the only division is the last.
    for n in range(v.size):
        x = min(max(-v[n], -700.0), 700.0)
        shifted = x * _LOG2E + _SHIFT
        k = shifted - _SHIFT
        r = (x - k * _LN2_HIGH) - k * _LN2_LOW
        # k + 1023 moves from the low bits into the exponent: the float 2ᵏ.
        power = np.int64(np.float64(shifted).view(np.int64) << 52).view(np.float64)
        square = r * r
        even = 1.0 + square * (5 / 44 + square * (1 / 792 + square * (1 / 665280)))
        odd = r * (1 / 2 + square * (1 / 66 + square * (1 / 15840)))
        below = even - odd
        v[n] = below / (below + power * (even + odd))


@kernel
def _forward(hidden, output, x, signal, answer):
    # signal (H, runs) and answer (2, runs) are filled.
    neurons, runs = signal.shape
    for h in range(neurons):
        for r in range(runs):
            signal[h, r] = hidden[0, h, r] * x[0, r] + hidden[1, h, r] * x[1, r] + hidden[2, h, r]
    _logistic(signal.reshape(neurons * runs))
    for k in range(2):
        for r in range(runs):
            answer[k, r] = output[k, r]
        for h in range(neurons):
            for r in range(runs):
                answer[k, r] += hidden[3 + k, h, r] * signal[h, r]
    _logistic(answer.reshape(2 * runs))


@kernel
def _answers(hidden, output, x, result):
    neurons, runs = hidden.shape[1:]
    signal = np.empty((neurons, runs))
    for i in range(x.shape[0]):
        _forward(hidden, output, x[i], signal, result[i])


@kernel
def _teach(hidden, output, inputs, targets, rate, delta, reading, history, epochs, met):
    # Changes hidden and output; returns the number of epochs that were begun.
    neurons, runs = hidden.shape[1:]
    pairs = inputs.shape[0]
    signal = np.empty((neurons, runs))
    answer = np.empty((2, runs))
    slope = np.empty((2, runs))
    step = np.full(runs, rate)  # a run that has stopped goes on with rate 0
    for epoch in range(history.shape[0]):
        error = history[epoch]
        error[:] = 0.0
        for i in range(pairs):
            x = inputs[i]
            _forward(hidden, output, x, signal, answer)
            for k in range(2):
                for r in range(runs):
                    miss = targets[i, k, r] - answer[k, r]
                    error[0, r] += miss * miss
                    error[2, r] = max(error[2, r], abs(miss))
                    slope[k, r] = step[r] * miss * answer[k, r] * (1.0 - answer[k, r])
                    output[k, r] += slope[k, r]
            for h in range(neurons):
                for r in range(runs):
                    s = signal[h, r]
                    back = slope[0, r] * hidden[3, h, r] + slope[1, r] * hidden[4, h, r]
                    back *= s * (1.0 - s)
                    hidden[0, h, r] += back * x[0, r]
                    hidden[1, h, r] += back * x[1, r]
                    hidden[2, h, r] += back
                    hidden[3, h, r] += slope[0, r] * s
                    hidden[4, h, r] += slope[1, r] * s
        active = False
        for r in range(runs):
            error[0, r] /= 2.0 * pairs
            error[1, r] = np.sqrt(error[0, r])
            if not met[r]:
                epochs[r] += 1
                if error[reading, r] < delta:
                    met[r] = True
                    step[r] = 0.0
                else:
                    active = True
        if not active:
            return epoch + 1
    return history.shape[0]
