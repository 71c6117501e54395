"""FRFs of forces that never rest, against the exact FRFs of the machine that was shaken."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.signal
import scipy.stats

from identification import read_campaign, read_layout, read_settings, smooth_variance
from identification.continuous import estimate_continuous_frf
from identification.continuous.plan import _hann, _independent_blocks, find_period
from identification.continuous.spectra import average_blocks, choose_lines
from identification.hits import HitSettings
from identification.words import Dof, InputError, Records
from tests.helpers.shaken_machine import (
    OUTPUTS,
    RATE_HZ,
    SETTLING,
    exact,
    multisine,
    random_force,
    ratio,
    shake,
)

FORCES = {
    "random": (random_force(1, 1, 40_000), (0,)),
    "two random ones": (random_force(2, 1, 60_000), (0, 2)),
    "two that are alike": (
        np.array([[0.9, 0.3], [0.5, 0.8]]) @ random_force(2, 60_000, seed=3).reshape(2, -1),
        (0, 2),
    ),
    "a sweep": (
        scipy.signal.chirp(np.arange(40_000) / RATE_HZ, 3, 156, 65)[None, None],
        (1,),
    ),
    "a stepped sine": (  # 56 lines of 4 s each
        np.sin(np.cumsum(np.repeat(np.linspace(5, 60, 56), 1024)) * 2 * np.pi / RATE_HZ)[
            None, None
        ],
        (0,),
    ),
    "bursts": (
        random_force(16, 8192) * (np.abs(np.arange(8192) / RATE_HZ - 12) < 2),
        (0,),
    ),
    "a multisine": (multisine(1, 1, 8), (0,)),
    "two multisines": (multisine(2, 3, 6), (0, 2)),
}


@pytest.mark.parametrize("name", FORCES)
def test_the_error_is_that_which_the_variance_says(name):
    force, points = FORCES[name]
    records = shake(force.reshape(len(points), -1, force.shape[-1]), points, noise=0.05)
    result = estimate_continuous_frf(records)
    squares = ratio(records, result)
    assert 0.4 < squares.mean() < 1.5
    count, inputs = result.estimate.averages, len(points)
    inside = squares < scipy.stats.f.ppf(0.95, 2, 2 * (count - inputs))
    assert inside.mean() > 0.93
    frf = result.estimate.frf
    band = (frf.freq_hz > 4) & (frf.freq_hz < 60)
    assert np.median((result.estimate.variance / np.abs(frf.values) ** 2)[band]) < 0.1


def test_a_sweep_that_stops_with_the_record_does_not_bend_the_last_lines():
    sweep = scipy.signal.chirp(np.arange(40_000) / RATE_HZ, 3, 156.25, 38)
    records = shake(np.concatenate([np.zeros(SETTLING), sweep])[None, None])
    frf = estimate_continuous_frf(records).estimate.frf
    for low, high, largest in ((35, 37, 0.03), (37, 37.8, 0.06)):  # 0.055 and 0.106 by H1 alone
        band = (frf.freq_hz > low) & (frf.freq_hz < high)
        right = exact(frf.freq_hz[band])[:, :, 0]
        error = np.abs(frf.values[band, :, 0] - right) / np.abs(right).max(axis=0)
        assert error.max() < largest


def test_a_sweep_that_starts_with_the_record_bends_no_line_of_a_free_axis():
    rate, seconds = 1000.0, np.arange(60_000) / 1000.0
    force = scipy.signal.chirp(seconds, 2, 60, 120, phi=-90)
    top, bottom, _ = scipy.signal.cont2discrete(([1.0], [22.0, 40.0, 0.0]), 1 / rate)
    motion = scipy.signal.lfilter(top.ravel(), bottom, force)
    places = {"outputs": OUTPUTS[:1], "reference": OUTPUTS[0]}
    records = Records(rate, force[None], motion[None, None], quantity="receptance", **places)
    result = estimate_continuous_frf(records)
    freq = result.estimate.frf.freq_hz
    band = (freq > 2) & (freq < 100)
    right = scipy.signal.freqz(top.ravel(), bottom, freq[band], fs=rate)[1]
    error = np.abs(result.estimate.frf.values[band, 0, 0] - right)
    # Without what is taken off and left out 50 %, and 180 standard deviations.
    assert (error / np.abs(right)).max() < 0.04
    assert (error**2 / result.estimate.variance[band, 0, 0]).max() < 9
    assert freq.min() < 5
    assert any("ends of the record" in remark for remark in result.remarks)


def test_each_force_has_its_own_column():
    force, points = random_force(2, 1, 60_000), (0, 2)
    records = shake(force, points, noise=0.02)
    other = replace(
        records,
        force=records.further_forces[0],
        further_forces=records.force[None],
        reference=OUTPUTS[2],
        further_references=(OUTPUTS[0],),
    )
    for each in (records, other):
        assert ratio(each, estimate_continuous_frf(each)).mean() < 1.5
    alone = replace(records, further_forces=np.zeros((0, 0, 0)), further_references=())
    coherence = estimate_continuous_frf(alone).estimate.coherence
    assert np.median(coherence) < 0.8  # the force that is left out is noise to one input


def test_the_coherence_is_what_a_force_explains_beside_the_others():
    # Bendat and Piersol 2010, ch. 7: both records without what the other force explains of them.
    burst = random_force(3, 16, 8192, seed=5) * (np.abs(np.arange(8192) / RATE_HZ - 12) < 2)
    force = np.array([burst[0] + 0.8 * burst[1], 0.3 * burst[1], burst[2]])
    records = shake(force, (0, 2, 1), noise=1e-5)
    known = {"further_forces": force[1:2, :, -records.force.shape[1] :]}
    records = replace(records, **known, further_references=records.further_references[:1])
    result = estimate_continuous_frf(records)
    assert result.blocks.kind == "burst"  # a third force, that nobody measured, is the noise
    spectra = average_blocks(records, result.blocks)
    lines = choose_lines(spectra, result.blocks, records)
    sxx, syx, syy = spectra.force[lines], spectra.cross[lines], spectra.motion[lines]
    shared = sxx[:, 0, 1] / sxx[:, 1, 1].real  # of the first force and the other
    cross = syx[:, :, 0] - syx[:, :, 1] * shared[:, None].conj()
    power = sxx[:, 0, 0].real - np.abs(sxx[:, 0, 1]) ** 2 / sxx[:, 1, 1].real
    rest = syy - np.abs(syx[:, :, 1]) ** 2 / sxx[:, 1, 1].real[:, None]
    conditioned = np.abs(cross) ** 2 / (power[:, None] * rest)
    np.testing.assert_allclose(result.estimate.coherence[:, :, 0], conditioned, rtol=1e-9)


def test_bursts_need_no_window():
    time = np.arange(8192) / RATE_HZ
    force = random_force(1, 12, 8192) * ((time > 10) & (time < 14))
    records = shake(force, noise=1e-5)
    result = estimate_continuous_frf(records)
    assert result.blocks.kind == "burst"
    assert result.blocks.count == 12
    assert "bursts, 12 blocks of 24 s, 12 independent" in result.remarks[0]
    frf = result.estimate.frf
    band = (frf.freq_hz > 4) & (frf.freq_hz < 60)
    error = np.abs(frf.values[band, :, 0] / exact(frf.freq_hz[band])[:, :, 0] - 1)
    assert np.median(error) < 2e-3


def test_bursts_of_one_record_need_no_window_either():
    burst = np.zeros((1, 1, 12 * 6144))
    lengths = np.random.default_rng(8).integers(6000, 6144, 12)
    starts = np.cumsum(lengths) - lengths
    for k, start in enumerate(starts):
        burst[0, 0, start : start + 600] = random_force(600, seed=20 + k)
    records = shake(np.concatenate([np.zeros((1, 1, 2048)), burst], axis=2), noise=0.02, seed=9)
    result = estimate_continuous_frf(records)
    assert result.blocks.kind == "burst"
    assert len(result.blocks.starts) == 12
    frf = result.estimate.frf
    band = (frf.freq_hz > 5) & (frf.freq_hz < 60)
    error = frf.values[band, :, 0] - exact(frf.freq_hz[band])[:, :, 0]
    squares = np.abs(error) ** 2 / result.estimate.variance[band, :, 0]
    assert 0.8 < squares.mean() < 1.3


def test_lines_of_periods_are_those_that_the_force_excites():
    result = estimate_continuous_frf(shake(multisine(1, 1, 8), noise=0.01))
    freq = result.estimate.frf.freq_hz
    assert result.blocks.kind == "periodic"
    assert (result.blocks.length, len(result.blocks.starts)) == (2048, 6)  # the first one settles
    assert (freq[0], freq[-1]) == (3.0, 65.0 - RATE_HZ / 2048)


def test_the_variance_of_periods_follows_a_force_that_differs_from_line_to_line():
    """Noise is averaged over lines before it is divided by the power of the force."""
    period = multisine(1, 1, 1)[0, 0]
    spectrum = np.fft.rfft(period)
    spectrum[::2] *= 0.1
    force = np.tile(np.fft.irfft(spectrum, len(period)), 8)
    records = shake(force[None, None], noise=0.05)
    result = estimate_continuous_frf(records)
    squares = ratio(records, result)
    freq = result.estimate.frf.freq_hz
    weak = np.round(freq[(freq > 4) & (freq < 60)] * 2048 / RATE_HZ) % 2 == 0
    assert 0.7 < squares[weak].mean() < 1.4
    assert 0.7 < squares[~weak].mean() < 1.4
    smooth = smooth_variance(result.estimate)
    np.testing.assert_array_equal(smooth, result.estimate.variance)


@pytest.mark.parametrize("count", [3, 4, 5, 6])
def test_few_periods_have_their_noise_too(count):
    records = shake(multisine(1, 1, count), noise=0.05)
    result = estimate_continuous_frf(records)
    squares = ratio(records, result)
    assert len(result.blocks.starts) == max(count - 2, 2)  # the machine begins with one more
    assert 0.7 < squares.mean() < 1.4


def shake_by_another_clock(period, noise=0.01):
    """Records of a multisine whose period is no whole number of samples, settled, by its lines."""
    lines = np.arange(round(3 * period / RATE_HZ), round(65 * period / RATE_HZ))
    phases = np.random.default_rng(2).uniform(0, 2 * np.pi, len(lines))
    turns = np.exp(2j * np.pi * np.outer(lines / period, np.arange(9 * period)))
    turns *= np.exp(1j * phases)[:, None]
    frfs = exact(lines * RATE_HZ / period)[:, :, 0]
    motion = (frfs.T @ turns).real
    motion += noise * motion.std() * np.random.default_rng(5).standard_normal(motion.shape)
    first = OUTPUTS[0]
    force = turns.real.sum(axis=0)[None]
    return Records(RATE_HZ, force, motion[None], OUTPUTS, first, "accelerance", test="clock.npz")


@pytest.mark.parametrize("period", [2048.1, 2047.69, 2048.5])
def test_a_period_may_be_no_whole_number_of_samples(period):
    records = shake_by_another_clock(period)
    result = estimate_continuous_frf(records)
    assert 0.7 < ratio(records, result).mean() < 1.4
    if period == 2048.5:  # two of them are a whole number
        assert result.blocks.length == 4097
        return
    (said,) = [remark for remark in result.remarks if "no whole number" in remark]
    length = float(said.partition("repeats each ")[2].partition(" samples")[0])
    whole = result.blocks.length
    assert length * round(whole / length) / period == pytest.approx(round(whole / period), abs=1e-6)
    stated = estimate_continuous_frf(records, HitSettings(period_s=period / RATE_HZ))
    assert stated.blocks.length == round(period)
    assert 0.7 < ratio(records, stated).mean() < 1.4
    records = shake_by_another_clock(period, noise=1e-5)
    errors = []
    for assumed in (period, round(period)):
        settings = HitSettings(period_s=assumed / RATE_HZ)
        frf = estimate_continuous_frf(records, settings).estimate.frf
        mode = (frf.freq_hz > 25) & (frf.freq_hz < 45)
        errors.append(np.abs(frf.values[mode, 0, 0] / exact(frf.freq_hz[mode])[:, 0, 0] - 1).max())
    assert errors[0] < 1e-3 < errors[1]


def test_a_stated_period_has_to_fit_twice():
    with pytest.raises(InputError, match="does not fit twice into records of"):
        estimate_continuous_frf(shake(random_force(1, 1, 8_000)), HitSettings(period_s=20.0))


def test_lines_that_a_force_leaves_out_do_not_widen_the_others():
    spectrum = np.fft.rfft(multisine(1, 1, 1)[0, 0])
    spectrum[1::2] = 0.0
    force = np.tile(np.fft.irfft(spectrum, 2048), 8)
    records = shake(force[None, None], noise=0.05)
    records = replace(records, force=records.force + 1e-9 * random_force(*records.force.shape))
    settings = HitSettings(period_s=2048 / RATE_HZ)
    assert 0.7 < ratio(records, estimate_continuous_frf(records, settings)).mean() < 1.4


def test_distortion_is_told_from_noise_by_realisations():
    plain = estimate_continuous_frf(shake(multisine(1, 5, 4), noise=0.01))
    bent = estimate_continuous_frf(shake(multisine(1, 5, 4), noise=0.01, cubic=0.03))
    assert not any("realisations" in remark for remark in plain.remarks)
    assert any("realisations differ by" in remark for remark in bent.remarks)
    assert np.median(bent.estimate.variance / plain.estimate.variance) > 4


def test_leakage_at_sharp_modes_widens_the_variance_and_is_said():
    records = shake(random_force(1, 1, 8_000), noise=1e-4)
    result = estimate_continuous_frf(records, HitSettings(block_s=2.0))
    (said,) = [remark for remark in result.remarks if "leakage" in remark]
    assert "% of the peak" in said
    assert np.quantile(ratio(records, result), 0.9) < 20  # noise alone would say thousands
    longer = estimate_continuous_frf(shake(random_force(1, 1, 80_000)), HitSettings(block_s=40.0))
    assert not any("leakage" in remark for remark in longer.remarks)


def test_leakage_of_a_steep_frf_is_not_that_of_a_mode():
    force = random_force(1, 80_000)
    low_pass = scipy.signal.butter(1, 0.1, fs=RATE_HZ)  # speed of a free mass with a damper
    motion = scipy.signal.lfilter(*low_pass, force)[:, None]
    places = {"outputs": OUTPUTS[:1], "reference": OUTPUTS[0]}
    records = Records(RATE_HZ, force, motion, quantity="mobility", **places)
    result = estimate_continuous_frf(records, HitSettings(block_s=2.0))
    (said,) = [remark for remark in result.remarks if "leakage" in remark]
    assert "leakage of a steep FRF" in said


def test_a_force_that_falls_at_a_mode_is_said():
    force = random_force(1, 1, 40_000)
    assert not said(force, "falls")
    freq = np.fft.rfftfreq(40_000, 1 / RATE_HZ)
    notch = 1 - 0.97 * np.exp(-(((freq - 30.0) / 0.5) ** 2))  # as of a shaker at a resonance
    dropped = np.fft.irfft(np.fft.rfft(force) * notch, 40_000)
    (sentence,) = said(dropped, "falls")
    assert " dB at 30" in sentence or " dB at 29.9" in sentence or " dB at 30." in sentence
    assert "H2" in sentence


def test_lines_that_a_force_leaves_out_are_no_fall():
    spectrum = np.fft.rfft(multisine(1, 1, 1)[0, 0])
    spectrum[300:310] = 0.0
    force = np.tile(np.fft.irfft(spectrum, 2048), 8)[None, None]
    settings = HitSettings(block_s=8.0)  # one period: between its lines there is nothing
    remarks = estimate_continuous_frf(shake(force), settings).remarks
    assert not any("falls" in text for text in remarks)


def said(force, word):
    """Remarks on a record that hold a word."""
    return [text for text in estimate_continuous_frf(shake(force)).remarks if word in text]


def test_estimators_of_one_force_bracket_the_frf():
    records = shake(random_force(1, 1, 40_000), noise=0.3)
    low, middle, high = (
        np.abs(estimate_continuous_frf(records, HitSettings(estimator=name)).estimate.frf.values)
        for name in ("H1", "Hv", "H2")
    )
    assert (low <= middle * (1 + 1e-9)).all()
    assert (middle <= high * (1 + 1e-9)).all()


@pytest.mark.parametrize(
    ("force", "points", "settings", "said"),
    [
        (np.repeat(random_force(1, 1, 6048), 2, axis=0), (0, 2), {}, "are one signal"),
        (multisine(2, 1, 6), (0, 2), {}, "1 realisation cannot tell the 2 forces along"),
        (multisine(3, 2, 6), (0, 1, 2), {}, "2 realisations cannot tell the 3 forces along"),
        (random_force(1, 1, 6048), (0,), {"block_s": 30.0}, "do not fit into records of 4000"),
        (random_force(1, 1, 6048), (0,), {"block_s": 15.0}, "too few for 1 forces"),
        (random_force(1, 1, 6048), (0,), {"exponential_tau": 0.1}, "exponential_tau is for hits"),
        (random_force(2, 1, 9000), (0, 2), {"estimator": "H2"}, "H2 is for one force, and 2 act"),
    ],
)
def test_records_that_cannot_be_used_are_refused_in_one_sentence(force, points, settings, said):
    with pytest.raises(InputError, match=said):
        estimate_continuous_frf(shake(force, points), HitSettings(**settings))


def test_a_period_is_found_by_the_sample():
    period = np.random.default_rng(4).standard_normal(777)
    force = np.tile(period, 4)[None] + 0.05 * np.random.default_rng(5).standard_normal((1, 3108))
    assert find_period(force) == 777
    assert find_period(np.sin(2 * np.pi * np.arange(4000) / 50)[None]) == 50
    assert find_period(random_force(1, 4000)) is None
    rng = np.random.default_rng(3)
    long = np.tile(period, 8)[None]
    assert find_period(long + 0.5 * long.std() * rng.standard_normal(long.shape)) == 777
    ringing = scipy.signal.lfilter([1.0], [1.0, -1.94, 0.995], rng.standard_normal((1, 20_000)))
    assert find_period(ringing) is None
    slow = scipy.signal.sosfilt(
        scipy.signal.butter(4, 2, fs=RATE_HZ, output="sos"),
        np.random.default_rng(6).standard_normal((1, 8000)),
    )
    assert find_period(slow) is None


def test_overlapping_blocks_count_as_many_as_their_scatter_says():
    length, hop = 64, 21
    window, starts = _hann(length), tuple(range(0, 640 - 64 + 1, 21))
    noise = np.random.default_rng(7).standard_normal((3000, 640))
    blocks = np.stack([noise[:, s : s + length] * window for s in starts], axis=1)
    power = np.abs(np.fft.rfft(blocks)[:, :, 5:28]) ** 2
    scatter = power.mean(axis=1).var(axis=0).mean() / power.mean() ** 2
    assert _independent_blocks(window, hop, starts) == pytest.approx(1 / scatter, rel=0.03)
    half = _independent_blocks(_hann(64), 32, tuple(range(0, 64_000, 32)))
    assert half / 2000 == pytest.approx(1 / (1 + 2 / 36), rel=1e-3)  # Hann, half overlap: 1/6


LAYOUT = "".join(f'[site.acc{k}]\nbody = "row"\nposition = [0.{k}, 0.0, 0.0]\n' for k in (1, 2, 3))
ENTRY = """
layout = "layout.toml"
[[test]]
file = "shaken.npz"
channels = ["acc1:+x", "acc2:+x", "acc3:+x"]
references = [{}]
"""


def read(folder, force, response, references):
    np.savez(folder / "shaken.npz", force=force, response=response, rate_hz=RATE_HZ)
    (folder / "layout.toml").write_text("[body.row]\ncentre = [0.0, 0.0, 0.0]\n" + LAYOUT)
    (folder / "campaign.toml").write_text(ENTRY.format(references))
    source, settings = read_settings(folder)
    return read_campaign(source, settings, read_layout(folder / "layout.toml"))


def test_a_campaign_of_forces_at_once_has_a_test_for_each(tmp_path):
    records = shake(random_force(2, 1, 30_000), (0, 2), noise=0.02)
    force = np.stack([records.force, *records.further_forces])
    campaign = read(tmp_path, force, records.motion, '"acc1:+x", "acc3:+x"')
    assert [str(test.condition.reference) for test in campaign.tests] == ["acc1:+tx", "acc3:+tx"]
    for test in campaign.tests:
        frf = test.estimate.frf
        column = 0 if test.condition.reference == Dof("acc1", "+tx") else 2
        peak = np.abs(exact(frf.freq_hz)[:, :, column]).max()
        band = (frf.freq_hz > 4) & (frf.freq_hz < 60)
        error = frf.values[band, :, 0] - exact(frf.freq_hz[band])[:, :, column]
        assert np.abs(error).mean() < 0.02 * peak
    (said,) = [remark for remark in campaign.remarks if "forces at once" in remark]
    assert "forces at once along acc1:+tx, acc3:+tx: a force that neither repeats" in said


def test_a_text_table_may_hold_several_forces(tmp_path):
    records = shake(random_force(2, 1, 9_000), (0, 2), noise=0.02)
    force = np.stack([records.force, *records.further_forces])
    expected = read(tmp_path, force, records.motion, '"acc1:+x", "acc3:+x"').tests
    time = np.arange(records.force.shape[1]) / RATE_HZ
    table = np.column_stack([time, *records.motion[0], *force[:, 0]])
    heading = "time [s];" + ";".join([f"a{k} [m/s^2]" for k in (1, 2, 3)] + ["f1 [N]", "f3 [N]"])
    np.savetxt(tmp_path / "shaken.csv", table, "%.12e", ";", header=heading, comments="")
    text = (tmp_path / "campaign.toml").read_text().replace("shaken.npz", "shaken.csv")
    (tmp_path / "campaign.toml").write_text(text)
    source, settings = read_settings(tmp_path)
    tests = read_campaign(source, settings, read_layout(tmp_path / "layout.toml")).tests
    for test, twin in zip(tests, expected, strict=True):
        frf, peak = test.estimate.frf.values, np.abs(twin.estimate.frf.values).max()
        np.testing.assert_allclose(frf, twin.estimate.frf.values, rtol=1e-6, atol=1e-8 * peak)


def test_one_random_force_may_have_plain_shapes(tmp_path):
    records = shake(random_force(1, 1, 20_000), noise=0.02)
    campaign = read(tmp_path, records.force[0], records.motion[0], '"acc1:+x"')
    assert len(campaign.tests) == 1
    assert campaign.tests[0].hits is None
