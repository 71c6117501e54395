"""Sixty stages on six springs each: 720 parameters."""

import numpy as np
import pytest
from large_machine import large_mjcf
from mbmodel_examples import channel_scale, worst_of_channels

from identification.words import Dof
from mbmodel import Evaluator, FrfRequest, as_drawn

FREQ = np.array([0.0, 3.0, 21.0, 60.5, 133.0, 200.0])


@pytest.fixture(scope="module")
def large(from_text):
    return as_drawn(from_text(large_mjcf(60)))


def ask(model, freq=FREQ):
    points = model.machine.layout.points
    outputs = tuple(Dof.of(point, axis) for point in points[::6] for axis in range(3))
    return FrfRequest(freq, outputs, tuple(Dof.of(points[-1], axis) for axis in range(3)))


def test_sixty_stages_have_720_parameters_and_a_modal_form(large):
    assert len(large.parameters) == 720
    assert Evaluator(large, ask(large)).at(large.drawn).solver.form is not None


def test_frfs_of_sixty_stages_are_those_of_the_direct_solve(large):
    frf_request = ask(large)
    modal, direct = (
        Evaluator(large, frf_request, direct=way).at(large.drawn).values for way in (False, True)
    )
    assert worst_of_channels(modal, direct) < 1e-9


def test_the_gradient_of_720_parameters_is_the_slope_along_any_direction(large):
    rng = np.random.default_rng(2)
    evaluator = Evaluator(large, ask(large, FREQ[1:]), direct=True)
    direction = large.drawn * rng.normal(size=720)
    at = Evaluator(large, ask(large, FREQ[1:])).at(large.drawn)
    scale = 1 / channel_scale(at.values)
    cotangent = (rng.normal(size=at.values.shape) + 1j * rng.normal(size=at.values.shape)) * scale

    def cost(step):
        values = evaluator.at(large.drawn + step * direction).values
        return (cotangent.conj() * values).sum().real

    h = 1e-4
    expected = (8 * (cost(h) - cost(-h)) - (cost(2 * h) - cost(-2 * h))) / (12 * h)
    assert at.gradient(cotangent) @ direction == pytest.approx(expected, rel=1e-6)
