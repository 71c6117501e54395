"""FRF tables of .mat and .npz files that are refused, and MATLAB v7.3."""

import gc
import io

import h5py
import numpy as np
import pytest
import scipy.io
from array_files import CHANNELS, FREQ, NAMES, OPTIONS, refusal, save, save_frfs, tables

from identification.readers.array_frfs import read_arrays
from identification.words import InputError


@pytest.fixture(params=[".mat", ".npz"])
def path(request, tmp_path):
    return tmp_path / f"test{request.param}"


def test_a_missing_file_is_named(path):
    assert "does not exist" in refusal(path)


@pytest.mark.parametrize("missing", [0, 2])
def test_a_missing_variable_is_named_with_those_there(path, missing):
    names = NAMES[path.suffix]
    variables = {names[0]: tables()[0], names[2]: FREQ}
    kept = names[2 - missing]
    save(path, **{kept: variables[kept]})
    message = refusal(path)
    assert f"no variable '{names[missing]}'" in message
    assert kept in message


@pytest.mark.parametrize(
    "options",
    [{"channels": CHANNELS[:4]}, {"references": ["11:+z"]}, {"channels": "nodes 1..2, xyz"}],
)
def test_a_table_of_another_shape_is_refused_with_both_shapes(path, options):
    save_frfs(path, np.moveaxis(tables()[0], 0, 2))
    message = refusal(path, **options)
    assert "(5, 2, 7)" in message
    assert "correct channels or references" in message


@pytest.mark.parametrize("order", [(0, 2, 1), (1, 0, 2), (2, 0, 1), (2, 1, 0)])
def test_axes_in_no_known_order_are_refused(path, order):
    save_frfs(path, np.transpose(tables()[0], order))
    shape = tuple((7, 5, 2)[axis] for axis in order)
    assert (
        f"{NAMES[path.suffix][0]} has shape {shape}, its axes are in another order: save them as "
        "(out, in, freq), (5, 2, 7), or as (freq, out, in), (7, 5, 2)" in refusal(path)
    )


@pytest.mark.parametrize("is_first", [True, False])
def test_other_lines_than_frequencies_are_counted(path, is_first):
    values = tables()[0]
    save_frfs(path, values if is_first else np.moveaxis(values, 0, 2), freq=FREQ[:-3])
    message = refusal(path)
    assert f"{NAMES[path.suffix][0]} has 7 lines, and the file has 4 frequencies: save" in message
    assert "channels" not in message


def test_other_lines_of_a_single_reference_are_counted(path):
    save_frfs(path, tables()[0][:, :, 0], freq=FREQ[:-3])
    assert "has 7 lines, and the file has 4 freq" in refusal(path, references=["11:+z"])


def test_coherences_of_another_shape_are_refused(path):
    values, coherence = tables()
    save_frfs(path, values, coherence[:, :4])
    assert NAMES[path.suffix][1] in refusal(path)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("name", [0, 1])
def test_a_value_that_is_no_number_is_named_by_line_and_channel(path, bad, name):
    both = tables()
    both[name][3, 1, 1] = bad
    save_frfs(path, *both)
    message = refusal(path)
    assert NAMES[path.suffix][name] in message
    assert "at 3 Hz, response 7:-ty, reference 3:-tx" in message


@pytest.mark.parametrize(
    "freq",
    [FREQ[::-1], [0, 1, 1, 2, 3, 4, 5], [0, 1, np.nan, 3, 4, 5, 6], [0, 1, 2, 3, 4, 5, np.inf]],
)
def test_frequencies_that_do_not_rise_are_refused(path, freq):
    save_frfs(path, tables()[0], freq=np.asarray(freq))
    assert "does not increase strictly" in refusal(path)


@pytest.mark.parametrize(
    "freq",
    [np.array(list("abcdefg")), FREQ + 1j, np.array(["0.5"] * 7)],
    ids=["text", "complex", "digits"],
)
def test_frequencies_that_are_no_real_numbers_are_refused(path, freq):
    save_frfs(path, tables()[0], freq=freq)
    assert NAMES[path.suffix][2] in refusal(path)


def test_frfs_that_are_text_are_refused(tmp_path):
    path = save_frfs(tmp_path / "a.npz", np.full((7, 5, 2), "1+2j"))
    assert "frf" in refusal(path)


def test_a_cell_array_in_place_of_the_frfs_is_refused(tmp_path):
    cells = np.empty((7, 5, 2), object)
    cells[...] = "x"
    assert "FRFs" in refusal(save_frfs(tmp_path / "a.mat", cells))


@pytest.mark.parametrize(
    "content", [b"", b"freq,h\n1,2\n", b"\x00" * 400, b"\xff" * 400, b"PK\x03\x04"]
)
def test_a_file_of_another_kind_is_refused(path, content):
    path.write_bytes(content)
    assert "again" in refusal(path)
    gc.collect()  # a file left open is found here


def test_an_array_without_names_is_refused(tmp_path):
    buffer = io.BytesIO()
    np.save(buffer, tables()[0])
    (tmp_path / "a.npz").write_bytes(buffer.getvalue())
    assert "again" in refusal(tmp_path / "a.npz")


def test_pickled_objects_are_not_loaded(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, frf=np.array([{"a": 1}], object), freq_hz=FREQ)
    assert "cannot be read" in refusal(path)


MATLAB_73 = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"


def save_73(path, values, coherence):
    """As MATLAB does: axes reversed, complex numbers as pairs, a header of 512 bytes."""
    pairs = np.empty(values.T.shape, [("real", "f8"), ("imag", "f8")])
    pairs["real"], pairs["imag"] = values.T.real, values.T.imag
    with h5py.File(path, "w", userblock_size=512) as file:
        file["FRFs"], file["COHs"] = pairs, coherence.T
        file["freqs"] = FREQ[:, None]
        file["note"] = np.array([72, 105], np.uint16)
        file.create_group("#refs#")["a"] = 1.0
    with path.open("r+b") as file:
        file.write(MATLAB_73)


def test_matlab_v73_is_read_as_v5(tmp_path):
    values, coherence = tables()
    old, new = tmp_path / "old.mat", tmp_path / "new.mat"
    kept = [np.moveaxis(array, 0, 2) for array in (values, coherence)]
    save_frfs(old, *kept)
    save_73(new, *kept)
    expected, found = (read_arrays(path, **OPTIONS) for path in (old, new))
    np.testing.assert_array_equal(found.values, expected.values)
    np.testing.assert_array_equal(found.coherence, expected.coherence)
    np.testing.assert_array_equal(found.freq_hz, FREQ)


def test_a_broken_matlab_v73_is_refused(tmp_path):
    path = tmp_path / "a.mat"
    path.write_bytes(MATLAB_73.ljust(512, b"\0") + b"\x89HDF\r\n\x1a\n" + b"\0" * 100)
    message = refusal(path)
    assert "v7.3 and cannot be read" in message
    assert "save it again" in message


def test_hdf5_without_the_header_of_matlab_is_refused(tmp_path):
    path = tmp_path / "a.mat"
    with h5py.File(path, "w") as file:
        file["FRFs"] = tables()[0]
    assert "again" in refusal(path)


@pytest.mark.parametrize("compressed", [True, False])
@pytest.mark.parametrize("ending", [".mat", ".npz"])
def test_a_file_cut_anywhere_is_refused(tmp_path, ending, compressed):
    values, coherence = tables()
    names = NAMES[ending]
    # Coherence first: without it a table would still be one.
    variables = {names[1]: coherence, names[0]: values, names[2]: FREQ}
    path = tmp_path / f"whole{ending}"
    if ending == ".mat":
        scipy.io.savemat(path, variables, do_compression=compressed)
    else:
        (np.savez_compressed if compressed else np.savez)(path, **variables)
    content = path.read_bytes()
    leaks: dict[str, list[int]] = {}
    for cut in range(0, len(content), 3):
        path.write_bytes(content[:cut])
        try:
            table = read_arrays(path, **OPTIONS)
        except InputError:
            continue
        except Exception as error:
            leaks.setdefault(f"{type(error).__name__}: {error}", []).append(cut)
        else:
            np.testing.assert_array_equal(table.values, values)
            np.testing.assert_array_equal(table.coherence, coherence)
    gc.collect()  # a file left open is found here
    assert not leaks
