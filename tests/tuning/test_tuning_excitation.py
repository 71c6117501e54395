"""Excitation of drives: optimal power, low peaks, limits, and intervals that hold."""

import numpy as np
import pytest
import scipy.optimize
import scipy.stats
from encoder_campaign import STIFFNESS, write_axis

from identification.continuous import estimate_continuous_frf
from identification.words import (
    Campaign,
    Condition,
    Controller,
    Loop,
    PortSum,
    Records,
    Signal,
    Test,
    Tolerance,
    UsageError,
)
from mbmodel import DryFriction, JenkinsElement, load_machine, with_loops
from tuning import fit
from tuning.excitation.design import design_excitation
from tuning.excitation.input_spectra import (
    LineInformation,
    design_spectrum,
    flat_spectrum,
    lower_peak,
    orthogonal_turns,
    periodic_waveform,
    schroeder_phases,
)
from tuning.excitation.limits import DriveLimits, drive_command
from tuning.excitation.prediction import (
    predict_coherence,
    predict_confidence,
    predict_record,
    predict_sliding,
    sliding_share,
)
from tuning.excitation.request import ExcitationOptions, build_request

EXACT = Tolerance(**dict.fromkeys(
    ("mass", "inertia", "com", "joint_position", "sensor_gain", "sensor_angle", "sensor_position",
     "hammer_angle", "hammer_position", "sensor_delay", "sensor_cross", "hammer_gain",
     "hammer_delay"), 0.0,
))  # fmt: skip
DRIVE, SHAKER = Signal("drive"), Signal("coil-magnet:+tx")
LIMITS = {
    "drive": DriveLimits(force=70.0, stroke=1e-4, speed=0.02),
    "coil-magnet:+x": DriveLimits(current=2.0, motor_constant=12.0),
}
# So much that the relative error of the force, which fits add, counts nothing beside it.
NOISE = {"encoder": 5e-7, "acc1:+tx": 5e-2, "acc2:+tx": 5e-2, "acc2:+tz": 5e-2}


@pytest.fixture(scope="module")
def axis(tmp_path_factory):
    path = tmp_path_factory.mktemp("axis") / "axis.xml"
    write_axis(path)
    return load_machine(path)


def make(machine, **changes):
    options = {
        "limits": LIMITS,
        "outputs": ["encoder", "acc1:+x", "acc2:+x", "acc2:+z"],
        "noise": NOISE,
        "band": (8.0, 90.0),
        "seconds": 60.0,
        "rate_hz": 500.0,
    }
    request, _ = build_request(machine, ExcitationOptions(**{**options, **changes}))
    return design_excitation(machine, request, EXACT)


@pytest.fixture(scope="module")
def excitation(axis):
    return make(axis)


def test_four_points_are_optimal_for_a_cubic():
    """D-optimal design on [-1, 1]: a quarter each at +-1 and +-1/sqrt 5 (Fedorov 1972)."""
    t = np.linspace(-1, 1, 401)
    rows = np.stack([t**0, t, t**2, t**3], axis=1)
    none = np.zeros((401, 1, 1))
    information = LineInformation(rows[:, None, None], none, np.full(4, 1e-12), np.ones(4, bool))
    design = design_spectrum(information, np.ones((1, 401, 1)), even_share=0.0)
    optimum = np.vander([-1, -(5**-0.5), 5**-0.5, 1], 4) / 2
    best = np.linalg.slogdet(optimum.T @ optimum)[1]
    assert best - design.gap - 1e-9 <= design.criterion <= best + 1e-9
    assert design.gap < 0.02
    near = np.abs(np.abs(t[:, None]) - [1, 5**-0.5]).min(axis=1) < 0.05
    assert design.power[near].sum() > 0.85


def test_the_bound_holds_against_a_general_solver():
    """Two drives, of which one alone has a further limit, and estimated coordinates beside."""
    random = np.random.default_rng(3)
    factors = random.normal(size=(6, 2, 3, 4)) * np.linspace(0.2, 2, 6)[:, None, None, None]
    information = LineInformation(
        factors,
        random.uniform(0, 3, (6, 2, 3)),
        np.full(4, 0.3),
        np.array([True, True, False, False]),
    )
    costs = np.zeros((3, 6, 2))
    costs[0, :, 0], costs[1, :, 1], costs[2] = 1.0, 0.5, np.linspace(2, 0.1, 6)[:, None]
    design = design_spectrum(information, costs, even_share=0.0)
    matrix = costs.reshape(3, -1)
    solved = scipy.optimize.minimize(
        lambda v: -information.criterion(v.reshape(6, 2)),
        flat_spectrum(costs).ravel(),
        jac=lambda v: -information.gradient(v.reshape(6, 2)).ravel(),
        bounds=[(0, None)] * 12,
        constraints={"type": "ineq", "fun": lambda v: 1 - matrix @ v, "jac": lambda v: -matrix},
        options={"ftol": 1e-12, "maxiter": 500},
    )
    assert solved.success
    assert (matrix @ design.power.ravel() <= 1 + 1e-9).all()
    assert -1e-6 <= -solved.fun - design.criterion <= design.gap + 1e-6
    assert design.flat < design.criterion


def test_slopes_of_the_criterion_are_its_differences():
    random = np.random.default_rng(5)
    information = LineInformation(
        random.normal(size=(4, 2, 3, 3)),
        random.uniform(0, 3, (4, 2, 3)),
        np.ones(3),
        np.array([True, False, True]),
    )
    power, step = random.uniform(0.5, 1, (4, 2)), 1e-6
    slopes = information.gradient(power)
    for line, drive in np.ndindex(4, 2):
        moved = power.copy()
        moved[line, drive] += step
        difference = (information.criterion(moved) - information.criterion(power)) / step
        assert slopes[line, drive] == pytest.approx(difference, rel=1e-4)


def test_swapping_lowers_the_peak_and_keeps_the_amplitudes():
    lines, samples = np.arange(7, 300), 2048
    power = 1 + 5 * np.exp(-(((lines - 80) / 9) ** 2))
    amplitudes = np.sqrt(2 * power).astype(complex)
    start = schroeder_phases(power)
    best = lower_peak(amplitudes, lines, samples, start)
    crests = []
    for phases in (start, best):
        waveform = periodic_waveform(amplitudes * np.exp(1j * phases), lines, samples)
        assert waveform.var() == pytest.approx(power.sum())
        crests.append(np.abs(waveform).max() / waveform.std())
    assert crests[1] < min(1.5, 0.85 * crests[0])


def test_a_sweep_stays_at_each_frequency_in_proportion_to_its_power():
    lines, samples = np.arange(20, 400), 4096
    power = np.where(lines < 200, 3.0, 1.0)
    phases = schroeder_phases(power)
    waveform = periodic_waveform(np.sqrt(2 * power) * np.exp(1j * phases), lines, samples)
    share = power[lines < 200].sum() / power.sum()
    early = np.abs(np.fft.rfft(waveform[: round(share * samples)], samples)[lines]) ** 2
    assert early[lines < 190].sum() > 20 * early[lines > 210].sum()


@pytest.mark.parametrize("drives", [1, 2, 3, 5])
def test_realisations_are_orthogonal(drives):
    turns = orthogonal_turns(drives)
    np.testing.assert_allclose(turns.conj().T @ turns, drives * np.eye(drives), atol=1e-12)
    np.testing.assert_allclose(np.abs(turns), 1)


def test_no_limit_is_exceeded_and_one_is_met(excitation):
    used = [p / s.limit for p, s in zip(excitation.peaks(), excitation.limited, strict=True)]
    assert max(used) == pytest.approx(1.0)
    named = {(str(s.drive), s.what): s.unit for s in excitation.limited}
    assert named == {
        ("drive", "force"): "N",
        ("drive", "stroke"): "m",
        ("drive", "speed"): "m/s",
        ("coil-magnet:+tx", "current"): "A",
    }
    assert min(used[0], used[3]) > 0.5  # both drives work


def test_peaks_are_those_of_the_signals(excitation):
    """The motor has a gear of 35, and the current is the shaker's force over its constant."""
    signals = excitation.periods
    assert excitation.peaks()[0] == pytest.approx(35 * np.abs(signals[:, 0]).max())
    assert excitation.peaks()[3] == pytest.approx(np.abs(signals[:, 1]).max() / 12)
    record = excitation.repeat(signals)
    plan = excitation.plan
    assert record.shape == (2, plan.samples * plan.periods * plan.realisations)
    assert record.shape[1] <= 60 * 500
    np.testing.assert_array_equal(
        record[:, : plan.samples], record[:, plan.samples :][:, : plan.samples]
    )


def test_a_closed_loop_adds_what_its_controller_gives(axis):
    """u = r - K y with the position y of the encoder, in closed form for one stiff carriage."""
    gain = 3e3
    controller = Controller(
        np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[gain]])
    )
    loop = Loop("x", DRIVE, PortSum("x", ((Signal("encoder"), 1.0),), "m"), controller, "control")
    closed = make(with_loops(axis, (loop,)), limits={"drive": DriveLimits(force=70.0)})
    freq = closed.plan.freq_hz
    command = drive_command(closed.model, closed.theta, freq, (DRIVE,), 0)[:, 0]
    plain = make(axis, limits={"drive": DriveLimits(force=70.0)}, seconds=20.0)
    values = frf_at(plain, freq)
    np.testing.assert_allclose(command, 1 / (1 + gain * values), rtol=1e-9)
    assert closed.peaks()[0] == pytest.approx(70.0)


def frf_at(excitation, freq):
    from mbmodel import Evaluator, FrfRequest  # noqa: PLC0415

    request = FrfRequest(freq, (Signal("encoder"),), (DRIVE,), "receptance")
    return Evaluator(excitation.model, request).at(excitation.theta).values[:, 0, 0]


def test_the_design_beats_the_flat_spectrum(excitation):
    assert excitation.design.criterion > excitation.design.flat + 1.0
    assert excitation.design.gap < 0.05
    assert {f"{name}.stiffness" for name in STIFFNESS} == set(excitation.of_interest)


def identify(excitation, random):
    """Tests by the reader's own estimate from a record with noise."""
    plan, request = excitation.plan, excitation.request
    shape = (-1, plan.realisations, plan.samples * plan.periods)
    forces = excitation.repeat(excitation.periods).reshape(shape)
    motion = predict_record(excitation, random).reshape(shape).swapaxes(0, 1)
    tests = []
    for k, drive in enumerate(request.drives):
        records = Records(
            plan.rate_hz,
            forces[k],
            motion,
            request.outputs,
            drive,
            request.quantity,
            further_forces=np.delete(forces, k, axis=0),
            further_references=request.drives[:k] + request.drives[k + 1 :],
        )
        result = estimate_continuous_frf(records)
        assert result.blocks.kind == "periodic"
        tests.append(Test(Condition("record", drive), result.estimate))
    return Campaign("record", excitation.model.machine.layout, tuple(tests), tolerance=EXACT)


@pytest.mark.parametrize("kind", ["multisine", "sweep"])
def test_tuned_parameters_scatter_as_predicted(axis, kind):
    """Squares of the errors over the predicted covariance are chi-square distributed."""
    excitation = make(axis, kind=kind, seconds=30.0)
    confidence = predict_confidence(excitation)
    vague = np.array(confidence.parametrisation.names)[confidence.is_undetermined]
    assert set(vague) == {"frame_tz.stiffness", "frame_tz.damping"}  # both drives act along x
    seen = np.flatnonzero(~confidence.is_undetermined)
    inverse = np.linalg.inv(confidence.covariance[np.ix_(seen, seen)])
    squares, random = [], np.random.default_rng(7)
    for _ in range(12):
        campaign = identify(excitation, random)
        # A search that begins at the truth ends there.
        start = excitation.theta * np.exp(random.normal(0, 0.2, len(excitation.theta)))
        varies = excitation.parametrisation
        tuned = fit(excitation.model, campaign, parametrisation=varies, starts=(start,))
        squares.append(float(tuned.x[seen] @ inverse @ tuned.x[seen]))
    low, high = scipy.stats.chi2.ppf([1e-3, 1 - 1e-3], len(squares) * len(seen))
    assert low < sum(squares) < high


def test_the_predicted_variance_and_coherence_are_those_of_the_estimate(excitation):
    campaign = identify(excitation, np.random.default_rng(2))
    rows = {(row.drive, row.output): row.coherence for row in predict_coherence(excitation)}
    for test, expected in zip(campaign.tests, excitation.campaign.tests, strict=True):
        assert test.estimate.averages == expected.estimate.averages
        np.testing.assert_allclose(
            np.median(test.estimate.variance / expected.estimate.variance, axis=0), 1, rtol=0.1
        )
        for row, output in enumerate(test.estimate.frf.outputs):
            coherence = rows[test.condition.reference, output]
            clear = coherence > 0.9  # elsewhere noise raises the power of the motion
            difference = test.estimate.coherence[clear, row, 0] - coherence[clear]
            assert np.abs(difference).mean() < 0.02 if clear.any() else True


def test_a_period_rings_down_and_several_are_recorded(excitation):
    plan = excitation.plan
    assert plan.periods >= 4
    assert plan.realisations == 2
    assert plan.averages == 2 * (plan.periods - 1)
    assert plan.freq_hz[0] >= 8.0
    assert plan.freq_hz[-1] <= 90.0
    np.testing.assert_allclose(np.diff(plan.freq_hz), 1 / plan.period_s)


def test_a_short_record_says_what_rings_on(axis):
    plan = make(axis, seconds=4.0).plan
    assert "rings on" in plan.remarks[0]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"band": (0.0, 90.0)}, "LOW above 0"),
        ({"rate_hz": 200.0}, "at least 225"),
        ({"rate_hz": float("nan")}, "--rate nan"),
        ({"band": (8.0, float("inf"))}, "--rate"),
        ({"seconds": 0.5}, "lines in the band"),
        ({"seconds": -1.0}, "above 0"),
        ({"limits": {}}, "no drive is named"),
        ({"limits": {"drive": DriveLimits()}}, "has no limit"),
        ({"limits": {"drive": DriveLimits(force=-1.0)}}, "above 0"),
        ({"limits": {"drive": DriveLimits(current=1.0)}}, "belong together"),
        ({"limits": {"floor:+tx": DriveLimits(force=1.0)}}, "floor is no drive"),
        ({"limits": {"drive": DriveLimits(stroke=1.0, at="acc9")}}, "acc9"),
        ({"limits": {"drive": DriveLimits(force=1.0, at="encoder")}}, "neither is limited"),
        ({"limits": {"motor": DriveLimits(force=1.0)}}, "motor"),
        ({"kind": "noise"}, "multisine, sweep"),
        ({"noise": {"gyro": 1.0}}, "no output"),
        ({"noise": {"encoder": 0.0}}, "above 0"),
        ({"outputs": ["joint:frame_tx", "acc1:+x"], "noise": {}}, "jointpos"),
    ],
)
def test_what_cannot_be_used_is_refused(axis, changes, words):
    with pytest.raises(UsageError, match=words):
        make(axis, **changes)


def test_encoders_are_found_and_their_steps_are_noise(axis):
    request, remarks = build_request(
        axis, ExcitationOptions(limits=LIMITS, steps={"encoder": 3e-6})
    )
    assert str(request.outputs[0]) == "encoder"
    assert len(request.outputs) == 1 + 6
    assert request.noise[0] == pytest.approx(3e-6 / np.sqrt(6 * request.rate_hz))
    assert request.rate_hz >= 5 * request.band[1]
    assert "accelerometers" in remarks[0]
    assert "encoder" not in remarks[0]


def test_a_sine_slides_but_for_the_turns():
    """After a turn a Jenkins element sticks until the motion is 2 limit / k."""
    phase = 2 * np.pi * np.arange(20_000) / 20_000
    amplitude, stiffness, limit = 3e-3, 2e4, 12.0
    sticks = np.arccos(1 - 2 * limit / stiffness / amplitude) / np.pi
    share = sliding_share(amplitude * np.sin(phase), stiffness, limit)
    assert share == pytest.approx(1 - sticks, abs=1e-3)
    assert sliding_share(limit / stiffness * np.sin(phase), stiffness, 1.01 * limit) == 0.0


def test_joints_with_friction_slide_where_the_force_is_enough(excitation):
    laws = [
        DryFriction("carriage_tx", 20.0),
        DryFriction("frame_tx", 1e4),
        JenkinsElement("carriage_tx", 1e5, 1e-3),
    ]
    carriage, frame, jenkins = predict_sliding(excitation, laws)
    assert carriage.slides
    assert not frame.slides
    assert jenkins.slides
    # A force of the motor alone that blocks the joint is the motor's force itself.
    alone = make(excitation.model.machine, limits={"drive": DriveLimits(force=70.0)})
    (row,) = predict_sliding(alone, [DryFriction("carriage_tx", 20.0)])
    assert row.force_ratio == pytest.approx(70.0 / 20.0)
