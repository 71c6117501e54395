"""Campaigns in: files, nodes, corrections and conditions become labelled tests."""

import tomllib
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from identification_examples import (
    ARRAY_TEST,
    EVEN,
    FIRST,
    HEAD,
    SECOND,
    TEST,
    THIRD,
    a_layout,
    npz,
    numbers,
    read_small,
    uff,
)
from scipy.spatial.transform import Rotation

from identification import CampaignSettings, correct_layout
from identification.words import Dof, InputError

ROOT = Path(__file__).resolve().parents[2]
DEMO = ROOT / "assets" / "demo"
OPEN = Path(__file__).resolve().parents[3] / "shared" / "campaigns" / "open"


@pytest.fixture
def read(tmp_path):
    """Writes a campaign around the small layout and reads it."""
    return partial(read_small, tmp_path)


def labels(dofs):
    return [str(dof) for dof in dofs]


def test_each_reference_of_a_file_is_a_test(read, tmp_path):
    campaign = read()
    assert campaign.name == tmp_path.name
    first, second = campaign.tests
    assert str(first.condition.reference) == "hit11:+tz"
    assert labels(first.estimate.frf.outputs) == ["acc7:+tx", "acc2:-ty"]
    assert str(second.condition.reference) == "acc1:+ty"
    assert labels(second.estimate.frf.outputs) == ["acc7:+tx"]


def test_values_go_to_their_test_and_channel(read):
    first, second = (test.estimate.frf for test in read().tests)
    np.testing.assert_allclose(first.values[:, 0, 0], FIRST.data, rtol=1e-12)
    np.testing.assert_allclose(first.values[:, 1, 0], SECOND.data, rtol=1e-12)
    np.testing.assert_allclose(second.values[:, 0, 0], THIRD.data, rtol=1e-12)
    np.testing.assert_array_equal(first.freq_hz, EVEN)


def test_the_hammer_point_goes_before_the_accelerometer_for_the_reference_only(read):
    campaign = read(a_uff=uff(replace(FIRST, rsp=(11, 1), ref=(11, -2))))
    (test,) = campaign.tests
    assert str(test.condition.reference) == "hit11:-ty"
    assert labels(test.estimate.frf.outputs) == ["acc11:+tx"]


def test_a_reference_at_a_node_without_hammer_point_is_at_the_accelerometer(read):
    (test,) = read(a_uff=uff(replace(FIRST, ref=(7, 1)))).tests
    assert str(test.condition.reference) == "acc7:+tx"


@pytest.mark.parametrize("end", ["rsp", "ref"])
def test_an_unknown_node_is_refused_with_a_remedy(refusal, end):
    message = refusal(a_uff=uff(FIRST, replace(SECOND, **{end: (5, 1)})))
    assert "a.uff: node 5 has no site" in message
    assert "acc5" in message


def test_files_may_name_sites_in_place_of_nodes(read):
    text = HEAD + (
        '[[test]]\nfile = "b.npz"\nchannels = ["focus:+x", "7:-rz"]\nreferences = ["acc1:+y"]\n'
    )
    values = numbers(5, (9, 2))
    (test,) = read(text, b_npz=npz(frf=values, freq_hz=EVEN)).tests
    assert labels(test.estimate.frf.outputs) == ["focus:+tx", "acc7:-rz"]
    assert str(test.condition.reference) == "acc1:+ty"
    np.testing.assert_array_equal(test.estimate.frf.values[:, :, 0], values)


def test_arrays_become_tests_by_reference(read):
    values, coherence = numbers(5, (9, 4, 2)), np.random.default_rng(1).random((9, 4, 2))
    text = ARRAY_TEST + 'averages = 6\nunit = "mm/s/N"\nquantity = "mobility"\n'
    campaign = read(text, b_npz=npz(frf=values, coherence=coherence, freq_hz=EVEN))
    assert [str(t.condition.reference) for t in campaign.tests] == ["hit11:+tx", "acc7:-tz"]
    for k, test in enumerate(campaign.tests):
        frf = test.estimate.frf
        assert labels(frf.outputs) == ["acc1:+tx", "acc1:+ty", "acc2:+tx", "acc2:+ty"]
        assert frf.quantity == "mobility"
        np.testing.assert_allclose(frf.values[:, :, 0], values[:, :, k] / 1e3, rtol=1e-15)
        np.testing.assert_array_equal(test.estimate.coherence[:, :, 0], coherence[:, :, k])


def test_accelerance_is_meant_where_arrays_do_not_say(read):
    (test, _) = read(ARRAY_TEST, b_npz=npz(frf=numbers(5, (9, 4, 2)), freq_hz=EVEN)).tests
    assert test.estimate.frf.quantity == "accelerance"


@pytest.mark.parametrize("key", ["channels", "references"])
def test_arrays_without_labels_are_refused(refusal, key):
    text = "\n".join(line for line in ARRAY_TEST.splitlines() if not line.startswith(key))
    message = refusal(text, b_npz=npz(frf=numbers(5, (9, 4, 2)), freq_hz=EVEN))
    assert "b.npz does not name its channels: add" in message


@pytest.mark.parametrize("line", ['channels = "nodes 1..2, x"', 'references = ["11:x"]'])
def test_labels_for_a_universal_file_are_refused(refusal, line):
    message = refusal(TEST + line + "\n")
    assert f"remove {line.split()[0]}" in message


def test_a_stated_quantity_overrides_the_file_with_a_remark(read):
    # The records say acceleration.
    campaign = read(TEST + 'quantity = "receptance"\n')
    assert campaign.tests[0].estimate.frf.quantity == "receptance"
    assert any('quantity = "receptance" of campaign.toml overrides' in r for r in campaign.remarks)


def test_a_point_whose_name_is_a_superscript_is_refused(refusal):
    # "\u00b2".isdigit() is true, int() of it fails.
    text = ARRAY_TEST.replace('"7:-z"', '"\u00b2:-z"')
    assert "b.npz" in refusal(text, b_npz=npz(frf=numbers(5, (9, 4, 2)), freq_hz=EVEN))


@pytest.mark.parametrize("second", ["11:+x", "hit11:+x", "11:-x"])
def test_one_reference_under_two_names_is_refused(refusal, second):
    text = ARRAY_TEST.replace('"7:-z"', f'"{second}"')
    assert "b.npz" in refusal(text, b_npz=npz(frf=numbers(5, (9, 4, 2)), freq_hz=EVEN))


def test_one_response_under_two_names_is_refused(refusal):
    text = ARRAY_TEST.replace('"nodes 1..2, xy"', '["1:x", "acc1:x", "2:x", "2:y"]')
    assert "b.npz" in refusal(text, b_npz=npz(frf=numbers(5, (9, 4, 2)), freq_hz=EVEN))


@pytest.mark.parametrize("name", ["a.xlsx", "a", "a.h5"])
def test_an_unknown_kind_of_file_is_refused(refusal, name):
    assert "is of an unknown kind: give" in refusal(TEST.replace("a.uff", name))


@pytest.mark.parametrize("name", ["gone.uff", "gone.unv", "gone.npz", "gone.mat"])
def test_a_missing_file_of_a_test_is_named(refusal, name):
    text = TEST.replace("a.uff", name)
    if not name.endswith(("uff", "unv")):
        text += 'channels = ["1:x"]\nreferences = ["11:x"]\n'
    assert f"{name} does not exist" in refusal(text)


def test_the_condition_carries_what_was_special(read):
    text = TEST + 'level = 150.0\nspindle_speed = 3.5\nsetup = "b"\nwindow_tau = 0.25\n'
    for test in read(text).tests:
        assert test.condition.test == "a.uff"
        assert test.condition.level_n == 150.0
        assert test.condition.spindle_speed == 3.5
        assert test.condition.setup == "b"
        assert test.estimate.window_tau == 0.25
        assert test.estimate.averages == 10


def test_each_file_has_its_own_condition(read):
    text = TEST + 'level = 50.0\n[[test]]\nfile = "c.unv"\naverages = 3\nlevel = 1000.0\n'
    tests = read(text, c_unv=uff(FIRST)).tests
    assert [(t.condition.test, t.condition.level_n, t.estimate.averages) for t in tests] == [
        ("a.uff", 50.0, 10),
        ("a.uff", 50.0, 10),
        ("c.unv", 1000.0, 3),
    ]


def test_the_tolerance_of_the_campaign_is_carried(read):
    tolerance = read(TEST + "[tolerance]\nmass = 0.07\n").tolerance
    assert (tolerance.mass, tolerance.inertia) == (0.07, 0.05)


def test_a_negative_time_convention_is_conjugated(read):
    (first, _) = read(TEST + 'time_sign = "-"\n').tests
    expected = np.conj([FIRST.data, SECOND.data]).T
    np.testing.assert_allclose(first.estimate.frf.values[:, :, 0], expected, rtol=1e-12)


@pytest.mark.parametrize(
    "other",
    [
        replace(FIRST, ordinate=8),
        replace(FIRST, x=EVEN + 0.1),
    ],
    ids=["quantity", "axis"],
)
def test_files_that_cannot_stand_beside_one_another_are_refused(refusal, other):
    message = refusal(TEST + '[[test]]\nfile = "c.unv"\n', c_unv=uff(other))
    assert "c.unv" in message
    assert "campaign.toml" in message


# Corrections.


def test_a_flipped_channel_turns_its_axis_round():
    layout, drawn = corrected('flip = ["z", "x"]'), a_layout()
    np.testing.assert_array_equal(layout.axes[2], drawn.axes[2] * [-1, 1, -1])
    others = np.delete(layout.axes[: len(drawn.axes)], 2, 0)
    np.testing.assert_array_equal(others, np.delete(drawn.axes, 2, 0))


def corrected(lines, site="acc7"):
    content = tomllib.loads(TEST + f"[sensor.{site}]\n{lines}\n")
    settings = CampaignSettings.model_validate(content)
    return correct_layout(Path("campaign.toml"), settings, a_layout())


def test_a_turned_sensor_has_its_drawn_axes_turned_about_world_axes():
    turn = [0.3, -0.2, 0.7]
    rotation = Rotation.from_rotvec(turn)
    for axis in range(3):
        expected = rotation.apply(a_layout().axes[2].T.copy()[axis])
        np.testing.assert_allclose(corrected(f"turn = {turn}").axes[2][:, axis], expected)


def test_a_sensor_is_turned_first_and_flipped_then():
    both = corrected('turn = [0.3, -0.2, 0.7]\nflip = ["y"]')
    turned = corrected("turn = [0.3, -0.2, 0.7]")
    np.testing.assert_array_equal(both.axes[2], turned.axes[2] * [1, -1, 1])


def test_a_sensor_may_sit_on_another_body():
    layout = corrected('body = "low"')
    assert layout.body_name("acc7") == "low"
    np.testing.assert_array_equal(layout.body_of[:6], [0, 0, 0, 1, 1, 1])
    np.testing.assert_array_equal(layout.positions[:6], a_layout().positions)


@pytest.mark.parametrize(
    ("site", "lines", "message"),
    [
        ("acc9", "flip = []", "sensor.acc9: the model has no site 'acc9'"),
        ("7", "flip = []", "sensor.7: the model has no site '7'"),
        ("low", "flip = []", "no site 'low'"),
        ("acc7", 'body = "middle"', "sensor.acc7: the model has no body 'middle'"),
        ("acc7", 'body = "acc1"', "no body 'acc1'"),
    ],
)
def test_a_correction_of_nothing_is_refused(site, lines, message):
    with pytest.raises(InputError) as caught:
        corrected(lines, site)
    assert "campaign.toml" in str(caught.value)
    assert message in str(caught.value)


@pytest.mark.parametrize("lines", ['flip = ["x"]', "turn = [0.0, 0.4, 0.0]"], ids=["flip", "turn"])
def test_a_corrected_sensor_leaves_the_hammer_at_its_node_alone(read, lines):
    # Node 7 has no hit7, so the hammer hits along the drawn axes of acc7; the hammer is no sensor.
    file = uff(replace(FIRST, rsp=(2, 1), ref=(7, 1)))
    campaign = read(TEST + f"[sensor.acc7]\n{lines}\n", a_uff=file)
    reference = campaign.tests[0].condition.reference
    drawn = a_layout().rows([Dof.parse("acc7:+tx")])
    np.testing.assert_allclose(campaign.layout.rows([reference]), drawn)


def test_an_ignored_channel_is_gone_from_every_test(read):
    first, second = read(TEST + '[sensor.acc2]\nignore = ["y"]\n').tests
    assert labels(first.estimate.frf.outputs) == ["acc7:+tx"]
    assert labels(second.estimate.frf.outputs) == ["acc7:+tx"]
    np.testing.assert_allclose(first.estimate.frf.values[:, 0, 0], FIRST.data, rtol=1e-12)


def test_an_ignored_direction_spares_the_others(read):
    first, _ = read(TEST + '[sensor.acc2]\nignore = ["x", "z"]\n').tests
    assert labels(first.estimate.frf.outputs) == ["acc7:+tx", "acc2:-ty"]


def test_an_ignored_sensor_is_still_a_reference(read):
    _, second = read(TEST + '[sensor.acc1]\nignore = ["x", "y", "z"]\n').tests
    assert str(second.condition.reference) == "acc1:+ty"


def test_a_test_that_loses_its_last_channel_is_refused(refusal):
    message = refusal(TEST + '[sensor.acc7]\nignore = ["x"]\n')
    assert "all channels of reference acc1:+ty are ignored" in message


def test_negative_frequencies_are_refused(refusal):
    assert "a.uff" in refusal(a_uff=uff(replace(FIRST, x=EVEN - 5)))
