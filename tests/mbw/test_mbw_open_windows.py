"""The workbench beside a second window, a hand that hesitates, and values that cannot be."""

import io
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from browser import CHROMIUM, open_tab
from campaign_folder import write_folder
from workbench_server import Browser, serve

from identification.words import InputError
from mbw.workbench.opening import open_subject

ASSETS = Path(__file__).parents[2] / "assets"
READY = "document.documentElement?.dataset.ready"
SLIDER = "document.querySelector('#groups input[type=range]')"
FIELD = "document.querySelector('#groups .value')"
SAID = "document.getElementById('status').textContent"
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")


@pytest.fixture
def campaign(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "states"))
    return write_folder(tmp_path / "campaign")


@pytest.fixture
def window(campaign):
    """A window of the page, and requests of another one."""
    with serve(open_subject(campaign, None, None)) as server, open_tab() as tab:
        other = Browser(server)
        tab.show(server.address)
        tab.wait(READY)
        yield tab, other
        assert tab.run("FAULTS") == []


def move(other, name, x, revision):
    """Move a parameter in the other window."""
    content = {"revision": revision, "action": {"do": "move", "values": {name: x}}}
    assert other.ask("POST", "/act", content)[0] == 200


def drag(tab, *steps):
    """Press the mouse on the thumb of the first slider, move it by some pixels, and release it."""
    box = tab.run(
        f"(({{left, top, width, height}}) => [left + width / 2, top + height / 2])"
        f"({SLIDER}.getBoundingClientRect())"
    )
    kinds = ["mousePressed", *["mouseMoved"] * len(steps), "mouseReleased"]
    for kind, step in zip(kinds, (0, *steps, steps[-1]), strict=True):
        tab.send(
            "Input.dispatchMouseEvent", type=kind, x=box[0] + step, y=box[1], button="left",
            buttons=1, clickCount=1,
        )  # fmt: skip


@needs_browser
def test_a_slider_that_came_back_follows_the_other_window(window):
    tab, other = window
    drawn = tab.run(f"{FIELD}.value")
    drag(tab, 15, 0)
    assert tab.run(f"{FIELD}.value") == drawn
    name = tab.run(f"{SLIDER}.closest('.row').querySelector('label').title")
    move(other, name, 1.0, 0)
    tab.wait(f"{FIELD}.value !== {drawn!r}")
    assert float(tab.run(f"{SLIDER}.value")) == pytest.approx(1.0, abs=0.02)


@needs_browser
def test_a_window_that_was_busy_shows_what_another_did_meanwhile(window):
    tab, other = window
    second = "document.querySelectorAll('#groups .row')[1]"
    name, drawn = tab.run(
        f"[{second}.querySelector('label').title, {second}.querySelector('.value').value]"
    )
    tab.run("""window.original = window.fetch;
      window.fetch = (path, ...more) => path !== "/preview" ? original(path, ...more)
        : new Promise(done => { window.go = () => done(original(path, ...more)); });
      let told = new EventSource("/events");
      told.onmessage = event => { window.newest = Number(event.data.split(" ")[0]); };
      0""")
    tab.run(f"{SLIDER}.stepUp(20); {SLIDER}.dispatchEvent(new Event('input'))")
    move(other, name, 1.0, 0)
    tab.wait("window.newest === 1")
    tab.run("window.fetch = window.original; window.go()")
    tab.wait(f"{second}.querySelector('.value').value !== {drawn!r}")
    tab.run(f"{SLIDER}.dispatchEvent(new Event('change'))")
    tab.wait("Number(document.getElementById('undo').disabled) === 0")
    assert tab.run(SAID) == ""


@needs_browser
@pytest.mark.parametrize("text", ["abc", "", "-5", "1e300"])
def test_a_value_that_cannot_be_is_refused_with_its_bounds(window, text):
    tab, _ = window
    drawn = tab.run(f"{FIELD}.value")
    tab.run(f"{FIELD}.value = {text!r}; {FIELD}.dispatchEvent(new Event('change'))")
    name = tab.run(f"{SLIDER}.closest('.row').querySelector('label').title")
    said = tab.run(SAID)
    assert said.startswith(f'{name} cannot be "{text}": give a number from ')
    low, high = (float(word) for word in (said.split()[-4], said.split()[-2]))
    assert low < float(drawn) < high
    assert tab.run(f"{FIELD}.value") == drawn
    tab.run("document.querySelector('#adders button').click()")
    tab.wait(f"{SAID} === ''")
    point = "document.querySelector('#edit-rows .words.soft input')"
    tab.run(f"{point}.value = ''; {point}.dispatchEvent(new Event('change'))")
    assert "mass1, point: x" in tab.run(SAID)
    assert tab.run(f"{point}.value") == "0.000"


@needs_browser
def test_the_whole_machine_is_in_the_picture(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with (
        serve(open_subject(ASSETS / "hexapod.xml", None, None)) as server,
        open_tab("--enable-unsafe-swiftshader") as tab,
    ):
        tab.show(server.address)
        tab.wait(READY)
        tab.run("document.getElementById('marks').hidden = true")
        tab.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        box = tab.run(
            "(({left, top, width, height}) => [left, top, width, height].map(Math.round))"
            "(document.getElementById('scene').getBoundingClientRect())"
        )
        image = matplotlib.image.imread(io.BytesIO(tab.shot()))
    left, top, width, height = box
    picture = image[top : top + height, left : left + width, :3]
    is_machine = np.abs(picture - picture[0, 0]).max(axis=2) > 0.02
    assert is_machine.mean() > 0.1
    assert not is_machine[[0, 1, -2, -1]].any()
    assert not is_machine[:, [0, 1, -2, -1]].any()


def test_the_diagnosed_curve_of_an_exchanged_channel_is_that_of_its_record():
    subject = open_subject(ASSETS / "gallery" / "gantry-diagnosed", None, None)
    diagnosed, test = subject.stored["diagnosed"], subject.campaign.tests[0]
    for row, output in enumerate(test.estimate.frf.outputs):
        measured = test.estimate.frf.values[:, row, 0]
        curve = diagnosed.values[:, diagnosed.column[subject.tests[0], str(output)]]
        assert np.linalg.norm(curve - measured) < 0.2 * np.linalg.norm(measured), output


def test_a_path_that_is_not_there_and_a_keyframe_of_a_campaign_are_refused(campaign):
    with pytest.raises(InputError, match="nothing does not exist"):
        open_subject(campaign / "nothing", None, None)
    with pytest.raises(InputError, match=r"state key in the campaign\.toml"):
        open_subject(campaign, None, "home")


def test_a_coordinate_that_cannot_be_is_named(campaign):
    with serve(open_subject(campaign, None, None)) as server:
        mass = {"kind": "mass", "name": "mass1", "body": "head", "mass": 1.0}
        wrong = {"do": "put", "edit": {**mass, "point": [0.0, 2e6, 0.0]}}
        _, _, said = Browser(server).ask("POST", "/act", {"revision": 0, "action": wrong})
    assert b"point y: the value should be less than or equal to 1000000" in said
