"""Campaigns of time records: folders, keys, remarks, drive points, the band, and their modes."""

import io
import re
from dataclasses import replace

import numpy as np
import pytest
import scipy.io
from hammer_records import Hammer, a_system, channel_functions, strike
from identification_examples import Function, a_layout, numbers, read_written, write_campaign

from identification import band_lines
from identification.hits import drive_point_signs
from identification.modal import identify
from identification.words import Dof

HEAD = 'model = "model.xml"\n'
TEST = '[[test]]\nfile = "a.uff"\n'
ARRAYS = 'channels = ["7:+z", "1:+x", "1:-y", "2:+z"]\nreferences = ["7:+z"]\n'
SYSTEM = a_system()
HAMMER = Hammer(
    noise=1e-3, outputs=("7:+z", "1:+x", "1:-y", "2:+z"), reference="7:+z", times_s=((0.1,),) * 5
)
# With the drive point along another line the first channel is no drive point.
SIDE = replace(HAMMER, reference="7:+x", seed=21)


def uff(*records, **options):
    functions = [f for own in records for f in channel_functions(own, order="<", **options)]
    return b"".join(function.content() for function in functions)


@pytest.fixture(scope="module")
def records():
    return strike(SYSTEM, HAMMER)


@pytest.fixture
def read(tmp_path):
    def read_text(text, layout=None, **files):
        contents = {name.replace("_", "."): content for name, content in files.items()}
        write_campaign(tmp_path, HEAD + text, contents)
        return read_written(tmp_path, layout)

    return read_text


def npz(**arrays):
    content = io.BytesIO()
    np.savez(content, **arrays)
    return content.getvalue()


def test_a_file_of_records_becomes_tests_at_the_sites(read, records):
    campaign = read(TEST + "level = 200.0\n", a_uff=uff(records))
    (test,) = campaign.tests
    assert str(test.condition.reference) == "acc7:+tz"
    assert test.condition.level_n == 200.0
    labels = [str(dof) for dof in test.estimate.frf.outputs]
    assert labels == ["acc7:+tz", "acc1:+tx", "acc1:-ty", "acc2:+tz"]
    assert test.estimate.averages == 5
    assert test.estimate.frf.freq_hz[-1] == 512.0
    assert test.hits.densities.motion.shape == (2049, 4)
    assert campaign.remarks == ()


def test_values_are_those_of_the_modes(read, records):
    (test,) = read(TEST, a_uff=uff(records)).tests
    freq = test.estimate.frf.freq_hz
    band = (freq > 5) & (freq < 200)
    exact = SYSTEM.accelerance(2j * np.pi * freq)
    error = np.abs(test.estimate.frf.values[:, :, 0] - exact) ** 2
    ratio = (error / test.estimate.variance[:, :, 0])[band]
    assert ratio.mean() == pytest.approx(4 / 3, rel=0.15)


def test_two_references_of_one_file_are_two_tests_with_one_window(read, records):
    light = strike(a_system(damping=0.001), replace(SIDE, duration_s=4.0))
    campaign = read(TEST, a_uff=uff(records, light))
    references = [str(test.condition.reference) for test in campaign.tests]
    assert references == ["acc7:+tz", "acc7:+tx"]
    taus = {test.estimate.window_tau for test in campaign.tests}
    assert len(taus) == 1
    assert taus.pop() > 0


def test_arrays_of_records_are_read_alike(read, records):
    first = read(TEST, a_uff=uff(records)).tests[0].estimate
    arrays = {"force": records.force, "response": records.motion, "rate_hz": 1024.0}
    second = read(f'[[test]]\nfile = "b.npz"\n{ARRAYS}', b_npz=npz(**arrays)).tests[0].estimate
    np.testing.assert_allclose(second.frf.values, first.frf.values, rtol=1e-9)
    assert second.frf.outputs == first.frf.outputs


def test_matlab_files_of_records_are_read_in_their_unit(read, records, tmp_path):
    file = tmp_path / "c.mat"
    arrays = {"force": records.force, "response": records.motion / 9.80665, "fs": 1024}
    scipy.io.savemat(file, arrays)
    text = f'[[test]]\nfile = "c.mat"\nunit = "g/N"\n{ARRAYS}'
    found = read(text).tests[0].estimate.frf
    expected = read(TEST, a_uff=uff(records)).tests[0].estimate.frf
    np.testing.assert_allclose(found.values, expected.values, rtol=1e-9)


def test_arrays_of_two_references_have_an_axis_more(read, records):
    other = strike(SYSTEM, SIDE)
    arrays = {
        "force": np.array([records.force, other.force]),
        "response": np.array([records.motion, other.motion]),
        "fs": 1024.0,
    }
    text = f'[[test]]\nfile = "b.npz"\n{ARRAYS}'
    text = text.replace('references = ["7:+z"]', 'references = ["7:+z", "7:+x"]')
    campaign = read(text, b_npz=npz(**arrays))
    expected = read(TEST, a_uff=uff(records, other))
    for one, two in zip(campaign.tests, expected.tests, strict=True):
        assert one.condition.reference == two.condition.reference
        np.testing.assert_allclose(
            one.estimate.frf.values, two.estimate.frf.values, rtol=1e-8, atol=1e-12
        )


@pytest.mark.parametrize(
    ("arrays", "text"),
    [
        ({"fs": None}, "has no sampling rate"),
        ({"fs": [1.0, 2.0]}, "fs is not a sampling rate"),
        ({"fs": -3.0}, "fs is not a sampling rate"),
        ({"force": np.ones((3, 64), complex)}, "force is not an array of real numbers"),
        ({"force": np.full((3, 64), np.nan)}, "force holds NaN"),
        ({"response": np.ones((3, 64, 4))}, r"response \(3, 64, 4\), but 1 references and 4"),
        (
            {"response": np.ones((2, 4, 64))},
            "correct channels, references or the order of the axes",
        ),
    ],
)
def test_arrays_that_do_not_fit_are_refused(refusal, arrays, text):
    good = {"force": np.ones((3, 64)), "response": np.ones((3, 4, 64)), "fs": 512.0}
    given = {name: value for name, value in (good | arrays).items() if value is not None}
    message = refusal(f'[[test]]\nfile = "b.npz"\n{ARRAYS}', b_npz=npz(**given))
    assert "b.npz" in message
    assert re.search(text, message), message


def test_an_ignored_channel_rejects_no_hit(read, records):
    motion = records.motion.copy()
    ceiling = 0.3 * np.abs(motion[:, 1]).max()
    motion[:, 1] = np.clip(motion[:, 1], -ceiling, ceiling)
    file = uff(replace(records, motion=motion))
    campaign = read(TEST + '[sensor.acc1]\nignore = ["x"]\n', a_uff=file)
    assert campaign.tests[0].estimate.averages == 5
    assert len(campaign.tests[0].estimate.frf.outputs) == 3


def test_all_channels_ignored_are_refused(refusal, records):
    text = TEST + "".join(f'[sensor.acc{k}]\nignore = ["x", "y", "z"]\n' for k in (1, 2, 7))
    assert "all channels of reference acc7:+tz are ignored" in refusal(text, a_uff=uff(records))


def test_rejected_hits_reach_the_reader(read, records):
    motion = records.motion.copy()
    motion[2] *= -1
    campaign = read(TEST, a_uff=uff(replace(records, motion=motion)))
    (remark,) = campaign.remarks
    assert remark.startswith(
        "a.uff, hammer at acc7:+tz: 1 of 5 hits were left out: hit 3 (record 3"
    )


def test_the_keys_of_records_are_obeyed(read, records):
    keys = 'block_s = 2.0\npretrigger_s = 0.05\nexponential_tau = 0.5\nestimator = "H2"\n'
    (test,) = read(
        TEST + keys + "force_window_s = 0.02\nreject = false\n", a_uff=uff(records)
    ).tests
    assert test.estimate.window_tau == 0.5
    assert test.hits.block_s == 2.0
    assert test.hits.pretrigger_s == pytest.approx(0.05, abs=1e-3)
    assert test.hits.estimator == "H2"
    assert test.hits.force_window_s < 0.2


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ('frequency_unit = "rad/s"', "frequency_unit is for FRFs"),
        ('channels = ["1:+x"]', "itself holds its channels"),
    ],
)
def test_keys_that_records_have_no_use_for_are_refused(refusal, records, key, text):
    assert text in refusal(f"{TEST}{key}\n", a_uff=uff(records))


def test_a_time_sign_has_no_effect_on_records(read, records):
    plain, stated = (read(f"{TEST}{key}", a_uff=uff(records)) for key in ("", 'time_sign = "-"\n'))
    np.testing.assert_array_equal(
        stated.tests[0].estimate.frf.values, plain.tests[0].estimate.frf.values
    )
    assert any("time_sign has no effect on time records" in text for text in stated.remarks)


@pytest.mark.parametrize(
    "key", ["block_s = 1", "exponential_tau = 1", 'estimator = "H1"', "reject = true"]
)
def test_keys_of_records_are_refused_for_frfs(refusal, key):
    frf = Function(numbers(1), rsp=(7, 1), ref=(11, 3)).content()
    message = refusal(f"{TEST}{key}\n", a_uff=frf)
    assert f"a.uff holds FRFs, but {key.split(' ', maxsplit=1)[0]} is for time records" in message


def test_averages_that_are_not_those_found_are_remarked(read, records):
    campaign = read(TEST + "averages = 8\n", a_uff=uff(records))
    assert "5 hits were found, but campaign.toml says averages = 8" in campaign.remarks[0]
    assert read(TEST + "averages = 5\n", a_uff=uff(records)).remarks == ()


def test_records_and_frfs_on_other_lines_are_refused_with_the_key(refusal, records):
    frf = Function(numbers(1), 0.37 * np.arange(1, 10), rsp=(7, 1), ref=(11, 3)).content()
    text = TEST + '[[test]]\nfile = "b.uff"\n'
    message = refusal(text, a_uff=uff(records), b_uff=frf)
    assert "b.uff has another frequency axis" in message
    assert "block_s sets the axis of time records" in message


def test_a_node_without_site_is_refused_in_records_too(refusal, records):
    other = replace(records, reference=Dof.parse("5:+z"))
    assert "a.uff: node 5 has no site" in refusal(TEST, a_uff=uff(other))


def test_the_band_of_records_ends_at_0_8_of_nyquist(read, records):
    campaign = read(TEST, a_uff=uff(records))
    quiet = replace(
        campaign,
        tests=tuple(
            replace(
                t, estimate=replace(t.estimate, coherence=np.full_like(t.estimate.variance, 0.9))
            )
            for t in campaign.tests
        ),
    )
    for one in (quiet, replace(quiet, tests=tuple(without_coherence(t) for t in quiet.tests))):
        freq = one.freq_hz[band_lines(one)]
        assert freq[-1] == 409.5
        assert one.freq_hz[band_lines(one, (5.0, 500.0))][-1] == 500.0


def without_coherence(test):
    return replace(test, estimate=replace(test.estimate, coherence=None))


def test_the_coherence_of_records_ends_the_band_too(read, records):
    campaign = read(TEST, a_uff=uff(records))
    freq = campaign.freq_hz[band_lines(campaign)]
    assert 200 < freq[-1] < 409.5
    assert freq[0] > 0


# Drive points.


@pytest.fixture
def turned(read, records):
    return read(
        TEST, a_uff=uff(replace(records, motion=records.motion * [[-1.0], [1.0], [1.0], [1.0]]))
    )


def test_a_drive_point_of_the_right_sign_gives_no_remark(read, records):
    (point,) = drive_point_signs(read(TEST, a_uff=uff(records)))
    assert str(point.output) == "acc7:+tz"
    assert point.share > 0.95
    assert point.remark is None


def test_a_turned_drive_point_is_remarked_and_not_flipped(turned):
    (point,) = drive_point_signs(turned)
    assert point.share < -0.95
    assert "the drive point acc7:+tz reads with the opposite sign of the hammer" in point.remark
    assert point.remark in turned.remarks
    values = turned.tests[0].estimate.frf.values[:, 0, 0]
    assert np.median(values[20:800].imag) < 0


def test_the_sign_of_a_drive_point_goes_with_its_labels(read, records):
    other = replace(
        records,
        motion=records.motion * [[-1.0], [1.0], [1.0], [1.0]],
        outputs=(Dof.parse("7:-z"), *records.outputs[1:]),
    )
    (point,) = drive_point_signs(read(TEST, a_uff=uff(other)))
    assert point.share > 0.95


def test_a_drive_point_at_a_hammer_point_of_its_own_axes_is_told_by_the_axes(read, records):
    layout = a_layout()
    axes, positions = layout.axes.copy(), layout.positions.copy()
    eleven, hit = layout.points.index("acc11"), layout.points.index("hit11")
    axes[hit] = -axes[eleven]
    positions[hit] = positions[eleven]
    own = replace(layout, axes=axes, positions=positions)
    at = replace(
        records,
        outputs=(Dof.parse("11:-z"), *records.outputs[1:]),
        reference=Dof.parse("11:+z"),
    )
    (point,) = drive_point_signs(read(TEST, layout=own, a_uff=uff(at)))
    assert point.share > 0.95


def test_the_sign_holds_with_an_exponential_window(read, records):
    campaign = read(TEST + "exponential_tau = 0.2\n", a_uff=uff(records))
    (point,) = drive_point_signs(campaign)
    assert point.share > 0.95


@pytest.mark.parametrize("quantity", ["receptance", "mobility"])
def test_the_sign_is_read_in_every_quantity(read, records, quantity):
    campaign = read(TEST, a_uff=uff(records))
    (test,) = campaign.select_lines(campaign.freq_hz > 0).tests
    frf = test.estimate.frf.as_quantity(quantity)
    size = np.abs(frf.values / test.estimate.frf.values) ** 2
    estimate = replace(test.estimate, frf=frf, variance=test.estimate.variance * size)
    other = replace(campaign, tests=(replace(test, estimate=estimate),))
    (point,) = drive_point_signs(other)
    assert point.share > 0.95


def test_a_point_with_power_of_both_signs_is_remarked(read, records):
    # The "drive point" reads the motion of another one.
    swapped = replace(records, motion=records.motion[:, [3, 1, 2, 0]])
    campaign = read(TEST, a_uff=uff(swapped))
    (point,) = drive_point_signs(campaign)
    assert abs(point.share) < 1
    if abs(point.share) < 0.5:
        assert "has no clear sign: check that both are at one point, and" in point.remark


def test_frf_files_have_their_drive_points_checked_too(read):
    freq = 0.5 + 0.25 * np.arange(900)
    values = SYSTEM.accelerance(2j * np.pi * freq)
    frf = Function(-values[:, 0], freq, rsp=(7, 3), ref=(7, 3)).content()
    campaign = read(TEST, a_uff=frf)
    assert any("opposite sign of the hammer at acc7:+tz" in text for text in campaign.remarks)


# Modes.


@pytest.mark.parametrize("damping", [0.02, 0.003])
def test_the_modes_of_a_campaign_of_records_are_those_of_the_machine(read, damping):
    # 0.3 %: two thirds of the lowest mode are cut off without the exponential window.
    system = a_system(damping=damping)
    hammer = replace(HAMMER, duration_s=2.0, noise=3e-4)
    campaign = read(TEST, a_uff=uff(strike(system, hammer)))
    assert (campaign.tests[0].estimate.window_tau > 0) == (damping < 0.01)
    band = campaign.select_lines(band_lines(campaign, (10.0, 220.0)))
    model = identify(band)[0]
    nearest = np.abs(model.freq_hz[:, None] / system.freq_hz - 1).argmin(axis=0)
    np.testing.assert_allclose(model.freq_hz[nearest], system.freq_hz, rtol=1e-4)
    np.testing.assert_allclose(model.damping[nearest], damping, rtol=0.01)
