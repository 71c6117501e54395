"""Bad hits of a virtual test: as many as asked for, each wrong in its own way."""

import numpy as np
import pytest

from identification.words import Dof, UsageError
from mbmodel.virtual_test.bad_hits import (
    KINDS,
    BadHit,
    draw_bad_hits,
    spoil_channels,
    spoil_hits,
)
from mbmodel.virtual_test.hits import Hits

PLACE = Dof.parse("acc1:+tx")
PLANNED = (PLACE, Dof.parse("acc3:+ty"))


def kinds_of(hits):
    return [hit.kind for hit in hits if hit is not None]


def test_bad_hits_are_a_share_beside_the_planned_ones():
    hits = draw_bad_hits(4000, 0.2, PLACE, PLANNED, np.random.default_rng(0))
    assert hits.count(None) == 4000
    share = len(kinds_of(hits)) / len(hits)
    assert share == pytest.approx(0.2, abs=5 * np.sqrt(0.16 / len(hits)))
    assert set(kinds_of(hits)) == set(KINDS)
    for hit in hits:
        if hit is not None and hit.kind == "wrong point":
            assert hit.struck == PLANNED[1]
        elif hit is not None and hit.kind == "wrong direction":
            assert hit.struck.point == PLACE.point
            assert hit.struck != PLACE
        elif hit is not None:
            assert hit.struck == PLACE


def test_a_test_of_one_point_has_no_wrong_point():
    hits = draw_bad_hits(300, 0.5, PLACE, (PLACE,), np.random.default_rng(1))
    assert set(kinds_of(hits)) == set(KINDS) - {"wrong point"}


def test_pulses_of_double_weak_and_strong_hits():
    good = Hits(
        onsets=np.array([[0.1, 0.1]] * 4),
        peaks=np.array([[200.0, 0.0]] * 4),
        widths=np.full((4, 2), 0.004),
        turns=np.zeros((4, 3)),
        places=np.zeros((4, 3)),
    )
    bad = [None, BadHit("double", PLACE), BadHit("weak", PLACE, share=0.1)]
    bad.append(BadHit("overload", PLACE, share=4.0))
    hits = spoil_hits(good, bad, np.random.default_rng(2))
    np.testing.assert_allclose(hits.peaks[:, 0], [200, 200, 20, 800])
    assert 0.2 * 200 <= hits.peaks[1, 1] <= 0.7 * 200
    assert hits.peaks[[0, 2, 3], 1].tolist() == [0, 0, 0]
    assert hits.onsets[1, 1] - hits.onsets[1, 0] >= 4 * 0.004


def test_channels_are_recorded_wrongly():
    random = np.random.default_rng(3)
    motion = random.standard_normal((6, 4, 64))
    kinds = (None, "turned channel", "swapped channels", "overload", "loose cable", "loose cable")
    bad = [kind and BadHit(kind, PLACE, share=4.0) for kind in kinds]
    bad[5] = BadHit("loose cable", PLACE, is_dead=True)
    recorded, named = spoil_channels(motion, bad, random)
    np.testing.assert_array_equal(recorded[0], motion[0])
    (turned,) = named[1].channels
    np.testing.assert_array_equal(recorded[1, turned], -motion[1, turned])
    first, second = named[2].channels
    np.testing.assert_array_equal(recorded[2, [first, second]], motion[2, [second, first]])
    limit = 1.3 / 4.0 * np.abs(motion[3]).max()
    np.testing.assert_array_equal(recorded[3], np.clip(motion[3], -limit, limit))
    assert named[3].channels == (0, 1, 2, 3)
    (noisy,) = named[4].channels
    assert 0 < (recorded[4, noisy] - motion[4, noisy]).std() < np.abs(motion[4, noisy]).max()
    (dead,) = named[5].channels
    assert np.abs(recorded[5, dead]).max() < 0.01 * np.abs(motion[5, dead]).max()


def test_a_single_channel_cannot_be_exchanged():
    bad = [BadHit("swapped channels", PLACE)]
    with pytest.raises(UsageError, match="give more channels"):
        spoil_channels(np.ones((1, 1, 8)), bad, np.random.default_rng(4))
