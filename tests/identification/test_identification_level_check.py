"""Level check: modes against the level, from FRFs of each level and from free decays."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from identification.level_check import LevelCheck, check_decay, check_levels, track_decay
from identification.level_check.shared_shapes import _apply_step, _linearise, fit_poles
from identification.level_check.trends import (
    ModeTrend,
    find_clearest_trend,
    group_visits,
    growth_exponent,
    is_like_hysteresis,
)
from identification.modal import combine_tests, identify
from identification.modal.shape_fit import ModalFit
from identification.words import Campaign
from mbmodel import Model, as_drawn, load_machine
from tests.helpers.nonlinear_mass import DAMPING, MASS_KG, MJCF, STIFFNESS, level_campaign

LEVELS_N = (20.0, 100.0, 200.0)
BRB = Path(__file__).resolve().parents[3] / "shared" / "real" / "brb"


@pytest.fixture(scope="module")
def block(tmp_path_factory) -> Model:
    path = tmp_path_factory.mktemp("mass") / "mass.xml"
    path.write_text(MJCF, encoding="utf-8")
    return as_drawn(load_machine(path))


def gap(half_width, centre=0.0, stiffness=0.6 * STIFFNESS):
    """Force of a gap beside the linear spring: it takes its part of the spring away within."""
    rest = np.clip(centre, -half_width, half_width)
    return lambda q: -stiffness * (np.clip(q - centre, -half_width, half_width) + rest)


def returned(campaign: Campaign, again: Campaign) -> Campaign:
    """Campaign whose first level is measured once more, at the end."""
    first = campaign.tests[0].condition.level_n
    more = [
        replace(test, condition=replace(test.condition, test="again"))
        for test in again.tests
        if test.condition.level_n == first
    ]
    return replace(campaign, tests=(*campaign.tests, *more))


def drifted(campaign: Campaign, factors: dict[float, float]) -> Campaign:
    """Campaign whose frequency axis is stretched from level to level, as by softer springs."""
    tests = []
    for test in campaign.tests:
        frf = test.estimate.frf
        factor = factors[test.condition.level_n]
        values = [
            np.interp(frf.freq_hz / factor, frf.freq_hz, part)
            for part in np.concatenate([frf.values.real, frf.values.imag], axis=2).T.reshape(
                -1, len(frf.freq_hz)
            )
        ]
        count = len(values) // 2
        moved = (np.array(values[:count]) + 1j * np.array(values[count:])).T
        changed = replace(frf, values=moved.reshape(frf.values.shape))
        tests.append(replace(test, estimate=replace(test.estimate, frf=changed)))
    return replace(campaign, tests=tuple(tests))


def test_slopes_of_the_poles_are_difference_quotients(block):
    campaign = level_campaign(block, None, (100.0,))
    model, _, measured = identify(campaign)
    data, moving = measured.weight_by_variance(), np.array([True, False, True])
    nothing = np.zeros(measured.measured.shape)
    poles = model.poles * (1.003 + 0.001j)
    start = ModalFit(poles, 1.05 * model.participation, model.shapes, nothing, nothing, 0.0)
    _, normal, right = _linearise(data, start, moving)
    random, size = np.random.default_rng(2), np.sqrt(np.diag(normal))
    direction = random.standard_normal(len(right)) / size
    costs = [
        _linearise(data, _apply_step(start, sign * 1e-2 * direction, moving), moving)[0].cost
        for sign in (1, 0, -1)
    ]
    assert (costs[2] - costs[0]) / 4e-2 == pytest.approx(right @ direction, rel=1e-3)


def test_a_cubic_spring_raises_one_frequency_with_the_level(block):
    levels = (20.0, 115.0, 270.0)
    check = check_levels(level_campaign(block, lambda q: 1.5e15 * q**3, levels))
    vertical = check.trends[-1]
    np.testing.assert_allclose(vertical.freq_hz, [67.9, 68.5, 71.5], atol=0.1)
    assert not check.is_constant
    assert check.changed[-1][0]
    assert not any(check.changed[0])
    assert "Hz changes by +5" in check.sentence
    assert "run mbw diagnose" in check.sentence


@pytest.mark.parametrize(("levels", "seed"), [((3.0, 411.0), 1), (LEVELS_N, 2)])
def test_a_linear_machine_changes_nothing(block, levels, seed):
    check = check_levels(level_campaign(block, None, levels, seed=seed))
    assert len(check.trends) == 3
    assert check.is_constant
    assert not np.any(check.changed)


def test_one_level_is_no_level_check(block):
    assert check_levels(level_campaign(block, None, (100.0,))) is None


@pytest.mark.parametrize("force", [gap(1.5e-6), gap(2e-6, -12e-6), lambda q: -1e14 * q**3])
def test_no_law_is_named_for_modes_that_change(block, force):
    check = check_levels(level_campaign(block, force, (20.0, 60.0, 200.0)))
    assert not check.is_constant
    for law in ("hardening", "gap", "friction", "softening"):
        assert law not in check.sentence


def test_drift_is_no_change_where_the_first_level_is_repeated(block):
    plain = level_campaign(block, None, LEVELS_N)
    moved = drifted(plain, {20.0: 1.0, 100.0: 0.997, 200.0: 0.994})
    open_ended = check_levels(moved)
    assert not open_ended.is_constant
    assert "drifts" in open_ended.sentence
    last = drifted(plain, dict.fromkeys(LEVELS_N, 0.991))
    closed = check_levels(returned(moved, last))
    assert closed.returns
    assert closed.is_constant


def test_visits_hold_set_ups_and_begin_anew_where_a_cell_is_measured_again(block):
    plain = level_campaign(block, None, LEVELS_N)
    visits = group_visits(returned(plain, plain))
    assert [level for level, _ in visits] == [20.0, 100.0, 200.0, 20.0]
    assert all(len(visited.tests) == 3 for _, visited in visits)


def rove(campaign: Campaign) -> Campaign:
    """Campaign measured in two set-ups that share the sensor acc1, at one level after the other."""
    tests = []
    for name, points in (("a", ("acc1", "acc2")), ("b", ("acc1", "acc3"))):
        for test in campaign.tests:
            frf = test.estimate.frf
            rows = [k for k, dof in enumerate(frf.outputs) if dof.point in points]
            estimate = replace(
                test.estimate,
                frf=replace(
                    frf,
                    values=frf.values[:, rows],
                    outputs=tuple(frf.outputs[k] for k in rows),
                ),
                variance=test.estimate.variance[:, rows],
                measured=test.estimate.measured[rows],
            )
            condition = replace(test.condition, test=f"{test.condition.test}_{name}", setup=name)
            tests.append(replace(test, condition=condition, estimate=estimate))
    return replace(campaign, tests=tuple(tests))


def test_set_ups_that_share_a_sensor_are_one_visit(block):
    roved = rove(level_campaign(block, lambda q: 1.5e15 * q**3, LEVELS_N))
    visits = group_visits(roved)
    assert [level for level, _ in visits] == [20.0, 100.0, 200.0]
    assert all(len(visited.tests) == 6 for _, visited in visits)
    check = check_levels(roved)
    assert not check.returns
    assert not check.is_constant
    again = replace(roved, tests=(*roved.tests, *roved.tests[:3]))
    assert [level for level, _ in group_visits(again)] == [20.0, 100.0, 200.0, 20.0]
    renamed = [replace(t, condition=replace(t.condition, setup="c")) for t in roved.tests[:3]]
    again = replace(roved, tests=(*roved.tests, *renamed))
    assert [level for level, _ in group_visits(again)] == [20.0, 100.0, 200.0, 20.0]


def test_poles_at_known_shapes_are_those_of_a_full_fit(block):
    campaign = level_campaign(block, None, (100.0,))
    model, identified, measured = identify(campaign)
    nothing = np.zeros(measured.measured.shape)
    start = ModalFit(
        model.poles * (1.01 + 0.002j), model.participation, model.shapes, nothing, nothing, 0.0
    )
    fitted = fit_poles(measured.weight_by_variance(), start, identified.inside)
    np.testing.assert_allclose(fitted.poles, model.poles, rtol=2e-5)
    np.testing.assert_allclose(fitted.freq_sd, model.freq_sd, rtol=0.3)
    np.testing.assert_allclose(fitted.damping_sd, model.damping_sd, rtol=0.3)


def test_deviations_of_poles_at_known_shapes_cover_the_scatter_of_the_noise(block):
    true, _, _ = identify(level_campaign(block, None, (100.0,), noise=1e-6))
    pulls = []
    for seed in range(12):
        measured = combine_tests(level_campaign(block, None, (100.0,), seed=seed))
        nothing = np.zeros(measured.measured.shape)
        start = ModalFit(true.poles, true.participation, true.shapes, nothing, nothing, 0.0)
        fitted = fit_poles(measured.weight_by_variance(), start, np.ones(len(true.poles), bool))
        freq = np.abs(fitted.poles) / (2 * np.pi)
        pulls.append((freq - true.freq_hz) / fitted.freq_sd)
    assert 0.7 < np.std(pulls) < 1.4


def free_decay(force, rate_hz=4000.0, seconds=3.0, damping=DAMPING / 20):
    """Two channels of a mass that rings at 67.9 Hz; Dormand-Prince, with the slip as a state."""
    times = np.arange(0, seconds, 1 / rate_hz)

    def rates(_time, state):
        stretch, speed, slip = state
        joint, slide = force(stretch, speed, slip)
        return [speed, -(STIFFNESS * stretch + damping * speed + joint) / MASS_KG, slide]

    path = solve_ivp(
        rates, (0, seconds), [1e-4, 0.0, 0.0], t_eval=times, rtol=1e-8, atol=1e-13, max_step=5e-4
    )
    speed, stretch = path.y[1], path.y[0]
    joint = np.array([force(q, v, y)[0] for q, v, y in path.y.T])
    motion = -(STIFFNESS * stretch + damping * speed + joint) / MASS_KG
    noise = 1e-4 * np.random.default_rng(4).standard_normal((2, len(times))) * np.abs(motion).max()
    return np.stack([motion, -0.6 * motion]) + noise


def jenkins(stiffness, limit):
    """Force and rate of slip of a Jenkins element, its corner rounded by Bouc-Wen (n = 2)."""

    def force(_stretch, speed, slip):
        drawn = slip * stiffness / limit
        slide = speed * (1 - (0.5 + 0.5 * np.sign(speed * drawn)) * drawn**2)
        return stiffness * slip, slide

    return force


@pytest.mark.parametrize(
    ("force", "changes"),
    [
        (lambda q, v, y: (0.0, 0.0), False),
        (lambda q, v, y: (2e14 * q**3, 0.0), True),
        (jenkins(0.02 * STIFFNESS, 3.0), True),
    ],
)
def test_a_free_decay_shows_what_changes_with_the_amplitude(force, changes):
    track = track_decay(free_decay(force), 4000.0, 67.9, 20.0)
    assert track.trend.changes(1e-3)[0] == changes
    assert track.shape[1] == pytest.approx(-0.6, abs=0.01)


def test_a_linear_decay_has_one_frequency_and_damping():
    track = track_decay(free_decay(lambda q, v, y: (0.0, 0.0)), 4000.0, 67.0, 20.0).trend
    np.testing.assert_allclose(track.freq_hz, 67.9, rtol=2e-4)
    np.testing.assert_allclose(
        track.damping, DAMPING / 20 / 2 / MASS_KG / (2 * np.pi * 67.9), rtol=0.05
    )


def test_noise_alone_is_not_followed():
    noise = np.random.default_rng(5).standard_normal((2, 8000))
    track = track_decay(noise, 4000.0, 67.9, 20.0)
    assert track is None or find_clearest_trend([track.trend]) is None


@pytest.mark.skipif(not BRB.exists(), reason="the measured beam is not at hand")
def test_a_bolted_beam_loses_more_at_large_amplitudes_of_its_decay():
    data = np.load(BRB / "decay_after_a_hammer_hit.npz")
    rate = float(data["rate_hz"])
    motion = data["acceleration_m_s2"][:, int(0.012 * rate) :].astype(float)
    check = check_decay(motion, rate)
    first = check.tracks[0].trend
    assert first.freq_hz[0] == pytest.approx(80.58, abs=0.03)
    assert first.freq_hz[-1] / first.freq_hz[0] - 1 == pytest.approx(-0.0035, abs=0.001)
    assert first.damping[-1] / first.damping[0] == pytest.approx(2.0, abs=0.25)
    assert "in damping" in check.sentence


def test_a_decay_of_two_linear_modes_changes_nothing():
    times = np.arange(0, 4, 1 / 2000)
    random = np.random.default_rng(6)
    motion = [
        np.exp(-2 * np.pi * 50 * 0.003 * times) * np.sin(2 * np.pi * 50 * times) * size
        + np.exp(-2 * np.pi * 130 * 0.002 * times) * np.sin(2 * np.pi * 130 * times)
        for size in (1.0, -0.4)
    ]
    check = check_decay(np.array(motion) + 1e-4 * random.standard_normal((2, len(times))), 2000.0)
    np.testing.assert_allclose([t.trend.freq_hz[0] for t in check.tracks], [50, 130], rtol=1e-3)
    np.testing.assert_allclose([t.trend.damping[-1] for t in check.tracks], [3e-3, 2e-3], rtol=0.1)
    assert "no mode changes" in check.sentence
    single = check_decay(motion[0], 2000.0)
    assert [round(float(track.trend.freq_hz[0])) for track in single.tracks] == [50, 130]


@pytest.mark.skipif(not BRB.exists(), reason="the measured beam is not at hand")
def test_a_bolted_beam_loses_more_at_large_amplitudes_of_a_stepped_sine():
    # One mode, fitted level by level with a residual; the level is the acceleration.
    data = np.load(BRB / "stepped_sine_at_8_response_levels.npz")
    levels, rows = [], []
    for freq, force, size, phase in zip(
        data["frequency_hz"],
        data["force_n"],
        data["acceleration_m_s2"],
        data["phase_rad"],
        strict=True,
    ):
        frf = size / force * np.exp(1j * phase)

        def misfit(values, freq=freq, frf=frf):
            pole = 2 * np.pi * values[0] * (-values[1] + 1j)
            kernel = 1 / (2j * np.pi * freq - pole)
            columns = np.stack([kernel, np.ones_like(kernel)], axis=1)
            solution, *_ = np.linalg.lstsq(columns, frf, rcond=None)
            off = columns @ solution - frf
            return np.concatenate([off.real, off.imag])

        fit = least_squares(misfit, [80.3, 0.003], x_scale=[0.1, 1e-3])
        scatter = (fit.fun**2).mean() * np.linalg.inv(fit.jac.T @ fit.jac)
        levels.append(size.mean())
        rows.append((*fit.x, *np.sqrt(np.diag(scatter))))
    freq, damping, freq_sd, damping_sd = np.array(rows).T
    trend = ModeTrend(np.array(levels), freq, freq_sd, damping, damping_sd)
    assert trend.changes(1e-3) == (True, True)
    assert damping[0] == pytest.approx(0.0016, rel=0.15)
    assert damping[-1] == pytest.approx(0.0070, rel=0.15)


def test_a_mode_that_was_followed_badly_is_not_the_clearest():
    # A gap with a preload moves two modes; two others are none of the machine, and turn back.
    levels = np.array([40.0, 200.0, 700.0])

    def trend(freq, freq_sd, damping, damping_sd):
        deviations = np.full(3, freq_sd), np.full(3, damping_sd)
        return ModeTrend(levels, np.array(freq), deviations[0], np.array(damping), deviations[1])

    right = [
        trend([105.448, 105.445, 104.161], 0.005, [0.0073, 0.0074, 0.0094], 4e-5),
        trend([194.40, 194.40, 193.36], 0.02, [0.0080, 0.0080, 0.0095], 1e-4),
    ]
    wrong = [
        trend([75.9, 73.2, 79.7], 0.4, [0.073, 0.008, 0.126], 5e-3),
        trend([104.3, 101.6, 119.2], 0.2, [0.063, 0.037, 0.095], 2e-3),
    ]
    assert find_clearest_trend([*wrong, *right]) is right[0]
    assert find_clearest_trend([]) is None


@pytest.mark.skipif(not BRB.exists(), reason="the measured beam is not at hand")
@pytest.mark.parametrize("first", [0, 400, 4000])
def test_the_bolted_beam_changes_wherever_its_record_begins(first):
    data = np.load(BRB / "decay_after_a_hammer_hit.npz")
    check = check_decay(data["acceleration_m_s2"][:, first:].astype(float), float(data["rate_hz"]))
    assert "The mode at 80." in check.sentence


_LEVELS = np.array([0.1, 0.2, 0.3])


def _shifted(shift, damping):
    freq = 800.0 * (1 + np.asarray(shift))
    deviations = np.full(3, 1e-3), np.full(3, 1e-6)
    return ModeTrend(_LEVELS, freq, deviations[0], np.asarray(damping), deviations[1])


@pytest.mark.parametrize("exponent", [-1.0, 0.0, 0.5, 1.0, 2.0, 4.0])
def test_the_exponent_of_a_shift_is_found(exponent):
    growth = np.log(_LEVELS / 0.1) if exponent == 0 else (_LEVELS / 0.1) ** exponent - 1
    found = growth_exponent(_shifted(-1e-3 * growth, np.full(3, 0.01)))
    assert found == pytest.approx(exponent, abs=0.03)


def test_what_grows_with_the_level_from_the_lowest_on_may_be_hysteresis():
    # Rayleigh: k falls by nu A and each cycle loses (4 / 3) nu A^3, so that zeta rises by
    # 2 nu A / (3 pi).
    nu = 0.1
    rayleigh = _shifted(np.sqrt((1 - nu * _LEVELS) / (1 - nu * 0.1)) - 1,
                        0.01 + 2 * nu * _LEVELS / (3 * np.pi))  # fmt: skip
    cubic = _shifted(-0.1 * (_LEVELS**2 - 0.01), np.full(3, 0.01))
    gap = _shifted([0.0, -3e-5, -1.2e-2], [0.0073, 0.0074, 0.0094])
    full_slip = _shifted(np.zeros(3), [0.03, 0.015, 0.01])
    assert is_like_hysteresis([rayleigh, rayleigh, cubic])
    assert not is_like_hysteresis([cubic])
    assert not is_like_hysteresis([gap])
    assert not is_like_hysteresis([full_slip])
    assert not is_like_hysteresis([])


def test_hysteresis_is_named_as_a_possibility():
    trend = _shifted(-0.05 * (_LEVELS - 0.1), 0.01 + 0.02 * _LEVELS)
    check = LevelCheck(_LEVELS, (trend,), (trend.changes(1e-3),), returns=True)
    assert "as hysteresis or gradual friction in joints or actuators" in check.sentence
