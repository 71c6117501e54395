"""Sections of the tuning page: badges, intervals, pulls, identifiability, starts."""

import re
from dataclasses import replace

import numpy as np
import pytest
from browser import CHROMIUM, browse, data_of, unpacked
from campaign_folder import write_folder
from typer.testing import CliRunner

from mbw.command import app
from mbw.page.numbers import format_four_digits, format_percent, format_shift, format_tolerance
from mbw.tune.convergence import badges, identifiability_section, starts_section
from mbw.tune.page import render
from mbw.tune.parameters import interval_note, parameters_table
from mbw.tune.pulls import kind_of, pull_points, pulls_note, pulls_table
from tuning import read_result
from tuning.assessment.findings import CorrelationRow, UnseenRow


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    place = tmp_path_factory.mktemp("parts")
    arguments = ["tune", write_folder(place / "campaign"), "--out", place / "result", "--quiet"]
    arguments += ["--starts", 2]
    assert CliRunner().invoke(app, [str(word) for word in arguments]).exit_code == 0
    return read_result(place / "result")


@pytest.fixture
def summary(result):
    return result.summary


def changed(summary, **fields):
    return summary.model_copy(update=fields)


def fitted(summary, **fields):
    return changed(summary, fit=summary.fit.model_copy(update=fields))


def with_row(summary, name, **fields):
    """The summary with one parameter changed."""
    assert name in [row.name for row in summary.parameters]
    rows = [
        row.model_copy(update=fields) if row.name == name else row for row in summary.parameters
    ]
    return changed(summary, parameters=rows)


def row_of(html, name):
    (found,) = [row for row in html.split("<tr")[1:] if f">{name}<" in row or f">{name} <" in row]
    return found


def test_converged_is_green_only_without_doubts(summary):
    sure = badges(fitted(summary, converged=True, trusted=True, doubts=[]))
    assert re.findall(r'class="badge (\w+)">([\w ]+)<', sure) == [("good", "converged")]
    assert "mbw diagnose" in sure
    one = badges(fitted(summary, converged=True, trusted=False, doubts=["k < 0", "b"]))
    assert re.findall(r'class="badge (\w+)">([\w ]+)<', one) == [
        ("plain", "converged"), ("trouble", "2 doubts"),
    ]  # fmt: skip
    assert "<li>k &lt; 0</li><li>b</li>" in one
    neither = badges(
        fitted(
            summary, converged=False, trusted=False, outcome="failed", advice="free it", doubts=[]
        )
    )
    assert neither.count("trouble") == 2
    assert "<li>the search ended early (failed): free it</li>" in neither


def test_of_an_earlier_version_s_result_trust_is_not_claimed_either_way(summary):
    text = badges(fitted(summary, converged=True, trusted=False, doubts=[]))
    assert "trusted" not in text


def test_each_parameter_has_its_interval_and_a_whisker_about_the_end_of_its_bar(summary):
    rows = parameters_table(summary)
    free = [row for row in summary.parameters if row.prior is None]
    assert rows.count("<tr") - 1 == len(free) == 12
    for row in free:
        html = row_of(rows, row.name)
        assert f"{format_four_digits(row.low)} … {format_four_digits(row.high)}" in html
        left, width = map(float, re.search(r'<u style="left:(.*?)%;width:(.*?)%"', html).groups())
        end = 50 + 25 * np.log2(row.tuned / row.drawn)
        # Two figures behind the comma of places, one of the bar's.
        assert left - 0.02 <= end <= left + width + 0.02
        assert width == pytest.approx(25 * np.log2(row.high / row.low), abs=0.02)


def test_an_unidentifiable_parameter_has_no_interval(summary):
    name = "head_tx.damping"
    html = row_of(parameters_table(with_row(summary, name, seen=False)), name)
    assert "unidentifiable" in html
    assert "…" not in html
    assert "<u" not in html
    assert "hatched" in html


def test_an_interval_beyond_the_scale_ends_with_it(summary):
    name = "head_tx.damping"
    wide = with_row(summary, name, low=1e-3, high=1e9, tuned=1e6, drawn=1.0)
    assert '<u style="left:0.00%;width:100.00%">' in row_of(parameters_table(wide), name)


@pytest.mark.parametrize(
    ("factor", "mark"),
    [
        (22.9, '<em class="above">&times;22.9 ▸</em>'),
        (0.01, '<em class="below">◂ &divide;100</em>'),
        (3.9, ""),
        (0.26, ""),
    ],
)
def test_a_factor_beyond_the_scale_stands_at_its_end(summary, factor, mark):
    name = "head_tx.damping"
    ends = {"low": 0.98 * factor, "high": 1.02 * factor}
    html = row_of(parameters_table(with_row(summary, name, tuned=factor, drawn=1.0, **ends)), name)
    assert (mark or "</span></td>") in html
    assert ("<em" in html) == bool(mark)
    assert ("<u" in html) == (not mark)


def test_a_freed_displacement_has_no_factor_and_an_interrupted_tuning_no_interval(summary):
    free = with_row(summary, "head.com_x", prior=None, pull=None)
    html = row_of(parameters_table(free), "head.com_x")
    assert 'class="bar' not in html
    assert "… " in html
    bare = with_row(summary, "head_tx.damping", low=None, high=None, deviation=None)
    html = row_of(parameters_table(bare), "head_tx.damping")
    assert "<u" not in html
    assert '<span class="bar"><i' in html


def test_every_tolerance_is_a_point_of_its_kind(summary):
    pulls = pull_points(summary)
    rows = {row.name: row for row in summary.parameters if row.prior is not None}
    assert {point["name"]: point["pull"] for point in pulls["points"]} == {
        name: row.pull for name, row in rows.items()
    }
    assert pulls["kinds"] == [
        "mass", "inertia", "centre of mass", "joint position", "sensor gain", "sensor angle",
        "sensor position", "transverse sensitivity", "sensor delay",
        "hammer angle", "hammer position", "hammer gain", "hammer delay",
    ]  # fmt: skip
    for point in pulls["points"]:
        assert pulls["kinds"][point["kind"]] == kind_of(rows[point["name"]])
    sizes = [abs(point["pull"]) for point in pulls["points"]]
    assert sizes == sorted(sizes, reverse=True)


def test_a_spring_with_a_prior_is_a_tolerance_of_its_own_kind(summary):
    known = with_row(summary, "head_tx.stiffness", prior=0.1, pull=1.0)
    assert "stiffness" in pull_points(known)["kinds"]
    assert ">head_tx.stiffness<" not in parameters_table(known)


def test_the_table_has_the_ten_largest_pulls_and_marks_the_impossible(summary):
    far = with_row(summary, "acc4.rotation_y", pull=-15.04, at_bound=True, tuned=-0.043625)
    table = pulls_table(far)
    body = table.split("<tbody>")[1].split("<tr")[1:]
    assert len(body) == 10
    assert "class=bad" in body[0]
    assert "acc4.rotation_y" in body[0]
    assert [cell for cell in ("1°", "-15.0", "-2.5° <small>bound") if cell not in body[0]] == []
    assert not any("class=bad" in row for row in body[1:])
    assert "keeps all within 2.5" in pulls_note(far)
    assert "keeps all within 2.5" not in pulls_note(summary)
    assert "class=bad" not in pulls_table(with_row(summary, "acc4.rotation_y", pull=3.4))


def test_percentages_have_no_exponent():
    assert [format_percent(value, 2) for value in (1.0, 1.234, 0.0712)] == [
        "100 %", "120 %", "7.1 %",
    ]  # fmt: skip
    assert [format_percent(value) for value in (12.344, 0.12345, -0.5)] == [
        "1230 %", "12.3 %", "-50 %",
    ]  # fmt: skip


def test_numbers_are_in_units_that_a_workshop_reads():
    assert [format_four_digits(value) for value in (5.5734e9, 3000.0, 40.0, 0.0, -2.5e-7)] == [
        "5.573e9", "3000", "40.00", "0.000", "-2.500e-7",
    ]  # fmt: skip
    assert format_shift(0.0, 0.00375, "m") == "+3.75 mm"
    assert format_shift(0.0, np.radians(-2.0), "rad") == "-2°"
    assert format_shift(40.0, 41.0, "kg") == "+2.5 %"
    assert format_shift(0.0, 0.02, "kg m^2") == "+0.02 kg m^2"
    assert format_tolerance(0.0015, "m") == "1.5 mm"
    assert format_tolerance(np.radians(1), "rad") == "1°"
    assert format_tolerance(0.05, "kg m^2") == "5 %"


def test_unidentifiable_parameters_and_the_ten_strongest_correlations_are_listed(summary):
    unseen = [UnseenRow(parameters=["a", "b"], deviation=3.0, sentence="a & b: only as a sum")]
    pairs = [
        CorrelationRow(first=f"p{k}", second=f"q{k}", correlation=(-1) ** k * (1 - 0.001 * k))
        for k in range(12)
    ]
    html = identifiability_section(changed(summary, unseen=unseen, correlations=pairs))
    assert "<li>a &amp; b: only as a sum</li>" in html
    assert "-0.9910" in html
    assert "p9" in html
    assert "p10" not in html
    assert "the data determine all" in identifiability_section(changed(summary, unseen=[]))
    assert "no correlation is above 0.9" in identifiability_section(
        changed(summary, correlations=[])
    )


def test_an_interrupted_tuning_claims_nothing_about_what_the_data_tell(result):
    rows = [
        row.model_copy(update={"low": None, "high": None, "deviation": None})
        for row in result.summary.parameters
    ]
    bare = changed(result.summary, parameters=rows, correlations=[], unseen=[], interrupted=True)
    assert identifiability_section(bare) == ""
    levels = {name: replace(level, deviation=None) for name, level in result.levels.items()}
    text = render(replace(result, summary=bare, levels=levels))
    assert "What the data cannot tell" not in text
    assert "the tuning was interrupted" in text
    assert data_of(text)["deviation"] is None


def test_several_starts_have_a_table_and_a_single_one_has_none(summary):
    html = starts_section(summary)
    assert html.count("<tr>") == 1 + 2
    ends = list(summary.fit.ends)
    ends[1] = ends[1].model_copy(
        update={"agrees": False, "cost": 2 * ends[0].cost, "farthest": {"head_rz.damping": 3.25}}
    )
    html = starts_section(fitted(summary, ends=ends))
    assert "head_rz.damping &times;3.25" in html
    assert '<span class="bad">no</span>' in html
    assert "100.00 %" in html
    assert starts_section(fitted(summary, ends=[], starts=1)) == ""


def test_the_band_is_that_of_the_result_and_the_inputs_are_named(result):
    text = render(result)
    level = result.levels["bodies"]
    packed = unpacked(data_of(text)["deviation"])
    assert packed == pytest.approx(level.deviation.T.ravel(), rel=1e-7)
    for row in result.summary.inputs:
        assert f'{row.file} <code title="SHA-256 {row.sha256}">{row.sha256[:10]}</code>' in text


PROBE = """<script>setTimeout(() => {
  const marks = [...document.querySelectorAll("#pulls .points path")].map(p => p.style.stroke);
  const labels = [...document.querySelectorAll("#pulls .annotation-text")].map(t => t.textContent);
  const left = document.getElementById("pulls").getBoundingClientRect().left;
  const clipped = [...document.querySelectorAll("#pulls .ytick text")]
    .filter(t => t.getBoundingClientRect().left < left).map(t => t.textContent);
  const steps = [...document.querySelectorAll("#pulls .xtick text")].map(t => t.textContent);
  const overlay = document.getElementById("overlay"), start = overlay.getBoundingClientRect().left;
  const ends = Object.entries(overlay._fullLayout).filter(([key]) => /^xaxis/.test(key))
    .map(([_, axis]) => start + axis._offset + axis._length);
  const values = [...overlay.querySelectorAll("g[class^=y][class$=tick] text")]
    .map(t => t.getBoundingClientRect());
  const crossing = values.filter(b => ends.some(end => b.left < end && end < b.right)).length;
  const wide = document.documentElement.scrollWidth;
  const fills = document.querySelectorAll("#overlay .js-fill").length;
  [...document.querySelectorAll("#choose button")].find(b => b.textContent === "phase").click();
  const phase = document.querySelectorAll("#overlay .js-fill").length;
  const boxes = [...document.querySelectorAll("#pulls .annotation-text")]
    .map(t => t.getBoundingClientRect());
  const hit = boxes.some((a, i) => boxes.slice(i + 1).some(b => a.left < b.right && b.left < a.right
    && a.top < b.bottom && b.top < a.bottom));
  const pre = document.createElement("pre"); pre.id = "found";
  pre.textContent = JSON.stringify({faults: FAULTS, marks, labels, wide, fills, hit, phase, clipped,
    steps, values: values.length, crossing});
  document.body.append(pre);
}, 3000);</script>"""


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_in_a_browser_the_impossible_pull_is_red_and_named_and_every_motion_has_its_band(
    result, tmp_path
):
    far = with_row(result.summary, "acc4.rotation_y", pull=-15.04)
    found = browse(render(replace(result, summary=far)), tmp_path, probe=PROBE)
    assert found["faults"] == []
    assert len(found["marks"]) == 130
    assert sum(mark == "rgb(180, 35, 24)" for mark in found["marks"]) == 1
    assert found["labels"] == ["acc4.rotation_y -15.0"]
    steps = {step.replace("\u2212", "-") for step in found["steps"]}
    assert steps == {"0", "+2", "-2", "+4", "-4", "+10", "-10"}
    assert found["clipped"] == []
    assert not found["hit"]
    assert found["fills"] == 6 * 3  # sensors that are off read a little of every direction
    assert found["phase"] == 0
    assert found["wide"] <= 1280


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_in_a_narrow_window_the_values_of_a_plot_stay_beside_its_neighbour(result, tmp_path):
    narrow_page = browse(render(result), tmp_path, "--window-size=640,1600", probe=PROBE)
    assert narrow_page["values"] > 18
    assert narrow_page["crossing"] == 0
    assert narrow_page["clipped"] == []
    assert "+10" not in narrow_page["steps"]


def test_intervals_say_what_they_presume(summary, result):
    sure = interval_note(fitted(summary, converged=True, trusted=True, doubts=[]))
    assert "if the model lacks nothing" in sure
    doubtful = interval_note(fitted(summary, converged=True, trusted=False, doubts=["b"]))
    assert doubtful.startswith(sure)
    assert doubtful.endswith("the true value may lie outside.")
    assert interval_note(summary) in re.sub(r"</?abbr[^>]*>", "", render(result))
