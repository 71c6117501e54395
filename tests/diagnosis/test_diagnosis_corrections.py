"""Corrections of a campaign, and hypotheses of the faults that the data checks prove."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis import build_verdict, diagnose
from diagnosis.corrections import divide_channels, exchange_channels, mask_channels, match_channels
from diagnosis.data_checks.sensors import build_fault_hypothesis, check_sensors
from diagnosis.refits.extended_parametrisation import extend_parametrisation
from diagnosis.settings import SETTINGS
from identification import Fault, check_bodies, mount_response
from identification.words import Dof
from tests.helpers.drawn import drawn
from tuning import UserSpecification, parametrise


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    return drawn(tmp_path_factory.mktemp("drawn"), 72_002, lines=161)[0]


def values(campaign):
    return [test.estimate.frf.values for test in campaign.tests]


def sites(session):
    return sorted({dof.point for dof in session.campaign.outputs})


def test_masked_channels_count_as_not_measured(session):
    site = sites(session)[0]
    one = mask_channels(session.campaign, match_channels(f"sensor:{site}", "ty"))
    for test in one.tests:
        for row, dof in enumerate(test.estimate.frf.outputs):
            off = dof.point == site and dof.direction[1:] == "ty"
            assert test.estimate.measured[row, 0] != off
            assert np.abs(test.estimate.frf.values[:, row]).max() == 0 if off else True


def test_exchanging_twice_and_dividing_back_change_nothing(session):
    first, second = sites(session)[:2]
    pairs = tuple(
        (Dof.parse(f"{first}:+t{axis}"), Dof.parse(f"{second}:+t{axis}")) for axis in "xyz"
    )
    once = exchange_channels(session.campaign, pairs)
    twice = exchange_channels(once, pairs)
    assert not np.array_equal(values(once)[0], values(session.campaign)[0])
    for back, original in zip(values(twice), values(session.campaign), strict=True):
        np.testing.assert_array_equal(back, original)
    concerned = match_channels(f"sensor:{first}", None)
    read = divide_channels(session.campaign, concerned, lambda f: mount_response(f, 90.0, 0.05))
    again = divide_channels(read, concerned, lambda f: 1 / mount_response(f, 90.0, 0.05))
    for back, original in zip(values(again), values(session.campaign), strict=True):
        np.testing.assert_allclose(back, original, rtol=1e-12)


@pytest.mark.parametrize(
    ("effect", "dof", "parameters"),
    [
        ("sensor_gain", "tx", {"gain": 1.3}),
        ("sensor_misalignment", None, {"rotation": (0.1, 0.2, -0.3)}),
        ("sensor_position", None, {"offset": (0.01, 0.0, 0.02)}),
    ],
)
def test_what_a_fit_has_to_find_is_released(session, effect, dof, parameters):
    site = sites(session)[0]
    one = build_fault_hypothesis(
        Fault(effect, f"sensor:{site}", dof, 1.0, parameters, 1.0), session
    )
    assert set(one.release) <= set(session.parametrisation.names)
    assert list(one.begin.values()) == list(np.ravel(list(parameters.values())))
    said = one.state(one.begin)
    assert said.keys() == parameters.keys()
    assert [np.ravel(v).tolist() for v in said.values()] == [list(one.begin.values())]
    assert one.correct is None


def test_what_is_known_is_corrected(session):
    first, second = sites(session)[:2]
    where = f"sensor:{first}"
    parameters = {"frequency": 300.0, "damping": 0.05}
    faults = [
        Fault("sensor_polarity", where, "tz", 1.0, {}, 1.0),
        Fault("sensor_swap", where, "tx+ty", 1.0, {}, 1.0),
        Fault("sensor_swap", f"{where}+{second}", None, 1.0, {}, 1.0),
        Fault("sensor_delay", where, None, 1.0, {"delay": 1e-4}, 1.0),
        Fault("mount_resonance", where, "tx", 1.0, parameters, 1.0),
    ]
    for fault in faults:
        one = build_fault_hypothesis(fault, session)
        assert one.key == (fault.effect, fault.location, fault.dof)
        assert not one.release
        moved = one.correct(session.campaign)
        concerned = match_channels(fault.location, fault.dof)
        for test, before in zip(moved.tests, session.campaign.tests, strict=True):
            for row, dof in enumerate(test.estimate.frf.outputs):
                same = np.array_equal(
                    test.estimate.frf.values[:, row], before.estimate.frf.values[:, row]
                )
                assert same != concerned(dof), (fault.effect, dof)
    dead = Fault("dead_channel", where, "tx", 1.0, {}, 1.0)
    assert build_fault_hypothesis(dead, session) is None


def test_a_turned_channel_is_proven_and_taken_out(session):
    layout = session.campaign.layout
    on = [layout.body_name(site) for site in sites(session)]
    fullest = max(on, key=on.count)
    assert on.count(fullest) > 3
    site = sites(session)[on.index(fullest)]
    tests = []
    for test in session.campaign.tests:
        frf = test.estimate.frf
        signs = [-1.0 if d.point == site and d.direction[1:] == "tz" else 1.0 for d in frf.outputs]
        turned = replace(frf, values=frf.values * np.array(signs)[:, None])
        tests.append(replace(test, estimate=replace(test.estimate, frf=turned)))
    checks = check_sensors(replace(session.campaign, tests=tuple(tests)), SETTINGS)
    assert [(f.effect, f.location, f.dof) for f in checks.faults] == [
        ("sensor_polarity", f"sensor:{site}", "tz")
    ]
    assert not check_sensors(session.campaign, SETTINGS).faults
    off = [not test.estimate.measured.all() for test in checks.campaign.tests]
    assert all(off)


def test_of_a_channel_that_reads_noise_alone_no_fault_is_believed(session):
    site = fullest(session)
    turned = [f"{site}:+tz"]

    def reading(values, _, names):
        return values * np.where(np.isin(names, turned), -1.0, 1.0)[:, None]

    campaign = read_as(session, reading)
    assert [one.effect for one in check_sensors(campaign, SETTINGS).faults] == ["sensor_polarity"]
    tests = []
    for test in campaign.tests:
        row = np.isin(list(map(str, test.estimate.frf.outputs)), turned)
        coherence = np.where(row[:, None], 1e-3, test.estimate.coherence)
        tests.append(replace(test, estimate=replace(test.estimate, coherence=coherence)))
    checks = check_sensors(replace(campaign, tests=tuple(tests)), SETTINGS)
    assert not checks.faults
    for test in checks.alive.tests:
        assert not test.estimate.measured[list(map(str, test.estimate.frf.outputs)).index(*turned)]


def fullest(session):
    """A sensor of the body with most channels."""
    layout = session.campaign.layout
    on = [layout.body_name(site) for site in sites(session)]
    return sites(session)[on.index(max(on, key=on.count))]


def read_as(session, reading):
    """The campaign with other readings: of a test's FRFs, lines and outputs."""
    tests = []
    for test in session.campaign.tests:
        frf = test.estimate.frf
        values = reading(frf.values, frf.freq_hz, list(map(str, frf.outputs)))
        estimate = replace(test.estimate, frf=replace(frf, values=values))
        tests.append(replace(test, estimate=estimate))
    return replace(session.campaign, tests=tuple(tests))


def test_a_sensor_that_is_wrong_by_no_known_fault_is_left_out_and_named(session):
    site = fullest(session)

    def wobbling(values, freq_hz, outputs):
        wrong = np.ones(values.shape)
        wrong[:, outputs.index(f"{site}:+tz"), 0] += 0.6 * np.sin(freq_hz / 9)
        return values * wrong

    campaign = read_as(session, wobbling)
    checks = check_sensors(campaign, SETTINGS)
    assert [(f.effect, f.location, f.dof) for f in checks.faults] == [
        ("sensor_unknown", f"sensor:{site}", "tz")
    ]
    assert checks.unknown == (f"sensor:{site}",)
    for test in checks.alive.tests:
        row = list(map(str, test.estimate.frf.outputs)).index(f"{site}:+tz")
        assert not test.estimate.measured[row, 0]
    found = build_verdict(diagnose(replace(session, campaign=campaign)))
    assert (found.verdict, found.where[0].location) == ("unexplained", f"sensor:{site}")
    assert f"exchange {site}" in found.next_experiment


def test_numbers_exported_twice_are_no_exchanged_channels(session):
    site = fullest(session)

    def twice(values, _, outputs):
        same = values.copy()
        same[:, outputs.index(f"{site}:+tz")] = values[:, outputs.index(f"{site}:+tx")]
        return same

    checks = check_sensors(read_as(session, twice), SETTINGS)
    assert {(f.effect, f.location) for f in checks.faults} == {("sensor_unknown", f"sensor:{site}")}


def test_where_most_bodies_seem_to_bend_small_faults_of_sensors_are_no_more_believed(
    session, monkeypatch
):
    checks = check_bodies(session.campaign)
    assert len(checks) > 2
    site = sites(session)[0]
    gain = Fault("sensor_gain", f"sensor:{site}", "tx", 1.0, {"gain": 1.2}, 1.0)
    turned = Fault("sensor_polarity", f"sensor:{site}", "ty", 1.0, {}, 1.0)
    bent = [
        replace(one, faults=(Fault("flexible_body", f"body:{one.body}", None, 1.0, {}, 1.0),))
        for one in checks
    ]
    for many in (1, 3):
        drawn = [*bent[:many], *checks[many:]]
        drawn[-1] = replace(drawn[-1], faults=(*drawn[-1].faults, gain, turned))
        monkeypatch.setattr(
            "diagnosis.data_checks.sensors.check_bodies", lambda _, drawn=drawn: tuple(drawn)
        )
        result = check_sensors(session.campaign, SETTINGS)
        small = {"flexible_body"} if many == 3 else {"flexible_body", "sensor_gain"}
        assert {one.effect for one in result.faults} == {"sensor_polarity", *small}


def test_what_a_user_has_fixed_is_taken_as_the_gate_found_it(session):
    site = sites(session)[0]
    fault = Fault("sensor_gain", f"sensor:{site}", "tx", 1.0, {"gain": 1.3}, 1.0)
    one = build_fault_hypothesis(fault, session)
    wishes = UserSpecification(fix=["*.gain_*"])
    fixed = parametrise(session.model, session.campaign.tolerance, wishes)
    varies = extend_parametrisation(fixed, session.model, session, [one])
    theta = varies.theta(np.zeros(varies.size))
    names = [parameter.name for parameter in session.model.parameters]
    assert theta[names.index(f"{site}.gain_x")] == 1.3
    assert theta[names.index(f"{site}.gain_y")] == 1.0
