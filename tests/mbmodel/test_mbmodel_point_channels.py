"""Labels grouped by their points, against a search of all labels for each point."""

import numpy as np
import pytest

from identification.words import Dof, Signal
from mbmodel.frf.solution import output_selection
from mbmodel.ports.ports import NO_CHANNELS, direction_selection, group_by_point

LABELS = (
    Dof("acc2", "-ty"),
    Dof("acc1", "+tx"),
    Signal("acc1@0,0,0.2:+tx"),
    Dof("acc2", "+rz"),
    Dof("acc1", "-tz"),
)


@pytest.mark.parametrize("point", ["acc1", "acc2", "acc3"])
def test_channels_of_a_point_are_the_rows_that_a_search_finds(point):
    channels = group_by_point(LABELS).get(point, NO_CHANNELS)
    for found, searched in (
        (channels.directions, direction_selection(LABELS, point)),
        (channels.selection, output_selection(LABELS, point)),
    ):
        whole = np.zeros((len(LABELS), 6))
        whole[channels.rows] = found
        np.testing.assert_array_equal(whole, searched)


def test_a_signal_is_no_direction_of_a_point():
    (channels,) = group_by_point(LABELS[2:3]).values()
    assert channels.rows.tolist() == [0]
    assert not channels.directions.any()
