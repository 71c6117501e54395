"""Positions in millimetres are refused where bodies contradict them, else remarked."""

from pathlib import Path

import numpy as np
import pytest

from identification.checks.files import check_lengths
from identification.words import InputError, Layout

SITES = np.array([[0.1, 0.2, 0.0], [-0.2, 0.1, 0.3], [0.3, -0.35, 0.9], [0.1, 0.1, 1.2]])
CENTRES = np.array([[0.0, 0.0, 0.1], [0.05, 0.0, 1.0]])
CAMPAIGN = Path("campaign.toml")


def layout(sites, centres=CENTRES):
    names = tuple(f"acc{k}" for k in range(1, 5))
    bodies = ("base", "head")[: len(centres)]
    body_of = np.array([0, 0, 1, 1]) % len(centres)
    return Layout(bodies, centres, names, body_of, sites, np.tile(np.eye(3), (4, 1, 1)))


def test_lengths_in_metres_are_not_questioned():
    assert check_lengths(CAMPAIGN, layout(SITES)) == []
    assert check_lengths(CAMPAIGN, layout(SITES, CENTRES[[0, 0]])) == []  # concentric stages
    assert check_lengths(CAMPAIGN, layout(0.01 * SITES, 0.01 * CENTRES)) == []
    assert check_lengths(CAMPAIGN, layout(20 * SITES, 20 * CENTRES)) == []


def test_sites_in_millimetres_on_bodies_in_metres_are_refused():
    with pytest.raises(InputError, match=r"campaign\.toml: points lie .* divide .* by 1000"):
        check_lengths(CAMPAIGN, layout(1000 * SITES))


@pytest.mark.parametrize(("scale", "advice"), [(1e3, "divide"), (1e-4, "check their unit")])
def test_a_layout_of_an_impossible_size_is_a_remark(scale, advice):
    (remark,) = check_lengths(CAMPAIGN, layout(scale * SITES, scale * CENTRES))
    assert advice in remark
    (remark,) = check_lengths(CAMPAIGN, layout(scale * SITES, scale * CENTRES[:1]))
    assert advice in remark
