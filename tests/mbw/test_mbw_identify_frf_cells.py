"""Coherence and rigid-body reconstruction of each measured FRF."""

from dataclasses import replace

import numpy as np
import pytest
from campaign_folder import write_folder

from identification.modal.campaign_modes import combine_tests
from identification.result.arrays import compute_frf_cells
from tuning import open_campaign

LOST = ("acc3:+tx", "acc4:+tz", "acc6:+ty")  # of nine channels on the head: six are left


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    folder = write_folder(tmp_path_factory.mktemp("cells") / "campaign", lines=64)
    return open_campaign(folder, None)[2]


def changed(test, factor, **fields):
    """The same test with its variance times a factor, and other fields of its estimate."""
    estimate = replace(test.estimate, variance=factor * test.estimate.variance, **fields)
    return replace(test, estimate=estimate)


def test_coherence_is_that_of_the_test_each_cell_was_taken_from(campaign):
    # A noisier test of the first reference: its coherence must not be shown.
    first = campaign.tests[0]
    other = changed(first, 4.0, coherence=0.5 * first.estimate.coherence)
    both = replace(campaign, tests=(other, *campaign.tests))
    cells = compute_frf_cells(both, combine_tests(both))
    assert cells.has_coherence.all()
    for column, test in enumerate(campaign.tests):
        np.testing.assert_array_equal(
            cells.coherence[:, :, column], test.estimate.coherence[:, :, 0]
        )


def test_a_test_without_coherence_shows_none_and_not_that_of_a_worse_test(campaign):
    first = campaign.tests[0]
    tests = (changed(first, 4.0), changed(first, 1.0, coherence=None), *campaign.tests[1:])
    both = replace(campaign, tests=tests)
    cells = compute_frf_cells(both, combine_tests(both))
    assert not cells.has_coherence[:, 0].any()
    assert not cells.coherence[:, :, 0].any()
    assert cells.has_coherence[:, 1:].all()


def test_solid_bodies_read_what_was_measured_but_for_noise(campaign):
    measured = combine_tests(campaign)
    cells = compute_frf_cells(campaign, measured)
    assert cells.has_solid.all()
    rows = campaign.layout.rows(measured.outputs)  # the bodies' columns do not mix
    motion = np.linalg.lstsq(rows, measured.values[30], rcond=None)[0]
    np.testing.assert_allclose(cells.solid[30], rows @ motion, rtol=1e-9, atol=1e-12)
    away = np.abs(cells.solid - measured.values) ** 2
    assert (away.sum(axis=(0, 1)) < measured.variance.sum(axis=(0, 1))).all()


def test_a_turned_channel_is_far_from_its_body(campaign):
    measured = combine_tests(campaign)
    values = measured.values.copy()
    values[:, 6] *= -1
    cells = compute_frf_cells(campaign, replace(measured, values=values))
    away = np.linalg.norm(cells.solid[:, 6] - values[:, 6])
    assert away > 0.3 * np.linalg.norm(values[:, 6])


def test_a_body_without_redundant_channels_has_no_rigid_reconstruction(campaign):
    measured = combine_tests(campaign)
    there = measured.measured.copy()
    lost = [k for k, dof in enumerate(measured.outputs) if str(dof) in LOST]
    there[lost, 0] = False
    cells = compute_frf_cells(campaign, replace(measured, measured=there))
    head = [k for k, dof in enumerate(measured.outputs) if dof.point in {"acc3", "acc4", "acc6"}]
    assert not cells.has_solid[head, 0].any()
    assert not cells.solid[:, head, 0].any()
    assert cells.has_solid[:, 1:].all()
    rest = [k for k in range(len(measured.outputs)) if k not in head]
    assert cells.has_solid[rest, 0].all()
