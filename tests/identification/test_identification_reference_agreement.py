"""Runs that contradict each other: the fault is named, and the modes are those of the machine."""

from dataclasses import replace

import numpy as np
import pytest

from identification.modal import identify, negative_drive_points, scale_shapes
from identification.words import (
    Campaign,
    Condition,
    Dof,
    Frf,
    FrfEstimate,
    InputError,
    Layout,
    Test,
)

FREQ = np.arange(1, 201) * 0.5
OUTPUTS = tuple(Dof(f"acc{k}", "+tz") for k in range(1, 7))
FREQUENCIES = np.array([20.0, 35.0, 52.0, 80.0])
DAMPING = np.array([0.01, 0.015, 0.008, 0.02])
LAYOUT = Layout(
    ("plate",),
    np.zeros((1, 3)),
    tuple(dof.point for dof in OUTPUTS),
    np.zeros(6, int),
    np.array([[0.1 * k, 0.05 * (k % 2), 0.0] for k in range(6)]),
    np.tile(np.eye(3), (6, 1, 1)),
)


def draw_shapes(seed):
    """Return shapes without nodes; (6, 4)."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0.4, 1.2, (6, 4)) * rng.choice([-1.0, 1.0], (6, 4))


def accelerance(shapes, reference, *, stretch=1.0, signs=1.0, damping=DAMPING):
    """Return the column of one reference by modal superposition; (n_freq, 6).

    ``stretch`` multiplies all frequencies of the machine; ``signs`` multiply residues (6, 4).
    """
    poles = 2 * np.pi * FREQUENCIES * (-damping + 1j * np.sqrt(1 - damping**2))
    residues = signs * shapes * shapes[reference] / (2j * poles.imag)
    s = 2j * np.pi * FREQ[:, None, None] / stretch
    receptance = (residues / (s - poles) + residues.conj() / (s - poles.conj())).sum(axis=-1)
    return receptance * s[:, :, 0] ** 2


def campaign_of(columns, references, *, noise=1e-3, seed=0):
    """Return a campaign with one run for each reference, with white noise."""
    rng = np.random.default_rng(seed)
    tests = []
    for clean, reference in zip(columns, references, strict=True):
        sd = noise * np.sqrt((np.abs(clean) ** 2).mean(axis=0))
        error = sd * rng.normal(size=(2, *clean.shape)) / np.sqrt(2)
        values = (clean + error[0] + 1j * error[1])[:, :, None]
        frf = Frf(FREQ, values, OUTPUTS, (OUTPUTS[reference],), "accelerance")
        variance = np.broadcast_to(sd**2, clean.shape)[:, :, None]
        estimate = FrfEstimate(frf, variance, "differences", np.ones((6, 1), bool))
        tests.append(Test(Condition(f"{reference}.uff", OUTPUTS[reference]), estimate))
    return Campaign("plate", LAYOUT, tuple(tests))


def identify_rightly(campaign):
    """Identify the modes, expect the four of the machine, and return the corrections."""
    model, identified, measured = identify(campaign)
    inside = np.flatnonzero(identified.inside)
    assert len(inside) == 4
    np.testing.assert_allclose(model.freq_hz[:4], FREQUENCIES, rtol=3e-4)
    np.testing.assert_allclose(model.damping[:4], DAMPING, rtol=0.03)
    return measured.corrections


@pytest.mark.parametrize("seed", [1])
@pytest.mark.parametrize("factor", [-1.0, 1.05, 0.8])
def test_a_channel_with_another_factor_in_one_run_is_named(factor, seed):
    shapes = draw_shapes(seed)
    first, second = accelerance(shapes, 0), accelerance(shapes, 3)
    second[:, 1] *= factor
    (sentence,) = identify_rightly(campaign_of([first, second], [0, 3], seed=seed))
    size = "opposite sign" if factor < 0 else f"{factor:.3g} times the gain"
    assert sentence.startswith("acc2:+tz")
    assert size in sentence


def test_of_three_runs_the_one_with_the_fault_is_named():
    shapes = draw_shapes(4)
    columns = [accelerance(shapes, reference) for reference in (0, 3, 5)]
    columns[0][:, 4] *= -1
    (sentence,) = identify_rightly(campaign_of(columns, [0, 3, 5]))
    assert sentence.startswith(
        "acc5:+tz reads with the opposite sign in the run with the reference acc1:+tz"
    )


@pytest.mark.parametrize("shift", [-0.01, 0.03])
def test_a_shift_of_all_frequencies_between_runs_is_named(shift):
    shapes = draw_shapes(5)
    columns = [accelerance(shapes, 0), accelerance(shapes, 3, stretch=1 + shift)]
    (sentence,) = identify_rightly(campaign_of(columns, [0, 3]))
    assert f"frequencies shift by {100 * shift:+.2g} %" in sentence


def test_a_negative_residue_at_a_drive_point_is_named_and_the_other_run_has_the_mode():
    shapes, signs = draw_shapes(6), np.ones((6, 4))
    signs[0, 1] = -1
    columns = [accelerance(shapes, 0, signs=signs), accelerance(shapes, 3)]
    (sentence,) = identify_rightly(campaign_of(columns, [0, 3]))
    assert sentence.startswith("mode at 35 Hz: at the drive point acc1:+tz")


def test_a_negative_residue_of_a_single_reference_leaves_real_shapes():
    shapes, signs = draw_shapes(6), np.ones((6, 4))
    signs[0, 1] = -1
    model, identified, _ = identify(campaign_of([accelerance(shapes, 0, signs=signs)], [0]))
    scaled = scale_shapes(model).model
    negative = negative_drive_points(scaled, identified.residue_sd, identified.inside)
    assert negative == {"acc1:+tz": (1,)}
    np.testing.assert_allclose(np.abs(scaled.shapes.real), np.abs(shapes), rtol=0.03)


@pytest.mark.parametrize("seed", range(2))
def test_references_that_agree_are_not_corrected(seed):
    shapes = draw_shapes(seed)
    campaign = campaign_of([accelerance(shapes, 0), accelerance(shapes, 3)], [0, 3], seed=seed)
    assert identify_rightly(campaign) == ()
    model, identified, _ = identify(campaign)
    assert not negative_drive_points(model, identified.residue_sd, identified.inside)


@pytest.mark.parametrize("apart", [0.0, 1e-3])
def test_two_modes_of_nearly_one_frequency_stay_two(apart, monkeypatch):
    # Each reference alone sees one mode there, of another shape: that is no fault of a channel.
    monkeypatch.setitem(globals(), "FREQUENCIES", np.array([20.0, 35.0, 35.0 * (1 + apart), 80.0]))
    monkeypatch.setitem(globals(), "DAMPING", np.array([0.01, 0.015, 0.015, 0.02]))
    shapes = draw_shapes(7)
    columns = [accelerance(shapes, k, damping=np.array([0.01, 0.015, 0.015, 0.02])) for k in (0, 3)]
    _, identified, measured = identify(campaign_of(columns, [0, 3]))
    assert identified.inside.sum() == 4
    assert measured.corrections == ()


def test_a_channel_that_one_run_lacks_is_not_compared():
    shapes = draw_shapes(9)
    campaign = campaign_of([accelerance(shapes, 0), accelerance(shapes, 3)], [0, 3])
    first, second = campaign.tests
    first = replace(first, estimate=first.estimate.select_outputs([0, 1, 2, 3, 4]))
    assert identify_rightly(replace(campaign, tests=(first, second))) == ()


@pytest.mark.parametrize("parts", [([0, 1, 2], [3, 4, 5]), ([0, 1, 2, 3], [3, 4, 5])])
def test_runs_with_other_sensors_have_the_same_modes(parts):
    shapes = draw_shapes(9)
    campaign = campaign_of([accelerance(shapes, 0), accelerance(shapes, 3)], [0, 3])
    tests = [
        replace(test, estimate=test.estimate.select_outputs(rows))
        for test, rows in zip(campaign.tests, parts, strict=True)
    ]
    assert identify_rightly(replace(campaign, tests=tuple(tests))) == ()


def test_a_reference_without_any_response_is_refused_by_name():
    shapes = draw_shapes(8)
    columns = [accelerance(shapes, 0), np.zeros((len(FREQ), 6))]
    with pytest.raises(InputError, match=r"no channel has a known response to acc4:\+tz"):
        identify(campaign_of(columns, [0, 3]))
