"""Static pages in a real browser: wide and narrow, light and dark, for everybody."""

from pathlib import Path

import pytest
from browser import CHROMIUM, GL, open_tab
from small_machine import MJCF
from typer.testing import CliRunner

from mbw.command import app

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
ROOT = Path(__file__).resolve().parents[2]
LOOKS = [(1280, False), (1280, True), (390, False), (390, True)]
PAPER = {False: "rgb(255, 255, 255)", True: "rgb(18, 22, 29)"}


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """The page of one verb of each kind: measured modes, and modes and FRFs of a model."""
    place = tmp_path_factory.mktemp("pages")
    (place / "pair.xml").write_text(MJCF, encoding="utf-8")
    words = {
        "predict.html": ["predict", str(place / "pair.xml")],
        "identify.html": ["identify", str(ROOT / "assets" / "two_bodies"), "--band", "20", "80"],
    }
    for verb in words.values():
        run = CliRunner().invoke(app, [*verb, "--out", str(place / "out"), "--quiet"])
        assert run.exit_code == 0, run.output
    return {name: (place / "out" / name).as_uri() for name in words}


@pytest.fixture(scope="module")
def tab():
    with open_tab(*GL, "--allow-file-access-from-files") as tab:
        yield tab


@pytest.mark.parametrize(("width", "dark"), LOOKS)
@pytest.mark.parametrize("name", ["predict.html", "identify.html"])
def test_every_look_is_for_everybody(pages, tab, name, width, dark):
    tab.show(pages[name], width, 844, dark=dark)
    tab.wait("document.readyState === 'complete' && document.querySelector('.js-plotly-plot')")
    assert tab.run("getComputedStyle(document.body).backgroundColor") == PAPER[dark]
    assert tab.run("document.documentElement.scrollWidth <= innerWidth")
    assert tab.find_barriers() == []
    assert tab.run("FAULTS") == []


def test_paper_is_white_and_plots_have_the_colours_of_the_page(pages, tab):
    tab.show(pages["predict.html"], dark=True)
    tab.wait("document.readyState === 'complete' && document.querySelector('.js-plotly-plot')")
    paper = "document.querySelector('.js-plotly-plot').layout.paper_bgcolor"
    assert tab.run(paper) == "#12161d"
    tab.send("Emulation.setEmulatedMedia", media="print", features=[])
    assert tab.run("getComputedStyle(document.body).backgroundColor") == PAPER[False]
    tab.send("Emulation.setEmulatedMedia", media="", features=[])
