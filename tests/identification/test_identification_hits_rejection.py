"""Every reason for which a hit is left out, and that the others stay."""

from dataclasses import replace

import numpy as np
import pytest
from hammer_records import Hammer, a_system, strike

from identification.hits import HitSettings, estimate_hit_frf
from identification.words import InputError

SYSTEM = a_system()
SEVEN = tuple((0.1 + 0.0003 * k,) for k in range(7))


@pytest.fixture(scope="module")
def records():
    return strike(SYSTEM, Hammer(times_s=SEVEN, noise=1e-3))


def changed(records, hit, *, force=None, motion=None):
    """The records with a function applied to the force or motion of one of them, from 0."""
    forces, motions = records.force.copy(), records.motion.copy()
    if force is not None:
        forces[hit] = force(forces[hit])
    if motion is not None:
        motions[hit] = motion(motions[hit])
    return replace(records, force=forces, motion=motions)


def reasons(found):
    return {one.hit: one.reason for one in found.rejected}


def test_good_hits_stay(records):
    found = estimate_hit_frf(records)
    assert len(found.kept) == 7
    assert found.rejected == ()


@pytest.mark.parametrize("second", [0.06, 0.4, 1.5])
@pytest.mark.parametrize("later", [0.02, 0.15])
def test_a_double_hit_is_left_out(second, later):
    times = [*SEVEN]
    times[3] = (0.1, 0.1 + later)
    peaks = [(200.0,)] * 7
    peaks[3] = (150.0, second * 150.0)
    hammer = Hammer(times_s=tuple(times), peaks_n=tuple(peaks), noise=1e-3)
    found = estimate_hit_frf(strike(SYSTEM, hammer))
    assert reasons(found).keys() == {4}
    assert "double hit, the second with " in reasons(found)[4]


def test_a_bounce_below_a_twentieth_is_tolerated():
    times = [*SEVEN]
    times[3] = (0.1, 0.15)
    peaks = [(200.0,)] * 7
    peaks[3] = (200.0, 7.0)
    hammer = Hammer(times_s=tuple(times), peaks_n=tuple(peaks), noise=1e-3)
    assert estimate_hit_frf(strike(SYSTEM, hammer)).rejected == ()


@pytest.mark.parametrize("full", [0.7, 0.78])
def test_a_clipped_force_is_left_out(records, full):
    # The ceiling is between the peaks: the larger hits reach it.
    peaks = np.abs(records.force).max(axis=1)
    ceiling = full * peaks.max()
    found = estimate_hit_frf(replace(records, force=np.minimum(records.force, ceiling)))
    over = {int(hit) + 1 for hit in np.flatnonzero(peaks >= ceiling)}
    assert 2 <= len(over) < 7
    assert reasons(found).keys() == over
    assert all("force along 11:+tz is overloaded" in text for text in reasons(found).values())


@pytest.mark.parametrize("sign", [1, -1])
def test_a_clipped_response_is_left_out(records, sign):
    loud = changed(records, 2, motion=lambda m: m * np.array([[1], [6], [1], [1]]))
    motion = loud.motion.copy()
    ceiling = 1.2 * np.abs(np.delete(motion[:, 1], 2, axis=0)).max()
    motion[:, 1] = sign * np.minimum(sign * motion[:, 1], ceiling)
    found = estimate_hit_frf(replace(loud, motion=motion))
    assert reasons(found)[3] == "1:+tx is overloaded"
    assert len(found.kept) == 6


def test_a_stated_ceiling_needs_one_sample_only(records):
    peaks = np.abs(records.force).max(axis=1)
    ceilings = np.array([np.sort(peaks)[-2] * 1.0005, 9, 9, 9, 9])
    found = estimate_hit_frf(replace(records, ceilings=ceilings))
    assert reasons(found).keys() == {int(np.argmax(peaks)) + 1, int(np.argsort(peaks)[-2]) + 1}


def test_steps_of_the_converter_are_no_overload(records):
    # 12 bits over the whole range: crests have equal samples, and none is at a ceiling.
    step = np.abs(records.motion).max() / 2048
    coarse = replace(records, motion=np.round(records.motion / step) * step)
    assert estimate_hit_frf(coarse).rejected == ()


def test_a_steady_hum_in_coarse_steps_is_no_overload(records):
    time = np.arange(records.motion.shape[2]) / records.rate_hz
    motion = records.motion.copy()
    motion[:, 3] = np.round(40 * np.sin(2 * np.pi * 49.7 * time)) * 1e-3
    found = estimate_hit_frf(replace(records, motion=motion))
    assert not any("overloaded" in text for text in reasons(found).values())


def test_weak_hits_are_left_out():
    peaks = [(200.0,)] * 6 + [(30.0,)]
    hammer = Hammer(times_s=SEVEN, peaks_n=tuple(peaks), noise=1e-3)
    found = estimate_hit_frf(strike(SYSTEM, hammer))
    assert reasons(found).keys() == {7}
    assert reasons(found)[7].startswith("weak: 0.")


@pytest.mark.parametrize("times", [1.0, 2.5, -0.7])
def test_a_copy_is_left_out_and_its_original_stays(records, times):
    force, motion = records.force.copy(), records.motion.copy()
    force[5], motion[5] = times * force[1], times * motion[1]
    found = estimate_hit_frf(replace(records, force=force, motion=motion))
    assert reasons(found).keys() == {6}
    text = "equal to hit 2" if times == 1 else f"{times:g} times hit 2"
    assert text in reasons(found)[6]


def test_equal_hits_with_noise_of_their_own_are_no_copies():
    peaks = ((200.0,),) * 7
    hammer = Hammer(times_s=((0.1,),) * 7, peaks_n=peaks, noise=1e-4, force_noise=1e-3)
    assert estimate_hit_frf(strike(SYSTEM, hammer)).rejected == ()


def test_a_hit_from_the_other_side_that_reads_the_same_sign_is_left_out(records):
    found = estimate_hit_frf(changed(records, 0, motion=np.negative))
    assert reasons(found).keys() == {1}
    assert "sign opposite" in reasons(found)[1]


def test_a_hit_of_the_other_sign_whose_frf_agrees_stays(records):
    both = changed(records, 0, force=np.negative, motion=np.negative)
    assert estimate_hit_frf(both).rejected == ()


def test_a_hit_at_another_place_is_an_outlier(records):
    other = replace(SYSTEM, drive=SYSTEM.shapes[2])
    hammer = Hammer(times_s=SEVEN, noise=1e-3)
    wrong = strike(other, hammer).motion[4]
    found = estimate_hit_frf(changed(records, 4, motion=lambda _: wrong))
    assert reasons(found).keys() == {5}
    assert "outlier" in reasons(found)[5] or "opposite" in reasons(found)[5]


def test_a_knocked_cable_is_an_outlier(records):
    def knock(motion):
        motion = motion.copy()
        motion[2, 700:720] += 0.5
        return motion

    found = estimate_hit_frf(changed(records, 4, motion=knock))
    assert reasons(found).keys() == {5}
    assert reasons(found)[5].startswith("outlier: ")


def test_hits_a_few_per_cent_apart_are_no_outliers(records):
    # By hand no two hits are at one place: shares of the modes differ by some per cent.
    rng = np.random.default_rng(4)
    motions = [
        strike(
            replace(SYSTEM, drive=SYSTEM.drive * (1 + 0.03 * rng.normal(size=4))),
            Hammer(times_s=SEVEN, noise=1e-3),
        ).motion[k]
        for k in range(7)
    ]
    assert estimate_hit_frf(replace(records, motion=np.array(motions))).rejected == ()


def test_a_hit_cut_by_the_end_of_the_record_is_left_out():
    times = ((0.5, 3.0, 5.5, 8.0, 10.5, 12.9),)
    found = estimate_hit_frf(strike(SYSTEM, Hammer(duration_s=13.2, times_s=times, noise=1e-3)))
    assert reasons(found) == {6: "its block leaves the record"}


def test_a_record_that_begins_within_a_hit_is_left_out(records):
    late = int(np.argmax(records.force[2]))
    cut = changed(
        records, 2, force=lambda f: np.roll(f, -late), motion=lambda m: np.roll(m, -late, axis=1)
    )
    assert reasons(estimate_hit_frf(cut))[3] in {
        "it begins before the record",
        "its block leaves the record",
    }


def test_a_hit_too_soon_after_another_is_left_out_and_spoils_it():
    times = ((0.5, 3.0, 5.5, 6.5, 9.0, 11.5),)
    found = estimate_hit_frf(strike(SYSTEM, Hammer(duration_s=14.0, times_s=times, noise=1e-3)))
    assert reasons(found) == {3: "the next hit is in its block"}


def test_without_reject_all_hits_stay_but_those_without_room(records):
    found = estimate_hit_frf(changed(records, 0, motion=np.negative), HitSettings(reject=False))
    assert found.rejected == ()
    assert found.estimate.coherence[200:800].max() < 0.9


def test_what_was_left_out_is_remarked_with_number_time_and_reason(records):
    found = estimate_hit_frf(changed(records, 4, motion=np.negative))
    (remark,) = found.remarks
    assert remark.startswith(
        "hits.uff, hammer at 11:+tz: 1 of 7 hits were left out: hit 5 (record "
    )
    assert "0.102 s): its responses have the sign opposite" in remark


def test_a_reader_is_told_when_less_than_half_is_left(records):
    force, motion = records.force.copy(), records.motion.copy()
    force[1:5], motion[1:5] = force[0], motion[0]
    found = estimate_hit_frf(replace(records, force=force, motion=motion))
    assert len(found.kept) == 3
    assert any("only 3 of 7 hits are left" in remark for remark in found.remarks)


def test_if_all_hits_are_bad_they_are_refused_with_the_reasons(records):
    ceilings = np.array([1.0, 9, 9, 9, 9])
    with pytest.raises(InputError, match=r"none of the 7 hits along 11:\+tz .* overloaded"):
        estimate_hit_frf(replace(records, ceilings=ceilings))
