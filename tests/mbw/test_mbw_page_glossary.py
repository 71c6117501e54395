"""Explanations on pages: the same words as in the glossary, where the words stand."""

import re
from html import unescape
from pathlib import Path

import pytest
from campaign_folder import write_folder
from small_machine import MJCF
from typer.testing import CliRunner

from mbw.command import app
from mbw.page.glossary import _WORDS, EXPLANATIONS, explain_words

GLOSSARY = Path(__file__).resolve().parents[2] / "docs" / "glossary.md"
TITLES = re.compile(r'<abbr title="([^"]*)">([^<]*)</abbr>')


def entries():
    """Plain text of each entry of the glossary page."""
    text = GLOSSARY.read_text("utf-8")
    for name, body in re.findall(r"^\*\*(.+?)\*\*.*\n:   ((?:.+\n?)+)", text, re.MULTILINE):
        plain = re.sub(r"\$[^$]*\$", "", re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", body))
        yield name, " ".join(plain.replace("`", "").split())


def test_explanations_are_the_beginnings_of_the_glossarys_entries():
    page = dict(entries())
    assert EXPLANATIONS.keys() == _WORDS.keys()
    for name, text in EXPLANATIONS.items():
        assert page[name].startswith(text), name


@pytest.mark.parametrize(
    "word", ["nats", "pull", "MPC", "MAC", "COMAC", "excess", "coherence", "held-out", "Held out"]
)
def test_a_word_is_explained_at_its_first_place_in_a_section(word):
    html = f"<p>The {word} is 3; the {word} again.</p><h2>{word}</h2><p>{word}</p>"
    explained = explain_words(html)
    assert [shown for _, shown in TITLES.findall(explained)] == [word, word]
    assert re.sub(r"</?abbr[^>]*>", "", explained) == html
    assert f"<h2>{word}</h2>" in explained


def test_names_code_and_scripts_are_left_alone():
    html = '<td title="excess">acc1.excess</td><code>excess</code><script>excess</script>'
    html += "<td>nats_of_body, MACHINE, sensor:excess, @pull</td>"
    assert explain_words(html) == html


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    place = tmp_path_factory.mktemp("pages")
    campaign = write_folder(place / "campaign")
    (place / "pair.xml").write_text(MJCF, encoding="utf-8")
    calls = {
        "identify": ("identify", campaign, "identify.html"),
        "tune": ("tune", campaign, "report.html"),
        "predict": ("predict", place / "pair.xml", "predict.html"),
    }
    texts = {}
    for verb, (_, source, name) in calls.items():
        out = place / verb
        done = CliRunner().invoke(app, [verb, str(source), "--out", str(out), "-q"])
        assert done.exit_code == 0, done.stderr
        texts[verb] = (out / name).read_text("utf-8").split("<script>\nconst DATA")[0]
    return texts


@pytest.mark.parametrize(
    ("verb", "words"),
    [("identify", {"MAC", "MPC", "COMAC", "CMIF"}), ("tune", {"excess", "held-out", "pull"})],
)
def test_pages_explain_their_words(pages, verb, words):
    found = TITLES.findall(pages[verb].partition("</script>")[2])
    assert words <= {shown for _, shown in found}
    assert {unescape(title) for title, _ in found} <= set(EXPLANATIONS.values())
