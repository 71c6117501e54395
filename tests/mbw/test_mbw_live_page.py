"""The page of a live test: who may ask its server, what it tells, and how a browser shows it."""

import json
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from urllib.parse import urlencode

import numpy as np
import pytest
from browser import CHROMIUM, open_tab
from live_test import PLACES, Clock, look, play
from workbench_server import Browser, frame_parts

from diagnosis.next_test.provisional import ProvisionalCause
from mbmodel import Evaluator, FrfRequest, as_drawn, load_machine
from mbw.live.findings import Findings, FindingsWorker, FullRefits
from mbw.live.page import LivePage
from mbw.live.session import LiveSession
from mbw.workbench.server import serve_beside

READY = "document.documentElement?.dataset.ready"
LOOKS = [(1280, 800, False), (1280, 800, True), (390, 844, False), (390, 844, True)]


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    return play(tmp_path_factory.mktemp("played"))


@pytest.fixture
def session(played, monkeypatch, tmp_path):
    """A test whose hits have come, with findings that are given."""
    monkeypatch.setattr(FindingsWorker, "ask", lambda *_: None)
    monkeypatch.setattr(FullRefits, "ask", lambda *_: None)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    session = LiveSession.open(played, lambda text: None)
    cause = ProvisionalCause("mass_error", "body:<head>", None, 41.0)
    since = time.monotonic() - 24
    session.findings.append(Findings(PLACES, 6, 0.1, 1.9, True, (cause,), (), {}, since))
    look(session, Clock())
    return session


@pytest.fixture
def served(session):
    with serve_beside(LivePage(session)) as server:
        yield Browser(server)


def ask_state(browser):
    status, _, text = browser.ask("GET", "/live")
    assert status == 200
    return json.loads(text)


def test_the_state_holds_hits_places_advice_and_findings_with_their_age(served, session):
    state = ask_state(served)
    sheet = session.sheet
    assert [hit["accepted"] for hit in state["hits"]] == [hit.is_accepted for hit in sheet.hits]
    assert [place["place"] for place in state["places"]] == [str(place[1]) for place in PLACES]
    assert (state["stop"], state["next"], state["reason"]) == (True, None, session.advice.reason)
    assert [cause["site"] for cause in state["causes"]] == ["mass_error@body:<head>"]
    assert 24 <= state["age_s"] < 120
    assert any("NOT ACCEPTED" in text for text in state["sentences"])


def test_the_frf_of_a_place_and_channel_is_the_estimate_of_its_accepted_hits(served, session):
    estimate = session.sheet.estimates[PLACES[1]].estimate
    labels = [str(output) for output in estimate.frf.outputs]
    model = as_drawn(load_machine(session.test.source.parent / session.test.settings.model))
    for channel, expected in ((labels[-1], labels[-1]), ("nowhere", "acc3:+tx")):
        query = urlencode({"place": 1, "channel": channel})
        header, arrays = frame_parts(served.ask("GET", f"/frf?{query}")[2])
        row = labels.index(expected)
        assert (header["view"]["channel"], header["unit"]) == (expected, "m/s²/N")
        values = arrays["measured"][::2] + 1j * arrays["measured"][1::2]
        np.testing.assert_allclose(values, estimate.frf.values[1:, row, 0], rtol=1e-6)
        np.testing.assert_allclose(arrays["deviation"] ** 2, estimate.variance[1:, row, 0], 1e-5)
        np.testing.assert_allclose(arrays["coherence"], estimate.coherence[1:, row, 0], 1e-6)
        np.testing.assert_allclose(arrays["freq"], estimate.frf.freq_hz[1:], 1e-6)
        ports = (estimate.frf.outputs[row],), (PLACES[1][1],)
        tau, freq = estimate.window_tau, estimate.frf.freq_hz[1:]
        request = FrfRequest(freq, *ports, "accelerance", window_tau=tau)
        drawn = Evaluator(model, request).at(model.drawn).values[:, 0, 0]
        current = arrays["current"][::2] + 1j * arrays["current"][1::2]
        np.testing.assert_allclose(current, drawn, rtol=1e-5)
    for number in ("9", "-1", "x"):
        assert frame_parts(served.ask("GET", f"/frf?place={number}")[2])[1] == {}


def test_a_decision_counts_and_all_windows_hear_of_it(served, session):
    hit = next(hit for hit in session.sheet.hits if not hit.is_accepted)
    version, heard = session.version, []
    page = served.server.page
    window = threading.Thread(target=lambda: heard.append(page.wait((version,), 20)))
    window.start()
    assert served.ask("POST", "/decide", {"hit": hit.key, "accepted": True})[0] == 200
    window.join(20)
    assert heard[0][0] > version
    row = next(row for row in ask_state(served)["hits"] if row["hit"] == hit.key)
    assert (row["accepted"], row["decision"], row["reason"]) == (True, True, hit.reason)


@pytest.mark.parametrize(
    ("task", "content", "status"),
    [
        ("decide", {"hit": "nothing", "accepted": True}, 422),
        ("decide", {"hit": "nothing"}, 400),
        ("decide", {"hit": "x", "accepted": True, "path": "/"}, 400),
        ("act", {}, 404),
    ],
)
def test_wrong_requests_change_nothing(served, session, task, content, status):
    version = session.version
    assert served.ask("POST", f"/{task}", content)[0] == status
    assert session.version == version


@pytest.mark.parametrize("path", ["/", "/live.js", "/live", "/frf?place=0", "/events"])
@pytest.mark.parametrize(
    "changed", [{"Cookie": None}, {"Host": "evil.example"}, {"Origin": "http://evil.example"}]
)
def test_nobody_else_reads_or_decides(served, session, path, changed):
    assert served.ask("GET", path, **changed)[0] == 403
    hit = session.sheet.hits[0]
    decision = {"hit": hit.key, "accepted": not hit.is_accepted}
    assert served.ask("POST", "/decide", decision, **changed)[0] == 403
    assert session.test.decisions == {}
    for elsewhere in ("/main.js", "/frame", "/../campaign.toml"):
        assert served.ask("GET", elsewhere)[0] == 404


def test_the_command_prints_the_address_and_serves_until_ctrl_c(played, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    words = [sys.executable, "-m", "mbw", "live", str(played), "--out", str(tmp_path / "out")]
    root = Path(__file__).resolve().parents[2]
    with subprocess.Popen(
        [*words, "--no-browser"], stderr=subprocess.PIPE, text=True, cwd=root
    ) as command:
        said = ""
        while "page of the test: http" not in said:
            line = command.stderr.readline()
            assert line, said
            said += line
        address = re.search(r"http://\S+", said)[0]
        where = type("Server", (), {"address": address, "host": address[7:].partition("/")[0]})
        assert ask_state(Browser(where))["name"] == played.name
        command.send_signal(signal.SIGINT)
        said += command.stderr.read()
        assert (command.wait(60), "the test is ended" in said) == (0, True), said


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
def test_a_browser_shows_the_test_and_decides_by_keys_in_every_look(served, session):
    last = "document.getElementById('last').textContent"
    cells = "[...document.querySelectorAll('#{} td')].map(cell => cell.textContent).join(' ')"
    with open_tab() as tab:
        for width, height, dark in LOOKS:
            tab.show(served.server.address, width, height, dark=dark)
            tab.wait(READY)
            assert tab.run("document.documentElement.scrollWidth <= innerWidth")
            tab.run("document.querySelector('#remarks').open = true")
            assert tab.find_barriers() == []
        assert tab.run("document.getElementById('sign').textContent") == "STOP"
        assert session.sheet.hits[-1].key in tab.run(last)
        assert "body:<head>" in tab.run("document.getElementById('cause-rows').textContent")
        assert re.search(r"6 hits, \d+ s old", tab.run("document.body.textContent"))
        assert "3 of 3" in tab.run(cells.format("place-rows"))
        assert float(tab.run(cells.format("readout")).split()[0]) > 0
        refused = [hit for hit in session.sheet.hits if not hit.is_accepted][-1]
        tab.press("b")
        tab.wait(f"{cells.format('hit-rows')}.includes('taken back: ')")
        assert session.test.decisions == {refused.key: True}
        accepted = [hit for hit in session.sheet.hits if hit.is_accepted][-1]
        tab.press("w")
        tab.wait(f"{cells.format('hit-rows')}.includes('withdrawn')")
        assert session.test.decisions[accepted.key] is False
        shown = "document.querySelector('#place-rows [aria-pressed=true]').textContent"
        tab.run("(e => { e.focus(); e.click(); })(document.querySelector('#place-rows button'))")
        tab.wait(f"{shown} === 'acc1:+tx' && document.activeElement.textContent === 'acc1:+tx'")
        tab.wait("document.getElementById('channel').value === 'acc1:+tx'")
        assert tab.run("FAULTS") == []
