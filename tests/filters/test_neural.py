"""The neural estimator and its teacher against closed forms and independent code."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from scipy import stats
from scipy.special import expit
from sklearn.neural_network import MLPRegressor

from seanav import checks, montecarlo
from seanav.filters import blended, neural

R, Q = 0.09, 0.005


@pytest.fixture
def z():
    return 5.0 + montecarlo.normals(1, "noise", 6, (80, 2)) * 0.3


def networks(runs=4, hidden=7, seed=3, spread=0.5):
    return neural.random_network(montecarlo.streams(seed, "weights", runs), hidden, spread)


def pairs(runs=4, count=20, seed=4):
    drawn = montecarlo.normals(seed, "pairs", runs, (2, count, 2)) * 0.5
    drawn = np.moveaxis(drawn, 0, -1) + 3.0
    return drawn[0], drawn[1]


# ---------------------------------------------------------------- numerical filters


def test_random_weights_are_uniform_around_zero():
    network = neural.random_network(montecarlo.streams(3, "weights", 50), 100, 0.2)
    drawn = np.concatenate([part.ravel() for part in (network.hidden, network.output)])
    assert np.abs(drawn).max() <= 0.2
    assert abs(drawn.mean()) < 4 * 0.2 / np.sqrt(3 * len(drawn))
    assert stats.kstest(drawn, "uniform", args=(-0.2, 0.4)).pvalue > 1e-3


def test_no_weight_on_the_measurement_is_the_kalman_filter_bit_for_bit(z):
    K, _ = blended.gains(Q, R, R, 80)
    x = z[:, 0].copy()
    ours = blended.estimate(z, K, 0.0, z[:, 0])
    for i in range(1, 80):
        x = x + K[i] * (z[:, i] - x)
        np.testing.assert_array_equal(ours[:, i], x)


def test_kalman_filter_agrees_with_filterpy(z):
    other = KalmanFilter(dim_x=2, dim_z=2)
    other.x, other.P, other.H = z[0, 0].copy(), np.eye(2) * R, np.eye(2)
    other.Q, other.R = np.eye(2) * Q, np.eye(2) * R
    K, P = blended.gains(Q, R, R, 80)
    ours = blended.estimate(z, K, 0.0, z[:, 0])
    for i in range(1, 80):
        other.predict()
        other.update(z[0, i])
        np.testing.assert_allclose(ours[0, i], other.x, rtol=1e-12)
        np.testing.assert_allclose(P[i] * np.eye(2), other.P, rtol=1e-12)


def test_full_weight_on_the_measurement_is_least_squares_of_two_points(z):
    K, _ = blended.gains(Q, R, R, 80)
    ours = blended.estimate(z, K, 1.0, z[:, 0])
    gain = K[1:, None]
    np.testing.assert_allclose(ours[:, 1:], (1 - gain) * z[:, :-1] + gain * z[:, 1:], rtol=1e-13)


def test_printed_innovation_contradicts_the_papers_own_sentence(z):
    K, _ = blended.gains(Q, R, R, 80)
    start = z[:, 0]
    printed = blended.estimate(z, K, 1.0, start, innovation="printed")
    assert np.abs(printed - blended.estimate(z, K, 1.0, start)).max() > 0.05
    kalman = blended.estimate(z, K, 0.0, start)
    np.testing.assert_array_equal(blended.estimate(z, K, 0.0, start, innovation="printed"), kalman)


def test_gain_settles_at_the_root_of_the_riccati_equation():
    K, _ = blended.gains(Q, R, R, 300)
    assert K[-1] == pytest.approx(blended.steady_gain(Q, R), rel=1e-12)
    assert K[-1] ** 2 * R == pytest.approx(Q * (1 - K[-1]), rel=1e-12)


@pytest.mark.parametrize("w1", [0.0, 0.3, 0.7, 1.0])
def test_closed_form_variance_is_the_sum_of_squared_impulse_response(w1):
    gain = blended.steady_gain(Q, R)
    impulse = np.zeros((1, 400, 2))
    impulse[0, 1] = 1.0
    response = blended.estimate(impulse, np.full(400, gain), w1, np.zeros((1, 2)))[0, :, 0]
    assert blended.steady_variance(gain, w1, R) == pytest.approx(R * (response**2).sum(), rel=1e-12)


@pytest.mark.parametrize("w1", [0.0, 0.3, 1.0])
def test_closed_form_variance_is_the_simulated_one(w1):
    z = montecarlo.normals(2, "noise", 4000, (61, 2)) * 0.3
    gain = blended.steady_gain(Q, R)
    last = blended.estimate(z, np.full(61, gain), w1, z[:, 0])[:, -1].ravel()
    error = last.var() * np.sqrt(2 / last.size)
    assert abs((last**2).mean() - blended.steady_variance(gain, w1, R)) < 4 * error


def test_manoeuvre_weight_is_causal_low_when_steady_and_high_in_a_turn():
    z = montecarlo.normals(2, "noise", 50, (120, 2)) * 0.3
    z[:, 60:, 0] += 0.3 * np.arange(60)
    K, P = blended.gains(Q, R, R, 120)
    weight = blended.manoeuvre_weight(z, K, P, R, Q, z[:, 0])
    cut = blended.manoeuvre_weight(z[:, :70], K[:70], P[:70], R, Q, z[:, 0])
    np.testing.assert_array_equal(weight[:, :70], cut)
    assert weight[:, 10:60].mean() < 0.1
    assert weight[:, 70:].mean() > 0.9
    assert ((weight >= 0) & (weight <= 1)).all()


# ---------------------------------------------------------------- the network


def test_logistic_function_is_right_to_the_last_bits():
    v = np.concatenate([np.linspace(-40, 40, 20001), [-800.0, 800.0, 0.0]])
    ours = v.copy()
    neural._logistic(ours)
    np.testing.assert_allclose(ours[:-3], expit(v[:-3]), rtol=1e-15)
    assert ours[-3] < 1e-300
    np.testing.assert_array_equal(ours[-2:], [1.0, 0.5])


def test_output_is_the_one_of_plain_numpy():
    net, (x, _) = networks(), pairs()
    u1, u2, threshold, out1, out2 = net.hidden[:, :, 1]
    s = x[:, :, 1] / 20 + 0.5
    hidden = expit(np.outer(s[:, 0], u1) + np.outer(s[:, 1], u2) + threshold)
    expected = expit(hidden @ np.stack([out1, out2], axis=1) + net.output[:, 1])
    np.testing.assert_allclose(net(x)[:, :, 1], 20 * (expected - 0.5), rtol=1e-12, atol=1e-13)


def test_scaling_round_trip():
    v = np.linspace(-10, 10, 41)
    np.testing.assert_allclose(neural.unscale(neural.scale(v)), v, atol=1e-14)
    assert neural.scale(-10.0) == 0.0
    assert neural.scale(10.0) == 1.0


def loss(hidden, output, x, t):
    answer = neural.scale(neural.Network(hidden, output)(x))
    return 0.5 * ((answer - neural.scale(t)) ** 2).sum(axis=(0, 1))


def one_step(net, x, t, rate=1e-3):
    after = neural.teach(net, x, t, rate=rate, max_epochs=1).network
    return (net.hidden - after.hidden) / rate, (net.output - after.output) / rate


def test_one_correction_is_the_gradient_by_central_differences():
    net = networks(spread=2.0)
    x, t = pairs(count=1)
    hidden, output = one_step(net, x, t + 4.0)
    for place in np.ndindex(net.hidden.shape[:2]):
        shift = np.zeros_like(net.hidden)
        shift[place] = 1e-5
        up = loss(net.hidden + shift, net.output, x, t + 4.0)
        down = loss(net.hidden - shift, net.output, x, t + 4.0)
        np.testing.assert_allclose(hidden[place], (up - down) / 2e-5, rtol=1e-7, atol=1e-9)
    for k in range(2):
        shift = np.zeros_like(net.output)
        shift[k] = 1e-5
        up = loss(net.hidden, net.output + shift, x, t + 4.0)
        down = loss(net.hidden, net.output - shift, x, t + 4.0)
        np.testing.assert_allclose(output[k], (up - down) / 2e-5, rtol=1e-7, atol=1e-9)


def test_one_correction_is_the_one_of_scikit_learn():
    # MLPRegressor has linear outputs: a target shifted so that its error equals the
    # slope of ours makes the two corrections the same.
    net = networks(runs=1, hidden=9)
    x, t = pairs(runs=1, count=1)
    s, answer = neural.scale(x[:, :, 0]), neural.scale(net(x)[:, :, 0])
    other = MLPRegressor(
        hidden_layer_sizes=(9,), activation="logistic", solver="sgd", alpha=0.0,
        batch_size=1, momentum=0.0,
        learning_rate_init=0.1, random_state=0,
    )  # fmt: skip
    other.partial_fit(s, answer)
    other.coefs_ = [net.hidden[:2, :, 0].copy(), net.hidden[3:, :, 0].T.copy()]
    other.intercepts_ = [net.hidden[2, :, 0].copy(), net.output[:, 0].copy()]
    # The optimizer keeps references to the parameters that it was made with.
    other._optimizer.params = other.coefs_ + other.intercepts_
    slope = (answer - neural.scale(t[:, :, 0])) * answer * (1 - answer)
    other.partial_fit(s, other.predict(s) - slope)
    after = neural.teach(net, x, t, rate=0.1, max_epochs=1).network
    np.testing.assert_allclose(after.hidden[:2, :, 0], other.coefs_[0], rtol=1e-12)
    np.testing.assert_allclose(after.hidden[3:, :, 0].T, other.coefs_[1], rtol=1e-12)
    np.testing.assert_allclose(after.hidden[2, :, 0], other.intercepts_[0], rtol=1e-12)
    np.testing.assert_allclose(after.output[:, 0], other.intercepts_[1], rtol=1e-12)
    assert np.abs(after.hidden - net.hidden).max() > 1e-5


def test_exclusive_or_is_learnt():
    corners = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]])
    answers = np.array([[0.1, 0.9], [0.9, 0.1], [0.9, 0.1], [0.1, 0.9]])
    x = np.repeat(neural.unscale(corners)[:, :, None], 6, axis=2)
    t = np.repeat(neural.unscale(answers)[:, :, None], 6, axis=2)
    net = networks(runs=6, hidden=12, spread=1.0)
    # Three times the epochs it needs: with hidden weights taught wrongly the output layer
    # gets there late or never.
    done = neural.teach(net, x, t, rate=2.0, delta=0.02, reading="rms", max_epochs=1000)
    assert done.met.all()
    assert np.abs(neural.scale(done.network(x)) - neural.scale(t)).max() < 0.1


def test_error_readings_and_reason_for_the_stop():
    net, (x, t) = networks(), pairs()
    capped = neural.teach(net, x, t, delta=1e-9, max_epochs=30)
    assert not capped.met.any()
    np.testing.assert_array_equal(capped.epochs, 30)
    square, rms, largest = capped.history[-1]
    np.testing.assert_allclose(rms**2, square, rtol=1e-14)
    assert (rms < largest).all()
    assert (largest**2 < square * 40).all()
    stopped = neural.teach(net, x, t, delta=0.01, reading="mean square", max_epochs=30)
    assert stopped.met.all()
    for run, epochs in enumerate(stopped.epochs):
        assert stopped.history[epochs - 1, 0, run] < 0.01
        assert (stopped.history[: epochs - 1, 0, run] >= 0.01).all()


def test_error_readings_are_those_of_plain_numpy():
    net, (x, t) = networks(), pairs()
    t = t - 3.0  # misses of both signs, so that the largest one is negative in some run
    miss = neural.scale(t) - neural.scale(net(x))
    assert (miss.max(axis=(0, 1)) < -miss.min(axis=(0, 1))).any()
    history = neural.teach(net, x, t, rate=1e-15, max_epochs=1).history[0]
    square = (miss**2).mean(axis=(0, 1))
    expected = [square, np.sqrt(square), np.abs(miss).max(axis=(0, 1))]
    np.testing.assert_allclose(history, expected, rtol=1e-10)


@pytest.mark.parametrize("reading", neural.READINGS)
def test_each_reading_stops_at_its_own_error(reading):
    net, (x, t) = networks(), pairs()
    kind = neural.READINGS.index(reading)
    free = neural.teach(net, x, t, delta=1e-12, max_epochs=30).history[:, kind]
    delta = np.sort(free.min(axis=0))[1] * 1.000001  # one run or two get below it
    done = neural.teach(net, x, t, delta=delta, reading=reading, max_epochs=30)
    below = free < delta
    np.testing.assert_array_equal(done.met, below.any(axis=0))
    assert 0 < done.met.sum() < 4
    expected = np.where(done.met, below.argmax(axis=0) + 1, 30)
    np.testing.assert_array_equal(done.epochs, expected)


def test_a_stopped_run_is_frozen_while_others_learn():
    net, (x, t) = networks(), pairs()
    t = t.copy()
    t[..., 0] = net(x)[..., 0]  # run 0 knows its answers already
    together = neural.teach(net, x, t, delta=1e-6, max_epochs=40)
    np.testing.assert_array_equal(together.met, [True, False, False, False])
    np.testing.assert_array_equal(together.network.hidden[..., 0], net.hidden[..., 0])


def test_a_stopped_run_keeps_the_weights_of_its_last_epoch():
    net, (x, t) = networks(), pairs()
    done = neural.teach(net, x, t, delta=1.5e-3, reading="mean square", max_epochs=30)
    assert len(set(done.epochs)) > 1
    for run, epochs in enumerate(done.epochs):
        alone = neural.teach(net, x, t, delta=1e-12, max_epochs=int(epochs)).network
        np.testing.assert_array_equal(done.network.hidden[..., run], alone.hidden[..., run])
        np.testing.assert_array_equal(done.network.output[:, run], alone.output[:, run])


def test_runs_do_not_depend_on_their_batch_nor_on_repetition():
    net, (x, t) = networks(), pairs()
    all_runs = neural.teach(net, x, t, max_epochs=25)
    np.testing.assert_array_equal(
        all_runs.network.hidden, neural.teach(net, x, t, max_epochs=25).network.hidden
    )
    part = slice(2, 3)
    alone = neural.teach(net.runs(part), x[..., part], t[..., part], max_epochs=25)
    np.testing.assert_array_equal(all_runs.network.hidden[..., part], alone.network.hidden)
    np.testing.assert_array_equal(all_runs.network(x)[..., part], alone.network(x[..., part]))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda n, x, t: neural.teach(n, x[:0], t[:0]), r"inputs = \(0, 2, 4\): must have the"),
        (lambda n, x, t: neural.teach(n, x, t[1:]), r"targets = \(19, 2, 4\): must have the"),
        (
            lambda n, x, t: neural.teach(n.runs(slice(0, 2)), x, t),
            r"inputs = \(20, 2, 4\): must have the shape \(20, 2, 2\)",
        ),
        (
            lambda n, x, t: neural.teach(n, x, t, rate=1e308, max_epochs=5),
            r"rate = 1e\+308: must be smaller: the weights overflow",
        ),
        (lambda n, x, t: n(x[..., 1:]), r"x = \(20, 2, 3\): must have the shape \(20, 2, 4\)"),
        (lambda n, x, t: neural.teach(n, x, t, delta=0.0), r"delta = 0.0: .*above 0"),
        (lambda n, x, t: neural.teach(n, x, t, rate=-1), r"rate = -1: .*above 0"),
        (lambda n, x, t: neural.teach(n, x, t, max_epochs=0), r"max_epochs = 0: .*at least 1"),
        (lambda n, x, t: neural.teach(n, x, t, reading="worst"), "reading = 'worst': must be one"),
        (lambda n, x, t: networks(hidden=0), "hidden = 0: must be an integer of at least 1"),
        (
            lambda n, x, t: blended.estimate(np.ones((1, 3, 2)), np.ones(3), 1.2, np.ones((1, 2))),
            "w1 = 1.2: ",
        ),
        (lambda n, x, t: blended.gains(Q, 0.0, R, 5), r"R = 0.0: .*above 0"),
    ],
)
def test_bad_input_is_one_clear_line(call, message):
    net, (x, t) = networks(), pairs()
    with pytest.raises(checks.ParameterError, match=message) as error:
        call(net, x, t)
    assert "\n" not in str(error.value)
