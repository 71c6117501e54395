"""What surrounds the command: MuJoCo's renderer, limits of memory, names of files."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mbw.memory_limit import MIN_ADDRESS_SPACE_BYTES, is_out_of_memory

ROOT = Path(__file__).resolve().parents[2]
MODEL = ROOT / "assets" / "two_bodies.xml"


def mbw(*arguments, folder, limit_kb=None, **variables):
    limit = "" if limit_kb is None else f"ulimit -v {limit_kb}; "
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **variables}
    return subprocess.run(
        ["bash", "-c", f'{limit}exec "$@"', "bash", sys.executable, "-m", "mbw", *arguments],
        cwd=folder, env=environment, capture_output=True, check=False, timeout=120,
    )  # fmt: skip


@pytest.mark.parametrize("renderer", ["osmesa", "foo"])
def test_a_renderer_that_cannot_be_loaded_hinders_pictures_alone(tmp_path, renderer):
    done = mbw("predict", MODEL, "--no-pictures", folder=tmp_path, MUJOCO_GL=renderer)
    assert (done.returncode, b"Traceback" in done.stderr) == (0, False), done.stderr
    done = mbw("view", MODEL, "--out", "m.png", folder=tmp_path, MUJOCO_GL=renderer)
    assert done.returncode == 0, done.stderr
    if b"outlines" in done.stderr:  # the library may be there
        assert f"(MUJOCO_GL is {renderer})".encode() in done.stderr


def test_too_little_memory_is_one_sentence(tmp_path):
    done = mbw("predict", MODEL, folder=tmp_path, limit_kb=400_000)
    assert done.returncode == 3
    assert done.stderr.decode() == (
        "mbw: the address space is limited to 410 MB, and mbw needs "
        f"{MIN_ADDRESS_SPACE_BYTES / 1e6:.0f} MB at least: raise the limit (ulimit -v)\n"
    )


def test_a_lack_of_memory_is_known_by_its_cause():
    lack, plain = ImportError("x.so: failed to map segment from shared object"), ImportError("x")
    wrapped = ImportError("numpy cannot be imported")
    wrapped.__cause__ = lack
    assert [is_out_of_memory(e) for e in (MemoryError(), lack, wrapped, plain, None)] == [
        True, True, True, False, False,
    ]  # fmt: skip


@pytest.mark.parametrize("option", ["model", "--out"])
def test_a_path_that_is_no_utf_8_is_refused(tmp_path, option):
    name = b"a\xff.xml"
    arguments = [name] if option == "model" else [MODEL, "--out", name]
    done = mbw("predict", *arguments, folder=tmp_path)
    assert (done.returncode, len(done.stderr.splitlines())) == (3, 1)
    assert b"is no UTF-8 text: rename the file or folder" in done.stderr


def test_a_model_in_a_folder_that_is_no_utf_8_is_refused(tmp_path):
    folder = os.fsencode(tmp_path) + b"/a\xff"
    os.mkdir(folder)
    shutil.copy(MODEL, folder + b"/model.xml")
    done = mbw("predict", "model.xml", "--no-pictures", folder=folder)
    assert done.returncode in (0, 3)  # a relative path is text
    assert b"internal error" not in done.stderr


@pytest.mark.parametrize("mode", ["0", "1"])
def test_umlauts_in_names_are_read_in_every_locale(tmp_path, mode):
    folder = tmp_path / "bücher"
    folder.mkdir()
    text = MODEL.read_text(encoding="utf-8").replace('"stage"', '"bühne"')
    (folder / "größe.xml").write_text(text, encoding="utf-8")
    done = mbw(
        "predict", "bücher/größe.xml", "--json", "-", folder=tmp_path,
        LC_ALL="C", PYTHONUTF8=mode, PYTHONCOERCECLOCALE="0",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "bühne" in json.loads(done.stdout)["bodies"]
