"""Paper 4 on a measured or tidal current: tables, conditions and pictures."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from seanav import estimates, plots
from seanav.claims import Condition
from seanav.filters import ins
from seanav.studies.imm_sea_current import figures, run, scores, tidal
from seanav.studies.imm_sea_current.flown import condition, shown
from seanav.studies.imm_sea_current.scenario import Scenario

HOUR = 3600.0
FLOWN = ("filter", "tcep_m", "rate_percent", "low", "high", "nis", "mode_1", "weak_less_strong")
EXACT = ("sigma_m_s", "time_s", "tide_m_s", "tcep_m", "over_best_flown")
TESTED = ("condition", "value", "low", "high", "region", "outcome")
KEEPS, STEADY = 90.0, 0.1  # percent; of a mode probability: fixed before any flight


def rows(sea: tidal.Sea, flown: Mapping[str, ins.Flight]) -> list[tuple]:
    """Return a row per filter with the entries of `FLOWN`; the rate is against the best EKF."""
    pure, best = flown[run.PURE.name], tidal.best(flown)
    found: list[tuple] = []
    for name, flight in flown.items():
        if scores.diverged(flight):
            found.append((name, None, None, None, None, None, None, None))
            continue
        rate: tuple = (None,) * 3
        if name == best:
            rate = (100.0,) * 3
        elif name != run.PURE.name:
            one = scores.rate(flight, pure, flown[best])
            rate = one.value, one.low, one.high
        mode: tuple = (None, None)
        if len(flight.mode_probability) > 1:
            apart = tidal.quarters(sea, flight)
            mode = scores.mode(flight).value, None if isinstance(apart, str) else apart.value
        nis = None if name == run.PURE.name else scores.nis(flight).value
        found.append((name, scores.tcep(flight).value, *rate, nis, *mode))
    return found


def fixed(scenario: Scenario, flown: Mapping[str, ins.Flight]) -> tidal.Belief:
    """Return the belief of the best fixed EKF that was flown."""
    return tidal.Belief(float(tidal.best(flown).split()[1]), scenario.correlation_time_s)


def exact_rows(
    scenario: Scenario, sea: tidal.Sea, flown: Mapping, exact: Mapping[tidal.Belief, float]
) -> list[tuple]:
    """Return a row per belief with the entries of `EXACT`, the best of each tide first."""
    if not exact:
        return []
    level = tidal.tcep(scenario, sea, fixed(scenario, flown))
    order = sorted(exact, key=lambda one: (one.tide, exact[one]))
    return [(b.sigma, b.time, b.tide, exact[b], exact[b] / level) for b in order]


def chosen(exact: Mapping[tidal.Belief, float]) -> dict[str, tidal.Belief]:
    """Return the best beliefs: with an oscillator, and of the paper's model with any T_c."""
    names = {"oscillator": True, "best T_c and σ_f": False}
    return {
        name: min((b for b in exact if bool(b.tide) == tide), key=exact.__getitem__)
        for name, tide in names.items()
        if exact
    }


def over_imm(
    scenario: Scenario,
    sea: tidal.Sea,
    flown: Mapping[str, ins.Flight],
    belief: tidal.Belief,
    name: str,
) -> estimates.Estimate | str:
    """Return the TCEP of a belief over that of a flown IMM, in the same currents.

    Exact TCEP of the belief over that of the best fixed EKF, times the ratio of the flown
    TCEPs of that EKF and the IMM: what the runs' sensors happened to add cancels.
    """
    if scores.diverged(flown[name]):
        return f"{name} diverged"
    one, best = (tidal.tcep(scenario, sea, b) for b in (belief, fixed(scenario, flown)))
    ratio = scores.tcep_ratio(flown[tidal.best(flown)], flown[name])
    return estimates.over(ratio, best / one)


def conditions(
    scenario: Scenario, sea: tidal.Sea, flown: Mapping[str, ins.Flight], exact: Mapping
) -> list[Condition]:
    """Return our three statements, tested: the gain kept, steady modes, the better model."""
    pure, best = flown[run.PURE.name], tidal.best(flown)
    found = []
    for pair in run.pairs(scenario):
        name = run.EKF(*pair).name
        if scores.diverged(flown[name]):
            found.append(condition(f"{name}: rate", f"{name} diverged", low=KEEPS))
            continue
        rate = scores.rate(flown[name], pure, flown[best])
        found.append(condition(f"{name}: rate against {best}", rate, low=KEEPS, unit="%"))
        apart = tidal.quarters(sea, flown[name])
        what = f"{name}: μ₁, weak less strong quarter"
        found.append(condition(what, apart, -STEADY, STEADY))
        for kind, belief in chosen(exact).items():
            ratio = over_imm(scenario, sea, flown, belief, name)
            aside = "" if kind == "oscillator" else "not counted"
            found.append(condition(f"{kind} over {name}: TCEP", ratio, high=1.0, aside=aside))
        slow = tidal.slower(run.EKF(*pair)).name
        if not scores.diverged(flown[slow]):
            ratio = scores.tcep_ratio(flown[slow], flown[name])
            found.append(condition(f"{slow} over it", ratio, high=1.0, aside="not counted"))
    return found


def tested(conditions: Sequence[Condition]) -> list[tuple]:
    """Return a row per condition with the entries of `TESTED`."""
    found = []
    for one in conditions:
        ends = (-np.inf, one.low), (np.inf, one.high)
        region = " … ".join("" if x == nowhere else f"{x:g}" for nowhere, x in ends)
        number: tuple = (None,) * 3
        if not isinstance(one.estimate, str) and not one.estimate.diverged:
            number = one.estimate.value, one.estimate.low, one.estimate.high
        found.append((one.what, *number, region, one.aside or one.outcome))
    return found


def water(sea: tidal.Sea, flown: Mapping[str, ins.Flight]) -> Figure:
    """Draw the currents of all missions, and the mean mode probabilities over time."""
    fig, axes = plt.subplots(1, 3, figsize=(10.2, 3.2))
    hours = np.arange(sea.current.shape[1]) / HOUR
    for axis, part, name in zip(axes, sea.current, ("north", "east"), strict=False):
        axis.plot(hours[::60], part[::60], color="0.3", lw=0.6, ls="-")
        axis.set(xlabel="time (h)", ylabel=f"current to the {name} (m/s)")
    for name, flight in flown.items():
        # Those of the fading filters lie upon them.
        if name.startswith("IMM-EKF ") and not scores.diverged(flight):
            curve = scores.mode_curve(flight)
            time = np.linspace(hours[-1] / len(curve), hours[-1], len(curve))
            plots.band(axes[2], time, curve, name, **figures.style(name))
    axes[2].set(xlabel="time (h)", ylabel="mode probability $\\mu_1$", ylim=(0, 1))
    plots.legend(axes[2], loc="upper center", bbox_to_anchor=(0.5, -0.2))
    return fig


def models(exact: Mapping[tidal.Belief, float]) -> Figure:
    """Draw the exact TCEP against the sigma of the Markov part, a line per kind of model."""
    lines: dict[tuple, list] = {}
    for one in exact:
        lines.setdefault((one.tide, one.time), []).append(one)
    fig, axis = plt.subplots(figsize=(6.4, 4.0))
    for k, ((tide, time), those) in enumerate(lines.items()):
        look = plots.look("hybrid" if tide else "Kalman", k)
        label = f"{time / HOUR:g} h" + (f", tide {tide:g} m/s" if tide else "")
        sigma = [one.sigma for one in those]
        axis.plot(sigma, [exact[one] for one in those], label=label, **look)
    axis.set(xlabel="belief of the Markov part (m/s)", ylabel="TCEP (m)", ylim=(0, None))
    plots.legend(axis, ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.15))
    return fig


def sentence(sea: tidal.Sea, flown: Mapping[str, ins.Flight]) -> str:
    """Say how strong the water was, and which fixed filter was best in it."""
    low, high = sea.strength.min(), sea.strength.max()
    name = tidal.best(flown)
    return (
        f"{len(sea.strength)} missions; RMS current of an axis {low:.2f} to {high:.2f} m/s. Best "
        f"fixed filter: {name}, TCEP {shown(scores.tcep(flown[name]), ' m')}."
    )
