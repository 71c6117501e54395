"""The workbench without a browser: frames, saving, and who may ask the server."""

import json
import re
import shutil
import signal
import socket
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from campaign_folder import write_folder
from diagnosed import diagnose_rotor
from small_machine import MJCF
from typer.testing import CliRunner
from workbench_server import Browser, frame_parts, serve

from identification.words import InputError, UsageError
from mbmodel import Evaluator, FrfRequest, model_modes, parse_input, parse_output
from mbw.command import app
from mbw.output_folder import ResultOptions
from mbw.workbench.desk import EditedMakers
from mbw.workbench.edits import AddedMass
from mbw.workbench.frames import FrameMaker
from mbw.workbench.opening import open_subject
from mbw.workbench.saving import save_state
from mbw.workbench.state import View
from mbw.workbench.state_log import log_path
from tuning import channel_gaps, open_session, predict, summarise_gaps
from tuning.misfit.modal_misfit import MODAL_STAGES, ModalCost


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("open") / "campaign")


@pytest.fixture(scope="module")
def results(campaign):
    """Folders of mbw identify and mbw tune beside the campaign."""
    for verb in ("identify", "tune"):
        run = CliRunner().invoke(app, [verb, str(campaign), "--quiet", "--no-pictures"])
        assert run.exit_code in (0, 4), run.output
    return campaign.with_name("campaign-tuned")


@pytest.fixture(autouse=True)
def state_home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "states"))
    return tmp_path / "states"


def complexes(numbers):
    return numbers.reshape(-1, 2) @ (1, 1j)


# ---- frames ------------------------------------------------------------------------------------


def test_all_of_a_frame_is_that_of_its_state(campaign):
    subject = open_subject(campaign, None, None)
    state = subject.first_state().move({subject.parametrisation.names[0]: 0.4})
    header, arrays = frame_parts(FrameMaker(subject).make(state))
    theta = subject.parametrisation.theta(state.x(subject.parametrisation.names))
    predicted = predict(subject.model, theta, subject.campaign)
    gap = summarise_gaps(channel_gaps(predicted, subject.campaign))
    assert header["gap"] == {"error": gap.error, "excess": gap.excess, "noise": gap.noise}
    estimate = subject.campaign.tests[0].estimate
    row = [str(dof) for dof in estimate.frf.outputs].index(state.view.channel)
    for name, values in (
        ("current", predicted[0][:, row, 0]),
        ("measured", estimate.frf.values[:, row, 0]),
        ("drawn", predict(subject.model, subject.model.drawn, subject.campaign)[0][:, row, 0]),
    ):
        np.testing.assert_allclose(complexes(arrays[name]), values, rtol=1e-6)
    np.testing.assert_allclose(arrays["deviation"] ** 2, estimate.variance[:, row, 0], rtol=1e-5)
    np.testing.assert_allclose(arrays["coherence"], estimate.coherence[:, row, 0], rtol=1e-6)
    modes = model_modes(subject.model, theta)
    np.testing.assert_allclose([each["frequency"] for each in header["modes"]], modes.freq_hz)
    assert header["key"] == state.key


def test_a_channel_that_was_not_measured_is_predicted(campaign):
    subject = open_subject(campaign, None, None)
    maker, machine = FrameMaker(subject), subject.model.machine
    view = View("acc1:+tx", "head:+rz")
    state = replace(subject.first_state(), view=view)
    header, arrays = frame_parts(maker.make(state))
    request = FrfRequest(
        subject.freq_hz,
        (parse_output(machine, view.channel),),
        (parse_input(machine, view.reference),),
        subject.quantity,
    )
    values = Evaluator(subject.model, request).at(subject.model.drawn).values[:, 0, 0]
    np.testing.assert_allclose(complexes(arrays["current"]), values, rtol=1e-5)
    assert "measured" not in arrays
    assert header["unit"] == "rad/s²/N"
    with pytest.raises(UsageError, match="nowhere"):
        maker.make(replace(state, view=View("acc1:+tx", "nowhere:+tx")))


def test_a_folder_of_results_begins_as_tuned_with_its_curves_and_modes(results):
    subject = open_subject(results, None, None)
    state = subject.first_state()
    header, arrays = frame_parts(FrameMaker(subject).make(state))
    saved = json.loads((results / "tuned.json").read_text("utf-8"))
    theta = subject.parametrisation.theta(state.x(subject.parametrisation.names))
    values = {p.name: v for p, v in zip(subject.model.parameters, theta, strict=True)}
    for row in saved["parameters"]:
        assert values[row["name"]] == pytest.approx(row["tuned"], rel=1e-9, abs=1e-9)
    assert header["gap"]["error"] == pytest.approx(saved["gap"]["sensors"]["tuned"]["error"])
    np.testing.assert_allclose(complexes(arrays["tuned"]), complexes(arrays["current"]), rtol=1e-4)
    pairs = ModalCost(subject.model, subject.measured_modes, MODAL_STAGES[-1]).pairs(theta)
    shown = sorted(row["mac"] for row in header["modes"] if "mac" in row)
    np.testing.assert_allclose(shown, sorted(pairs.mac[pairs.partner >= 0]))
    assert len(shown) > 3


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory):
    return diagnose_rotor(tmp_path_factory.mktemp("diagnosed"))


def test_a_diagnosed_folder_shows_the_model_with_its_causes(diagnosed):
    subject = open_subject(diagnosed, None, None)
    _, arrays = frame_parts(FrameMaker(subject).make(subject.first_state()))
    shown = json.loads((diagnosed / "diagnosis.json").read_text("utf-8"))
    with np.load(diagnosed / "diagnosis.npz") as stored:
        values = stored[shown["plant"]["held_out"]]
    label = subject.first_state().view.channel
    column = [row["output"] for row in shown["channels"]].index(label)
    np.testing.assert_allclose(complexes(arrays["diagnosed"]), values[:, column], rtol=1e-5)


def test_a_cause_is_switched_off_and_on(diagnosed, tmp_path):
    """The page begins at the fit of the diagnosis; without its cause the gap is there again."""
    subject = open_subject(diagnosed, None, None)
    makers, state = EditedMakers(subject, tmp_path), subject.first_state()
    verdict = json.loads((diagnosed / "verdict.json").read_text("utf-8"))
    (row,) = [r for r in verdict["causes"] if r["effect"] == "gyroscopic"]
    shown = subject.verdict.describe(subject.diagnosed_x())
    (cause,) = [each for each in shown["causes"] if "gyroscopic" in each["name"]]
    (name,) = cause["moves"]
    assert (cause["moves"][name], dict(state.coordinates)[name]) == (1.0, 1.0)
    (mark,) = subject.verdict.list_marks(subject.model.machine)
    assert subject.model.machine.layout.bodies[mark["stage"]] == row["location"][len("body:") :]
    gaps = {
        share: frame_parts(makers.of(moved).make(moved))[0]["gap"]["excess"]
        for share in (0.0, 0.5, 1.0)
        for moved in [state.move({name: share})]
    }
    assert gaps[1.0] == pytest.approx(verdict["gap"]["after"]["excess"], rel=0.1)
    assert gaps[0.0] > 1.5 * gaps[1.0]
    assert gaps[0.0] > gaps[0.5] > gaps[1.0]
    heavier = state.add(AddedMass(name="mass1", body="stage1", mass=1.0))
    header, _ = frame_parts(makers.of(heavier).make(heavier))
    assert header["x"][name] == 1.0
    assert makers.of(heavier).subject.limits[name] == (0.0, 1.5)


def test_kept_frames_stay_within_their_bytes(campaign):
    subject = open_subject(campaign, None, None)
    frame_bytes = len(FrameMaker(subject).make(subject.first_state()))
    maker, name = FrameMaker(subject, max_bytes=4 * frame_bytes), subject.parametrisation.names[0]
    for k in range(12):
        maker.make(subject.first_state().move({name: 0.01 * k}))
        assert maker.kept_bytes <= 4 * frame_bytes
    assert maker.kept_bytes > 2 * frame_bytes


# ---- saving ------------------------------------------------------------------------------------


def content(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_what_is_saved_reads_back_as_the_state_and_the_campaign_stays(campaign, tmp_path):
    subject, before = open_subject(campaign, None, None), content(campaign)
    names = [name for name in subject.parametrisation.names if name.endswith("stiffness")]
    state = subject.first_state().move({names[0]: 0.5, names[1]: -0.3})
    sentences = save_state(subject, state, ResultOptions(tmp_path / "saved"))
    assert len(sentences) == 1, sentences
    session = open_session(tmp_path / "saved", (subject.freq_hz[0], subject.freq_hz[-1]))
    theta = subject.parametrisation.theta(state.x(subject.parametrisation.names))
    wanted = predict(subject.model, theta, subject.campaign)
    for saved, meant in zip(
        predict(session.model, session.model.drawn, session.campaign), wanted, strict=True
    ):
        np.testing.assert_allclose(saved, meant, rtol=1e-8)
    assert content(campaign) == before
    run = CliRunner().invoke(app, ["predict", str(tmp_path / "saved/model.xml"), "--modes", "-q"])
    assert run.exit_code == 0


def test_what_an_mjcf_cannot_hold_is_named_with_its_size(campaign, tmp_path):
    subject = open_subject(campaign, None, None)
    state = subject.first_state().move({"acc3.gain_x": 2.0})
    sentences = save_state(subject, state, ResultOptions(tmp_path / "saved"))
    assert "does not hold" in sentences[-1]
    assert "%" in sentences[-1]


def test_a_model_alone_is_saved_and_never_over_what_was_opened(tmp_path):
    model = tmp_path / "model.xml"
    model.write_text(MJCF, encoding="utf-8")
    subject = open_subject(model, (5.0, 90.0), None)
    assert subject.freq_hz[[0, -1]].tolist() == [5.0, 90.0]
    with pytest.raises(UsageError, match="--out"):
        save_state(subject, subject.first_state(), ResultOptions(tmp_path, overwrite=True))
    save_state(subject, subject.first_state(), ResultOptions(None))
    assert (tmp_path / "model-opened" / "model.xml").is_file()
    assert model.read_text("utf-8") == MJCF


def test_a_urdf_is_opened_as_other_verbs_read_it():
    arm = Path(__file__).parents[1] / "field" / "inputs" / "written" / "a_urdf" / "m.urdf"
    subject = open_subject(arm, None, None)
    assert subject.model.parameters[0].name == "j.damping"


def test_what_has_changed_on_the_disk_is_not_saved_beside_what_was_opened(tmp_path):
    model = tmp_path / "model.xml"
    model.write_text(MJCF, encoding="utf-8")
    subject = open_subject(model, None, None)
    model.write_text(f"{MJCF}<!-- later -->", encoding="utf-8")
    with pytest.raises(UsageError, match="has changed since it was opened: open it again"):
        save_state(subject, subject.first_state(), ResultOptions(tmp_path / "saved"))
    assert not (tmp_path / "saved").exists()


# ---- what cannot be opened ---------------------------------------------------------------------


def test_what_cannot_be_opened_is_said_in_one_sentence(campaign, results, tmp_path):
    (tmp_path / "empty").mkdir()
    still = MJCF.replace("stiffness", "margin")
    assert CliRunner().invoke(app, ["open", str(tmp_path / "empty")]).exit_code == 3
    with pytest.raises(InputError, match=r"campaign\.toml, an MJCF or URDF, or a folder"):
        open_subject(tmp_path / "empty", None, None)
    shutil.copytree(results, tmp_path / "moved")
    with pytest.raises(InputError, match="its campaign is missing"):
        open_subject(tmp_path / "moved", None, None)
    (tmp_path / "still.xml").write_text(still, encoding="utf-8")
    with pytest.raises(InputError):
        open_subject(tmp_path / "still.xml", None, None)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        run = CliRunner().invoke(app, ["open", str(campaign), "--port", port, "--no-browser"])
    assert (run.exit_code, "--port" in run.stderr) == (3, True)


# ---- the server --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def served(campaign, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("states")))
        with serve(open_subject(campaign, None, None)) as server:
            yield Browser(server)


def test_the_token_gives_a_strict_cookie_and_leaves_the_address(served):
    path = served.server.address.removeprefix(f"http://{served.server.host}")
    status, headers, _ = served.ask("GET", path, Cookie=None)
    assert (status, headers["Location"]) == (303, "/")
    assert headers["Set-Cookie"].endswith("; HttpOnly; SameSite=Strict; Path=/")
    assert path.partition("=")[2] not in headers["Set-Cookie"]
    for used in (path, "/?token=guess", "/?token="):
        assert served.ask("GET", used, Cookie=None)[0] == 403


@pytest.mark.parametrize("path", ["/", "/main.js", "/session", "/scene", "/frame", "/events"])
@pytest.mark.parametrize(
    "changed",
    [
        {"Cookie": None},
        {"Cookie": "mbw-1=x; ;=;"},
        {"Host": "localhost:80"},
        {"Host": "evil.example"},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},
    ],
    ids=str,
)
def test_nothing_is_read_without_cookie_or_from_another_page(served, path, changed):
    assert served.ask("GET", path, **changed)[0] == 403


@pytest.mark.parametrize(
    "changed",
    [{"Cookie": None}, {"Origin": None}, {"Origin": "http://127.0.0.1:1"}, {"Host": "a.example"}],
    ids=str,
)
def test_nothing_is_done_for_another_page(served, changed):
    before = served.ask("GET", "/frame")[1]["Revision"]
    action = {"revision": int(before), "action": {"do": "look", "mode": 2}}
    assert served.ask("POST", "/act", action, **changed)[0] == 403
    assert served.ask("GET", "/frame")[1]["Revision"] == before


@pytest.mark.parametrize(
    "path", ["/../campaign.toml", "/..%2fcampaign.toml", "//etc/passwd", "/workbench/main.js", "/x"]
)
def test_no_path_of_a_request_is_looked_up_on_the_disk(served, path):
    assert served.ask("GET", path)[0] == 404


def test_every_answer_has_the_policy(served):
    for path in ("/", "/main.js", "/session", "/nowhere"):
        headers = served.ask("GET", path)[1]
        assert headers["Content-Security-Policy"].startswith("default-src 'self';")
        assert "unsafe" not in headers["Content-Security-Policy"]
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Cache-Control"] == "no-store"


@pytest.mark.parametrize(
    ("path", "content", "status", "words"),
    [
        ("/act", {"revision": 0}, 400, "open the page again"),
        ("/act", {"revision": 0, "action": {"do": "delete"}}, 400, "open the page again"),
        ("/preview", {"values": {"nothing": 1.0}}, 422, "nothing is no parameter"),
        ("/preview", {"values": {"base_tx.stiffness": 50.0}}, 422, "outside its bounds"),
        ("/preview", {"values": {"base_tx.stiffness": float("nan")}}, 400, "open the page again"),
        ("/save", {}, 404, "no such task"),
        ("/preview", {"values": {"x": "y" * 2**18}}, 413, "too long"),
    ],
)
def test_wrong_requests_get_a_sentence_and_change_nothing(served, path, content, status, words):
    before = served.ask("GET", "/frame")
    code, _, text = served.ask("POST", path, content)
    assert (code, words in json.loads(text)["error"]) == (status, True), text
    assert served.ask("GET", "/frame")[2] == before[2]


def test_actions_have_one_order_and_stale_ones_are_refused(served):
    revision = int(served.ask("GET", "/frame")[1]["Revision"])
    action = {"revision": revision, "action": {"do": "move", "values": {"base_tx.stiffness": 0.2}}}
    status, headers, frame = served.ask("POST", "/act", action)
    assert (status, int(headers["Revision"])) == (200, revision + 1)
    assert frame_parts(frame)[0]["x"] == {"base_tx.stiffness": 0.2}
    status, _, text = served.ask("POST", "/act", action)
    assert (status, "another window" in json.loads(text)["error"]) == (409, True)
    back = {"revision": revision + 1, "action": {"do": "undo"}}
    assert frame_parts(served.ask("POST", "/act", back)[2])[0]["x"] == {}


def test_a_view_of_what_is_not_there_is_refused_and_not_logged(served):
    before = served.ask("GET", "/frame")[1]["Revision"]
    look = {"revision": int(before), "action": {"do": "look", "channel": "nowhere:+tx"}}
    status, _, text = served.ask("POST", "/act", look)
    assert (status, "nowhere" in json.loads(text)["error"]) == (422, True)
    assert served.ask("GET", "/frame")[1]["Revision"] == before


def test_the_command_serves_until_ctrl_c_and_keeps_its_state(campaign, tmp_path):
    words = [sys.executable, "-m", "mbw", "open", str(campaign), "--no-browser"]
    words += ["--json", str(tmp_path / "end.json")]
    root = Path(__file__).resolve().parents[2]
    for expected in (0.25, 0.25):
        with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, cwd=root) as command:
            line = command.stderr.readline()
            while "http" not in line:
                assert line, "no address"
                line = command.stderr.readline()
            address = re.search(r"http://\S+", line)[0]
            where = type("Server", (), {"address": address, "host": address[7:].partition("/")[0]})
            browser = Browser(where)
            revision = int(browser.ask("GET", "/frame")[1]["Revision"])
            move = {"do": "move", "values": {"base_tx.stiffness": expected}}
            if not revision:
                assert browser.ask("POST", "/act", {"revision": 0, "action": move})[0] == 200
            assert frame_parts(browser.ask("GET", "/frame")[2])[0]["x"] == move["values"]
            command.send_signal(signal.SIGINT)
            said = command.stderr.read()
            assert (command.wait(20), "is kept" in said) == (0, True), said
        assert list(json.loads((tmp_path / "end.json").read_text())["parameters"]) == [
            "base_tx.stiffness"
        ]


def test_another_keyframe_is_another_state_and_another_state_has_another_folder(tmp_path):
    model = tmp_path / "model.xml"
    keys = '<keyframe><key name="up" qpos="0 0 0 0 0 0.1"/></keyframe></mujoco>'
    model.write_text(MJCF.replace("</mujoco>", keys), encoding="utf-8")
    plain, raised = (open_subject(model, None, key) for key in (None, "up"))
    paths = [log_path(model, "work", each.first_state()) for each in (plain, raised)]
    assert paths[0] != paths[1]
    save_state(plain, plain.first_state(), ResultOptions(None), "opened-heavy")
    assert (tmp_path / "model-opened-heavy" / "model.xml").is_file()
