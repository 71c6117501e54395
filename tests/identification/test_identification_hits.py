"""From records to FRFs: known modes struck by half-sine pulses, found within what is predicted."""

from dataclasses import replace

import numpy as np
import pytest
from hammer_records import Hammer, a_system, strike

from identification.hits import HitSettings, estimate_hit_frf, estimate_hit_frfs, find_blows
from identification.hits.hit_frfs import KeptEstimates
from identification.hits.remarks import window_remarks
from identification.words import Dof, InputError

SYSTEM = a_system()
BAND = 5.0, 200.0  # the pulses of 4 ms have their first zero at 375 Hz


def in_band(found):
    freq = found.estimate.frf.freq_hz
    return (freq >= BAND[0]) & (freq <= BAND[1])


def truth(system, found):
    tau = found.estimate.window_tau
    decay = 1 / tau if tau else 0.0
    return system.accelerance(decay + 2j * np.pi * found.estimate.frf.freq_hz)


def relative_error(system, found):
    band, exact = in_band(found), truth(system, found)
    error = found.estimate.frf.values[:, :, 0] - exact
    return float(np.linalg.norm(error[band]) / np.linalg.norm(exact[band]))


def squared(system, found):
    """|error|^2 over its variance in the band."""
    band, exact = in_band(found), truth(system, found)
    error = np.abs(found.estimate.frf.values[:, :, 0] - exact) ** 2
    return (error / found.estimate.variance[:, :, 0])[band]


@pytest.fixture(scope="module")
def noisy():
    return strike(SYSTEM, Hammer(noise=2e-3))


@pytest.fixture(scope="module")
def found(noisy):
    return estimate_hit_frf(noisy)


def test_without_noise_the_frf_is_that_of_the_modes():
    # What is left: half-sines of 4 ms alias, and the generator's filter rings beyond the window.
    found = estimate_hit_frf(strike(SYSTEM, Hammer()))
    assert relative_error(SYSTEM, found) < 1e-4


def test_errors_are_as_large_as_their_variance_says(found):
    # F(2, 2 (n - 1)) has the mean (n - 1) / (n - 2); 4 channels, 781 lines.
    n = len(found.kept)
    assert n == 8
    ratio = squared(SYSTEM, found)
    assert ratio.mean() == pytest.approx((n - 1) / (n - 2), rel=0.08)
    point = (n - 1) * (0.05 ** (-1 / (n - 1)) - 1)  # 95 % of F(2, 2 (n - 1))
    assert (ratio < point).mean() == pytest.approx(0.95, abs=0.012)


def test_each_record_of_one_hit_is_one_block(found):
    assert found.block_s == 4.0
    assert found.pretrigger_s == pytest.approx(0.1, abs=2e-3)
    assert found.rate_hz == 1024.0
    np.testing.assert_allclose(found.estimate.frf.freq_hz, np.arange(2049) / 4, rtol=1e-14)
    assert found.rejected == ()
    assert found.remarks == ()


def test_the_estimate_says_where_it_comes_from(found, noisy):
    estimate_ = found.estimate
    assert estimate_.averages == 8
    assert estimate_.variance_source == "coherence"
    assert estimate_.window_tau == 0
    assert estimate_.frf.outputs == noisy.outputs
    assert estimate_.frf.inputs == (noisy.reference,)
    assert estimate_.frf.quantity == "accelerance"
    assert [hit.number for hit in found.kept] == list(range(1, 9))
    assert [hit.record for hit in found.kept] == list(range(1, 9))
    for hit, force in zip(found.kept, noisy.force, strict=True):
        assert hit.peak_n == pytest.approx(force.max(), rel=1e-6)


def test_a_long_recording_gives_the_same_as_its_hits_one_by_one():
    times = (0.5, 3.1, 5.4, 8.0, 10.6)
    found = estimate_hit_frf(strike(SYSTEM, Hammer(duration_s=13.0, times_s=(times,), noise=2e-3)))
    assert len(found.kept) == 5
    np.testing.assert_allclose([hit.time_s for hit in found.kept], times, atol=2e-3)
    # The shortest time between hits sets the block.
    assert 2.2 < found.block_s <= 2.3
    assert squared(SYSTEM, found).mean() == pytest.approx(4 / 3, rel=0.15)


def test_a_record_of_one_late_hit_is_cut_before_it():
    times = tuple((1.5 + 0.01 * k,) for k in range(4))
    found = estimate_hit_frf(strike(SYSTEM, Hammer(times_s=times, noise=2e-3)))
    assert len(found.kept) == 4
    assert 2.3 < found.block_s < 2.6
    assert found.pretrigger_s < 0.1


def test_a_stated_block_and_pretrigger_are_taken(noisy):
    found = estimate_hit_frf(noisy, HitSettings(block_s=2.0, pretrigger_s=0.05))
    assert (found.block_s, found.pretrigger_s) == (2.0, pytest.approx(0.05, abs=1e-3))
    assert found.estimate.frf.freq_hz[1] == 0.5
    assert squared(SYSTEM, found).mean() == pytest.approx(7 / 6, rel=0.12)


LIGHT = a_system(damping=0.003)


def test_an_exponential_window_gives_the_frf_beside_the_imaginary_axis():
    # With 0.6 s blocks a fifth of the response and more is cut off; H(i w + 1/tau) is found still.
    hammer = Hammer(duration_s=0.6, noise=0.0)
    found = estimate_hit_frf(strike(LIGHT, hammer))
    assert found.residual_response > 0.2
    tau = found.estimate.window_tau
    assert found.block_s / 10 < tau < found.block_s / 5
    assert relative_error(LIGHT, found) < 0.004
    plain = estimate_hit_frf(strike(LIGHT, hammer), HitSettings(exponential_tau=0.0))
    assert plain.estimate.window_tau == 0
    assert relative_error(LIGHT, plain) > 0.1
    assert any("without an exponential window" in remark for remark in plain.remarks)


def test_tests_with_the_same_window_share_a_sentence():
    cut_off = estimate_hit_frf(strike(LIGHT, Hammer(duration_s=0.6, noise=0.0)))
    (single,) = window_remarks([cut_off])
    assert single in cut_off.remarks
    less = replace(cut_off, test="b.uff", residual_response=cut_off.residual_response / 2)
    (both,) = window_remarks([less, cut_off])
    assert both.startswith(
        f"2 tests, the first of them b.uff, hammer at {cut_off.reference}: up to "
    )
    assert both.partition(": ")[2] == f"up to {single.partition(': ')[2]}"
    other_window = replace(cut_off, tau_s=2 * cut_off.tau_s)
    assert len(window_remarks([cut_off, other_window, replace(cut_off, block_s=9.0)])) == 3
    settled = replace(cut_off, tau_s=0.0, residual_response=0.001)
    assert window_remarks([settled]) == ()


def test_with_noise_and_an_exponential_window_errors_are_as_predicted():
    found = estimate_hit_frf(strike(LIGHT, Hammer(duration_s=1.0, noise=5e-3)))
    assert found.estimate.window_tau > 0
    # Lines are correlated over 1 / (pi tau), two of them: twice the scatter of independent ones.
    assert squared(LIGHT, found).mean() == pytest.approx(7 / 6, rel=0.35)


def test_the_window_is_remarked_with_what_it_does_to_damping():
    found = estimate_hit_frf(strike(LIGHT, Hammer(duration_s=1.0, noise=2e-3)))
    (remark,) = found.remarks
    assert "adds 1/(tau omega) to a damping ratio; the modal fit subtracts it" in remark
    assert "hits.uff, hammer at 11:+tz" in remark


def test_noise_alone_at_the_end_of_a_block_asks_for_no_window():
    found = estimate_hit_frf(strike(SYSTEM, Hammer(noise=2e-2)))
    assert found.estimate.window_tau == 0


def test_a_window_as_long_as_the_block_keeps_the_force_whole(noisy):
    whole = estimate_hit_frf(noisy, HitSettings(force_window_s=0.0))
    assert whole.force_window_s == whole.block_s
    short = estimate_hit_frf(noisy)
    assert short.force_window_s < 0.12
    noise = strike(SYSTEM, Hammer(force_noise=1.0))
    # Noise outside the window no longer reaches the force: H1 falls less, and scatters less.
    errors = [
        relative_error(SYSTEM, estimate_hit_frf(noise, HitSettings(force_window_s=length)))
        for length in (None, 0.0)
    ]
    assert errors[0] < 0.6 * errors[1]


def test_noise_on_the_force_lowers_h1_but_not_h2():
    # The force window off, so that the noise of the whole block counts.
    records = strike(SYSTEM, Hammer(force_noise=3.0, times_s=tuple((0.1,) for _ in range(40))))
    ratios = {}
    for estimator in ("H1", "H2", "Hv"):
        found = estimate_hit_frf(
            records, HitSettings(force_window_s=0.0, estimator=estimator, reject=False)
        )
        band = in_band(found)
        exact = truth(SYSTEM, found)[band]
        ratio = (found.estimate.frf.values[band, :, 0] * exact.conj()).real.sum()
        ratios[estimator] = ratio / (np.abs(exact) ** 2).sum()
    assert ratios["H1"] < 0.85
    assert ratios["H2"] == pytest.approx(1.0, abs=0.01)
    # The noise before the hits tells Hv that it is all on the force.
    assert ratios["Hv"] == pytest.approx(ratios["H2"], rel=1e-3)


def test_one_hit_has_no_coherence_and_says_so():
    found = estimate_hit_frf(strike(SYSTEM, Hammer(times_s=((0.1,),), noise=2e-3)))
    assert found.estimate.coherence is None
    assert found.estimate.averages == 1
    assert found.estimate.variance_source == "differences"
    assert any("a single hit has no coherence" in remark for remark in found.remarks)
    assert np.median(squared(SYSTEM, found)) == pytest.approx(np.log(2), rel=0.25)


def test_one_hit_with_an_exponential_window_knows_its_variance_too():
    # The window joins neighbouring lines; differences would miss most of the noise.
    records = strike(SYSTEM, Hammer(times_s=((0.1,),), noise=2e-3))
    found = estimate_hit_frf(records, HitSettings(exponential_tau=2.0))
    assert np.median(squared(SYSTEM, found)) == pytest.approx(np.log(2), rel=0.4)


def test_densities_carry_the_energy_of_the_records(found, noisy):
    # Parseval: the integral of the squared density is the mean square of the block.
    step = found.densities.freq_hz[1]
    total = (found.densities.motion**2).sum(axis=0) * step
    np.testing.assert_allclose(total, (noisy.motion**2).mean(axis=(0, 2)), rtol=2e-3)
    force = (found.densities.force**2).sum() * step
    assert force == pytest.approx(float((noisy.force**2).mean()), rel=2e-3)


def test_the_noise_before_the_hits_has_its_density(found):
    # White noise of 2e-3 over 512 Hz; 51 lines of one segment are certain to 7 %.
    assert found.noise is not None
    np.testing.assert_allclose(
        np.sqrt((found.noise.motion[2:-2] ** 2).mean(axis=0)), 2e-3 / np.sqrt(512), rtol=0.25
    )


def test_offsets_of_force_and_motion_do_not_count(noisy, found):
    moved = replace(noisy, force=noisy.force + 7.0, motion=noisy.motion + 0.1)
    again = estimate_hit_frf(moved)
    np.testing.assert_allclose(
        again.estimate.frf.values[1:], found.estimate.frf.values[1:], rtol=1e-7
    )


def test_turning_a_channel_turns_its_frf_and_nothing_else(noisy, found):
    signs = np.array([1.0, -1.0, 1.0, 1.0])
    turned = estimate_hit_frf(replace(noisy, motion=noisy.motion * signs[:, None]))
    np.testing.assert_allclose(
        turned.estimate.frf.values, found.estimate.frf.values * signs[:, None], rtol=1e-12
    )
    np.testing.assert_allclose(turned.estimate.variance, found.estimate.variance, rtol=1e-9)


def test_a_negative_force_keeps_its_sign(noisy, found):
    turned = estimate_hit_frf(replace(noisy, force=-noisy.force))
    np.testing.assert_allclose(turned.estimate.frf.values, -found.estimate.frf.values, rtol=1e-12)
    assert all(hit.peak_n < 0 for hit in turned.kept)


def test_references_of_one_campaign_share_block_and_window():
    first = strike(LIGHT, Hammer(duration_s=1.0, noise=2e-3))
    second = strike(
        SYSTEM,
        Hammer(duration_s=5.0, times_s=((0.5, 1.9, 3.3),), noise=2e-3, reference="11:+x"),
    )
    one, other = estimate_hit_frfs([first, second], [HitSettings()] * 2)
    np.testing.assert_array_equal(one.estimate.frf.freq_hz, other.estimate.frf.freq_hz)
    assert one.estimate.window_tau == other.estimate.window_tau > 0
    assert other.reference == Dof.parse("11:+x")


def test_estimates_are_kept_where_records_settings_block_and_window_are_those_of_before(noisy):
    second, kept = replace(noisy, test="other.uff"), KeptEstimates()
    plain, fewer = HitSettings(), HitSettings(left_out=frozenset({2}))
    before = estimate_hit_frfs([noisy, second], [plain, plain], kept)
    same, changed = estimate_hit_frfs([noisy, second], [plain, fewer], kept)
    assert same is before[0]
    assert len(changed.kept) == len(before[1].kept) - 1
    alone = estimate_hit_frfs([noisy, second], [plain, fewer])[1]
    np.testing.assert_array_equal(changed.estimate.frf.values, alone.estimate.frf.values)
    renewed = replace(noisy, motion=2 * noisy.motion)
    of_renewed, still = estimate_hit_frfs([renewed, second], [plain, fewer], kept)
    assert still is changed
    np.testing.assert_array_equal(of_renewed.estimate.frf.values, 2 * same.estimate.frf.values)
    windowed = [replace(setting, exponential_tau=0.3) for setting in (plain, fewer)]
    assert estimate_hit_frfs([noisy, second], windowed, kept)[0].tau_s == 0.3


@pytest.mark.parametrize("key", ["block_s", "pretrigger_s", "exponential_tau"])
def test_settings_that_contradict_one_another_are_refused(noisy, key):
    other = replace(noisy, test="other.uff")
    settings = [HitSettings(**{key: value}) for value in (0.25, 0.5)]
    with pytest.raises(InputError, match=f"{key} is 0.25 s for hits.uff, 0.5 s for other.uff"):
        estimate_hit_frfs([noisy, other], settings)


def test_what_one_file_states_holds_for_all(noisy):
    other = replace(noisy, test="other.uff")
    one, two = estimate_hit_frfs([noisy, other], [HitSettings(block_s=2.0), HitSettings()])
    assert one.block_s == two.block_s == 2.0


def test_unequal_rates_are_refused(noisy):
    other = replace(noisy, rate_hz=512.0, test="other.uff")
    with pytest.raises(InputError, match=r"other.uff was sampled at 512 Hz and hits.uff at 1024"):
        estimate_hit_frfs([noisy, other], [HitSettings()] * 2)


def test_records_without_a_hit_are_refused(noisy):
    with pytest.raises(InputError, match="there is no hit in the force along 11:"):
        estimate_hit_frf(replace(noisy, force=np.zeros_like(noisy.force)))


def test_a_force_that_never_rests_is_no_hit(noisy):
    random = np.random.default_rng(5).normal(size=noisy.force.shape)
    with pytest.raises(InputError, match=r"force along 11:\+t. never rests .* no series of hits"):
        estimate_hit_frf(replace(noisy, force=random))
    time = np.arange(noisy.force.shape[1]) / noisy.rate_hz
    sweep = np.broadcast_to(np.sin(2 * np.pi * (5 + 3 * time) * time), noisy.force.shape)
    with pytest.raises(InputError, match=r"never rests .* no series"):
        estimate_hit_frf(replace(noisy, force=sweep))


@pytest.mark.parametrize("offset", [0.0, 12.0])
def test_bursts_of_random_force_and_chirps_are_no_hits(noisy, offset):
    n_sample = noisy.force.shape[1]
    time = np.arange(n_sample) / noisy.rate_hz
    is_on = time % 4.0 < 1.2
    random = 30 * np.random.default_rng(6).normal(size=noisy.force.shape) * is_on + offset
    chirp = np.broadcast_to(np.sin(2 * np.pi * 40 * (time % 4.0) ** 2) * is_on, noisy.force.shape)
    for force in (random, chirp):
        with pytest.raises(InputError, match=r"pulls as much as it pushes.* no series"):
            estimate_hit_frf(replace(noisy, force=force))


def test_blocks_too_short_are_refused(noisy):
    with pytest.raises(InputError, match="too short: set block_s"):
        estimate_hit_frf(noisy, HitSettings(block_s=0.01))


def test_ringing_of_the_hammer_is_no_second_hit(noisy):
    force = noisy.force.copy()
    for row in force:
        end = int(np.argmax(row)) + 4
        row[end : end + 8] += 0.15 * row.max() * np.exp(-np.arange(8) / 3) * (-1.0) ** np.arange(8)
    assert all(not blow.bounces for blow in find_blows(replace(noisy, force=force)))


def test_noise_makes_no_hits(noisy):
    rng = np.random.default_rng(8)
    loud = replace(noisy, force=noisy.force + 3.0 * rng.normal(size=noisy.force.shape))
    assert len(find_blows(loud)) == 8
