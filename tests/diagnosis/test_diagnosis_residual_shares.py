"""The residual by body, the baseline of every diagnosis."""

import numpy as np
import pytest

from diagnosis import compute_residual_shares
from identification.words import Dof, Layout
from tuning import ChannelGaps

LAYOUT = Layout(
    bodies=("base", "head"),
    centres=np.zeros((2, 3)),
    points=("acc1", "acc2"),
    body_of=np.array([0, 1]),
    positions=np.ones((2, 3)),
    axes=np.stack([np.eye(3)] * 2),
)


def test_the_shares_are_the_parts_of_the_squared_excess():
    gaps = ChannelGaps(
        outputs=(Dof("acc1", "+tx"), Dof("acc2", "+tx"), Dof("acc2", "+ty")),
        tests=(0, 0, 0),
        error=np.array([0.2, 0.3, 0.4]),
        noise=np.array([0.1, 0.1, 0.1]),
    )
    head, base = compute_residual_shares(gaps, LAYOUT)
    assert (head.body, base.body) == ("head", "base")
    assert head.share == pytest.approx(25 / 29)
    assert base.share == pytest.approx(4 / 29)
    assert head.excess == pytest.approx(np.sqrt(25 / 2))
    assert (head.channels, base.channels) == (2, 1)


def test_channels_without_noise_have_no_excess_and_are_left_out():
    gaps = ChannelGaps((Dof("acc1", "+tx"),), (0,), np.array([0.2]), np.array([0.0]))
    assert compute_residual_shares(gaps, LAYOUT) == ()
