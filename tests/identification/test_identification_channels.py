"""Channels that cannot be what they say."""

from dataclasses import replace

import numpy as np
import pytest

from identification.checks.channels import _coherence_of_noise, channel_remarks, noise_only_channels
from identification.words import Campaign, Condition, Dof, Frf, FrfEstimate, Layout, Test

SITES = ("acc1", "acc2", "acc3", "acc4")
LAYOUT = Layout(
    ("b",),
    np.zeros((1, 3)),
    SITES,
    np.zeros(4, int),
    np.eye(4)[:, :3],
    np.tile(np.eye(3), (4, 1, 1)),
)
OUTPUTS = tuple(Dof(site, "+tz") for site in SITES)


@pytest.fixture
def campaign():
    rng = np.random.default_rng(42)

    def build(edit=lambda values, coherence: None, references=("acc1:+tz", "acc2:+tx")):
        tests = []
        for label in references:
            values = rng.normal(size=(50, 4)) + 1j * rng.normal(size=(50, 4))
            coherence = rng.uniform(0.8, 1.0, (50, 4))
            edit(values, coherence)
            reference = Dof.parse(label)
            frf = Frf(np.arange(1.0, 51), values[:, :, None], OUTPUTS, (reference,), "accelerance")
            estimate = FrfEstimate(
                frf,
                np.ones((50, 4, 1)),
                "coherence",
                np.ones((4, 1), bool),
                coherence[:, :, None],
                10,
            )
            tests.append(Test(Condition("a.uff", reference), estimate))
        return Campaign("c", LAYOUT, tuple(tests))

    return build


def test_sound_channels_are_not_spoken_of(campaign) -> None:
    assert channel_remarks(campaign()) == ()


def test_a_channel_of_zeros_is_dead(campaign) -> None:
    def edit(values, coherence):
        values[:, 2] = 0

    (remark,) = channel_remarks(campaign(edit))
    assert remark == (
        "acc3:+tz is dead and reads zero in every test: ignore it, or repair its cable"
    )


def test_a_channel_that_lost_its_coherence_alone_is_dead(campaign) -> None:
    def edit(values, coherence):
        coherence[:, 1] = 0.02

    (remark,) = channel_remarks(campaign(edit))
    assert remark.startswith("acc2:+tz reads noise alone in every test")
    assert "at most 0.02 where others have 0.9" in remark


def test_a_hit_that_nobody_hears_well_says_nothing_of_a_dead_channel(campaign) -> None:
    def edit(values, coherence):
        coherence[:, 1] = 0.02

    first, *others = campaign(edit).tests

    def faint(test):
        quiet = np.minimum(test.estimate.coherence, 0.3)
        return replace(test, estimate=replace(test.estimate, coherence=quiet))

    made = replace(campaign(), tests=(first, *map(faint, others)))
    assert [str(dof) for dof in noise_only_channels(made)] == ["acc2:+tz"]
    assert noise_only_channels(replace(made, tests=tuple(map(faint, made.tests)))) == {}
    heard = campaign().tests[0]
    assert noise_only_channels(replace(made, tests=(*made.tests, heard))) == {}


@pytest.mark.parametrize("averages", [3, 5, 10])
def test_noise_has_the_coherence_of_few_averages(campaign, averages) -> None:
    rng = np.random.default_rng(7)
    shape = (averages, 20_000)
    force = rng.normal(size=shape) + 1j * rng.normal(size=shape)
    answer = rng.normal(size=shape) + 1j * rng.normal(size=shape)
    both = np.abs((force.conj() * answer).sum(axis=0)) ** 2
    coherence = both / (np.abs(force) ** 2).sum(axis=0) / (np.abs(answer) ** 2).sum(axis=0)
    least = max(np.median(coherence), 0.1)
    assert _coherence_of_noise(averages) == pytest.approx(least, rel=0.3)
    assert _coherence_of_noise(averages) >= 1.2 * np.median(coherence)

    def edit(values, seen):
        seen[:, 1] = np.quantile(coherence, (np.arange(50) + 0.5) / 50)

    made = campaign(edit)
    tests = tuple(
        replace(test, estimate=replace(test.estimate, averages=averages)) for test in made.tests
    )
    assert {str(dof) for dof in noise_only_channels(replace(made, tests=tests))} == {"acc2:+tz"}


def test_without_coherence_a_channel_is_dead_that_holds_no_more_than_its_noise(campaign) -> None:
    def without(tests, share):
        rng = np.random.default_rng(3)
        for test in tests:
            one = test.estimate
            noise = rng.normal(size=(2, 50)) * np.sqrt(0.5)
            values = 10 * one.frf.values
            values[:, 1, 0] = noise[0] + 1j * noise[1] + share * values[:, 1, 0]
            frf = replace(one.frf, values=values)
            bare = replace(one, frf=frf, coherence=None, variance_source="differences")
            yield replace(test, estimate=bare)

    made = campaign()
    (remark,) = channel_remarks(replace(made, tests=tuple(without(made.tests, 0.0))))
    assert remark.startswith("acc2:+tz reads noise alone in every test, with a power over that")
    assert noise_only_channels(replace(made, tests=tuple(without(made.tests, 0.1)))) == {}


def test_a_hit_that_was_poor_as_a_whole_makes_no_channel_dead(campaign) -> None:
    def edit(values, coherence):
        coherence[:] = 0.05

    assert channel_remarks(campaign(edit)) == ()


@pytest.mark.parametrize("sign", [1, -1])
def test_two_channels_with_the_same_numbers_are_one_exported_twice(campaign, sign) -> None:
    def edit(values, coherence):
        values[:, 3] = sign * values[:, 0]

    (remark,) = channel_remarks(campaign(edit))
    assert remark.startswith("acc1:+tz and acc4:+tz hold the same numbers")


def test_proportional_channels_are_two(campaign) -> None:
    def edit(values, coherence):
        values[:, 3] = 1.01 * values[:, 0]

    assert channel_remarks(campaign(edit)) == ()


def test_a_fault_of_one_test_is_named_with_its_hit(campaign) -> None:
    found = campaign(lambda values, coherence: None)
    first = found.tests[0]
    values = first.estimate.frf.values.copy()
    values[:, 1] = 0
    frf = Frf(np.arange(1.0, 51), values, OUTPUTS, (Dof("acc1", "+tz"),), "accelerance")
    estimate = FrfEstimate(frf, np.ones((50, 4, 1)), "differences", np.ones((4, 1), bool))
    broken = Campaign("c", LAYOUT, (Test(first.condition, estimate), found.tests[1]))
    (remark,) = channel_remarks(broken)
    assert "reads zero if hit at acc1:+tz: ignore it" in remark


def test_a_channel_that_one_of_the_hits_does_not_move_is_sound(campaign) -> None:
    hits = iter((0.02, 0.9))

    def edit(values, coherence):
        coherence[:, 1] = next(hits)

    assert channel_remarks(campaign(edit)) == ()
