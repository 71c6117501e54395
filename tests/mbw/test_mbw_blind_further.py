"""``mbw blind --further``: ranked further tests, confirmed on the same machines."""

import json
import tomllib

import pytest
from browser import CHROMIUM, GL, browse
from servo_campaign import write_servo_campaign
from typer.testing import CliRunner

from mbmodel import load_machine
from mbw.blind import case as blind_case
from mbw.blind import further
from mbw.blind.further import FurtherConfirmation, further_table
from mbw.blind.user_test import find_model
from mbw.command import app
from tuning import open_campaign

RUNNER = CliRunner()
EFFECTS = ["--effect", "mass_error", "--effect", "joint_coupling"]
# One of each kind, and the sensor that the page is asked for.
RANKED = {"sensor acc2", "sensor acc6", "hammer point acc3", "twice the hits", "twice the force"}


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    return write_servo_campaign(tmp_path_factory.mktemp("own"))


def run(path, out, *options):
    return RUNNER.invoke(app, ["blind", str(path), "--further", "--out", str(out), *options])


@pytest.fixture(scope="module")
def confirmed(campaign, tmp_path_factory):
    """Two cases of the best further test, drawn and not diagnosed."""
    cases, list_all = [], further.list_further_tests

    def list_some(*arguments):
        return [test for test in list_all(*arguments) if test.name in RANKED]

    def judge(case):
        cases.append(case)

    out = tmp_path_factory.mktemp("further") / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(blind_case, "_judge", judge)
        patch.setattr(further, "list_further_tests", list_some)
        result = run(campaign, out, *EFFECTS, "--confirm", "1", "--cases", "2")
    assert result.exit_code == 0, result.stderr
    return out, result, cases


def test_every_further_test_is_ranked(confirmed):
    out, result, _ = confirmed
    gains = json.loads((out / "further.json").read_text())["gains"]
    names = {gain["name"] for gain in gains}
    assert names == RANKED
    order = [(gain["findable_before"] - gain["findable"], gain["shrink"]) for gain in gains]
    assert order == sorted(order)
    # A posterior counts a limited number of independent values: tests without news dilute it.
    assert all(0 < gain["shrink"] <= 1.1 for gain in gains)
    shrink = {gain["name"]: gain["shrink"] for gain in gains}
    assert max(shrink["twice the hits"], shrink["twice the force"]) < 1
    for name in names:
        assert f"{name}: " in result.stdout


def test_the_same_machines_are_tested_without_and_with_it(confirmed):
    out, _, cases = confirmed
    (row,) = json.loads((out / "further.json").read_text())["confirmed"]
    answers = {}
    for case in cases:
        answer = tomllib.loads(case.sealed.read_text())
        tests = len(open_campaign(case.campaign)[2].tests)
        answers.setdefault(case.number, []).append((case.further, answer, tests))
    for before, after in answers.values():
        assert (before[0], after[0]) == ("", row["name"])
        assert before[1].get("parameters") == after[1].get("parameters")
        assert before[1].get("location") == after[1].get("location")
        added = 3 if row["name"].startswith("hammer point") else 0
        assert after[2] == before[2] + added
    effects = [a[0][1] for a in answers.values() if a[0][1]["effect"] != "none"]
    assert effects
    assert row["found_before"] == [0, len(effects)]  # no verdict was written
    assert effects[0]["effect"] == row["effect"]


PROBE = """<script>
addEventListener("load", () => setTimeout(() => {
  const rows = id => Array.from(document.querySelectorAll(`#${id} tbody tr`));
  const texts = id => rows(id).map(row => row.innerText);
  const sensor = PLACES.findIndex(place => place.name === "sensor acc6");
  const found = {gains: texts("gains"), confirmed: texts("confirmed")};
  const dots = () => byId("picture").data.find(trace => trace.name === "place").x.length;
  found.dots = [dots(), PLACES[0].points.length];
  rows("gains")[sensor].click();
  found.points = PLACES[sensor].points;
  Object.assign(found, {chosen: byId("chosen").textContent, faults: FAULTS});
  found.without = PLACES.filter(place => !place.points.length).map(place => place.name).sort();
  document.body.append(element("pre", JSON.stringify(found), {id: "found"}));
}, 1500));
</script>"""


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium")
def test_the_page_shows_the_ranking_and_the_points(confirmed, campaign, tmp_path):
    out, _, _ = confirmed
    rows = json.loads((out / "further.json").read_text())
    page = browse((out / "further.html").read_text(), tmp_path, *GL, probe=PROBE)
    assert page["faults"] == []
    assert [text.split("\t")[0] for text in page["gains"]] == [
        gain["name"] for gain in rows["gains"]
    ]
    assert page["confirmed"][0].startswith(rows["confirmed"][0]["name"])
    assert page["dots"][0] == page["dots"][1]
    assert page["chosen"] == "sensor acc6"
    layout = load_machine(find_model(campaign)).layout
    expected = layout.positions[layout.points.index("acc6")]
    assert page["points"] == [pytest.approx(expected.tolist())]
    assert page["without"] == ["twice the force", "twice the hits"]


def test_a_confirmation_is_a_sentence_with_both_rates():
    row = FurtherConfirmation(
        "hammer point acc3",
        "mass_error",
        "body:a",
        "mass",
        2.5,
        (3, 10),
        (9, 10),
        (0.1, 0.6),
        (0.6, 0.98),
    )
    assert further_table([], [row]).splitlines()[-1] == (
        "confirmed: hammer point acc3, mass_error at body:a, mass 2.5: found in 3 of 10 cases "
        "(95 %: 10% to 60%) as it is, and in 9 of 10 cases (95 %: 60% to 98%) with it"
    )


@pytest.mark.parametrize(
    ("model", "options", "words"),
    [
        ("trees", [], "--further needs one machine"),
        (None, ["--smallest"], "exclude each other"),
        (
            None,
            ["--place", "body:nowhere", "--effect", "mass_error"],
            "it has body:frame, body:slide",
        ),
    ],
)
def test_what_cannot_be_ranked_is_one_sentence(campaign, tmp_path, model, options, words):
    result = run(model or campaign, tmp_path / "out", *options)
    assert result.exit_code in (2, 3)
    assert words in result.stderr
    assert "Traceback" not in result.stderr
