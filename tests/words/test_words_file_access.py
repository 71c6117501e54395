"""Reading and writing of files that are no files, may not be read, or cannot be written."""

import os
from pathlib import Path

import pytest

from identification.words import InputError
from identification.words.file_access import check_file, read_bytes, read_text, write_text


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("missing", "missing does not exist: name it"),
        ("file/inside", "inside does not exist: name it"),
        ("folder", "folder is a folder, a file of this name does not exist: name it"),
        ("pipe", "pipe is a device or a pipe, a file of this name does not exist: name it"),
        ("loop", "loop cannot be read .Too many levels of symbolic links.: name it"),
        ("a\0b", "cannot be read .embedded null byte.: name it"),
        ("n" * 300, "cannot be read .File name too long.: name it"),
        (
            "/dev/zero",
            "/dev/zero is a device or a pipe, a file of this name does not exist: name it",
        ),
    ],
)
def test_what_is_no_file_is_refused(tmp_path, name, sentence):
    (tmp_path / "file").write_text("x")
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for read in (check_file, read_bytes, read_text):
        with pytest.raises(InputError, match=sentence):
            read(tmp_path / name, "name it")


def test_a_file_that_may_not_be_read_is_refused(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("x")

    def deny(path):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_bytes", deny)
    with pytest.raises(InputError, match=r"file cannot be read \(Permission denied\): name it"):
        read_bytes(tmp_path / "file", "name it")


def test_text_of_another_encoding_is_refused_with_its_line(tmp_path):
    (tmp_path / "file").write_bytes(b"\xef\xbb\xbffirst\r\nsecond\r")
    assert read_text(tmp_path / "file", "name it") == "first\nsecond\n"
    (tmp_path / "file").write_bytes(b"first\nsecond \xe9\n")
    with pytest.raises(
        InputError, match="cannot be read as text: line 2 is not UTF-8 text, so save it"
    ):
        read_text(tmp_path / "file", "name it")


def test_a_text_replaces_a_file_behind_a_link_and_leaves_nothing_else(tmp_path):
    (tmp_path / "file").write_text("old")
    (tmp_path / "link").symlink_to("file")
    write_text(tmp_path / "link", "new")
    assert (tmp_path / "file").read_text() == "new"
    assert (tmp_path / "link").is_symlink()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "link"]


def test_a_device_is_written_and_never_replaced():
    write_text(Path(os.devnull), "text")
    assert not Path(os.devnull).is_file()
    with pytest.raises(InputError, match=r"/dev/full cannot be written \(No space left on device"):
        write_text(Path("/dev/full"), "text")


@pytest.mark.parametrize("name", ["none/file", "a\0b", "n" * 300])
def test_what_cannot_be_written_is_one_sentence(tmp_path, name):
    with pytest.raises(InputError, match=r"cannot be written \(.*\): name another"):
        write_text(tmp_path / name, "text")
    assert not list(tmp_path.iterdir())
