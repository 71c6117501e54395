"""Level check on the page of ``mbw identify``: its rows, and its plot in a browser."""

from dataclasses import replace

import numpy as np
import pytest
from browser import CHROMIUM, GL, browse, data_of
from campaign_folder import write_folder
from typer.testing import CliRunner

from identification.level_check import check_levels
from identification.result.collect import level_row
from identification.result.remarks import list_remarks
from identification.result.stored_result import IdentificationResult, read_result
from mbmodel import as_drawn, load_machine
from mbw.command import app
from mbw.identify.page import render
from tests.helpers.nonlinear_mass import MJCF, level_campaign

LEVELS_N = (20.0, 100.0, 200.0)
PROBE = """<script>
const wait = ms => new Promise(done => setTimeout(done, ms));
(async () => {
  await wait(1500);
  const plot = byId("level-plot"), lines = axis => plot.data.filter(t => (t.yaxis || "y") === axis);
  const found = {words: byId("level-words").textContent, faults: FAULTS};
  found.frequency = lines("y").map(t => Array.from(t.y));
  found.damping = lines("y2").map(t => Array.from(t.y));
  found.bars = lines("y").map(t => Array.from(t.error_y.array));
  found.levels = Array.from(plot.data[0].x);
  found.legend = lines("y").filter(t => t.showlegend).map(t => t.name);
  document.body.append(element("pre", JSON.stringify(found), {id: "found"}));
})();
</script>"""


@pytest.fixture(scope="module")
def check(tmp_path_factory):
    path = tmp_path_factory.mktemp("mass") / "mass.xml"
    path.write_text(MJCF, encoding="utf-8")
    block = as_drawn(load_machine(path))
    return check_levels(level_campaign(block, lambda q: 1.5e15 * q**3, LEVELS_N))


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    place = tmp_path_factory.mktemp("identify")
    campaign = write_folder(place / "campaign", lines=321)
    arguments = ["identify", campaign, "--out", place / "result"]
    outcome = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert outcome.exit_code == 0, outcome.stderr
    return read_result(place / "result")


@pytest.fixture(scope="module")
def text(result, check):
    summary = result.summary.model_copy(update={"levels": level_row(check)})
    return render(IdentificationResult(summary, result.arrays, result.layout), None)


def test_a_row_holds_the_modes_at_each_level(check):
    row = level_row(check)
    assert row.level == list(LEVELS_N)
    assert row.effects is None
    assert [mode.frequency_changes for mode in row.modes] == [False, False, True]
    assert row.modes[-1].frequency == check.trends[-1].freq_hz.tolist()
    assert level_row(None) is None
    assert (
        level_row(replace(check, trends=check.trends[:2], changed=check.changed[:2])).effects == []
    )


def test_modes_of_levels_that_differ_are_said_to_be_of_all_levels(result, check):
    def remarks(row):
        summary = result.summary.model_copy(update={"levels": row})
        return list_remarks(IdentificationResult(summary, result.arrays, result.layout))

    row = level_row(check)
    within, same = (
        row.model_copy(update=update) for update in ({"within_tests": True}, {"effects": []})
    )
    assert sum("list its tests alone" in text for text in remarks(row)) == 1
    for levels in (None, within, same):
        assert remarks(levels) == [text for text in remarks(row) if "its tests alone" not in text]


def test_a_campaign_of_one_level_has_no_section(result):
    assert result.summary.levels is None
    page = render(result, None)
    assert 'id="level-plot"' not in page
    assert data_of(page)["levels"] is None


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_the_page_plots_each_mode_against_the_level(text, check, tmp_path):
    found = browse(text, tmp_path, *GL, probe=PROBE)
    assert found["faults"] == []
    assert found["words"] == check.sentence
    assert found["levels"] == list(LEVELS_N)
    for k, trend in enumerate(check.trends):
        np.testing.assert_allclose(found["frequency"][k], 100 * trend.frequency_shift, atol=1e-9)
        np.testing.assert_allclose(
            found["damping"][k], 100 * (trend.damping - trend.damping[0]), atol=1e-9
        )
        np.testing.assert_allclose(found["bars"][k], 200 * trend.freq_sd / trend.freq_hz[0])
    assert found["legend"] == [f"{check.trends[-1].freq_hz[0]:.4g} Hz"]
