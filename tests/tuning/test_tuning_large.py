"""Machines of many bodies: normal equations block by block, within a bounded memory."""

import tracemalloc

import numpy as np
import pytest
from large_campaign import large_misfit
from large_machine import large_mjcf

from mbmodel import load_machine
from mbmodel.frf import forward_sensitivities
from tuning.misfit import accumulation

MIB = 2**20


def load(tmp_path, n_body):
    path = tmp_path / "large.xml"
    path.write_text(large_mjcf(n_body, sensors=1), encoding="utf-8")
    return load_machine(path)


def scales(normal):
    """Square roots of the diagonal; 1 for a turn of the hammer about its own axis."""
    size = np.sqrt(normal.diagonal())
    return np.where(size > 0, size, 1.0)


@pytest.fixture
def traced():
    """Peak of the memory that Python and numpy allocate."""
    tracemalloc.start()
    yield tracemalloc
    tracemalloc.stop()


def test_normal_equations_line_by_line_are_those_of_all_lines_at_once(tmp_path, monkeypatch):
    misfit, x = large_misfit(load(tmp_path, 8), 60)
    value, gradient, normal = misfit.quadratic_model(x)
    monkeypatch.setattr(accumulation, "MAX_JACOBIAN_VALUES", 1)
    monkeypatch.setattr(forward_sensitivities, "_MAX_ADJOINT_BYTES", 0)
    by_line, gradient_by_line, normal_by_line = misfit.quadratic_model(x)
    whole, blocks = normal.dense(), normal_by_line.dense()
    size = scales(normal)
    assert by_line == pytest.approx(value, rel=1e-12)
    assert (np.abs(whole - blocks) / np.outer(size, size)).max() < 1e-11
    assert (np.abs(gradient - gradient_by_line) / size).max() < 1e-9 * np.sqrt(value)


def test_normal_equations_are_those_of_differences(tmp_path):
    """N x along any direction is the slope of the gradient where the residual vanishes."""
    machine = load(tmp_path, 5)
    misfit, x = large_misfit(machine, 25)
    direction = np.random.default_rng(1).normal(size=len(x))
    _, gradient, normal = misfit.quadratic_model(x)
    _, by_adjoint = misfit(x)
    size = scales(normal)
    assert (np.abs(gradient - by_adjoint) / size).max() < 1e-8 * np.sqrt(misfit.value(x))
    exact = direction @ normal.multiply(direction)
    step = 1e-5
    sides = [misfit(x + sign * step * direction)[1] @ direction for sign in (1, -1)]
    prior = (direction[misfit.parametrisation.is_tolerance] ** 2).sum()
    slope = (sides[0] - sides[1]) / (2 * step) - prior
    assert slope == pytest.approx(exact, rel=0.02)  # the residual is the noise of 1 %


def test_a_machine_of_sixty_bodies_is_small(tmp_path, traced):
    """Sixty bodies hold 360 springs, none of which keeps a matrix of all coordinates."""
    machine = load(tmp_path, 60)
    kept, _ = traced.get_traced_memory()
    assert len(machine.springs) == 360
    assert kept < 60 * MIB


def test_normal_equations_of_sixty_bodies_fit_into_the_memory(tmp_path, traced):
    """1340 shared coordinates: dense slopes of all of them would take some GiB."""
    machine = load(tmp_path, 60)
    misfit, x = large_misfit(machine, 4)
    traced.reset_peak()
    _, gradient, normal = misfit.quadratic_model(x)
    _, peak = traced.get_traced_memory()
    step = normal.solve(gradient, np.ones(len(x)))
    assert len(normal.shared) > 1300
    assert np.isfinite(step).all()
    assert peak < 500 * MIB
