"""The workbench's page in a real browser: it follows its sliders, in every look."""

from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, open_tab
from campaign_folder import write_folder
from diagnosed import diagnose_rotor
from small_machine import MJCF
from typer.testing import CliRunner
from workbench_server import serve

from mbw.command import app
from mbw.output_folder import ResultOptions
from mbw.workbench.opening import open_subject
from mbw.workbench.saving import save_state
from mbw.workbench.state import Move

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
READY = "document.documentElement?.dataset.ready"
LOOKS = {
    "wide": {"width": 1280, "height": 800},
    "dark": {"width": 1280, "height": 800, "dark": True},
    "narrow": {"width": 390, "height": 844},
    "narrow and dark": {"width": 390, "height": 844, "dark": True},
}
SLIDER = "document.querySelector('#groups input[type=range]')"
FIGURE = "document.querySelector('#figures strong').textContent"
HEAD_HZ = "document.querySelectorAll('#mode-rows tr')[2].cells[1].textContent"


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    place = write_folder(tmp_path_factory.mktemp("page") / "campaign")
    for verb in ("identify", "tune"):
        run = CliRunner().invoke(app, [verb, str(place), "--quiet", "--no-pictures"])
        assert run.exit_code in (0, 4), run.output
    return place.with_name("campaign-tuned")


@pytest.fixture(scope="module")
def server(results, tmp_path_factory):
    def save(desk):
        outputs = ResultOptions(results.with_name("saved"), overwrite=True)
        return save_state(desk.subject, desk.state, outputs)

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("states")))
        with serve(open_subject(results, None, None), save=save) as server:
            yield server


@pytest.fixture(scope="module")
def tab():
    with open_tab("--enable-unsafe-swiftshader") as tab:
        yield tab


@pytest.fixture
def page(server, tab):
    """The page as tuned, in a wide window, which no script of another place may disturb."""
    tab.show(server.address)
    tab.wait(READY)
    yield tab
    assert tab.run("FAULTS") == []
    tab.run("document.getElementById('as-tuned').click()")
    tab.wait(f"{SLIDER}.closest('.row').querySelector('.tuned')")


def pixels(tab, colour):
    """Number of pixels of the plot that have a colour of the page."""
    return tab.run(f"""(() => {{
      const canvas = document.getElementById("plot"), probe = document.createElement("canvas");
      probe.width = probe.height = 1;
      const ink = probe.getContext("2d");
      ink.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--{colour}");
      ink.fillRect(0, 0, 1, 1);
      const [r, g, b] = ink.getImageData(0, 0, 1, 1).data;
      const all = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
      let count = 0;
      for (let k = 0; k < all.length; k += 4)
        count += Math.abs(all[k] - r) + Math.abs(all[k + 1] - g) + Math.abs(all[k + 2] - b) < 12;
      return count;
    }})()""")


def test_curves_modes_and_misfit_follow_a_slider_moved_by_keys(page):
    before = page.run(f"[{FIGURE}, {HEAD_HZ}, {SLIDER}.ariaValueText, {SLIDER}.value]")
    assert min(pixels(page, name) for name in ("measured", "drawn", "current")) > 30
    page.run(f"{SLIDER}.focus()")
    for _ in range(40):
        page.press("ArrowRight", code=39)
    page.wait(f"{FIGURE} !== {before[0]!r}")
    after = page.run(f"[{FIGURE}, {HEAD_HZ}, {SLIDER}.ariaValueText, {SLIDER}.value]")
    assert float(after[3]) > float(before[3])
    assert after[2] != before[2]
    page.wait("!document.getElementById('undo').disabled")


def test_undo_and_redo_by_keys_bring_the_figures_back(page):
    first = page.run(FIGURE)
    page.run(f"{SLIDER}.focus()")
    for _ in range(30):
        page.press("ArrowLeft", code=37)
    page.wait(f"{FIGURE} !== {first!r} && !document.getElementById('undo').disabled")
    page.run("document.getElementById('plot').focus()")
    for _ in range(30):
        page.press("z", modifiers=2)
    page.wait(f"{FIGURE} === {first!r}")
    page.press("Z", modifiers=10)
    page.wait(f"{FIGURE} !== {first!r}")


def test_as_drawn_and_a_typed_value_are_the_model_s_own_numbers(page):
    page.run("document.getElementById('as-drawn').click()")
    page.wait("document.getElementById('as-drawn').disabled")
    subject = open_subject(Path(page.run("document.getElementById('subtitle').title")), None, None)
    drawn = subject.parametrisation.fixed[subject.parametrisation.free][0]
    field = "document.querySelector('#groups .value')"
    assert float(page.run(f"{field}.value")) == pytest.approx(drawn, rel=1e-3)
    typed = 1.5 * drawn
    page.run(f"(f => {{ f.value = '{typed}'; f.dispatchEvent(new Event('change')); }})({field})")
    page.wait(f"{SLIDER}.ariaValueText.includes('1.50')")
    assert float(page.run(f"{SLIDER}.value")) == pytest.approx(np.log(1.5), abs=5e-3)


def test_a_click_on_a_sensor_chooses_the_output(page):
    spot = page.run("""(() => {
      const dot = document.querySelector("#marks i.sensor").getBoundingClientRect();
      return [dot.x + dot.width / 2, dot.y + dot.height / 2];
    })()""")
    before = page.run("document.getElementById('channel').value")
    for kind in ("mousePressed", "mouseReleased"):
        page.send(
            "Input.dispatchMouseEvent", type=kind, x=spot[0], y=spot[1], button="left", clickCount=1
        )
    page.wait(f"document.getElementById('channel').value !== {before!r}")
    point = page.run("document.getElementById('channel').value").partition(":")[0]
    page.wait(f"document.querySelector('#marks span.channel').textContent.includes({point!r})")
    assert point in page.run("decodeURIComponent(location.hash)")


def test_another_window_s_action_is_shown_here(page, server):
    desk = server.page.desk
    name = desk.subject.parametrisation.names[0]
    desk.act(desk.history.revision, Move(values={name: 0.9}))
    page.wait(f"Math.abs({SLIDER}.value - 0.9) < 0.01")


def test_the_model_is_saved_and_the_page_says_where(page, results):
    page.run("document.getElementById('save').click()")
    page.wait("document.getElementById('status').textContent.includes('campaign.toml are in')")
    assert (results.with_name("saved") / "model.xml").is_file()


ADD = "[...document.querySelectorAll('#adders button')].find(e => e.textContent.includes({!r}))"
NEW_MODE = "[...document.querySelectorAll('#mode-rows tr')].find(row => !row.cells[2].textContent)"


def test_an_appendage_is_added_tried_out_by_its_slider_and_undone(page):
    modes = page.run("document.querySelectorAll('#mode-rows tr').length")
    page.run(f"{ADD.format('Appendage')}.click()")
    page.wait(f"document.querySelectorAll('#mode-rows tr').length === {modes + 3}")
    page.wait("document.querySelector('#marks i.edit')?.textContent === 'appendage1'")
    before = float(page.run(f"{NEW_MODE}.cells[1].textContent"))
    page.run("document.getElementById('appendage1-frequency').focus()")
    for _ in range(30):
        page.press("ArrowRight", code=39)
    page.wait(f"Number({NEW_MODE}.cells[1].textContent) > {before}")
    page.wait("document.activeElement.id === 'appendage1-frequency'")
    undo = "document.getElementById('undo')"
    page.run(f"addEventListener('painted', () => {{ if (!{undo}.disabled) {undo}.click(); }})")
    page.run(f"{undo}.click()")
    page.wait("!document.querySelector('.edit')")
    assert page.run("document.querySelectorAll('#mode-rows tr').length") == modes


def test_a_size_that_cannot_be_is_refused_and_the_field_shows_the_model_again(page):
    page.run(f"{ADD.format('Appendage')}.click()")
    page.wait("document.getElementById('appendage1-damping')")
    field = "document.getElementById('appendage1-damping').closest('.row').querySelector('.value')"
    typed = "field => { field.value = '1.2'; field.dispatchEvent(new Event('change')); }"
    page.run(f"({typed})({field})")
    status = "document.getElementById('status').textContent"
    page.wait(f"{status}.includes('damping: the value should be less than 1')")
    page.wait(f"{field}.value === '0.03000'")
    page.run("document.querySelector('.edit .reset').click()")
    page.wait(f"!document.querySelector('.edit') && {status} === ''")


def test_a_box_switches_a_cause_off_and_the_gap_comes_back(tab, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    subject = open_subject(diagnose_rotor(tmp_path), None, None)
    excess, box = "Number(document.querySelectorAll('#figures strong')[1].textContent.slice(2))", ""
    with serve(subject) as server:
        tab.show(server.address)
        tab.wait(READY)
        assert "spinning rotor" in tab.run("document.getElementById('headline').textContent")
        box = "document.querySelector('#cause-rows input')"
        assert tab.run(f"{box}.checked")
        whole = tab.run(excess)
        tab.run(f"{box}.click()")
        tab.wait(f"{excess} > {1.5 * whole}")
        tab.run("document.getElementById('as-diagnosed').click()")
        tab.wait(f"{excess} === {whole} && {box}.checked")
        tab.wait("document.querySelector('#marks i.cause')?.textContent === '1'")
        assert tab.run("FAULTS") == []


@pytest.mark.parametrize("look", LOOKS)
def test_every_look_is_for_everybody(server, tab, look):
    tab.show(server.address, **LOOKS[look])
    tab.wait(READY)
    for kind in ("Mass", "Spring", "Appendage"):
        tab.run(f"{ADD.format(kind)}.click()")
        tab.wait(f"document.querySelector('#edit-rows').textContent.includes({kind.lower()!r})")
    assert tab.run("document.documentElement.scrollWidth <= innerWidth")
    assert tab.find_barriers() == []
    assert tab.run("FAULTS") == []


def test_every_control_is_reached_by_keys_and_shows_its_focus(page):
    page.run("document.body.focus(); window.reached = new Set()")
    page.run("addEventListener('focusin', event => reached.add(event.target))")
    chosen = "button:not(:disabled):not([hidden]), select, canvas, #groups details[open] input"
    wanted = f"[...document.querySelectorAll('{chosen}')]"
    for _ in range(page.run(f"{wanted}.length") + 30):
        page.press("Tab", code=9)
    missing = f"{wanted}.filter(e => e.checkVisibility() && !reached.has(e)).map(e => e.outerHTML)"
    assert page.run(missing) == []
    assert page.run("getComputedStyle(document.activeElement).outlineStyle") != "none"


@pytest.mark.parametrize(("still", "pressed"), [(True, "false"), (False, "true")])
def test_modes_move_unless_the_user_wants_less_motion(server, tab, still, pressed):
    tab.show(server.address, still=still)
    tab.wait(READY)
    assert tab.run("document.getElementById('play').ariaPressed") == pressed


def test_nothing_is_asked_of_another_host(page):
    assert page.run("fetch('http://example.org').then(() => 'sent', () => 'refused')") == "refused"
    hosts = {
        event["params"]["request"]["url"].partition("//")[2].partition("/")[0]
        for event in page.events
        if event.get("method") == "Network.requestWillBeSent"
    }
    assert {host for host in hosts if not host.startswith("127.0.0.1:")} <= {"example.org"}
    refused = page.run("FAULTS.splice(0)")
    assert all("example.org" in text for text in refused)
    assert refused


def test_names_of_a_model_stay_text(tab, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "states"))
    bad = "&lt;img src=x onerror=boom()&gt;"
    model = tmp_path / "model.xml"
    model.write_text(MJCF.replace('body name="head"', f'body name="{bad}"'), encoding="utf-8")
    assert bad in model.read_text("utf-8")
    with serve(open_subject(model, None, None)) as server:
        tab.show(server.address)
        tab.wait(READY)
        assert tab.run("document.querySelectorAll('img').length") == 0
        assert tab.run("document.body.textContent.includes('<img src=x')")
        assert tab.run("FAULTS") == []


def test_a_peak_of_one_line_is_drawn_though_fifty_lines_share_a_pixel(page):
    """The curve's highest pixel lies at the peak: in the column of its line, at its magnitude."""
    column, row, top = page.run("""import("/curves.js").then(async ({createPlot}) => {
      const canvas = document.createElement("canvas"), n = 20001, at = 12345;
      canvas.style.cssText = "position: fixed; inset: 0; width: 474px; height: 400px";
      document.body.append(canvas);
      const current = new Float32Array(2 * n).fill(1);
      current[2 * at] = 1000;
      const plot = createPlot(canvas, Array.from({length: n}, (_, k) => k), ["current"], () => {});
      const view = {reference: "", channel: ""};
      plot.show({arrays: {current}, modes: [], view, unit: ""}, false);
      await new Promise(requestAnimationFrame);
      const {data, width} = canvas.getContext("2d").getImageData(0, 0, 474, 400);
      const colour = getComputedStyle(document.documentElement).getPropertyValue("--current");
      const wanted = [1, 3, 5].map(k => parseInt(colour.trim().slice(k, k + 2), 16));
      let found = 0;  // pixels beside the peak's line mix with the ground
      const differs = at => wanted.some((v, k) => Math.abs(data[4 * at + k] - v) > 60);
      while (differs(found) || data[4 * found + 3] < 100) found++;
      canvas.remove();
      const free = 400 - 58, height = 0.72 * free;
      return [found % width, Math.floor(found / width), 20 + 0.15 / 3.35 * height];
    })""")
    assert column == pytest.approx(58 + 12345 / 20000 * 400, abs=2)
    assert row == pytest.approx(top, abs=2.5)
