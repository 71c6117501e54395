"""Modes beside the band stand in the fit, so that those inside it are not biased."""

import numpy as np
from modal_case import modal_case

from identification.modal import WeightedFrfs, identify_modes
from identification.modal.refinement import refine


def found_in(seed):
    case = modal_case(seed, 8, total=12, n_out=18, lines=401, start=10)
    s = 2j * np.pi * case.freq_hz
    data = WeightedFrfs(s, 2, case.noisy, np.ones((len(s), 1, 1)), 1 / case.sd**2)
    return case, data, identify_modes(data, case.freq_hz)


def test_intervals_hold_for_machines_with_modes_above_the_band() -> None:
    pulls, misfits = [], []
    for seed in range(60_000, 60_008):
        case, _, found = found_in(seed)
        near = np.abs(found.fit.freq_hz[:, None] / case.modes_hz - 1).argmin(axis=0)
        pulls.append((found.fit.freq_hz[near] - case.modes_hz) / found.freq_sd[near])
        pulls.append((found.fit.damping[near] - case.damping) / found.damping_sd[near])
        misfits.append(found.misfit)
    # 128 pulls, robust against a single one: without guards the rms is above 1.3.
    assert np.sqrt(np.mean(np.square(np.clip(pulls, -4, 4)))) < 1.2
    assert max(misfits) < 1.06


def test_real_residuals_alone_do_not_stand_for_modes_next_to_the_band() -> None:
    _, data, found = found_in(60_000)
    inside = found.inside
    bare, _ = refine(data, found.fit.poles[inside], found.fit.participation[:, inside])
    assert bare.cost > 1.5 * found.fit.cost


def test_poles_beside_the_band_are_not_counted_as_modes() -> None:
    case, _, found = found_in(60_001)
    assert found.inside.sum() == len(case.modes_hz)
    assert (~found.inside).any()
    outside = found.fit.freq_hz[~found.inside]
    assert ((outside < case.freq_hz[0]) | (outside > case.freq_hz[-1])).all()
