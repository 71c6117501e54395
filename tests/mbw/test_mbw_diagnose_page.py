"""Page of ``mbw diagnose``: its text for each verdict, and its behaviour in a browser."""

import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
from browser import CHROMIUM, GL, browse, data_of, unpacked
from diagnosed import CASES, diagnosed, lead_of, plain
from diagnosis_probe import PROBE
from drawn import drawn

from diagnosis.decision.established import RemarkRow
from diagnosis.labels import name_direction
from diagnosis.verdict.sentences import UNEXPLAINED, place_name, place_phrase
from identification.words import capitalise
from mbmodel import load_machine
from mbw.diagnose.fitted_sets import fitted_rows
from mbw.diagnose.page import render
from mbw.diagnose.tables import hypotheses_section
from mbw.results.diagnosed_files import NAMES, read_result, write_files
from tests.helpers.command import invoke as mbw


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A diagnosis of each kind, made by the first test that needs it."""

    class Folders(dict):
        def __missing__(self, name):
            self[name] = diagnosed(name, tmp_path_factory.mktemp(name))
            return self[name]

    return Folders()


@pytest.fixture(scope="module")
def texts(folders):
    class Texts(dict):
        def __missing__(self, name):
            return (folders[name] / "report.html").read_text("utf-8")

    return Texts()


@pytest.fixture(scope="module")
def explained(folders):
    return read_result(folders["explained"])


def test_the_headline_states_cause_place_size_and_gap(texts, explained):
    lead, verdict = lead_of(texts["explained"]), explained.verdict
    assert verdict.verdict == "explained"
    assert lead.startswith(
        "One effect is missing (> 99 %): a spinning rotor on body stage2 (angular "
    )
    assert "kg m²/s" in lead
    assert f"{verdict.gap.retuned.excess:.3g} times" in lead
    assert f"{verdict.gap.after.excess:.3g} times" in lead
    assert f"{100 * verdict.gap.closed:.3g} % of the gap beyond the noise is closed." in lead
    assert '<span class="badge good">one cause &gt; 99 %</span>' in texts["explained"]
    assert "<b>gyroscopic</b><br><small>a rotor spins in stage2</small>" in texts["explained"]
    assert f"<b>Next experiment:</b> {verdict.next_experiment}" in texts["explained"]
    drawn, retuned, after = explained.shown.centres
    assert drawn.excess > retuned.excess > after.excess > 0.5
    assert (
        f"re-tuned {retuned.excess:.3g}, with the effect {after.excess:.3g}" in texts["explained"]
    )
    assert "with the effect" not in re.search("Reduced to the.*?<", texts["none"])[0]


@pytest.mark.parametrize("name", CASES)
def test_the_tuned_model_is_an_mjcf(folders, name):
    assert load_machine(folders[name] / "augmented.xml").springs


def test_what_the_tuned_model_does_not_hold_is_said(explained):
    said = explained.shown.not_held_by_mjcf
    assert any("let it spin" in text for text in said)  # a rotor
    assert any("gain" in text for text in said)


def test_a_proven_fault_comes_first_where_no_known_effect_explains_the_rest(folders):
    result = read_result(folders["sensor"])
    remark = RemarkRow(effect="flexible_body", location="body:stage1", dof=None, closed=0.0123)
    unknown = RemarkRow(effect="sensor_gain", location="sensor:acc11", dof="tx", closed=None)
    verdict = result.verdict.model_copy(
        update={"verdict": "unexplained", "remarks": [remark, unknown]}
    )
    page = render(replace(result, verdict=verdict))
    lead = lead_of(page)
    assert lead.startswith("Proven by the redundant channels: ")
    assert "turned sign" in lead
    retuned, after = (f"{at.excess:.3g} times" for at in (verdict.gap.retuned, verdict.gap.after))
    assert f"model is {retuned} the noise, with that fault corrected still {after}" in lead
    assert (
        "on body stage1 is proven without the model, but it closes only 1.2 % of the gap."
        in plain(page)
    )
    assert (
        "along x is proven without the model, but is not established as a cause of the gap." in page
    )


def test_a_proven_fault_that_would_close_much_is_to_be_corrected_first(folders):
    result = read_result(folders["sensor"])
    remark = RemarkRow(effect="flexible_body", location="body:stage1", dof=None, closed=0.975)
    verdict = result.verdict.model_copy(update={"verdict": "unexplained", "remarks": [remark]})
    assert (
        "on body stage1 is proven without the model and would close 98 % of the gap: "
        "correct it first and repeat." in plain(render(replace(result, verdict=verdict)))
    )


def test_a_partly_explained_gap_names_cause_and_rest(folders, texts):
    result, lead = read_result(folders["partly"]), lead_of(texts["partly"])
    verdict, rest = result.verdict, result.verdict.rest
    assert verdict.verdict == "partly"
    assert lead.startswith(
        "One effect is established, and a rest remains: a link that bypasses joints between "
        "stage1 and stage3 (stiffness"
    )
    assert f"{verdict.gap.retuned.excess:.3g} times the noise (re-tuned) to" in lead
    assert f"What remains is {rest.excess:.3g} times the noise: the model's error is" in lead
    assert rest.spread == "local"
    assert f"it mainly arises {place_phrase(rest.where[0].location)} (" in lead
    error = f"{100 * rest.model_error:.3g} %"
    assert f'<span class="badge trouble">a rest remains: model error {error}' in texts["partly"]
    assert '<span class="badge good">one cause' in texts["partly"]
    (established,) = result.shown.established
    assert established.cause == 0
    assert f"<td>{100 * established.closed:.3g} %</td>" in texts["partly"]
    places = {row["name"]: row["gain"] for row in data_of(texts["partly"])["places"]}
    located = result.evidence.rest_pushed[0]
    assert places[place_name(located.location)] == located.gain


def test_each_refit_states_model_error_residual_and_closed_gap(explained, texts):
    page = plain(texts["explained"])
    assert (
        '<th class="name">with</th><th>model error</th><th>residual over noise</th>'
        "<th>gap closed</th><th>log odds [nats]</th>" in page
    )
    null, best = explained.evidence.null, fitted_rows(explained.evidence)[0]
    assert best.fit.keys == explained.evidence.sets[0].keys
    assert f"{100 * null.floor:.3g} %</td><td>{null.chi_square**0.5:.3g}</td>" in page
    assert f"<td>{best.fit.chi_square**0.5:.3g}</td><td>{100 * best.closed:.3g} %</td>" in page


def test_refits_state_what_differs_between_levels_where_there_are_levels(explained, texts):
    assert "between levels" not in plain(texts["explained"])
    levels = {"level_excess": 3.0}
    sets = tuple(
        fitted.model_copy(update={"level_excess": 0.21}) for fitted in explained.evidence.sets
    )
    null = explained.evidence.null.model_copy(update=levels)
    evidence = explained.evidence.model_copy(update={"null": null, "sets": sets})
    page = plain(hypotheses_section(replace(explained, evidence=evidence)))
    assert "<th>residual over noise</th><th>between levels</th><th>gap closed</th>" in page
    assert f"<td>{null.chi_square**0.5:.3g}</td><td>2</td>" in page
    assert f"<td>{fitted_rows(evidence)[0].fit.chi_square ** 0.5:.3g}</td><td>1.1</td>" in page


def test_a_set_that_held_out_lines_reject_is_told_from_others_that_contain_it(explained):
    half = {"parameters": (), "shifts": (), "serial": explained.evidence.null.gap / 2}
    best = explained.evidence.sets[0].model_copy(update=half)
    keys = (*best.keys, ("drift", "joint:a", None))
    more = best.model_copy(update={"keys": keys, "chi_square": 1.0, "serial": 0.0})
    sets = {"sets": (more, best), "rejected": (best.keys,)}
    rows = fitted_rows(explained.evidence.model_copy(update=sets))
    reasons = {row.fit.keys: row.rejection for row in rows}
    assert reasons[best.keys] == "fails on held-out lines"
    assert reasons[keys] == "contains a set that fails on held-out lines"


def test_nothing_missing_is_said_without_place_and_without_effect(texts):
    assert lead_of(texts["none"]).startswith("Nothing is missing beyond tolerances and noise (")
    assert '<span class="badge good">nothing missing ' in texts["none"]
    assert "No place stands out" in texts["none"]
    assert "they need hits of several levels" in texts["none"]  # not: excluded
    data = data_of(texts["none"])
    assert [bar["name"] for bar in data["gap"]] == ["as drawn", "re-tuned"]
    assert data["places"] == []
    assert "after" not in data["frf"]
    assert "picture" not in data


def test_what_no_known_effect_explains_is_located_by_a_free_force(texts, folders):
    result = read_result(folders["unexplained"])
    assert result.verdict.verdict == "unexplained"
    best = result.evidence.pushed[0]
    lead = lead_of(texts["unexplained"])
    assert lead.startswith(f"{capitalise(UNEXPLAINED)} (")
    towards = f"{place_phrase(best.location)}, {name_direction(best.dof)}"
    assert f"The missing force most probably acts {towards}; second comes" in lead
    assert '<span class="badge trouble">unexplained' in texts["unexplained"]
    names = {row["name"]: row for row in data_of(texts["unexplained"])["places"]}
    assert names[place_name(best.location)]["gain"] == best.gain


def test_a_sensor_that_is_at_fault_is_shown_as_measured_and_as_it_would_be(texts, folders):
    result = read_result(folders["sensor"])
    lead = lead_of(texts["sensor"])
    assert lead.startswith(
        "One sensor is at fault (> 99 %): a turned sign at sensor acc32, along z"
    )
    outputs = [result.shown.channels[k].output for k in result.shown.corrected]
    assert outputs == ["acc32:+tz"] * 3
    measured = result.arrays["measured"][:, result.shown.corrected]
    np.testing.assert_array_equal(result.arrays["corrected"], -measured)
    assert data_of(texts["sensor"])["frf"]["corrected_channels"] == result.shown.corrected


@pytest.mark.parametrize("name", CASES)
def test_report_makes_the_same_page_again_from_the_folder_alone(folders, texts, tmp_path, name):
    shutil.copytree(folders[name], tmp_path / "moved")
    (tmp_path / "moved" / "report.html").unlink()
    outcome = mbw("report", tmp_path / "moved")
    assert outcome.exit_code == 0, outcome.stderr
    assert (tmp_path / "moved" / "report.html").read_text("utf-8") == texts[name]


def test_the_page_is_written_to_the_named_file(folders, texts, tmp_path):
    target = tmp_path / "mine.html"
    assert mbw("report", folders["none"] / "verdict.json", "--out", target).exit_code == 0
    assert target.read_text("utf-8") == texts["none"]


@pytest.mark.parametrize("fault", ["missing", "broken", "cut", "empty"])
@pytest.mark.parametrize("name", NAMES[:4])
def test_a_missing_or_broken_file_is_refused_in_one_sentence(folders, tmp_path, name, fault):
    folder = tmp_path / "result"
    shutil.copytree(folders["none"], folder, ignore=shutil.ignore_patterns("report.html"))
    kept = (folder / name).read_bytes()
    content = {"broken": b'{"campaign": 3}', "cut": kept[: len(kept) // 2], "empty": b""}
    (folder / name).unlink()
    if fault != "missing":
        (folder / name).write_bytes(content[fault])
    outcome = mbw("report", folder)
    assert outcome.exit_code == 3
    assert len(outcome.stderr.strip().splitlines()) == 1
    assert name in outcome.stderr
    assert "mbw diagnose" in outcome.stderr
    assert not (folder / "report.html").exists()


def test_files_of_two_diagnoses_are_not_mixed(folders, tmp_path):
    shutil.copytree(folders["none"], tmp_path / "mixed")
    shutil.copy(folders["explained"] / "diagnosis.npz", tmp_path / "mixed")
    outcome = mbw("report", tmp_path / "mixed")
    assert outcome.exit_code == 3
    assert "do not belong together" in outcome.stderr


def test_a_folder_that_cannot_take_the_files_is_refused_before_the_work(folders, tmp_path):
    drawn(tmp_path, CASES["none"][0], lines=41)
    (tmp_path / "out" / "diagnosis.npz").mkdir(parents=True)
    outcome = mbw("diagnose", tmp_path / "campaign", "--out", tmp_path / "out")
    assert outcome.exit_code == 3
    assert "diagnosis.npz is a folder" in outcome.stderr


@pytest.mark.parametrize("name", CASES)
def test_the_page_fetches_nothing(texts, name):
    page = re.sub(r"<script>/\*\*.*?</script>", "", texts[name], flags=re.DOTALL)
    assert len(page) < len(texts[name]) / 2  # plotly itself is inside
    assert "src=" not in page
    assert not re.search(r"<link|@import|url\(|https?://", page)


def test_names_cannot_break_the_page(explained):
    evil = "</script><b>&x"
    verdict, shown = explained.verdict, explained.shown
    row = verdict.causes[0].model_copy(update={"effect": evil, "location": f"body:{evil}"})
    verdict = verdict.model_copy(
        update={"causes": [row], "twins": [(evil, f"{evil}@body:a")], "next_experiment": evil}
    )
    channels = [one.model_copy(update={"body": evil}) for one in shown.channels]
    shown = shown.model_copy(
        update={"campaign": evil, "means": [evil], "remarks": [evil], "channels": channels}
    )
    page = render(replace(explained, verdict=verdict, shown=shown))
    assert "<b>&x" not in page
    assert page.count("</script>") == render(explained).count("</script>")


def test_excess_of_channels_makes_up_that_of_the_verdict(explained):
    gap, channels = explained.verdict.gap, data_of(render(explained))["channels"]
    for key, at in (("retuned", gap.retuned), ("after", gap.after)):
        found = np.array([channel[f"{key}_excess"] for channel in channels])
        assert np.sqrt((found**2).mean()) == pytest.approx(at.excess, rel=1e-3)


def test_responses_of_the_page_are_those_of_the_files(explained):
    data, arrays = data_of(render(explained))["frf"], explained.arrays
    lines, channels = arrays["measured"].shape
    assert unpacked(data["freq"]) == pytest.approx(arrays["freq_hz"])
    for name in ("measured", "retuned", "after"):
        steps = unpacked(data[name], "<i2").reshape(channels, lines, 2).astype(float)
        values = 10 ** (steps[..., 0] / 1500) * np.exp(1j * np.radians(steps[..., 1] / 100))
        error = np.abs(values - arrays[name].T) / np.abs(arrays[name].T)
        assert error.max() < 1e-3
    noise = 10 ** (unpacked(data["noise"], "<i2").reshape(channels, lines) / 1500)
    np.testing.assert_allclose(noise, arrays["noise"].T, rtol=1e-3)


def test_places_lie_on_the_machine(explained):
    machine, places = explained.shown.machine, explained.shown.places
    centre = explained.arrays["centres"][machine.bodies.index("stage2")]
    assert places["body:stage2"].bodies == ["stage2"]
    assert places["body:stage2"].points == [pytest.approx(tuple(centre))]
    assert places["joint:stage3"].bodies == ["stage3"]
    assert len(places["joint:stage3"].points) == 1


def test_a_campaign_of_full_size_leaves_less_than_fifteen_megabytes(explained, tmp_path):
    count, lines = 207, 800
    random = np.random.default_rng(72_001)
    arrays, shown = dict(explained.arrays), explained.shown
    for name in ("measured", "retuned", "after"):
        arrays[name] = random.normal(size=(lines, 2 * count)).astype("<f4").view("<c8")
    arrays["noise"] = random.random((lines, count)).astype("<f4")
    arrays["corrected"] = arrays["corrected"][:0].reshape(lines, 0)
    arrays["freq_hz"] = np.linspace(1, 200, lines)
    for name in ("retuned_excess", "retuned_error", "after_excess", "after_error", "channel_noise"):
        arrays[name] = random.random(count)
    rows = [
        shown.channels[0].model_copy(update={"output": f"acc{k // 3}:+t{'xyz'[k % 3]}", "test": t})
        for t in range(3)
        for k in range(69)
    ]
    shown = shown.model_copy(update={"channels": rows, "corrected": [], "lines": lines})
    result = replace(explained, shown=shown, arrays=arrays)
    write_files(result, tmp_path)
    (tmp_path / "report.html").write_text(render(read_result(tmp_path)), encoding="utf-8")
    assert sum(file.stat().st_size for file in tmp_path.iterdir()) < 15e6


@pytest.fixture(scope="module")
def found(texts, tmp_path_factory):
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed")
    return browse(texts["explained"], tmp_path_factory.mktemp("browser"), *GL, probe=PROBE)


def test_the_page_runs_without_faults(found, explained):
    assert found["faults"] == []
    assert found["drawn"]
    assert found["wide"]
    assert found["bars"] == ["as drawn", "re-tuned", "with the effect"]
    rows = len({channel.output for channel in explained.shown.channels})
    assert found["maps"] == [rows, rows]


def test_the_channel_that_gains_most_is_shown_first(found, explained):
    arrays = explained.arrays
    best = int(np.argmax(arrays["retuned_excess"] ** 2 - arrays["after_excess"] ** 2))
    assert found["first"] == found["most"] == best
    assert set(found["curves"]) >= {"measured", "re-tuned", "with the effect"}
    for name in ("measured", "after"):
        np.testing.assert_allclose(found[name], np.abs(arrays[name][:20, best]), rtol=1e-3)
    assert found["worst"] == int(np.argmax(arrays["after_excess"]))
    channels = explained.shown.channels
    assert channels[found["switched"]] == channels[best].model_copy(update={"test": 1})


def test_a_click_on_the_map_chooses_the_channel(found, explained):
    channel = explained.shown.channels[7]
    assert found["clicked"] == [7, channel.output, channel.test]


def test_a_click_on_a_place_shows_it_on_the_machine(found, texts):
    first, second = data_of(texts["explained"])["places"][:2]
    assert found["chosen"].startswith(first["name"])
    assert found["second"].startswith(second["name"])
    assert found["before"] != found["later"]


def test_the_page_of_nothing_runs_without_faults(texts, tmp_path):
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed")
    probe = """<script>setTimeout(() => document.body.append(element("pre",
      JSON.stringify({faults: FAULTS, maps: byId("map").data.length}), {id: "found"})), 1000);
    </script>"""
    seen = browse(texts["none"], tmp_path, probe=probe)
    assert seen == {"faults": [], "maps": 1}


def test_every_step_of_the_gap_has_an_interval(explained, texts):
    gap, ends = explained.verdict.gap, explained.shown.steps
    assert ends.after == pytest.approx(gap.interval.after)
    for size, (low, high) in (
        (gap.as_drawn.excess, ends.as_drawn),
        (gap.retuned.excess, ends.retuned),
        (gap.noise, ends.noise),
    ):
        assert 0 < low < size < high < 10 * size
    assert all(row["interval"] for row in data_of(texts["explained"])["gap"])
    assert "the noise alone is an error of" in texts["explained"]
