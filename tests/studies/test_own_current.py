"""Paper 4 on an own record of the current: reading, missions, exact covariance, flights."""

import math

import attrs
import numpy as np
import pytest

from seanav.checks import ParameterError
from seanav.studies.imm_sea_current import linear, own_current, own_figures, run, scores, tidal
from seanav.studies.imm_sea_current.scenario import Scenario

SHORT = Scenario(duration_s=600, runs=16, current_missions=16, corner_radius=100)


def written(folder, text):
    path = folder / "mine.csv"
    path.write_text(text, encoding="utf-8")
    return str(path)


def table(folder, head="time,north_m_s,east_m_s", count=20, step=600, line=None):
    line = line or (lambda k: f"{k * step},{0.1 * math.sin(k):.6f},{0.05:.6f}")
    return written(folder, "\n".join([head, *map(line, range(count))]) + "\n")


# ---------------------------------------------------------------- the file

GOOD = "0,0.1,0.1\n600,0.2,0.1\n1200,0.1,0.0\n"
HEAD = "time,north_m_s,east_m_s\n"
BAD = {
    "": "must not be empty",
    "time,north_m_s\n0,1\n600,1\n1200,1\n": "must have the columns",
    "time,north_kn,east_kn\n" + GOOD: "multiply by 0.514444",
    "time,north_cm_s,east_cm_s\n" + GOOD: "divide by 100",
    "north_m_s,east_m_s\n1,1\n1,1\n": "must have the columns",
    "time;north_m_s;east_m_s\n" + GOOD.replace(",", ";"): "separated by commas",
    HEAD: "rows",
    HEAD + "0,0.1,0.1\n": "rows",
    HEAD + "0,x,0.1\n600,0.2,0.1\n1200,0,0\n": "row 2",
    HEAD + "0,0.1,0.1\n600,,0.1\n1200,0,0\n": "row 3",
    HEAD + "0,0.1,0.1\n600,nan,0.1\n1200,0,0\n": "row 3",
    HEAD + "0,0.1,0.1\n600,0.1,45\n1200,0,0\n": "row 3: east_m_s = 45",
    HEAD + "0,0.1,0.1\n600,0.1,0.1\n600,0,0\n": "row 4",
    HEAD + "0,0.1,0.1\n600,0.1,0.1\n500,0,0\n": "row 4",
    HEAD + "0,0.1,0.1\n11000,0.1,0.1\n12000,0,0\n": "gaps may be 10800 s",
    HEAD + "0,0.1,0.1\n600,0.1,0.1\n1100,0,0\n": "must last 2 missions",
    HEAD + "0,0.1,0.1\n600,0.1\n1200,0,0\n": "row 3",
    HEAD + "0,0.1,0.1\n2017-04-06T12:10:00Z,0.1,0.1\n1200,0,0\n": "row 3",
    HEAD + "06/04/2017,0.1,0.1\n07/04/2017,0.1,0.1\n": "row 2",
    "time,speed_m_s,direction_deg\n0,-0.1,10\n600,0.1,10\n1200,0,0\n": "row 2: speed_m_s",
    "time,speed_m_s,direction_deg\n0,0.1,10\n600,0.1,361\n1200,0,0\n": "row 3: direction_deg",
}


@pytest.mark.parametrize("text", BAD)
def test_a_file_that_does_not_fit_is_refused_in_one_line(tmp_path, text):
    with pytest.raises(ParameterError) as error:
        tidal.sea(attrs.evolve(SHORT, current_file=written(tmp_path, text)))
    said = str(error.value)
    assert BAD[text] in said
    assert "\n" not in said
    assert said.startswith("current_file")
    assert [p.name for p in tmp_path.iterdir()] == ["mine.csv"]


@pytest.mark.parametrize("where", ["none.csv", ""])
def test_no_file_and_a_folder_are_refused(tmp_path, where):
    with pytest.raises(ParameterError, match="current_file"):
        tidal.sea(attrs.evolve(SHORT, current_file=str(tmp_path / where)))


def test_missions_follow_each_other_and_are_interpolated(tmp_path):
    path = table(tmp_path, count=8, line=lambda k: f"{k * 450},{k * 0.45:.2f},{1 - k * 0.09:.2f}")
    starts, current = own_current.missions(
        SHORT, own_current.read(attrs.evolve(SHORT, current_file=path))
    )
    assert starts.tolist() == [0, 600, 1200, 1800, 2400]
    time = starts + np.arange(601)[:, None]
    np.testing.assert_allclose(current, [time * 1e-3, 1 - time * 2e-4], atol=1e-12)


def test_of_too_many_missions_the_chosen_are_spread_over_the_record(tmp_path):
    few = attrs.evolve(SHORT, current_file=table(tmp_path, count=41), current_missions=3)
    starts, current = own_current.missions(few, own_current.read(few))
    assert starts.tolist() == [0, 12000, 23400]
    assert current.shape == (2, 601, 3)


def test_a_direction_is_where_the_water_flows_to(tmp_path):
    lines = {0: (1.0, 0), 1: (1.0, 90), 2: (2.0, 225)}
    path = table(
        tmp_path, "time,speed_m_s,direction_deg", 3,
        line=lambda k: f"{k * 600},{lines[k][0]},{lines[k][1]}",
    )  # fmt: skip
    flow = own_current.velocities(own_current.read(attrs.evolve(SHORT, current_file=path)))
    root = math.sqrt(2)
    np.testing.assert_allclose(flow, [[1, 0, -root], [0, 1, -root]], atol=1e-12)


def test_the_mean_that_is_removed_is_that_over_time(tmp_path):
    times, values = (0, 100, 1200), (0.0, 1.0, 1.0)
    path = table(tmp_path, count=3, line=lambda k: f"{times[k]},{values[k]},0.2")
    flow = own_current.velocities(
        own_current.read(attrs.evolve(SHORT, current_file=path)), "removed"
    )
    np.testing.assert_allclose(flow[0], np.array(values) - 1150 / 1200, atol=1e-12)
    np.testing.assert_allclose(flow[1], 0.0, atol=1e-12)


# ---------------------------------------------------------------- exact numbers


def test_the_papers_model_is_the_special_case_without_a_tide():
    belief = tidal.Belief(0.3, SHORT.correlation_time_s)
    np.testing.assert_array_equal(tidal.gains(SHORT, belief)[0], linear.gains(SHORT, 0.3))
    none = tidal.Sea("none", np.zeros((2, 601, 1)))
    exact = linear.mean_squares(SHORT, 0.3)[0][1:, :2] * linear.metres(SHORT)[1:] ** 2
    found = tidal.mean_squares(SHORT, none, belief)[:, 0]
    np.testing.assert_allclose(found, exact.mean(axis=0), rtol=1e-9)


def test_a_tide_of_no_strength_changes_nothing():
    one, other = tidal.Belief(0.3, 7200.0), tidal.Belief(0.3, 7200.0, 1e-9)
    sea = tidal.sea(SHORT)
    np.testing.assert_allclose(
        tidal.mean_squares(SHORT, sea, one), tidal.mean_squares(SHORT, sea, other), rtol=1e-6
    )


def test_over_many_markov_currents_the_response_is_the_linear_covariance():
    many = attrs.evolve(SHORT, current="markov", current_missions=256, sigma_true=(0.4,))
    start = attrs.evolve(many, initial_current="stationary")
    own = tidal.tcep(many, tidal.sea(many), tidal.Belief(0.1, many.correlation_time_s))
    assert own == pytest.approx(linear.tcep(start, 0.1, 0.4), rel=0.1)  # 256 runs: 4 %, 2.5 s


def test_the_oscillator_is_right_where_it_is_true():
    # A tide of random phase and a quiet rest: the covariance that the filter believes is the
    # mean of what it does. Squares of 0, 90, 180 and 270 degrees have the mean of all phases.
    drawn = attrs.evolve(SHORT, initial_errors="drawn")
    belief, speed = tidal.Belief(1e-6, 7200.0, 0.3, 2e-3), 2e-3
    time, four = np.arange(601)[:, None], np.arange(4) * math.pi / 2
    wave, still = 0.3 * math.sqrt(2) * np.cos(speed * time + four), np.zeros((601, 4))
    flow = np.concatenate([[wave, still], [still, wave]], axis=2)
    found = tidal.mean_squares(drawn, tidal.Sea("tide", flow), belief)
    none = tidal.mean_squares(drawn, tidal.Sea("none", 0 * flow), belief)
    both = found[:, :4].mean(axis=1) + found[:, 4:].mean(axis=1) - none[:, 0]
    P = np.einsum("kii->ki", tidal.gains(drawn, belief)[1])[1:, :2]
    believed = (P * linear.metres(drawn)[1:] ** 2).mean(axis=0)
    np.testing.assert_allclose(both, believed, rtol=1e-6)


def test_flights_agree_with_the_exact_numbers():
    sea = tidal.sea(attrs.evolve(SHORT, current_missions=64))
    flown = tidal.fly(SHORT, sea, [run.EKF(0.1)])["EKF 0.1"]
    exact = tidal.tcep(SHORT, sea, tidal.Belief(0.1, SHORT.correlation_time_s))
    found = scores.tcep(flown)
    assert abs(found.value - exact) < 2 * found.se + 0.02 * exact


def test_the_response_has_the_signs_of_the_flights():
    # With a current, with the opposite one and with none: what the sensors do cancels run by
    # run. The signs of north and east to each other matter here, by over 10 %.
    def both(flow):
        sea = tidal.Sea("steady", np.ones((2, 601, 16)) * np.reshape(flow, (2, 1, 1)))
        flown = tidal.fly(SHORT, sea, [run.EKF(0.3)])["EKF 0.3"].mean_squares
        exact = tidal.mean_squares(SHORT, sea, tidal.Belief(0.3, 7200.0)).mean(axis=1)
        return np.array([[flown.north.mean(), flown.east.mean()], exact])

    none, found = both([0, 0]), []
    for sign in (1, -1):
        flow = np.array([0.5, 0.5 * sign])
        flown, exact = both(flow) / 2 + both(-flow) / 2 - none
        np.testing.assert_allclose(exact, flown, rtol=0.03)
        found.append(exact)
    assert (np.abs(found[0] / found[1] - 1) > 0.1).any()


# ---------------------------------------------------------------- flights


def test_the_papers_unit_current_flies_as_before():
    sensors = run.sense(SHORT, 0)
    current = 0.3 * sensors.unit_current[:, :2].transpose(1, 0, 2)
    own = tidal.fly(SHORT, tidal.Sea("paper", current), [run.EKF(0.1)])["EKF 0.1"]
    before = run.fly(SHORT, sensors, run.EKF(0.1), 0.3)
    # The paper's vertical current does not reach a forward log on a level path.
    np.testing.assert_allclose(own.mean_squares.north, before.mean_squares.north, rtol=1e-9)


@pytest.mark.parametrize("name", ["tidal", "markov", "file"])
@pytest.mark.parametrize("axes", [1, 3])
def test_tables_and_pictures_are_made_of_any_current(tmp_path, name, axes):
    source = {"current": name}
    if name == "file":
        source = {"current_file": table(tmp_path)}
    own = attrs.evolve(SHORT, log_axes=axes, **source)
    sea = tidal.sea(own)
    flown, exact = tidal.fly(own, sea), {}
    if axes == 1:
        exact = {b: tidal.tcep(own, sea, b) for b in tidal.beliefs()[::7]}
    rows = own_figures.rows(sea, flown)
    assert len(rows) == len(tidal.filters(own))
    assert all(len(row) == len(own_figures.FLOWN) for row in rows)
    assert len(own_figures.exact_rows(own, sea, flown, exact)) == len(exact)
    tested = own_figures.tested(own_figures.conditions(own, sea, flown, exact))
    assert all(row[-1] for row in tested)
    own_figures.water(sea, flown)
    own_figures.models(exact)
    assert str(tmp_path) not in sea.name + own_figures.sentence(sea, flown)


def test_quarters_are_the_weakest_and_the_strongest_missions():
    current = np.ones((2, 601, 8)) * [3, 1, 2, 5, 4, 8, 7, 6]
    sea = tidal.Sea("steps", current)
    flight = type("Flight", (), {"mode_probability": np.array([[0, 0.9, 0.7, 0, 0, 0.2, 0.4, 0]])})
    found = tidal.quarters(sea, flight)
    assert found.value == pytest.approx(0.8 - 0.3)
    assert found.se == pytest.approx(math.sqrt(4 * 0.01 * 4**2 / 7 / 8), rel=1e-12)
    assert isinstance(tidal.quarters(tidal.Sea("few", current[..., :7]), flight), str)
