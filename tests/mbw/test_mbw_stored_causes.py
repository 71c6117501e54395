"""Causes that a diagnosis stores: with their whole share they are the fit, whatever the effect."""

import numpy as np
import pytest
from drawn import drawn

from diagnosis import EFFECTS, Scene
from diagnosis.refits.refitting import add_hypotheses
from identification.words import InputError
from mbmodel import Model
from mbw.results.stored_causes import read_causes, read_fitted_values, store_causes
from tuning import predict

WITH_TERMS = (
    *("appendage", "drift", "feedback_delay", "gyroscopic", "inertance", "joint_coupling"),
    *("mass_error", "mount_resonance", "parallel_path", "structural_damping", "support_loss"),
    "viscoelastic",
)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    session, _ = drawn(tmp_path_factory.mktemp("drawn"), 72_002, lines=81)
    return Scene(session, session.model.drawn * 1.1)


def proposals(scene, effect):
    """A few places of an effect that is added to the equation of motion."""
    every = [each for each in EFFECTS[effect](scene) if each.parts and each.spring is None]
    return every[:: max(1, len(every) // 3)]


def fitted(scene, cause, seed):
    """Session with the cause, and parameters at which it is not small."""
    session, random = add_hypotheses(scene.session, cause), np.random.default_rng(seed)
    values = {p.name: p.drawn * 1.05 for p in scene.model.parameters}
    for part in cause.parts:
        for parameter in part.parameters:
            values.setdefault(parameter.name, abs(random.normal(0, 1)))
    values |= {name: values[source] for name, source in cause.follow.items()}
    return session, np.array([values[p.name] for p in session.model.parameters])


def names(campaign):
    return [(test.condition.test, str(test.condition.reference)) for test in campaign.tests]


def relative(first, second):
    return max(np.abs(a - b).max() / np.abs(b).max() for a, b in zip(first, second, strict=True))


@pytest.mark.parametrize("effect", WITH_TERMS)
def test_a_stored_cause_is_its_part_at_the_fit_and_nothing_without_a_share(scene, effect):
    causes = proposals(scene, effect)
    assert causes
    for seed, cause in enumerate(causes):
        session, theta = fitted(scene, cause, seed)
        arrays = {"freq_hz": session.campaign.freq_hz} | store_causes(session, theta, (cause,))
        (stored,) = read_causes(arrays, names(session.campaign))
        assert (stored.effect, stored.location) == (cause.effect, cause.location)
        fit = read_fitted_values(arrays)
        base = scene.session.model
        part = stored.build_part("share", base.machine)
        model = Model(base.machine, (*base.parts, part))
        values = np.array([fit.get(p.name, 0.0) for p in model.parameters])
        without = predict(model, values, session.campaign)
        assert relative(without, predict(base, values[:-1], session.campaign)) < 1e-12
        with_cause = predict(model, np.append(values[:-1], 1.0), session.campaign)
        wanted = predict(session.model, theta, session.campaign)
        assert relative(with_cause, wanted) < 1e-9
        assert relative(without, wanted) > 1e-6


def test_a_released_tolerance_is_stored_by_its_value(scene):
    cause = next(iter(EFFECTS["sensor_gain"](scene)))
    session, theta = fitted(scene, cause, 1)
    arrays = {"freq_hz": session.campaign.freq_hz} | store_causes(session, theta, (cause,))
    (stored,) = read_causes(arrays, names(session.campaign))
    assert (stored.terms, list(stored.values)) == ((), list(cause.release))
    assert stored.values == {name: read_fitted_values(arrays)[name] for name in cause.release}


def test_files_of_earlier_versions_have_none():
    assert read_causes({"freq_hz": np.ones(3)}, []) == ()
    assert read_fitted_values({}) == {}


def test_a_drift_acts_in_the_tests_of_its_order_whatever_their_names(scene):
    cause = next(iter(EFFECTS["drift"](scene)))
    session, theta = fitted(scene, cause, 3)
    arrays = {"freq_hz": session.campaign.freq_hz} | store_causes(session, theta, (cause,))
    moved = [(f"../{file}", reference) for file, reference in names(session.campaign)]
    there, copied = (read_causes(arrays, each)[0] for each in (names(session.campaign), moved))
    assert list(there.shares.values()) == list(copied.shares.values())
    assert list(copied.shares) == moved
    assert any(there.shares.values())


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("cause0.0.left", lambda a: a[:-1]),
        ("cause0.0.core", lambda a: np.full_like(a, np.nan)),
        ("cause0.0.core", lambda a: a[:2]),
        ("cause0.terms", lambda a: np.array([["wall", ""]])),
        ("fit_values", lambda a: a[:3]),
    ],
)
def test_damaged_arrays_are_named(scene, name, change):
    cause = next(iter(EFFECTS["parallel_path"](scene)))
    session, theta = fitted(scene, cause, 4)
    arrays = {"freq_hz": session.campaign.freq_hz} | store_causes(session, theta, (cause,))
    with pytest.raises(InputError, match="diagnose again"):
        read_causes({**arrays, name: change(arrays[name])}, names(session.campaign))
