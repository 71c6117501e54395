"""The folder for temporary files: a full disk is named as such, with the folder."""

import errno
import os
import subprocess
import sys
from pathlib import Path
from tempfile import gettempdir

import pytest

from identification.readers import child_process
from identification.words import InputError
from identification.words.file_access import temporary_folder, write_bytes


def full(path):
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


def test_a_full_disk_is_said_with_its_folder(monkeypatch):
    monkeypatch.setenv("TMPDIR", gettempdir())
    said = f"{gettempdir()}, cannot be written .*No space left"
    with pytest.raises(InputError, match=said), temporary_folder() as folder:
        raise full(folder / "x")


def test_a_full_disk_elsewhere_is_not_blamed_on_the_temporary_folder(tmp_path):
    with pytest.raises(OSError, match="elsewhere"), temporary_folder():
        raise full(tmp_path / "elsewhere")
    said = r"^/dev/full/x cannot be written"
    with pytest.raises(InputError, match=said), temporary_folder():
        write_bytes(Path("/dev/full/x"), b"x")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is always full")
def test_a_child_that_cannot_write_says_so_with_a_code_of_its_own(tmp_path):
    script = tmp_path / "reads.py"
    script.write_text("import numpy as np\ndef read(path, most):\n return {'a': np.ones(9)}\n")
    (tmp_path / "full.npz").symlink_to("/dev/full")
    done = subprocess.run(
        [
            *(sys.executable, child_process._MAIN, script, script),
            *("99", tmp_path / "full.npz", "9", str(1 << 32)),
        ],
        capture_output=True, check=False,
    )  # fmt: skip
    assert done.returncode == child_process._CANNOT_WRITE
    assert done.stdout.decode() == os.strerror(errno.ENOSPC)
