"""Fits of a model that lacks something end: gains count over the dispersion of the residual."""

from types import SimpleNamespace

import numpy as np
import pytest

from identification.words import Dof
from mbmodel import Evaluator, FrfRequest, as_drawn, load_machine
from tuning import TUNING_ALGORITHM, fit, open_session
from tuning.fitting.stage_search import LAST_STAGE, STAGES, residual_dispersion

MODEL = """<mujoco model="hinges"><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>
<body name="base"><inertial mass="20" pos="0 0 0" diaginertia="1 1 1"/>
<joint name="base_ry" type="hinge" axis="0 1 0" pos="0 0 -0.3" stiffness="9e4" damping="5"/>
<site name="acc1" pos="0.1 0 0.1"/>
<body name="arm" pos="0 0 0.3"><inertial mass="5" pos="0 0 0.1" diaginertia="0.1 0.1 0.1"/>
<joint name="arm_ry" type="hinge" axis="0 1 0" stiffness="{stiffness}" damping="{damping}"/>
<site name="acc2" pos="0.05 0 0.25"/></body></body></worldbody></mujoco>"""
OUTPUTS, INPUTS = ("acc1:+tx", "acc1:+tz", "acc2:+tx", "acc2:+tz"), ("acc1:+tx", "acc2:+tx")


def test_noise_has_no_dispersion() -> None:
    rng = np.random.default_rng(1)
    unit = rng.normal(size=(2, 300, 5, 3)) / np.sqrt(2)
    misfit = SimpleNamespace(unit_residuals=lambda _: [unit[0] + 1j * unit[1]])
    assert residual_dispersion(misfit, np.zeros(1), LAST_STAGE) == pytest.approx(1.0, abs=0.1)


def test_a_residual_of_one_shape_holds_few_independent_values() -> None:
    # A constant of size s has one independent value along each axis, where white noise has
    # n m / (n + m): phi = s^2 n_all / (n_all / product of these), over all axes.
    shape, size = (40, 3, 2), 5.0
    misfit = SimpleNamespace(unit_residuals=lambda _: [np.full(shape, size + 0j)])
    total = np.prod(shape)
    white = np.prod([n * (total / n) / (n + total / n) for n in shape])
    expected = size**2 * white
    assert residual_dispersion(misfit, np.zeros(1), LAST_STAGE) == pytest.approx(expected)


def test_logarithmic_stages_have_no_dispersion() -> None:
    assert STAGES[0].logarithmic
    assert residual_dispersion(SimpleNamespace(), np.zeros(1), STAGES[0]) == 1.0


def test_a_hinge_whose_damping_is_out_of_reach_is_tuned_to_an_end(tmp_path) -> None:
    # The damping is a thousand times the drawn one, a tenth of which is in reach: the fit has a
    # misfit of 1e3 per value, and its errors are followed for hundreds of steps.
    truth = tmp_path / "true.xml"
    truth.write_text(MODEL.format(stiffness=3000, damping=1), encoding="utf-8")
    drawn = MODEL.format(stiffness=300, damping=0.001)
    (tmp_path / "model.xml").write_text(drawn, encoding="utf-8")
    freq = np.linspace(1, 60, 400)
    dofs = [tuple(map(Dof.parse, labels)) for labels in (OUTPUTS, INPUTS)]
    model = as_drawn(load_machine(truth))
    clean = Evaluator(model, FrfRequest(freq, *dofs)).at(model.drawn).values
    sd = 0.003 * np.sqrt((np.abs(clean) ** 2).mean(axis=0))
    rng = np.random.default_rng(1)
    noise = sd * (rng.normal(size=clean.shape) + 1j * rng.normal(size=clean.shape)) / np.sqrt(2)
    coherence = 1 / (1 + 9 * sd**2 / np.abs(clean + noise) ** 2)
    np.savez(tmp_path / "t.npz", frf=clean + noise, coherence=coherence, freq_hz=freq)
    labels = f"channels = {list(OUTPUTS)}\nreferences = {list(INPUTS)}\n"
    (tmp_path / "campaign.toml").write_text(
        'model = "model.xml"\n[[test]]\nfile = "t.npz"\naverages = 10\n'
        f'{labels}quantity = "accelerance"\nunit = "m/s^2/N"\n',
        encoding="utf-8",
    )
    session = open_session(tmp_path)
    tuned = fit(
        session.model,
        session.campaign,
        parametrisation=session.parametrisation,
        algorithm=TUNING_ALGORITHM,
    )
    assert tuned.outcome == "converged"
    assert tuned.evaluations < 700  # 798 where the dispersion is ignored
