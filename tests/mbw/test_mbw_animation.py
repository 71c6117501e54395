"""Modes as animated pictures: ``mbw identify --animate`` and ``mbw view --out``."""

import json
import os
import sys

import numpy as np
import pytest
from campaign_folder import write_folder
from PIL import Image, ImageSequence

from mbmodel import as_drawn, load_machine, model_modes
from mbw.animation.draw import FRAME_S, FRAMES
from tests.helpers.command import invoke as mbw


def pictures_of(path):
    with Image.open(path) as file:
        return [
            (np.asarray(frame.convert("RGB"), float), frame.info.get("duration"))
            for frame in ImageSequence.Iterator(file)
        ]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("small") / "campaign", lines=121)


@pytest.fixture(scope="module")
def animated(folder, tmp_path_factory):
    place = tmp_path_factory.mktemp("animated")
    outcome = mbw(
        "identify", folder, "--out", place / "result", "--no-pictures",
        "--animate", 2, place / "mode 2.gif", "--animate", 1, place / "mode1.png",
        "--animate", 1, place / "mode1.webp",
    )  # fmt: skip
    assert outcome.exit_code == 0, outcome.stderr
    return place, outcome.stderr


def moves(pictures):
    """Largest share of pixels that differ from the first picture, below the caption."""
    first = pictures[0][0][60:]
    return [float((np.abs(image[60:] - first).max(axis=2) > 40).mean()) for image, _ in pictures]


def test_a_mode_becomes_a_gif_that_moves_and_returns(animated):
    pictures = pictures_of(animated[0] / "mode 2.gif")
    assert len(pictures) == FRAMES
    assert {image.shape for image, _ in pictures} == {(600, 800, 3)}
    assert {duration for _, duration in pictures} == {1000 * FRAME_S}
    assert all((image[[0, -1]][:, [0, -1]] == 255).all() for image, _ in pictures)  # white corners
    change = moves(pictures)
    assert max(change) > 0.005
    assert np.argmax(change) in range(FRAMES // 3, 2 * FRAMES // 3 + 1)  # half a cycle later
    assert change[-1] < 0.5 * max(change)
    assert "mode 2 in" in animated[1]


def test_several_modes_and_kinds_come_from_one_call(animated):
    (still,) = pictures_of(animated[0] / "mode1.png")
    assert still[0].shape == (600, 800, 3)
    assert len(pictures_of(animated[0] / "mode1.webp")) == FRAMES


def test_the_machine_is_in_the_picture_below_its_caption(animated):
    image = pictures_of(animated[0] / "mode1.png")[0][0]
    dark = image.min(axis=2) < 200
    assert dark[:40, :400].any()  # the caption
    assert dark[60:].mean() > 0.01
    assert not dark[[0, -1]].any()  # nothing is cut off
    assert not dark[:, [0, -1]].any()


def test_without_opengl_the_edges_are_drawn_and_a_message_says_so(folder, tmp_path, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disable")
    outcome = mbw(
        "identify", folder, "--out", tmp_path / "result", "--no-pictures",
        "--animate", 1, tmp_path / "mode1.gif",
    )  # fmt: skip
    assert outcome.exit_code == 0, outcome.stderr
    assert "as outlines: MuJoCo cannot render here" in " ".join(outcome.stderr.split())
    pictures = pictures_of(tmp_path / "mode1.gif")
    assert len(pictures) == FRAMES
    assert max(moves(pictures)) > 0.002


LAYOUT = """\
[body.base]
[body.head]
"""


def test_a_campaign_without_a_model_shows_its_sensors(folder, tmp_path):
    """Two bodies of three sensors each: lines from the centres of mass to the sensors move."""
    place = tmp_path / "bare"
    place.mkdir()
    (place / "impact.mat").write_bytes((folder / "impact.mat").read_bytes())
    text = (folder / "campaign.toml").read_text("utf-8")
    (place / "campaign.toml").write_text(
        text.replace('model = "model.xml"', 'layout = "layout.toml"'), encoding="utf-8"
    )
    layout = load_machine(folder / "model.xml").layout
    sites = "".join(
        f"[site.{name}]\nposition = {layout.positions[k].tolist()}\n"
        f'body = "{layout.body_name(name)}"\n'
        for k, name in enumerate(layout.points)
        if name.startswith("acc")
    )
    (place / "layout.toml").write_text(LAYOUT + sites, encoding="utf-8")
    outcome = mbw(
        "identify", place, "--out", tmp_path / "result", "--no-pictures",
        "--animate", 1, tmp_path / "mode1.gif",
    )  # fmt: skip
    assert outcome.exit_code == 0, outcome.stderr
    assert "cannot render" not in outcome.stderr  # nothing was expected
    pictures = pictures_of(tmp_path / "mode1.gif")
    assert len(pictures) == FRAMES
    assert max(moves(pictures)) > 0.001


FAKE_FFMPEG = """#!{python}
import sys
pixels = sys.stdin.buffer.read()
size = sys.argv[sys.argv.index("-s") + 1]
open(sys.argv[-1], "w").write(size + " " + str(len(pixels)))
"""


@pytest.mark.skipif(os.name == "nt", reason="a script stands for ffmpeg")
def test_a_video_is_what_ffmpeg_makes_of_the_pixels(folder, tmp_path, monkeypatch):
    fake = tmp_path / "bin" / "ffmpeg"
    fake.parent.mkdir()
    fake.write_text(FAKE_FFMPEG.format(python=sys.executable), encoding="utf-8")
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", str(fake.parent))
    model = folder / "model.xml"
    outcome = mbw("view", model, "--mode", 1, "--out", tmp_path / "mode.mp4")
    assert outcome.exit_code == 0, outcome.stderr
    size, length = (tmp_path / "mode.mp4").read_text("utf-8").split()
    width, height = map(int, size.split("x"))
    assert int(length) % (3 * width * height) == 0
    assert int(length) // (3 * width * height) % FRAMES == 0
    fake.write_text(f"#!{sys.executable}\nraise SystemExit('no encoder')", encoding="utf-8")
    outcome = mbw("view", model, "--mode", 1, "--out", tmp_path / "other.webm")
    assert outcome.exit_code == 3
    assert "ffmpeg failed (no encoder)" in " ".join(outcome.stderr.split())


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        (("--animate", "3"), 2, "does not state a mode and a file"),
        (("--animate", "first", "a.gif"), 2, "does not state a mode and a file"),
        (("--animate", "1", "a.doc"), 2, "ends in .gif, .webp, .mp4, .webm or .png"),
        (("--animate", "1", "gone/a.gif"), 3, "name a file in a folder that exists"),
        (("--animate", "99", "a.gif"), 2, "modes were identified in this band"),
        (("--animate", "1", "a.mp4"), 3, "needs the program ffmpeg"),
    ],
)
def test_what_cannot_be_animated_is_refused_in_a_sentence(
    folder, tmp_path, monkeypatch, words, code, sentence
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))
    outcome = mbw("identify", folder, "--out", tmp_path / "result", "--no-pictures", *words)
    assert outcome.exit_code == code
    assert sentence in " ".join(outcome.stderr.split())
    assert not (tmp_path / "a.gif").exists()
    assert not (tmp_path / "result").exists()


def test_view_writes_a_mode_of_the_model_and_names_it(folder, tmp_path):
    model = folder / "model.xml"
    outcome = mbw("view", model, "--mode", 2, "--out", tmp_path / "mode2.gif", "--json", "-")
    assert outcome.exit_code == 0, outcome.stderr
    drawn = as_drawn(load_machine(model))
    modes = model_modes(drawn, drawn.drawn)
    content = json.loads(outcome.stdout)
    assert content["frequency"] == pytest.approx(modes.freq_hz[1])
    pictures = pictures_of(tmp_path / "mode2.gif")
    assert len(pictures) == FRAMES
    assert max(moves(pictures)) > 0.003


def test_view_writes_the_machine_at_rest(folder, tmp_path):
    outcome = mbw("view", folder / "model.xml", "--out", tmp_path / "rest.png")
    assert outcome.exit_code == 0, outcome.stderr
    assert len(pictures_of(tmp_path / "rest.png")) == 1
    again = mbw("view", folder / "model.xml", "--out", tmp_path / "rest.png")
    assert again.exit_code == 3
    assert "replace it with --overwrite" in " ".join(again.stderr.split())
    assert (
        mbw("view", folder / "model.xml", "--mode", 99, "--out", tmp_path / "a.png").exit_code == 2
    )


def test_view_without_a_display_says_so_in_one_sentence(folder, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    if sys.platform.startswith("linux"):
        outcome = mbw("view", folder / "model.xml")
        assert outcome.exit_code == 3
        assert "write a picture instead with --out view.gif" in " ".join(outcome.stderr.split())
