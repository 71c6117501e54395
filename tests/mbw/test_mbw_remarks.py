"""Remarks on a tuning: complete, and short."""

import pytest
from campaign_folder import write_folder
from typer.testing import CliRunner

from mbw.command import app
from mbw.page.html import warning_boxes
from mbw.remarks import (
    calibration_sentence,
    describe_not_in_mjcf,
    gain_tolerance,
    list_limits,
    list_remarks,
)
from tuning import read_result
from tuning.assessment.findings import UnseenRow


@pytest.fixture(scope="module")
def summary(tmp_path_factory):
    place = tmp_path_factory.mktemp("remarks")
    arguments = ["tune", write_folder(place / "campaign"), "--out", place / "result", "--quiet"]
    assert CliRunner().invoke(app, [str(word) for word in arguments]).exit_code == 0
    return read_result(place / "result").summary


def changed(summary, **fields):
    return summary.model_copy(update=fields)


def doubted(summary, *doubts):
    fit = summary.fit.model_copy(update={"trusted": not doubts, "doubts": list(doubts)})
    return changed(summary, fit=fit)


def tolerances(summary, pulls):
    """The summary with these pulls for its first tolerances, all at their bounds."""
    rows = [row for row in summary.parameters if row.prior is not None]
    new = {
        row.name: row.model_copy(update={"pull": pull, "at_bound": True})
        for row, pull in zip(rows, pulls, strict=False)
    }
    names = [row.name for row in rows[: len(pulls)]]
    calm = [
        new.get(row.name, row.model_copy(update={"at_bound": False})) for row in summary.parameters
    ]
    return changed(summary, parameters=calm), names


def test_a_result_without_faults_has_nothing_to_remark(summary):
    clean, _ = tolerances(doubted(summary), [])
    assert list_remarks(changed(clean, unseen=[], not_held_by_mjcf=[])) == []


def test_every_doubt_is_said(summary):
    (text, *_) = list_remarks(doubted(summary, "it was interrupted", "at a bound: k"))
    assert text == "Doubts: it was interrupted; at a bound: k."


@pytest.mark.parametrize("count", [1, 6])
def test_tolerances_at_their_bound_are_a_number_with_the_four_largest_pulls(summary, count):
    pulls = [2.5, -3.1, 4.2, -4.0, 2.6, 2.7][:count]
    lacking, names = tolerances(summary, pulls)
    (text,) = [text for text in list_remarks(lacking) if "reached the bound" in text]
    assert text.startswith("1 tolerance " if count == 1 else "6 tolerances ")
    if count == 6:
        largest = [f"{names[k]} {pulls[k]:+.1f}" for k in (2, 3, 1, 5)]
        assert text.endswith(f": {', '.join(largest)}.")
        assert names[0] not in text


def test_implausible_pulls_stand_in_the_doubts_alone(summary):
    lacking, _ = tolerances(summary, [9.0, 2.5])
    (text,) = [text for text in list_remarks(lacking) if "reached the bound" in text]
    assert text == "2 tolerances reached the bound of 2.5 standard deviations."


def test_at_most_four_unidentifiable_directions_are_named(summary):
    rows = [
        UnseenRow(
            parameters=[f"k{n}"], deviation=2.0, sentence=f"k{n} is not determined by the data"
        )
        for n in range(6)
    ]
    (text,) = [
        text for text in list_remarks(changed(summary, unseen=rows)) if "not determined" in text
    ]
    assert "k3 is not determined" in text
    assert "k4" not in text
    assert text.endswith("and 2 more.")


def test_what_the_mjcf_does_not_hold_is_summed_up(summary):
    names = [f"acc{k}.gain_{axis} (an MJCF site has no gain)" for k in (1, 12) for axis in "xyz"]
    names += ["acc1.delay_x (no delay)", "acc1.cross_xy (no gain)", "hammer(default).delay (none)"]
    names += ["hammer(acc1:tx) (one place)", "base.mass (its own MJCF body would weigh nothing)"]
    assert describe_not_in_mjcf(names, None, "tuned.json") == (
        "The tuned MJCF does not hold: gains of 2 sensors, delays of 1 sensor, "
        "delay of 1 force channel, place and direction of 1 hit, "
        "base.mass (its own MJCF body would weigh nothing) (tuned.json lists them)."
    )
    assert describe_not_in_mjcf([], None, "tuned.json") == ""
    alike = [f"ty.loss({one}) (it depends on frequency)" for one in ("a", "b")]
    text = describe_not_in_mjcf(alike, 0.021, "t.json")
    assert "hold: ty.loss(a), ty.loss(b) (it depends on frequency) (" in text
    assert "(without them the FRFs change by 2.1 %; t.json lists them)" in text


def test_limits_of_the_figures_are_no_doubts_of_the_fit(summary):
    assert list_limits(doubted(summary, "it was interrupted")) == []
    failed = changed(summary, held_out_outcomes=["converged", "out of evaluations"])
    assert list_limits(failed) == [
        "Some held-out fits did not converge: the held-out error may be too high."
    ]
    assert list_limits(failed)[0] in list_remarks(failed)


def test_absolute_stiffness_is_said_to_rest_on_the_force_channel(summary):
    assert calibration_sentence(0.02) == (
        "Absolute stiffness and damping rest on the calibration of the force channel; its "
        "tolerance of 2 % is in the intervals."
    )
    assert calibration_sentence(0.0).endswith("channel, which the intervals take as exact.")
    gains = [row for row in summary.parameters if row.name.endswith(").gain")]
    assert gain_tolerance(summary) == max((row.prior for row in gains), default=0.0)


def test_a_note_has_no_red_box():
    html = warning_boxes(
        ["the fit failed", "the test covered 2 to 90 Hz"], ["the test covered 2 to 90 Hz"]
    )
    assert html == (
        '<div class="warn">the fit failed</div><div class="note">the test covered 2 to 90 Hz</div>'
    )
