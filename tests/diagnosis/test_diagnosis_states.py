"""Tests before and after a change: the shared rest, the drift between visits, and the verdict."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagnosis import build_verdict, diagnose
from diagnosis.between_visits import VISIT_PRIORS, vary_between_machines, vary_between_visits
from diagnosis.data_checks.check_data import check_data
from diagnosis.null_model import fit_baseline
from diagnosis.refits.refit import mean_shared_part
from diagnosis.settings import SETTINGS
from diagnosis.states import check_data_after, search_before
from identification.words import InputError
from mbmodel import REST_FACTOR, Evaluator, FrfRequest, Model, RestPart
from tests.helpers.changed_chain import BEFORE, write_chain
from truth.campaign.changed_tower import TowerChange, change_tower, read_tower, write_tower
from tuning import open_session
from tuning.assessment.gap import MAX_NOISE_RATIO
from tuning.assessment.rest_estimate import (
    add_variance,
    estimate_rest,
    find_known_lines,
    shrink_rest,
)

TOWER = Path(__file__).resolve().parents[2] / "assets" / "tower"


def answer(model, theta, campaign):
    """Receptance of all channels to all references; (n_freq, n, n)."""
    request = FrfRequest(campaign.freq_hz, campaign.outputs, campaign.inputs, "receptance")
    return Evaluator(model, request).at(theta).values


@pytest.fixture(scope="module")
def tower():
    session = open_session(TOWER)
    return session, estimate_rest(session.model, session.model.drawn, session.campaign)


def test_with_its_rest_a_model_answers_as_measured(tower):
    session, estimate = tower
    model = replace(session.model, machine=replace(session.model.machine, rest=estimate.rest))
    predicted = answer(model, model.drawn, session.campaign)
    np.testing.assert_allclose(predicted, estimate.receptance, rtol=1e-6)


def test_a_softer_leg_acts_on_the_measured_matrix_as_in_closed_form(tower):
    # H' = H - H b (1/d + b' H b)^-1 b' H: structural modification of the measured FRFs alone.
    session, estimate = tower
    model = replace(session.model, machine=replace(session.model.machine, rest=estimate.rest))
    theta = model.drawn.copy()
    number = [parameter.name for parameter in model.parameters].index("leg2.stiffness")
    theta[number] *= 0.9
    change, b = -0.1 * model.drawn[number], np.array([-1.0, 1.0, 0.0])
    measured = estimate.receptance
    column = measured @ b
    row = np.einsum("i,fij->fj", b, measured)
    denominator = 1 / change + column @ b
    expected = measured - column[:, :, None] * row[:, None] / denominator[:, None, None]
    np.testing.assert_allclose(answer(model, theta, session.campaign), expected, rtol=1e-6)


def test_without_all_references_there_is_no_rest(tower):
    session, _ = tower
    fewer = replace(session.campaign, tests=session.campaign.tests[:2])
    assert estimate_rest(session.model, session.model.drawn, fewer) is None


def test_the_noise_before_adds_to_the_noise_after_an_unchanged_machine(tower):
    # A = B = 1 where nothing changed: the variances add, but for what the shrinkage takes.
    session, estimate = tower
    featured = replace(estimate, narrow=1e6 * estimate.narrow)  # nothing of it is noise
    rest, carried = shrink_rest(featured, session.campaign, floor=1e3, drift=0.0)
    np.testing.assert_allclose(carried.variance, estimate.variance, rtol=1e-3, atol=1e-30)
    np.testing.assert_allclose(rest.values, estimate.rest.values, rtol=1e-3, atol=1e-9)
    added = add_variance(session.campaign, estimate, carried)
    for first, second in zip(session.campaign.tests, added.tests, strict=True):
        ratio = second.estimate.variance / first.estimate.variance
        np.testing.assert_allclose(ratio, 2.0, rtol=2e-3)


def test_where_noise_hides_the_rest_the_error_of_the_model_counts(tower):
    session, estimate = tower
    noisy = replace(
        estimate,
        variance=1e12 * estimate.variance,
        smooth_variance=1e12 * estimate.smooth_variance,
    )
    rest, carried = shrink_rest(noisy, session.campaign, floor=0.1, drift=0.0)
    allowed = 0.01 * (np.abs(estimate.receptance) ** 2).sum(axis=(1, 2))
    np.testing.assert_allclose(carried.variance.sum(axis=(1, 2)), allowed, rtol=1e-3)
    shared = carried.shared.sum(axis=(1, 2)) / allowed
    assert (shared > 0.2).all()
    assert (shared < 1.001).all()
    assert (np.abs(rest.values) <= 1e-3 * np.abs(estimate.rest.values)).all()


def test_slopes_of_the_rest_by_the_drift_are_its_differences(tower):
    session, estimate = tower
    machine = replace(session.model.machine, rest=estimate.rest)
    model = Model(machine, (*session.model.parts, RestPart()))
    names = [parameter.name for parameter in model.parameters]
    chosen = np.array(names) == REST_FACTOR
    request = FrfRequest(
        session.campaign.freq_hz, session.campaign.outputs, session.campaign.inputs, "receptance"
    )
    evaluator = Evaluator(model, request)
    theta, step = model.drawn.copy(), 1e-6
    theta[-1] = 1.003
    slope = evaluator.at(theta).sensitivities(chosen).columns()[..., 0]
    ends = [evaluator.at(np.append(theta[:-1], theta[-1] + sign * step)).values for sign in (-1, 1)]
    difference = (ends[1] - ends[0]) / (2 * step)
    np.testing.assert_allclose(slope, difference, atol=1e-5 * np.abs(difference).max())


def test_between_visits_all_stiffness_drifts_as_one_and_masses_stay(tower):
    session, _ = tower
    varies = vary_between_visits(session.parametrisation, session.model.drawn)
    x = np.zeros(varies.size)
    x[varies.names.index("leg1.stiffness")] = 1.0
    pairs = zip(varies.theta(x), varies.theta(np.zeros(varies.size)), strict=True)
    for parameter, (moved, before) in zip(varies.parameters, pairs, strict=True):
        factor = np.exp(VISIT_PRIORS.stiffness) if parameter.known == "stiffness" else 1.0
        assert moved == pytest.approx(factor * before)
    held = {p.known for p, k in zip(varies.parameters, varies.coordinate_of, strict=True) if k < 0}
    assert held >= {"mass", "inertia", "com"}


def test_a_spring_that_softens_is_named_with_its_size_beside_an_unknown_rest(tmp_path):
    # The drawing lacks the mass on a spring in both states, and all is 0.3 % stiffer after.
    session = open_session(write_chain(tmp_path / "chain", factor=1.003))
    verdict = build_verdict(diagnose(session))
    cause = verdict.causes[0]
    assert (cause.effect, cause.location, cause.dof) == ("stiffness", "joint:high", "tx")
    assert cause.probability > 0.9
    assert cause.parameters["change"] == pytest.approx(-6300.0, rel=0.1)
    low, high = cause.interval["change"]
    assert low < -6300.0 < high
    assert (high - low) / 2 > 0.02 * 6300.0  # the calibration of forces and motions
    assert cause.parameters["factor"] == pytest.approx(0.9, abs=0.02)


def test_nothing_is_named_if_only_the_drift_differs(tmp_path):
    session = open_session(write_chain(tmp_path / "chain", after=BEFORE, factor=0.997))
    verdict = build_verdict(diagnose(session))
    assert [cause for cause in verdict.causes if cause.probability >= 0.5] == []


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('state = "after"', "", "has no state beside tests with one"),
        ('state = "after"', 'state = "before"', 'none has "after"'),
        ('state = "before"', 'state = "after"', 'none has "before"'),
    ],
)
def test_states_that_are_not_whole_are_refused_in_one_sentence(tmp_path, old, new, message):
    file = write_chain(tmp_path / "chain") / "campaign.toml"
    file.write_text(file.read_text().replace(old, new))
    with pytest.raises(InputError, match=message):
        open_session(file.parent)


@pytest.fixture(scope="module")
def heavier(tmp_path_factory):
    """The tower with 1 kg on floor 1 after the change, at a second visit."""
    change = TowerChange("mass_error", "body:floor1", {"mass": 1.0})
    freq_hz, frf = read_tower()
    values = change_tower(freq_hz, frf, [change], np.random.default_rng(4))
    folder = tmp_path_factory.mktemp("heavier")
    write_tower(folder, TOWER / "model.xml", freq_hz, values, before=frf)
    return open_session(folder)


def test_beside_a_narrow_mode_the_rest_is_known_to_a_few_percent(heavier):
    # The first mode is at 6.5 Hz before and at 6.3 Hz after.
    session, theta = heavier, heavier.model.drawn
    before, after = map(session.campaign.select_state, ("before", "after"))
    estimate = estimate_rest(session.model, theta, before)
    rest, carried = shrink_rest(estimate, after, 0.3, VISIT_PRIORS.stiffness)
    model = replace(session.model, machine=replace(session.model.machine, rest=rest))
    theta = theta.copy()
    theta[[p.name for p in model.parameters].index("floor1.mass")] += 1.0
    predicted = answer(model, theta, after)
    measured = np.concatenate([test.estimate.frf.values for test in after.tests], axis=2)
    measured = measured / estimate.factor
    error = (np.abs(predicted - measured) ** 2).sum(axis=(1, 2))
    power = (np.abs(measured) ** 2).sum(axis=(1, 2))
    near = ((after.freq_hz > 5.5) & (after.freq_hz < 6.0)) | (abs(after.freq_hz - 7.5) < 0.5)
    assert np.sqrt(np.median((error / power)[near])) < 0.04
    stated = carried.variance.sum(axis=(1, 2))
    assert np.median((error / stated)[near]) < 2
    well_known_lines = find_known_lines(after, estimate, carried)
    assert well_known_lines.mean() > 0.9
    assert np.sqrt((stated / power)[well_known_lines].max()) < MAX_NOISE_RATIO
    assert (carried.variance >= 0).all()
    assert (carried.shared <= carried.variance).all()


def test_a_mass_is_as_right_as_the_calibration_where_the_model_lacks_much(heavier):
    # The fit of the tests before leaves 29 % and pulls gains to their bounds: no word on them.
    before = fit_baseline(check_data(heavier, SETTINGS), 1, SETTINGS)
    after = check_data_after(heavier, before, SETTINGS).session
    parameters, fixed = after.model.parameters, after.parametrisation.fixed
    pairs = list(zip(parameters, fixed, strict=True))
    gains = [value for parameter, value in pairs if parameter.known.endswith("_gain")]
    assert gains == [1.0] * len(gains)
    assert {f"hammer({name}:tx).gain" for name in ("acc1", "acc2", "acc3")} <= {
        parameter.name for parameter in parameters
    }
    names = [parameter.name for parameter in before.null.session.model.parameters]
    assert abs(before.scene.theta[names.index("acc1.gain_x")] - 1) > 0.01
    tolerance = heavier.campaign.tolerance
    deviation = np.hypot(tolerance.hammer_gain, tolerance.sensor_gain)
    assert after.model.machine.rest.scale_deviation == pytest.approx(deviation)


def test_without_a_full_matrix_causes_of_the_state_before_are_part_of_the_machine(tmp_path):
    settings = replace(SETTINGS, max_causes=1)
    for references, is_held in ((2, True), (1, False)):
        session = open_session(write_chain(tmp_path / f"chain{references}", references=references))
        before = fit_baseline(check_data(session, settings), 1, settings)
        with_causes = search_before(before, settings, lambda _: None)
        assert (with_causes is before) == is_held
    assert with_causes.null.causes
    assert with_causes.null.floor < 0.7 * before.null.floor
    after = check_data_after(session, with_causes, settings).session
    (remark,) = (text for text in after.campaign.remarks if "full matrix" in text)
    assert remark.startswith("no full matrix of FRFs before the change")
    of_causes = {
        p.name for c in with_causes.null.causes for part in c.parts for p in part.parameters
    }
    varying = set(after.parametrisation.names)
    assert of_causes
    assert not of_causes & varying


@pytest.fixture(scope="module")
def fit_after(tmp_path_factory):
    """Return the null model of the tower after changes, a second visit drawn by a seed."""
    freq_hz, frf = read_tower()
    fitted = []

    def fit(changes, seed):
        values = change_tower(freq_hz, frf, changes, np.random.default_rng(seed))
        folder = tmp_path_factory.mktemp("after")
        write_tower(folder, TOWER / "model.xml", freq_hz, values, before=frf)
        session = open_session(folder)
        if not fitted:
            fitted.append(fit_baseline(check_data(session, SETTINGS), 1, SETTINGS))
        return fit_baseline(check_data_after(session, fitted[0], SETTINGS), 1, SETTINGS)

    return fit


def test_what_neighbouring_lines_share_of_the_noise_before_is_no_gap(fit_after):
    # Nothing changed: products of neighbouring residuals hold errors of the smooth rest alone.
    after = fit_after([], 11)
    shared = mean_shared_part(after.scene.session.campaign)
    assert 0.005 < shared < 0.1
    assert after.null.summary.serial + shared > 0.005
    assert after.null.summary.serial < 0.01


@pytest.mark.parametrize(
    ("effect", "place", "sizes"),
    [
        ("sensor_gain", "sensor:acc2", {"gain": 1.2}),
        ("hammer_gain", "hammer:acc2", {"gain": 1.2}),
        ("hammer_gain", "hammer:acc2", {"gain": -1.0}),
        ("hammer_delay", "hammer:acc1", {"delay": -5e-4}),
    ],
)
def test_what_breaks_reciprocity_is_of_a_channel_or_of_the_hits_there(
    fit_after, effect, place, sizes
):
    (proven,) = fit_after([TowerChange(effect, place, sizes)], 12).proven
    assert proven.key == (effect, place, "tx")
    ((name, size),) = sizes.items()
    assert proven.state({})[name] == pytest.approx(size, abs=0.02 if name == "gain" else 5e-5)


def test_between_machines_each_parameter_differs_by_sqrt_2_of_its_tolerance(tower):
    session, _ = tower
    before, drawn = session.parametrisation, session.model.drawn
    between = vary_between_machines(before, 1.1 * drawn)
    np.testing.assert_array_equal(between.fixed, 1.1 * drawn)
    widths = [scale / np.sqrt(precision) for scale, precision in _widths(before)]
    wider = [scale / np.sqrt(precision) for scale, precision in _widths(between)]
    np.testing.assert_allclose(wider, np.sqrt(2) * np.array(widths))
    x = np.zeros(between.size)
    x[between.names.index("floor1.mass")] = 1.0
    mass = between.theta(x)[[p.name for p in between.parameters].index("floor1.mass")]
    tolerance = session.campaign.tolerance.mass
    number = [p.name for p in between.parameters].index("floor1.mass")
    assert mass == pytest.approx(1.1 * drawn[number] * (1 + np.sqrt(2) * tolerance), rel=1e-3)


def _widths(varies):
    return zip(varies.scales, varies.precision, strict=True)


def test_a_spring_within_sqrt_2_tolerances_is_no_change_between_two_machines(tmp_path):
    folder = write_chain(tmp_path / "chain", factor=1.003)
    file = folder / "campaign.toml"
    file.write_text("two_machines = true\n" + file.read_text())
    settings = replace(SETTINGS, max_causes=1)
    session = open_session(folder)
    before = fit_baseline(check_data(session, settings), 1, settings)
    after = check_data_after(session, before, settings)
    varies = after.session.parametrisation
    assert "high.mass" in varies.names
    base = fit_baseline(after, 1, settings)
    names = [parameter.name for parameter in varies.parameters]
    ratio = (
        base.scene.theta[names.index("high_tx.stiffness")]
        / varies.fixed[names.index("high_tx.stiffness")]
    )
    assert ratio == pytest.approx(0.9, abs=0.02)


HINGED = """
<mujoco model="hinged">
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="low">
      <joint name="low_ry" type="hinge" axis="0 1 0" pos="0.1 0 0" stiffness="900" damping="1"/>
      <inertial pos="0.3 0 0" mass="3" diaginertia="0.1 0.1 0.1"/>
      <site name="acc1" pos="0.3 0 0.1"/>
      <body name="high" pos="0.5 0 0">
        <joint name="high_ry" type="hinge" axis="0 1 0" stiffness="500" damping="1"/>
        <inertial pos="0.2 0 0" mass="2" diaginertia="0.05 0.05 0.05"/>
        <site name="acc2" pos="0.2 0 0.1"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def test_slopes_by_the_places_of_joints_pass_through_the_rest(tmp_path):
    # Between two machines joints move, and the rest is a matrix of functions of frequency.
    folder = write_chain(tmp_path / "chain")
    (folder / "model.xml").write_text(HINGED)
    file = folder / "campaign.toml"
    file.write_text(file.read_text().replace(":+x", ":+z"))
    session = open_session(folder)
    before = session.campaign.select_state("before")
    estimate = estimate_rest(session.model, session.model.drawn, before)
    model = replace(session.model, machine=replace(session.model.machine, rest=estimate.rest))
    names = np.array([parameter.name for parameter in model.parameters])
    chosen = np.char.find(names, "joint_position") >= 0
    request = FrfRequest(before.freq_hz, before.outputs, before.inputs, "receptance")
    evaluator = Evaluator(model, request)
    slopes = evaluator.at(model.drawn).sensitivities(chosen).columns()
    for column, number in enumerate(np.flatnonzero(chosen)):
        step = np.zeros(len(names))
        step[number] = 1e-6
        ends = [evaluator.at(model.drawn + sign * step).values for sign in (-1, 1)]
        difference = (ends[1] - ends[0]) / 2e-6
        np.testing.assert_allclose(
            slopes[..., column], difference, atol=1e-5 * max(np.abs(difference).max(), 1e-6)
        )


AXIS = """
<mujoco model="axis">
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="slide">
      <joint name="drive" type="slide" axis="1 0 0" damping="40"/>
      <inertial pos="0 0 0" mass="12" diaginertia="1 1 1"/>
      <body name="load" pos="0 0 0.2">
        <joint name="flex" type="slide" axis="1 0 0" stiffness="1.07e6" damping="60"/>
        <inertial pos="0 0 0" mass="8" diaginertia="1 1 1"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="motor" joint="drive"/></actuator>
  <sensor><jointpos name="enc" joint="drive"/></sensor>
</mujoco>
"""


def test_a_spring_that_lost_much_is_named_by_a_motor_and_an_encoder(tmp_path):
    # The mode moves by a fifth: by slopes of the FRF a small mass on a spring would lead.
    (tmp_path / "model.xml").write_text(AXIS)
    freq, random = np.arange(5.0, 190.0, 0.5), np.random.default_rng(3)
    s = 2j * np.pi * freq
    text = 'model = "model.xml"\n'
    for state, stiffness in (("before", 1.07e6), ("after", 0.6 * 1.07e6)):
        link = stiffness + 60 * s
        exact = 1 / (12 * s**2 + 40 * s + link - link**2 / (8 * s**2 + link))
        noise = 0.005 * np.abs(exact)
        drawn = random.standard_normal((2, len(freq)))
        values = exact + noise * (drawn[0] + 1j * drawn[1]) / np.sqrt(2)
        file, cells = f"{state}.npz", {"frf": values, "variance": noise**2}
        shaped = {name: array[:, None, None] for name, array in cells.items()}
        np.savez(tmp_path / file, freq_hz=freq, **shaped)
        text += (
            f'[[test]]\nfile = "{file}"\nstate = "{state}"\nchannels = ["enc"]\n'
            'references = ["motor"]\nquantity = "receptance"\nunit = "m/N"\n'
        )
    (tmp_path / "campaign.toml").write_text(text)
    verdict = build_verdict(
        diagnose(open_session(tmp_path), settings=replace(SETTINGS, max_causes=1))
    )
    cause = verdict.causes[0]
    assert (cause.effect, cause.location) == ("stiffness", "joint:load")
    assert cause.probability > 0.95
    assert cause.parameters["factor"] == pytest.approx(0.6, rel=0.01)
