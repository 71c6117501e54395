"""Variables of .mat and .npz files: as scipy reads them, and never more than a file can hold."""

import io
import os
import zipfile
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse

from identification.readers import child_process, inflation
from identification.readers.array_files import load_arrays
from identification.readers.child_process import read_in_child
from identification.readers.matlab5 import read_matlab5
from identification.words import InputError

MATLAB_73 = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
SCIPY_FILES = sorted((Path(scipy.io.__file__).parent / "matlab/tests/data").glob("*.mat"))


def variables():
    rng = np.random.default_rng(3)
    real = rng.normal(size=(3, 4, 2))
    return {
        "real": real,
        "complex": real + 1j * rng.normal(size=real.shape),
        "single": real.astype("f4"),
        "complex_single": (real + 1j).astype("c8"),
        **{f"whole_{kind}": np.arange(6).astype(kind) for kind in ("i1", "u2", "i4", "u8")},
        "is_odd": np.array([True, False, True]),
        "number": 3.5,
        "empty": np.empty((0, 3)),
        "a_name_of_thirty_one_characters": np.array([[1.0]]),
    }


OTHER_VARIABLES = {
    "text": "acc1",
    "cells": np.array(["x", 3.0], object),
    "structure": {"a": 1.0},
    "sparse": scipy.sparse.csc_array(np.eye(3)),
}


@pytest.mark.parametrize("compressed", [True, False])
def test_numbers_are_read_as_scipy_reads_them(tmp_path, compressed):
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, variables() | OTHER_VARIABLES, do_compression=compressed)
    expected, arrays = scipy.io.loadmat(path), load_arrays(path)
    assert arrays.keys() == variables().keys() | OTHER_VARIABLES.keys() | {"structure/a"}
    for name in variables():
        assert arrays[name].dtype == expected[name].dtype
        np.testing.assert_array_equal(arrays[name], expected[name], strict=True)
    for name in OTHER_VARIABLES:
        assert arrays[name].dtype == object


@pytest.mark.parametrize("compressed", [False, True])
def test_fields_of_structures_have_the_names_before_theirs(tmp_path, compressed):
    path = tmp_path / "a.mat"
    table = np.arange(12.0).reshape(4, 3)
    inner = {"values": table, "label": "x", "dimensions": 3.0}
    several = np.array([(1.0, "a"), (2.0, "b")], dtype=[("value", object), ("unit", object)])
    content = {"log": {"time": np.arange(4.0), "signals": inner}, "rows": several, "none": {}}
    scipy.io.savemat(path, content, do_compression=compressed)
    arrays = load_arrays(path)
    np.testing.assert_array_equal(arrays["log/signals/values"], table)
    np.testing.assert_array_equal(arrays["log/time"].ravel(), np.arange(4.0))
    assert arrays["rows(2)/value"] == 2.0
    assert arrays["log/signals/label"].dtype == object


def test_matrices_of_version_4_are_read_as_scipy_reads_them(tmp_path):
    path = tmp_path / "a.mat"
    matrices = {"real": np.arange(6.0).reshape(2, 3), "complex": np.array([[1 + 2j]]), "text": "x"}
    scipy.io.savemat(path, matrices, format="4")
    arrays = load_arrays(path)
    for name in ("real", "complex"):
        np.testing.assert_array_equal(arrays[name], matrices[name], strict=True)
    assert arrays["text"].dtype == object


@pytest.mark.skipif(not SCIPY_FILES, reason="scipy is installed without the data of its tests")
def test_files_that_matlab_wrote_are_read_as_scipy_reads_them():
    compared = 0
    for path in SCIPY_FILES:
        try:
            expected = scipy.io.loadmat(path)
        except Exception:  # files that are broken on purpose, and version 7.3
            continue
        arrays = read_matlab5(path)
        for name, values in expected.items():
            if name in arrays and isinstance(values, np.ndarray) and values.dtype.kind in "fiuc":
                np.testing.assert_array_equal(arrays[name], values)
                compared += 1
    assert compared > 30


def test_every_changed_byte_of_a_header_is_survived(tmp_path):
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"FRFs": np.ones((2, 2, 3)) + 1j, "freqs": np.arange(3.0)})
    content = path.read_bytes()
    refusals = 0
    for place in range(len(content)):
        for byte in (0, 5, 255, content[place] ^ 1):
            with path.open("r+b") as file:
                file.seek(place)
                file.write(bytes([byte]))
            try:
                load_arrays(path)
            except InputError:
                refusals += 1
        path.write_bytes(content)
    assert refusals > len(content) // 4


@pytest.fixture
def small_limit(monkeypatch):
    """Arrays may take 1 MiB, or a hundred times the bytes of their file."""
    monkeypatch.setattr(inflation, "_MAX_HARMLESS_BYTES", 1 << 20)


def write_matlab_bomb(path):
    inner = io.BytesIO()
    scipy.io.savemat(inner, {"zeros": np.zeros(200_000)})
    packed = zlib.compress(inner.getvalue()[128:], 9)
    tag = np.array([15, len(packed)], "<u4").tobytes()
    path.write_bytes(inner.getvalue()[:128] + tag + packed)


def write_archive_bomb(path):
    np.savez_compressed(path, zeros=np.zeros(200_000))


def write_archive_with_shape(path, shape=(10**12, 8), kind="<f8"):
    with zipfile.ZipFile(path, "w") as archive, archive.open("freq_hz.npy", "w") as file:
        np.lib.format.write_array_header_1_0(
            file, {"descr": kind, "fortran_order": False, "shape": shape}
        )
        file.write(b"\0" * 64)


def write_hdf5(path, fill):
    with h5py.File(path, "w", userblock_size=512) as file:
        fill(file)
    with path.open("r+b") as file:
        file.write(MATLAB_73)


def write_hdf5_bomb(path):
    write_hdf5(path, lambda file: file.create_dataset("FRFs", (10**6, 10**6), "f8", chunks=(8, 8)))


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("bomb.mat", write_matlab_bomb),
        ("bomb.npz", write_archive_bomb),
        ("shape.npz", write_archive_with_shape),
        ("bomb73.mat", write_hdf5_bomb),
    ],
)
def test_arrays_far_larger_than_their_file_are_refused(tmp_path, small_limit, name, write):
    write(tmp_path / name)
    with pytest.raises(InputError, match=r"cannot be read .* save it again"):
        load_arrays(tmp_path / name)


def test_what_compresses_well_is_read_below_the_limit(tmp_path):
    write_matlab_bomb(tmp_path / "a.mat")
    write_archive_bomb(tmp_path / "a.npz")
    for name in ("a.mat", "a.npz"):
        np.testing.assert_array_equal(
            load_arrays(tmp_path / name)["zeros"].ravel(), np.zeros(200_000)
        )


@pytest.mark.parametrize("shape", [(-8,), (7,), (10**30, 0), (True,)])
def test_an_array_whose_shape_does_not_fit_its_bytes_is_refused(tmp_path, shape):
    write_archive_with_shape(tmp_path / "a.npz", shape)
    with pytest.raises(InputError, match="cannot be read"):
        load_arrays(tmp_path / "a.npz")


def link_to_another_file(file):
    file["FRFs"] = h5py.ExternalLink("other.mat", "/FRFs")


def soft_link_through_another_file(file):
    file.create_group("a")["b"] = h5py.ExternalLink("other.mat", "/")
    file["FRFs"] = h5py.SoftLink("/a/b/FRFs")


def external_storage(file):
    file.create_dataset("FRFs", (4,), "f8", external=[("values.bin", 0, 32)])


def virtual_dataset(file):
    layout = h5py.VirtualLayout((4,), "f8")
    layout[:] = h5py.VirtualSource("other.mat", "FRFs", (4,))
    file.create_virtual_dataset("FRFs", layout)


@pytest.mark.parametrize(
    "fill",
    [link_to_another_file, soft_link_through_another_file, external_storage, virtual_dataset],
)
def test_values_in_another_file_are_not_read(tmp_path, fill):
    (tmp_path / "values.bin").write_bytes(np.arange(4.0).tobytes())
    write_hdf5(
        tmp_path / "other.mat", lambda file: file.create_dataset("FRFs", data=np.arange(4.0))
    )
    write_hdf5(tmp_path / "a.mat", fill)
    with pytest.raises(InputError, match=r"FRFs|a/b") as refusal:
        load_arrays(tmp_path / "a.mat")
    assert "is MATLAB v7.3 and cannot be read" in str(refusal.value)


SCRIPTS = {
    "abort": "import os\ndef read(path, size): os.abort()",
    "exit": "def read(path, size): raise SystemExit",
    "hang": "def read(path, size):\n    while True: pass",
    "memory": "def read(path, size): return {'a': bytearray(1 << 44)}",
    "syntax": "def",
}


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_child_that_fails_costs_a_message(tmp_path, monkeypatch, name):
    monkeypatch.setattr(child_process, "_MIN_CPU_SECONDS", 1)
    script = tmp_path / "script.py"
    script.write_text(SCRIPTS[name])
    with pytest.raises(ValueError, match=r"\w"):
        read_in_child(script, script)


def test_a_child_that_waits_is_ended(tmp_path, monkeypatch):
    monkeypatch.setattr(child_process, "_WALL_PER_CPU_TIME", 0.1)
    script = tmp_path / "script.py"
    script.write_text("import time\ndef read(path, size): time.sleep(60)")
    with pytest.raises(ValueError, match="does not end"):
        read_in_child(script, script)


def test_a_child_may_print(tmp_path, capfd):
    script = tmp_path / "script.py"
    script.write_text(
        "import os, numpy\ndef read(path, size):\n    print('x')\n    os.write(1, b'y')\n"
        "    return {'file': numpy.arange(3)}"
    )
    np.testing.assert_array_equal(read_in_child(script, script)["file"], [0, 1, 2])
    assert capfd.readouterr() == ("", "")


def test_a_pipe_is_no_file(tmp_path):
    os.mkfifo(tmp_path / "a.mat")
    with pytest.raises(InputError, match="does not exist"):
        load_arrays(tmp_path / "a.mat")
