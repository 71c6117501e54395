"""Stability margins against closed forms, python-control, and loops that are broken by hand."""

import control
import numpy as np
import pytest

from tuning.plant.control_loops.loop_gain_lines import first_lines, sensitivity
from tuning.plant.control_loops.scaled_singular_values import (
    scaled_singular_values,
    singular_values,
)
from tuning.plant.control_loops.stability_margins import stability_margins

S = control.tf("s")
NOTCH = (S**2 + 0.02 * S + 400) / (S**2 + 0.05 * S + 900)
SHARP = (S**2 + 0.002 * S + 400) / (S**2 + 0.004 * S + 900)
LOOPS = {
    "third order": 15 / ((S + 1) * (S + 2) * (S + 3)),
    "conditionally stable": 10 * (S + 3) ** 2 / S**3 / (1 + S / 100),
    "resonance above one": 300 / ((S + 0.1) * (S + 20)) * NOTCH,
    "sharp resonance": 40 / (S + 1) * SHARP / (1 + S / 400),
    "position servo": 8e4 * (S + 20) * (S + 3) / (S * (S + 300) * (S**2 + 4 * S + 90)),
}


def margins_of(system, low=1e-4, high=1e4, delay=0.0):
    """Margins of one loop from a transfer function and a delay."""
    poles = np.concatenate([system.poles(), control.feedback(system, 1).poles()])

    def gain_of(freq):
        s = 2j * np.pi * freq
        return (np.atleast_1d(system(s)) * np.exp(-s * delay))[:, None, None]

    return stability_margins(gain_of, first_lines(low, high, poles))


def test_a_loop_without_gain_has_no_margins():
    margins = stability_margins(
        lambda freq: np.zeros((len(freq), 1, 1), complex), np.geomspace(0.1, 100.0, 30)
    )
    loop = margins.loops[0]
    for name in ("crossover", "bandwidth", "gain", "reduction", "phase", "delay", "modulus"):
        assert not getattr(loop, name).is_finite
    assert loop.modulus.value == 1.0


@pytest.mark.parametrize("name", LOOPS)
def test_margins_are_those_of_python_control(name):
    system = LOOPS[name]
    assert (control.feedback(system, 1).poles().real < 0).all()
    gains, phases, distances, at_gain, at_phase, at_distance = control.stability_margins(
        system, returnall=True
    )
    loop = margins_of(system).loops[0]
    above, below = gains[gains > 1], gains[gains < 1]
    assert loop.gain.value == pytest.approx(min(above, default=np.inf), rel=1e-6)
    assert loop.reduction.value == pytest.approx(max(below, default=0.0), rel=1e-6)
    best = np.argmin(np.abs(phases))
    assert loop.phase.value == pytest.approx(phases[best], abs=1e-5)
    assert loop.phase.freq_hz == pytest.approx(at_phase[best] / (2 * np.pi), rel=1e-6)
    assert loop.modulus.value == pytest.approx(distances.min(), rel=1e-5)
    nearest = at_distance[np.argmin(distances)] / (2 * np.pi)
    assert loop.modulus.freq_hz == pytest.approx(nearest, rel=2e-3)
    np.testing.assert_allclose(loop.gain_crossovers[:, 0], np.sort(at_phase) / (2 * np.pi))
    lines = at_gain[at_gain > 0] / (2 * np.pi)
    np.testing.assert_allclose(loop.phase_crossovers[:, 0], np.sort(lines), rtol=1e-6)
    assert loop.crossover.value == pytest.approx(at_phase.max() / (2 * np.pi), rel=1e-6)


@pytest.mark.parametrize("delay", [0.02, 0.11])
def test_an_integrator_with_a_delay_has_the_margins_of_the_closed_form(delay):
    # L = w1 exp(-s t) / s: phase 90 deg - w1 t, delay that over w1, gain pi / (2 w1 t).
    rate = 7.0
    loop = margins_of(rate / S, delay=delay).loops[0]
    phase = np.pi / 2 - rate * delay
    assert loop.phase.value == pytest.approx(np.degrees(phase), rel=1e-9)
    assert loop.delay.value == pytest.approx(phase / rate, rel=1e-9)
    assert loop.crossover.value == pytest.approx(rate / (2 * np.pi), rel=1e-9)
    assert loop.gain.value == pytest.approx(np.pi / (2 * rate * delay), rel=1e-9)
    assert loop.gain.freq_hz == pytest.approx(1 / (4 * delay), rel=1e-9)
    # |S| = |w / (w - i w1 exp(-i w t))|, on a fine grid
    omega = np.linspace(0.1, 200.0, 1_000_001)
    size = np.abs(omega / (omega - 1j * rate * np.exp(-1j * omega * delay)))
    assert 1 / loop.modulus.value == pytest.approx(size.max(), rel=1e-6)
    first = omega[np.argmax(size > np.sqrt(0.5))] / (2 * np.pi)
    assert loop.bandwidth.value == pytest.approx(first, rel=1e-3)


def test_a_phase_margin_is_negative_where_phase_lead_is_critical():
    system = 15 / ((S + 1) * (S + 2) * (S + 3)) * NOTCH**4
    loop = margins_of(system).loops[0]
    late = loop.gain_crossovers[loop.gain_crossovers[:, 1] < 0]
    assert loop.delay.value <= np.min(np.radians(late[:, 1] + 360) / (2 * np.pi * late[:, 0]))
    angle = np.angle(-system(2j * np.pi * late[0, 0]))
    assert np.radians(late[0, 1]) == pytest.approx(angle, abs=1e-6)


def test_a_loop_gain_that_stays_above_one_bears_no_delay():
    loop = margins_of(3.0 * (S + 1) / (S + 2)).loops[0]
    assert loop.delay.value == 0.0
    assert not loop.phase.is_finite


def test_a_loop_that_is_real_and_negative_at_rest_has_that_gain_margin():
    loop = margins_of(-0.4 / (1 + S / 30)).loops[0]
    assert loop.gain.value == pytest.approx(2.5, rel=1e-6)
    assert loop.gain.freq_hz == 0.0


# ---- several loops --------------------------------------------------------------------------

PLANT = control.ss(
    [[-1.0, 4.0, 0, 0], [-4.0, -1.0, 0, 0], [0, 0, -2.0, 30.0], [0, 0, -30.0, -2.0]],
    [[1.0, 0.3], [0.4, 2.0], [0.7, -1.0], [0.2, 1.5]],
    [[2.0, 1.0, 3.0, 0.0], [0.5, -1.0, 0.0, 4.0]],
    np.zeros((2, 2)),
)
GAINS = np.array([1.6, 0.9])


def plant_at(freq, units=(1.0, 1.0)):
    """GK at lines with outputs, and inverse inputs, in other units; (n_freq, 2, 2)."""
    values = np.moveaxis(PLANT(2j * np.pi * freq, squeeze=False), -1, 0) * GAINS
    scale = np.array(units)
    return scale[:, None] * values / scale


def lines_of_plant():
    closed = control.feedback(PLANT, np.diag(GAINS))
    assert (closed.poles().real < 0).all()
    return first_lines(1e-5, 1e3, np.concatenate([PLANT.poles(), closed.poles()]))


def test_each_loop_has_the_margins_of_the_plant_with_the_other_loop_closed():
    margins = stability_margins(plant_at, lines_of_plant())
    for number, other in ((0, 1), (1, 0)):
        around = np.zeros((2, 2))
        around[other, other] = GAINS[other]
        single = control.feedback(PLANT, around)[number, number] * GAINS[number]
        gain, phase, *_ = control.stability_margins(single)
        distance = np.abs(1 + single(2j * np.pi * np.geomspace(1e-3, 1e3, 300_001))).min()
        loop = margins.loops[number]
        assert loop.modulus.value == pytest.approx(distance, rel=1e-5)
        assert loop.gain.value == pytest.approx(gain, rel=1e-4)  # one of them at 0 Hz
        if np.isfinite(phase):
            assert loop.phase.value == pytest.approx(phase, abs=1e-4)


def test_the_margin_of_all_loops_has_no_units():
    lines = lines_of_plant()
    plain = stability_margins(plant_at, lines)
    rescaled = stability_margins(lambda freq: plant_at(freq, (1e6, 1e-3)), lines)
    assert rescaled.modulus.value == pytest.approx(plain.modulus.value, rel=1e-6)
    assert rescaled.singular.value < 1e-3 * plain.singular.value
    assert plain.modulus.value <= min(loop.modulus.value for loop in plain.loops) + 1e-9


def test_the_margin_of_all_loops_holds_for_changes_of_all_at_once():
    # S = (1 + GK)^-1: a diagonal change D of 1 + GK is critical if det(1 + D S) = 0.
    lines = lines_of_plant()
    margins = stability_margins(plant_at, lines)
    closed = sensitivity(plant_at(np.array([margins.modulus.freq_hz])))[0]
    random = np.random.default_rng(3)
    turns = np.exp(2j * np.pi * random.random((4000, 2)))
    radii = np.abs(1 / np.linalg.eigvals(turns[:, :, None] * closed)).min(axis=1)
    # No change below the margin is critical, and one hardly larger is: Perron's bound is close.
    assert radii.min() >= margins.modulus.value * (1 - 1e-9)
    assert radii.min() < 1.1 * margins.modulus.value


def test_scaled_singular_values_lie_between_spectral_radius_and_singular_value():
    random = np.random.default_rng(5)
    matrices = random.normal(size=(50, 3, 3)) + 1j * random.normal(size=(50, 3, 3))
    scaled = scaled_singular_values(matrices)
    radius = np.abs(np.linalg.eigvals(matrices)).max(axis=1)
    perron = np.abs(np.linalg.eigvals(np.abs(matrices))).max(axis=1)
    assert (radius <= scaled * (1 + 1e-9)).all()
    assert (scaled <= perron * (1 + 1e-9)).all()
    triangular = np.triu(matrices)
    diagonal = np.abs(np.einsum("fll->fl", triangular)).max(axis=1)
    np.testing.assert_allclose(scaled_singular_values(triangular), diagonal, rtol=0.02)
    np.testing.assert_allclose(
        singular_values(matrices), np.linalg.svd(matrices, compute_uv=False)[:, 0]
    )
