"""``mbw blind CAMPAIGN``: the user's channels, hits, motors, noise, tolerances and choice."""

import json
import re
import tomllib
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from any_machines import SERVO_AXIS
from browser import CHROMIUM, browse
from servo_campaign import AVERAGES, FREQ, REFERENCES, noise_of, request, write_servo_campaign
from typer.testing import CliRunner

from identification.words import InputError, Signal
from mbmodel import FrfRequest, as_drawn, linearise, load_machine
from mbw.blind import case as blind_case
from mbw.blind.case import BlindCase
from mbw.blind.user_test import read_user_test
from mbw.blind.verb import read_choice
from mbw.command import app
from truth import Choice, draw_case, write_campaign
from truth.campaign.case_design import deal_cards
from truth.campaign.draw import NO_TOLERANCE
from truth.campaign.machine_on_test import TrueMachine
from truth.campaign.measure import hammer_tests
from truth.campaign.protocol import takes
from truth.campaign.virtual_test import Plan, draw_machines, hammers_of
from truth.errors import NoPlaceError
from tuning import open_campaign, open_session

RUNNER = CliRunner()


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """A campaign from a hammer and from a motor."""
    return write_servo_campaign(tmp_path_factory.mktemp("own"))


@pytest.fixture(scope="module")
def drawn(campaign, tmp_path_factory):
    """One case of that test, as a campaign's folder, with its answer."""
    place = tmp_path_factory.mktemp("drawn")
    case = BlindCase(str(campaign), 3, 0, place, None, Choice(("mass_error",), ("body:slide",)))
    blind_case._draw(case)
    return case


def test_a_case_has_the_users_channels_references_levels_and_tolerances(campaign, drawn):
    own = open_campaign(campaign)[2]
    virtual = open_campaign(drawn.campaign)[2]
    assert virtual.inputs == own.inputs
    for mine, theirs in zip(own.tests, virtual.tests, strict=True):
        assert theirs.estimate.frf.outputs == mine.estimate.frf.outputs
        assert theirs.condition.reference == mine.condition.reference
        assert theirs.condition.level_n == mine.condition.level_n
        assert theirs.condition.hammer == mine.condition.hammer
        assert theirs.estimate.averages == mine.estimate.averages
    assert virtual.tolerance == own.tolerance
    np.testing.assert_allclose(virtual.freq_hz, own.freq_hz)
    model = drawn.campaign / tomllib.loads((drawn.campaign / "campaign.toml").read_text())["model"]
    assert model.read_text() == SERVO_AXIS


def test_the_noise_is_that_which_was_measured(campaign, drawn):
    own, virtual = (open_campaign(path)[2] for path in (campaign, drawn.campaign))
    for mine, theirs in zip(own.tests, virtual.tests, strict=True):
        ratio = np.sqrt(theirs.estimate.variance.mean(axis=0) / mine.estimate.variance.mean(axis=0))
        np.testing.assert_allclose(ratio, 1, atol=0.15)


def test_frfs_without_effect_and_tolerance_are_those_of_the_model(campaign):
    """Signs of channels and references, motors, and axes of hammer points."""
    test = read_user_test(campaign, None)

    protocol = test.repeated.protocol
    machine = TrueMachine(test.station, hammers_of(test.station, protocol, NO_TOLERANCE, 1))
    files = takes(protocol, test.station, 1)
    model = as_drawn(load_machine(campaign / "axis.xml"))
    for result, reference in zip(
        hammer_tests(machine, protocol, files, 1), REFERENCES, strict=True
    ):
        question = request(result.freq_hz, reference)
        exact = linearise(model, model.drawn, question).values
        sd = noise_of(list(REFERENCES).index(reference), exact)
        assert np.sqrt(np.mean(np.abs((result.frf - exact) / sd) ** 2)) == pytest.approx(1, abs=0.1)


def test_a_chosen_deck_has_effects_places_ratios_and_nothing():
    choice = read_choice(["mass_error", "drift"], ["body:a"], [1.0, 3.0], None, 5.0)
    assert choice.dirt == 5.0
    cards = [card for card, _ in zip(deal_cards(1, choice), range(24), strict=False)]
    assert Counter((card.kind, *card.names, card.ratio) for card in cards) == {
        ("nothing", 0.0): 4,
        ("one", "drift", 1.0): 5,
        ("one", "drift", 3.0): 5,
        ("one", "mass_error", 1.0): 5,
        ("one", "mass_error", 3.0): 5,
    }
    assert {card.location for card in cards if card.names} == {"body:a"}


def test_the_size_of_a_chosen_effect_is_what_the_user_states(campaign):
    test = read_user_test(campaign, None)
    choice = read_choice(["mass_error"], ["body:slide"], [], "mass=2.5", 0.0)
    answers = [
        tomllib.loads(
            draw_case(test.station, 1, number, choice, test.repeated).campaign.answer.decode()
        )
        for number in range(2)
    ]
    masses = [one["parameters"]["mass"] for one in answers if one["effect"] == "mass_error"]
    assert masses == [pytest.approx(2.5)] * len(masses)
    assert masses


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--effect", "gremlin"], "unknown"),
        (["--place", "body:slide"], "--effect"),
        (["--effect", "drift", "--size", "x"], "parameter=value"),
        (["--effect", "drift", "--ratio", "-1"], "more than 0"),
        (["--effect", "drift", "--ratio", "nan"], "more than 0"),
        (["--effect", "drift", "--size", "factor=nan"], "parameter=value"),
        (["--smallest", "--effect", "drift", "--ratio", "2"], "--ratio is for drawn cases"),
        (["--further", "--effect", "drift", "--size", "factor=2"], "--size is for drawn cases"),
        (["--smallest", "--shard", "1/2"], "--shard is for drawn cases"),
    ],
)
def test_a_wrong_choice_is_one_sentence(campaign, tmp_path, options, words):
    result = RUNNER.invoke(app, ["blind", str(campaign), "--out", str(tmp_path / "o"), *options])
    assert result.exit_code == 2
    assert words in result.stderr


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--effect", "mass_error", "--place", "body:lid"], "it has body:frame, body:slide"),
        (["--effect", "mass_error", "--place", "joint:slide"], "as body:<name>"),
        (["--effect", "friction", "--smallest"], "friction has no prediction"),
    ],
)
def test_a_place_or_effect_that_cannot_be_is_said_before_cases_are_drawn(
    campaign, tmp_path, options, words
):
    out = tmp_path / "o"
    result = RUNNER.invoke(app, ["blind", str(campaign), "--out", str(out), *options])
    assert result.exit_code == 3
    assert words in result.stderr
    assert not (out / "cases").exists()


@pytest.mark.parametrize(
    ("channel", "said"),
    [
        ("acc5:+rz", r"acc5:\+rz"),
        ("hook", "its tests read hook, and a blind test repeats sensors jointpos and jointvel"),
    ],
)
def test_a_channel_that_the_virtual_test_lacks_is_refused(campaign, tmp_path, channel, said):
    for path in campaign.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    text = (tmp_path / "campaign.toml").read_text()
    (tmp_path / "campaign.toml").write_text(text.replace("acc5:+tz", channel))
    hook = '<sensor><framepos name="hook" objtype="site" objname="hook_b"/></sensor></mujoco>'
    (tmp_path / "axis.xml").write_text(SERVO_AXIS.replace("</mujoco>", hook))
    with pytest.raises(InputError, match=said):
        read_user_test(tmp_path, None)


def test_the_request_names_campaign_and_choice(campaign, tmp_path, monkeypatch):
    monkeypatch.setattr(blind_case, "_judge", lambda case: None)
    out = tmp_path / "out"
    arguments = ["blind", str(campaign), "--cases", "1", "--out", str(out)]
    result = RUNNER.invoke(app, [*arguments, "--effect", "mass_error", "--ratio", "2"])
    assert "his test" not in result.stderr
    assert "is repeated on true machines" in result.stderr
    asked = json.loads((out / "asked.json").read_text())
    assert asked["choice"]["effects"] == ["mass_error"]
    other = RUNNER.invoke(app, [*arguments, "--effect", "drift"])
    assert other.exit_code == 3
    assert Path(out / "cases" / "0000" / "campaign" / "campaign.toml").is_file()


LOOP = """
[loop.drive]
input = "{input}"
output = "{output}"
controller = {{ zeros = [-60.0], poles = [-900.0], gain = 0.5 }}
delay = 2e-4
"""


def close_loop(campaign, folder, output="joint:drive", motor="servo"):
    for path in campaign.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    sensor = '<sensor><jointpos name="ruler" joint="drive"/></sensor></mujoco>'
    (folder / "axis.xml").write_text(SERVO_AXIS.replace("</mujoco>", sensor))
    text = (folder / "campaign.toml").read_text()
    (folder / "campaign.toml").write_text(text + LOOP.format(output=output, input=motor))
    return read_user_test(folder, None)


def test_frfs_with_a_loop_closed_are_those_of_the_model_with_its_loop(campaign, tmp_path):
    test = close_loop(campaign, tmp_path)
    protocol = test.repeated.protocol
    machine = TrueMachine(test.station, hammers_of(test.station, protocol, NO_TOLERANCE, 1))
    files = takes(protocol, test.station, 1)
    model, without = open_session(tmp_path).model, as_drawn(load_machine(campaign / "axis.xml"))
    differences = []
    for result, reference in zip(
        hammer_tests(machine, protocol, files, 1), REFERENCES, strict=True
    ):
        question = request(result.freq_hz, reference)
        exact = linearise(model, model.drawn, question).values
        opened = linearise(without, without.drawn, question).values
        sd = noise_of(list(REFERENCES).index(reference), opened)
        assert np.sqrt(np.mean(np.abs((result.frf - exact) / sd) ** 2)) == pytest.approx(1, abs=0.1)
        differences.append(np.abs(exact / opened - 1).max())
    assert max(differences) > 0.5  # the loop matters


def test_a_virtual_campaign_of_a_closed_loop_states_the_loop(campaign, tmp_path):
    test = close_loop(campaign, tmp_path)
    choice = read_choice(["mass_error"], ["body:slide"], [], "mass=2.5", 0.0)
    drawn = draw_case(test.station, 1, 0, choice, test.repeated).campaign
    assert tomllib.loads(drawn.files["campaign.toml"].decode())["loop"]["drive"]["delay"] == 2e-4
    plan = Plan(1, protocol=test.repeated.protocol)
    assert all(station.loops == test.station.loops for station in draw_machines(test.station, plan))


def test_a_loop_may_read_a_joint_by_mujocos_sensor(campaign, tmp_path):
    (loop,) = close_loop(campaign, tmp_path, "ruler").station.loops
    s = np.array([30j])
    assert loop.joint == "drive"
    assert loop.stiffness(s) == pytest.approx(0.5 * (s + 60) / (s + 900) * np.exp(-2e-4 * s))


@pytest.mark.parametrize(
    ("output", "motor", "sentence"),
    [
        ("acc5:+tz", "servo", "reads acc5:.tz, but .* one joint: leave it out"),
        ("joint:drive", "joint:drive", "read a joint .* and drive a motor .servo. alone"),
    ],
)
def test_a_loop_that_a_virtual_test_cannot_repeat_is_refused(
    campaign, tmp_path, output, motor, sentence
):
    with pytest.raises(InputError, match=sentence):
        close_loop(campaign, tmp_path, output, motor)


READINGS = ("ruler", "tacho", "joint:slide_rz")
SENSORS = """<sensor><jointpos name="ruler" joint="drive"/><jointvel name="tacho" joint="frame_ry"/>
</sensor></mujoco>"""


@pytest.mark.parametrize("quantity", ["accelerance", "receptance"])
def test_encoders_alone_are_repeated_in_what_they_read(tmp_path, quantity):
    """No accelerometer: a position, a velocity, and a joint in the quantity of the test."""
    path = tmp_path / "axis.xml"
    path.write_text(re.sub(r'"acc(\d)"', r'"p\1x"', SERVO_AXIS).replace("</mujoco>", SENSORS))
    model, ports = as_drawn(load_machine(path)), tuple(Signal(name) for name in READINGS)
    exact = linearise(model, model.drawn, FrfRequest(FREQ, ports, (Signal("servo"),))).values
    of_joint = (2j * np.pi * FREQ) ** 2 if quantity == "receptance" else np.ones(FREQ.size)
    exact[:, 2, 0] /= of_joint
    sd = 1e-3 * np.sqrt(np.mean(np.abs(exact) ** 2, axis=0))
    coherence = np.abs(exact) ** 2 / (np.abs(exact) ** 2 + sd**2 * (AVERAGES - 1))
    np.savez(tmp_path / "t.npz", freq_hz=FREQ, frf=exact, coherence=coherence)
    (tmp_path / "campaign.toml").write_text(
        f'model = "axis.xml"\n[[test]]\nfile = "t.npz"\naverages = {AVERAGES}\nchannels = '
        f'{list(READINGS)}\nreferences = ["servo"]\nquantity = "{quantity}"\n'
    )
    test = read_user_test(tmp_path, (FREQ[0], FREQ[-1]))
    protocol = test.repeated.protocol
    machine = TrueMachine(test.station, hammers_of(test.station, protocol, NO_TOLERANCE, 1))
    (result,) = hammer_tests(machine, protocol, takes(protocol, test.station, 1), 1)
    result.frf[:, 2, 0] /= of_joint
    error = np.sqrt(np.mean(np.abs(result.frf - exact) ** 2, axis=0)) / sd
    np.testing.assert_allclose(error, 1, atol=0.15)
    drawn = draw_case(
        test.station, 1, 0, read_choice(["mass_error"], [], [2.0], None, 0.0), test.repeated
    )
    write_campaign(drawn.campaign, tmp_path / "drawn", sealed=True)
    with pytest.raises(NoPlaceError, match="has no hits"):
        draw_case(test.station, 1, 1, read_choice(["friction"], [], [], None, 0.0), test.repeated)
    (virtual,) = open_campaign(tmp_path / "drawn")[2].tests
    assert tuple(map(str, virtual.estimate.frf.outputs)) == READINGS


PROBE = """<script>
addEventListener("load", () => setTimeout(() => {
  const rows = document.querySelectorAll("#effects tbody tr").length;
  const found = {places: PLACES.length, rows};
  showPlace(PLACES.length - 1);
  found.chosen = byId("chosen").textContent;
  found.confirmed = document.querySelectorAll("#confirmed tbody tr").length;
  found.faults = FAULTS;
  document.body.append(element("pre", JSON.stringify(found), {id: "found"}));
}, 1500));
</script>"""


@pytest.fixture(scope="module")
def smallest(campaign, tmp_path_factory):
    """Predicted sizes of two effects, one of which drawn cases confirm without a diagnosis."""
    out = tmp_path_factory.mktemp("smallest") / "out"
    options = ["--smallest", "--effect", "mass_error", "--effect", "joint_coupling"]
    result = RUNNER.invoke(app, ["blind", str(campaign), "--out", str(out), *options])
    assert result.exit_code == 0, result.stderr
    return out, result


def test_smallest_sizes_are_written_for_every_place(smallest):
    out, result = smallest
    sizes = json.loads((out / "smallest.json").read_text())["sizes"]
    assert {(row["effect"], row["location"]) for row in sizes} == {
        ("mass_error", "body:frame"),
        ("mass_error", "body:slide"),
        ("joint_coupling", "joint:frame"),
    }
    for row in sizes:
        assert row["value"] > 0
        assert f"{row['effect']} at {row['location']}" in result.stdout


def test_quieter_channels_show_smaller_sizes(campaign, smallest, tmp_path):
    for path in campaign.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    for number in range(3):
        arrays = dict(np.load(tmp_path / f"{number}.npz"))
        noise = (1 - arrays["coherence"]) / arrays["coherence"]
        np.savez(tmp_path / f"{number}.npz", **{**arrays, "coherence": 1 / (1 + noise / 100)})
    options = ["--smallest", "--effect", "joint_coupling", "--out", str(tmp_path / "out")]
    assert RUNNER.invoke(app, ["blind", str(tmp_path), *options]).exit_code == 0
    quiet = json.loads((tmp_path / "out" / "smallest.json").read_text())["sizes"]
    usual = json.loads((smallest[0] / "smallest.json").read_text())["sizes"]
    (before,) = (row["value"] for row in usual if row["effect"] == "joint_coupling")
    assert quiet[0]["value"] < 0.9 * before  # the rest is tolerance


def test_confirmed_cases_have_the_predicted_size(campaign, tmp_path, monkeypatch):
    drawn = []

    def judge(case):
        drawn.append(tomllib.loads(case.sealed.read_text()))

    monkeypatch.setattr(blind_case, "_judge", judge)
    out = tmp_path / "out"
    options = ["--confirm", "1", "--cases", "2", "--effect", "mass_error", "--out", str(out)]
    result = RUNNER.invoke(app, ["blind", str(campaign), *options])
    assert result.exit_code == 0, result.stderr
    (confirmed,) = json.loads((out / "smallest.json").read_text())["confirmed"]
    masses = [one["parameters"]["mass"] for one in drawn if one["effect"] != "none"]
    assert masses
    assert masses == [pytest.approx(confirmed["value"], rel=0.02)] * len(masses)
    assert confirmed["found_cases"] == [0, len(masses)]  # no verdict was written


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium")
def test_the_page_shows_places_on_the_machine(smallest, tmp_path):
    page = (smallest[0] / "smallest.html").read_text()
    found = browse(page, tmp_path, probe=PROBE)
    assert found["faults"] == []
    assert found["places"] == 3
    assert found["rows"] >= 1
    assert found["chosen"].partition(":")[0] in ("body", "joint")
