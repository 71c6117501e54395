"""Tests beside each other: paired modes, their shifts, a fleet's scatter, differences of FRFs."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t

from identification.comparison import (
    TestComparison,
    TestedModes,
    VisitDrift,
    compare_frfs,
    compare_tests,
    compute_scatter,
    compute_shifts,
    describe_fleet,
    describe_shifts,
    name_campaigns,
    pair_tests,
)
from identification.modal import MeasuredFrfs
from identification.words import (
    Campaign,
    Condition,
    Dof,
    Frf,
    FrfEstimate,
    InputError,
    Layout,
    Test,
)

BAND = (5.0, 100.0)
FREQ = np.linspace(5.0, 60.0, 441)
CHANNELS = tuple(Dof(f"acc{k}", "+tx") for k in (1, 2, 3))
MODES = np.array([[0.4, 0.8, 1.0], [1.0, 0.4, -0.9], [0.6, -1.0, 0.5]]).T


def modes_of(freq_hz, shapes, sd=1e-3):
    count = len(freq_hz)
    return TestedModes(
        np.asarray(freq_hz, float),
        np.full(count, sd),
        np.full(count, 0.01),
        np.full(count, 1e-4),
        np.asarray(shapes, complex),
        np.full((count, len(shapes)), 1e-6),
    )


def campaign(name="a", freq_hz=(12.0, 30.0, 47.0), *, seed=0, channels=CHANNELS, level=None):
    """Accelerances of three modes to a hit at the first channel; noise of 1 % of the largest."""
    random, omega = np.random.default_rng(seed), 2 * np.pi * FREQ
    natural = 2 * np.pi * np.asarray(freq_hz)
    values = sum(
        -(omega**2)[:, None]
        * np.outer(
            1 / (w**2 - omega**2 + 0.02j * w * omega),
            MODES[: len(channels), k] * MODES[0, k],
        )
        for k, w in enumerate(natural)
    )
    deviation = 0.01 * np.abs(values).max()
    drawn = random.standard_normal((2, *values.shape))
    noisy = values + deviation * (drawn[0] + 1j * drawn[1]) / np.sqrt(2)
    frf = Frf(FREQ, noisy[..., None], channels, (CHANNELS[0],), "accelerance")
    estimate = FrfEstimate(
        frf,
        np.full(frf.values.shape, deviation**2),
        "stated",
        np.ones((len(channels), 1), bool),
    )
    points = tuple(dict.fromkeys(dof.point for dof in (*channels, CHANNELS[0])))
    layout = Layout(
        bodies=("all",),
        centres=np.zeros((1, 3)),
        points=points,
        body_of=np.zeros(len(points), int),
        positions=np.zeros((len(points), 3)),
        axes=np.tile(np.eye(3), (len(points), 1, 1)),
    )
    return Campaign(name, layout, (Test(Condition("t", CHANNELS[0], level), estimate),))


def test_modes_are_paired_by_shape_where_their_frequencies_cross():
    first = modes_of([20.0, 21.0, 60.0], MODES)
    second = modes_of([20.5, 21.5, 61.0], MODES[:, [1, 0, 2]])
    modes = pair_tests([first, second], BAND)
    assert [mode.number.tolist() for mode in modes] == [[0, 1], [1, 0], [2, 2]]
    assert all(mode.mac[1] == pytest.approx(1.0) for mode in modes)


def test_where_one_channel_is_shared_the_frequencies_decide():
    first, second = modes_of([20.0, 40.0], np.ones((1, 2))), modes_of([21.0, 43.0], np.ones((1, 2)))
    modes = pair_tests([first, second], BAND)
    assert [mode.number.tolist() for mode in modes] == [[0, 0], [1, 1]]


def test_shapes_that_hardly_agree_are_no_pair_however_near_their_frequencies():
    across = np.array([[1.0, 1.0, 0.0], [1.0, -0.5, 1.5]]).T  # MAC 0.07
    modes = pair_tests([modes_of([20.0], across[:, :1]), modes_of([20.1], across[:, 1:])], BAND)
    assert [mode.number.tolist() for mode in modes] == [[0, -1], [-1, 0]]


def test_a_mode_without_a_partner_is_listed_alone():
    modes = pair_tests([modes_of([20.0, 60.0], MODES[:, :2]), modes_of([20.1], MODES[:, :1])], BAND)
    assert [mode.is_complete for mode in modes] == [True, False]
    assert np.isnan(modes[1].freq_hz[1])
    shifts = compute_shifts(modes)
    assert shifts[1] is None
    text = describe_shifts(modes, shifts, ["march", "june"], is_one_machine=True)
    assert "march alone has 60 Hz" in text
    assert "too far to be paired" not in text
    moved = pair_tests([modes_of([80.0], MODES[:, :1]), modes_of([20.0], MODES[:, :1])], BAND)
    text = describe_shifts(moved, compute_shifts(moved), ["march", "june"], is_one_machine=True)
    assert "june alone has 20 Hz, perhaps modes that moved too far to be paired" in text


def test_shifts_of_an_unchanged_machine_have_their_stated_deviation():
    squares = []
    for seed in range(3):
        pair = [campaign("a", seed=2 * seed), campaign("b", seed=2 * seed + 1)]
        comparison = compare_tests(pair, ["a", "b"])
        shifts = compute_shifts(comparison.modes)
        assert len(shifts) == 3
        squares += [shift.significance**2 for pair in shifts if pair for shift in pair]
        assert not any(shift.is_change for pair in shifts if pair for shift in pair)
    # The mean of 18 squares of standard normal numbers has a deviation of sqrt(2 / 18) = 0.33.
    assert np.mean(squares) == pytest.approx(1.0, abs=0.75)


def test_a_shift_within_the_drift_between_visits_is_significant_and_no_change():
    pair = [campaign("a"), campaign("b", (12.03, 30.075, 52.0), seed=1)]
    comparison = compare_tests(pair, ["a", "b"])
    shifts = compute_shifts(comparison.modes, VisitDrift(0.0025, 0.05))
    assert shifts[0][0].significance > 10
    assert [pair[0].is_change for pair in shifts] == [False, False, True]
    text = describe_shifts(comparison.modes, shifts, ["a", "b"], is_one_machine=True)
    assert text.startswith("1 of 3 modes changed beyond noise and the drift between visits")
    assert "+11 % in frequency" in text


def frfs(values, variance, order=2, freq_hz=FREQ):
    shape = (len(freq_hz), 1, 1)
    return MeasuredFrfs(
        freq_hz,
        np.broadcast_to(values, shape).astype(complex),
        np.broadcast_to(variance, shape).astype(float),
        np.ones((1, 1), bool),
        CHANNELS[:1],
        CHANNELS[:1],
        order,
        0.0,
    )


def beside(*tests):
    return TestComparison(("a", "b"), BAND, CHANNELS[:1], (), tests)


def test_a_difference_over_noise_is_that_of_its_formula():
    (cell,) = compare_frfs(beside(frfs(2.0, 0.09), frfs(2.5, 0.16)))
    assert cell.over_noise == pytest.approx(0.5 / np.sqrt(0.09 + 0.16))
    assert cell.relative == pytest.approx(0.25)


def test_receptances_are_compared_with_accelerances_as_accelerances():
    factor = ((2j * np.pi * FREQ) ** 2)[:, None, None]
    second = frfs(2.5 / factor, 0.16 / np.abs(factor) ** 2, order=0)
    (cell,) = compare_frfs(beside(frfs(2.0, 0.09), second))
    assert cell.over_noise == pytest.approx(1.0)


def test_noise_alone_gives_a_difference_of_one_noise():
    comparison = compare_tests([campaign("a"), campaign("b", seed=5)], ["a", "b"])
    for cell in compare_frfs(comparison):
        assert cell.over_noise == pytest.approx(1.0, abs=0.1)


def test_channels_are_shared_by_label_and_none_is_an_error():
    other = campaign("b", channels=(CHANNELS[2], CHANNELS[0]))
    assert compare_tests([campaign("a"), other], ["a", "b"]).outputs == (CHANNELS[0], CHANNELS[2])
    renamed = campaign("b", channels=tuple(Dof(f"acc{k}", "+ty") for k in (1, 2, 3)))
    with pytest.raises(InputError, match="no channel in common"):
        compare_tests([campaign("a"), renamed], ["a", "b"])


def hits_at(channels, *references):
    """A campaign with a test for each reference; the values do not matter here."""
    whole = campaign("b", channels=channels, seed=1)
    test = whole.tests[0]
    tests = [
        replace(
            test,
            condition=replace(test.condition, reference=dof),
            estimate=replace(test.estimate, frf=replace(test.estimate.frf, inputs=(dof,))),
        )
        for dof in references
    ]
    return replace(campaign("a"), tests=tuple(tests))


@pytest.mark.parametrize(
    ("other", "remarks"),
    [
        (hits_at(CHANNELS, CHANNELS[0]), []),
        (hits_at(CHANNELS[:2], CHANNELS[0]), ["acc3:+tx is read by a alone"]),
        (hits_at(CHANNELS, *CHANNELS[:2]), ["acc2:+tx is a reference of b alone"]),
        (
            hits_at(CHANNELS[:1], *CHANNELS),
            [
                "b: motion at acc2:+tx, acc3:+tx is that of hits there, by reciprocity",
                "acc2:+tx, acc3:+tx are read by a alone",
            ],
        ),
        (
            hits_at(CHANNELS[:1], *CHANNELS[:2]),
            [
                "b: motion at acc2:+tx is that of hits there, by reciprocity",
                "acc2:+tx, acc3:+tx are read by a alone",
            ],
        ),
    ],
)
def test_what_only_one_of_both_has_is_named(other, remarks):
    assert list(compare_tests([campaign("a"), other], ["a", "b"]).remarks) == remarks


def on_lines(freq_hz, seed=0):
    """The campaign on other lines, by interpolation between its own."""
    whole = campaign("b", seed=seed)
    estimate = whole.tests[0].estimate
    values = np.stack(
        [np.interp(freq_hz, FREQ, column) for column in estimate.frf.values[:, :, 0].T], axis=1
    )[..., None]
    frf = replace(estimate.frf, freq_hz=freq_hz, values=values)
    variance = np.full(values.shape, estimate.variance[0, 0, 0])
    shifted = replace(estimate, frf=frf, variance=variance)
    return replace(whole, tests=(replace(whole.tests[0], estimate=shifted),))


def test_without_a_common_axis_modes_are_compared_and_frfs_are_not():
    comparison = compare_tests([campaign("a"), on_lines(np.linspace(8.0, 59.0, 400))], ["a", "b"])
    assert "no common frequency axis" in comparison.remarks[0]
    assert [mode.is_complete for mode in comparison.modes] == [True] * 3
    assert comparison.band == pytest.approx((8.0, 59.0), abs=0.2)
    assert compare_frfs(comparison) == ()


def test_lines_from_0_hz_pair_the_modes_that_lines_above_it_pair():
    axis = np.arange(0.0, 60.0, 0.125)
    comparison = compare_tests([on_lines(axis), on_lines(axis, seed=1)], ["a", "b"])
    above = compare_tests([on_lines(axis[1:]), on_lines(axis[1:], seed=1)], ["a", "b"])
    assert comparison.band == above.band == (0.125, 59.875)
    assert [mode.is_complete for mode in comparison.modes] == [True] * 3


def test_tests_whose_bands_hardly_meet_are_refused_in_one_sentence():
    other = on_lines(np.linspace(59.51, 90.0, 400))
    with pytest.raises(InputError, match="share too few frequency lines"):
        compare_tests([campaign("a"), other], ["a", "b"])


def test_names_are_those_of_folders_with_as_many_parents_as_it_takes(tmp_path):
    places = [tmp_path / "march" / "test", tmp_path / "june" / "test" / "campaign.toml"]
    assert name_campaigns(places) == ["march-test", "june-test"]
    assert name_campaigns([tmp_path / "a", tmp_path / "b"]) == ["a", "b"]


def test_levels_that_only_one_campaign_has_are_left_out():
    low, high = campaign("a", level=40.0).tests[0], campaign("a", seed=2, level=400.0).tests[0]
    both = replace(campaign("a"), tests=(low, high))
    comparison = compare_tests([both, campaign("b", seed=3, level=44.0)], ["a", "b"])
    assert comparison.remarks == ("tests at levels that not all campaigns have are left out: 1",)
    pair = [campaign("a", level=40.0), campaign("b", seed=3, level=400.0)]
    apart = compare_tests(pair, ["a", "b"])
    assert "what depends on the level" in apart.remarks[0]


def test_who_stands_out_follows_the_studentised_residual():
    values = np.array([[10.0, 10.1, 9.9, 10.05], [20.0, 20.2, 19.9, 26.0]])
    deviations = np.full(values.shape, 0.01)
    scatter = compute_scatter(values, deviations)
    others = values[:, :3]
    centre = others.mean(axis=1)
    pooled = np.sqrt((((others - centre[:, None]) / centre[:, None]) ** 2).sum() / 4)
    residual = (26.0 / centre[1] - 1) / np.sqrt(pooled**2 * 4 / 3 + (0.01 / centre[1]) ** 2)
    assert scatter.stands_out[1, 3] == (residual > t.isf(0.5e-3 / 16, 4))
    assert scatter.stands_out.sum() == 1
    np.testing.assert_allclose(scatter.spread, values.std(axis=1, ddof=1))
    modes = pair_tests([modes_of(column, MODES[:, :2]) for column in values.T], BAND)
    text = describe_fleet(modes, scatter, list("abcd"))
    assert "d stands out at 21.52 Hz" in text


def test_equal_machines_of_a_fleet_do_not_stand_out():
    random = np.random.default_rng(6)
    false = [
        compute_scatter(
            10 * np.exp(0.01 * random.standard_normal((6, 4))), np.full((6, 4), 1e-4)
        ).stands_out.any()
        for _ in range(300)
    ]
    assert sum(false) <= 2  # one in a thousand each, with Bonferroni's correction
