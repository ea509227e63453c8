"""Adaptive fading: how much larger the residuals are than the filter thinks.

Nothing here knows what is estimated. Arrays hold independent runs innermost.

References
----------
Cha, Hwang and Park, *The Journal of Navigation*, 2022, equations (14)-(17);
K. H. Kim, J. G. Lee and C. G. Park, "Adaptive two-stage extended Kalman filter for a
fault-tolerant INS-GPS loosely coupled system", *IEEE Transactions on Aerospace and
Electronic Systems* 45 (2009) 125-137.
"""

from seanav._compile import kernel

# What the factor beta is applied to. The first is the paper's equation (17) read literally.
NONE, LITERAL, LITERAL_GAIN, BLOCK, VARIANCE, SIGMA = range(6)
FORMS = {
    "none": NONE,  # a plain Kalman filter
    "literal": LITERAL,  # P ← beta P, gamma = beta
    "literal-gain": LITERAL_GAIN,  # P ← beta P and the gain divided by beta, gamma = 1
    "block": BLOCK,  # only the block of the doubtful states of P times beta
    "variance": VARIANCE,  # process noise variance of the doubtful states: q ← beta q
    "sigma": SIGMA,  # its standard deviation: q ← beta² q
}


@kernel
def _remember(window, step, squared, total):
    """Put this step's squared residual into the ring and write the sum over the window.

    Parameters
    ----------
    window : (M, runs), changed
        Start with zeros.
    step : int
        Steps before this one.
    squared : (runs,)
        Squared residual (its trace, for a vector), from before the adaptation.
    total : (runs,), output
        Sum over the min(step + 1, M) residuals at hand.
    """
    M, runs = window.shape
    slot = step % M
    for r in range(runs):
        window[slot, r] = squared[r]
        total[r] = 0.0
    for m in range(M):
        for r in range(runs):
            total[r] += window[m, r]


@kernel
def _factor(total, count, S, cap):
    """Return beta = max(1, Ŝ/S), equation (16), with Ŝ = total / (count − 1), (15).

    It is 1 while fewer than two residuals are at hand, and never above `cap`.
    """
    if count < 2:
        return 1.0
    return min(max(1.0, total / (count - 1) / S), cap)
