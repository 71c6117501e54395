"""TOML files of any content: one sentence, whatever stands in them."""

import os

import pytest

from identification import read_settings
from identification.readers.layout import read_layout
from identification.words import InputError

TEST = '[[test]]\nfile = "a.npz"\n'
MODEL = 'model = "model.xml"\n' + TEST
NESTED = 100_000


def settings(tmp_path, content):
    (tmp_path / "campaign.toml").write_bytes(
        content if isinstance(content, bytes) else content.encode()
    )
    return read_settings(tmp_path)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("a = " + "[" * NESTED, "is nested too deeply"),
        ("a." * 5_000 + "b = 1", "is nested too deeply"),
        (MODEL + "averages = " + "9" * 5_000, "integer of thousands of digits: correct it"),
        (MODEL + "averages = " + "9" * 30, "test.1.averages is an integer of more than 64 bits"),
        (MODEL + "averages = 0x" + "f" * 9_000, "test.1.averages is an integer of more than 64"),
        (MODEL + "level = 1e300", r"test.1.level = 1e\+300 is larger than any quantity"),
        (MODEL + "[tolerance]\nmass = 1e31", r"tolerance.mass = 1e\+31 is larger"),
        (MODEL + "level = inf", "test.1.level = inf: Input should be a finite number"),
        (MODEL + "level = true", "test.1.level = True: Input should be a valid number"),
        (MODEL + 'level = "200"', "test.1.level = '200': Input should be a valid number"),
        (MODEL.replace("a.npz", "a\\u0000b"), "test.1.file = .*holds no control characters"),
        (MODEL.replace("a.npz", "a\\nb"), "test.1.file = .*holds no control characters"),
        ('model = "m\\u0000"\n' + TEST, "model = .*holds no control characters"),
        (b"\xff\xfea\0=\0001\0", "is not UTF-8 text, so save it"),
        (MODEL.encode() + b'setup = "\xe9"', "line 4 is not UTF-8 text, so save it"),
        (MODEL + "\0", "TOML syntax"),
        ("", "key test is missing: add it"),
    ],
)
def test_content_that_is_no_campaign_is_one_sentence(tmp_path, content, sentence):
    with pytest.raises(InputError, match=sentence) as caught:
        settings(tmp_path, content)
    assert len(str(caught.value)) < 500


def test_binary_in_a_message_is_cut(tmp_path):
    with pytest.raises(InputError) as caught:
        settings(tmp_path, MODEL + f'level = "{"é" * 100_000}"')
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("kind", ["folder", "pipe", "loop", "device"])
def test_a_campaign_that_is_no_file_is_one_sentence(tmp_path, kind):
    path = tmp_path / "campaign.toml"
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to({"loop": path, "device": "/dev/zero"}[kind])
    with pytest.raises(InputError, match=r"campaign\.toml (is a|cannot be read)"):
        read_settings(tmp_path)


def test_a_link_in_a_loop_as_file_of_a_test_is_read_as_a_name(tmp_path):
    (tmp_path / "a.npz").symlink_to("a.npz")
    assert settings(tmp_path, MODEL)[1].test[0].file == "a.npz"


@pytest.mark.parametrize("value", ["true", '"0.1"', "nan", "1e40"])
@pytest.mark.parametrize("key", ["position", "turn", "centre"])
def test_a_layout_takes_numbers_alone(tmp_path, key, value):
    rows = {"position": "[0, 0, 0]", "turn": "[0, 0, 0]", "centre": "[0, 0, 0]"}
    rows[key] = f"[0, {value}, 0]"
    path = tmp_path / "layout.toml"
    path.write_text(
        f"[body.plate]\ncentre = {rows['centre']}\n"
        f"[site.acc1]\nposition = {rows['position']}\nturn = {rows['turn']}\n"
    )
    with pytest.raises(InputError, match=rf"{key}\.2 (=|is)"):
        read_layout(path)
