"""Fixtures of the small machine: its springs alone, and all that can vary of it."""

from dataclasses import replace

import numpy as np
import pytest
from machine_fixtures import from_text, station, station_model
from small_machine import MJCF, TOLERANCE, campaign, drawing, flip, model, true_theta

from identification.words import Campaign, Condition, Dof, Frf, FrfEstimate, Test
from mbmodel import (
    Evaluator,
    FrfRequest,
    Model,
    body_parts,
    hammer_gain_parts,
    hammer_parts,
    joint_parts,
    load_machine,
    sensor_parts,
    spring_parts,
)
from tuning import UserSpecification, parametrise

__all__ = [
    "campaign",
    "drawing",
    "flip",
    "from_text",
    "model",
    "station",
    "station_model",
    "true_theta",
]

FREQ = np.array([6, 11, 17, 23, 31, 38, 47, 52, 61, 70, 78, 87, 99, 108, 121, 133, 149.0])
# Reference, window, sensors, level: tests of one input, tests of one window, a hit against its axis
HITS = (
    ("acc3:+tx", 0.0, (1, 2, 3, 4, 5, 6), 100.0),
    ("acc3:-tx", 0.0, (6, 1, 3, 5, 4), 350.0),
    ("acc3:-ty", 0.3, (3, 1, 4), 220.0),
    ("acc5:+tz", 0.3, (5, 4, 3, 2, 1), 180.0),
    ("acc5:+tz", 0.3, (2, 3), 90.0),
)


# Principal axes that lie along no axis of the machine.
TURNED = MJCF.replace('diaginertia="4 5 6"', 'fullinertia="4 5 6 0.3 -0.2 0.4"').replace(
    'diaginertia="1 1.2 0.9"', 'fullinertia="1 1.2 0.9 -0.05 0.08 0.06"'
)


@pytest.fixture(scope="session")
def whole(tmp_path_factory) -> Model:
    """Return springs, bodies, joints, six sensors, three hits, one hammer."""
    path = tmp_path_factory.mktemp("turned") / "turned.xml"
    path.write_text(TURNED, encoding="utf-8")
    machine = load_machine(path)
    hits = tuple(Dof.parse(name) for name in ("acc3:+tx", "acc3:+ty", "acc5:+tz"))
    return Model(
        machine,
        (
            *spring_parts(machine),
            *body_parts(machine),
            *joint_parts(machine),
            *sensor_parts(machine),
            *hammer_parts(machine, hits),
            *hammer_gain_parts(("default",), "hammer_gain"),
        ),
    )


@pytest.fixture(scope="session")
def toleranced(whole):
    """Return its parametrisation, with tolerances that all differ."""
    return parametrise(whole, TOLERANCE)


@pytest.fixture(scope="session")
def specify(whole):
    """Return a function: that parametrisation, changed by a user specification."""
    return lambda **specification: parametrise(whole, TOLERANCE, UserSpecification(**specification))


@pytest.fixture(scope="session")
def place(whole):
    """Return a function: the index of a parameter by name."""
    names = [parameter.name for parameter in whole.parameters]
    return names.index


@pytest.fixture(scope="session")
def parametrisation(whole):
    """Return its parametrisation with the tolerances of the campaign."""
    return parametrise(whole, TOLERANCE)


@pytest.fixture(scope="session")
def off(parametrisation):
    """Return an x off zero everywhere: by one tolerance, or by a factor exp(N(0, 0.3))."""
    random = np.random.default_rng(11)
    x = random.normal(0.0, np.where(parametrisation.is_tolerance, 1.0, 0.3))
    return np.clip(x, -2.0, 2.0)


@pytest.fixture(scope="session")
def mixed(whole, parametrisation, off) -> Campaign:
    """Return tests as different as possible, with one FRF masked."""
    random = np.random.default_rng(12)
    tests = [_virtual_test(whole, parametrisation.theta(off), random, *what) for what in HITS]
    estimate = tests[3].estimate
    measured, values = estimate.measured.copy(), estimate.frf.values.copy()
    measured[4], values[:, 4] = False, 0.0
    masked = replace(estimate, frf=replace(estimate.frf, values=values), measured=measured)
    tests[3] = replace(tests[3], estimate=masked)
    return Campaign("mixed", whole.machine.layout, tuple(tests), TOLERANCE)


def _virtual_test(model, theta, random, name, tau, sensors, level) -> Test:
    """Return one virtual test, with noise of some 3 % that differs in every channel and line."""
    reference = Dof.parse(name)
    outputs = tuple(Dof.of(f"acc{k}", axis) for k in sensors for axis in (2, 0, 1))
    question = FrfRequest(FREQ, outputs, (reference,), window_tau=tau)
    values = Evaluator(model, question).at(theta).values
    rms = np.sqrt((np.abs(values) ** 2).mean(axis=0))
    sigma = 0.03 * rms * random.uniform(0.5, 2.0, values.shape)
    error = random.normal(size=(2, *values.shape)) * sigma / np.sqrt(2)
    frf = Frf(FREQ, values + error[0] + 1j * error[1], outputs, (reference,), "accelerance")
    measured = np.ones(rms.shape, bool)
    estimate = FrfEstimate(frf, sigma**2, "differences", measured, window_tau=tau)
    return Test(Condition("virtual.uff", reference, level_n=level), estimate)
