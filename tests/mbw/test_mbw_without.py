"""``--without``: the page's jobs, the processes of a live test and blind cases carry it on."""

import numpy as np
import pytest
from any_machines import GANTRY
from campaign_folder import write_folder
from live_test import Clock, look
from mbmodel_examples import mass_on_spring, mjcf
from simulate_command import run as simulate
from simulate_command import write_pair_model
from test_mbw_open_jobs import wait
from test_mbw_options import options
from workbench_server import Browser, frame_parts, serve

from identification.words import InputError
from mbmodel import Reading, model_modes, read_as
from mbw.blind import case as blind_case
from mbw.blind.case import BlindCase
from mbw.blind.request import build_request
from mbw.command import VERBS
from mbw.live.findings import FullRefits
from mbw.live.session import LiveSession
from mbw.live.test import MIN_HITS
from mbw.workbench.opening import open_subject
from truth import Choice
from tuning import open_campaign

READ_NO_MODEL = {"demo", "match", "place", "report", "blind merge"}
FRICTION = Reading(("friction",))
RESTING = mjcf(  # on a floor that carries it
    '<geom type="plane" size="1 1 1"/>'
    + mass_on_spring(4, 3e4, 7, pos="0 0 0.0999").replace(
        "<site", '<geom type="box" size="0.1 0.1 0.1"/><site'
    )
)


@pytest.fixture
def state(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def add_friction(folder):
    """Give the first joint of a campaign's model dry friction."""
    model = folder / "model.xml"
    model.write_text(model.read_text().replace("<joint ", '<joint frictionloss="3" ', 1))
    return folder


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_that_reads_a_model_takes_the_option(verb):
    assert ("--without" in options(verb)) == (verb not in READ_NO_MODEL)


def test_the_workbench_and_its_jobs_leave_friction_out(tmp_path, state):
    folder = write_folder(tmp_path / "campaign")
    plain = open_subject(folder, None, None)
    with pytest.raises(InputError, match="frictionloss"):
        open_subject(add_friction(folder), None, None)
    with read_as(FRICTION):
        subject = open_subject(folder, None, None)
        with read_as(Reading(("friction", "gravity"))):
            assert open_subject(folder, None, None).hashes != subject.hashes
        with serve(subject) as server:
            browser = Browser(server)
            # A machine that is written and read by the threads of the server.
            edit = {"kind": "mass", "name": "mass1", "body": "head", "mass": 3.0}
            put = {"revision": 0, "action": {"do": "put", "edit": edit}}
            code, _, frame = browser.ask("POST", "/act", put)
            assert code == 200, frame
            header, _ = frame_parts(frame)
            assert header["modes"][0]["frequency"] < lowest_frequency(plain)
            for verb in ("identify", "tune"):
                assert browser.ask("POST", "/jobs", {"do": "add", "verb": verb})[0] == 200
            jobs = server.page.jobs
            wait(lambda: {job["status"] for job in jobs.list_jobs()} <= {"done", "failed"})
            assert [job["status"] for job in jobs.list_jobs()] == ["done"] * 2, jobs.list_jobs()


def lowest_frequency(subject):
    poles = model_modes(subject.model, subject.model.drawn).poles
    return np.abs(poles).min() / (2 * np.pi)


def test_a_live_test_hands_the_option_to_its_processes(tmp_path, state):
    hits = ["--hits", MIN_HITS, "--seed", 2, "--live", 0, "--rate", 512, "--block", 1]
    hits += ["--hammer", "acc1:+tx", "--no-pictures", "--out", tmp_path / "test", "--quiet"]
    simulate(write_pair_model(tmp_path), *hits)
    add_friction(tmp_path / "test")
    said, clock = [], Clock()
    with read_as(FRICTION):
        session = LiveSession.open(tmp_path / "test", said.append)
        look(session, clock)
        refits = FullRefits(tmp_path / "refits", said.append)
        refits.ask(session.test, session.sheet)
        wait(lambda: session.step() or session.findings)
    wait(refits._queue.list_jobs)
    (job,) = refits._queue.list_jobs()
    assert job["reading"] == ("--without", "friction")
    refits.close()
    session.close()
    assert not [text for text in said if text.startswith("no ")]


@pytest.mark.parametrize(
    ("text", "before", "option", "kind"),
    [
        (RESTING, "<option", '<option><flag contact="disable"/></option>', "contact"),
        (GANTRY, "<default>\n", '<option gravity="0 0 0"/>', "gravity"),
    ],
)
def test_a_blind_case_is_that_of_a_model_written_without_the_kind(
    tmp_path, text, before, option, kind
):
    frfs, requests, twin = [], [], text.replace(before, option + before)
    for name, content, without in (("full", text, (kind,)), ("twin", twin, ())):
        path = tmp_path / f"{name}.xml"
        path.write_text(content)
        case = BlindCase(str(path), 3, 0, tmp_path / name, None, Choice(("none",)), None, without)
        with read_as(Reading(without)):
            requests.append(build_request(str(path), 3, None))
            blind_case._draw(case)
        frfs.append(open_campaign(case.campaign)[2].tests[0].estimate.frf.values)
    assert twin != text
    np.testing.assert_array_equal(*frfs)
    assert [request.get("without") for request in requests] == [[kind], None]
