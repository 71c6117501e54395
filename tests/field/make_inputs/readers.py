"""Cases on universal files, arrays and meshes as programs write them, whole and broken."""

import io
import struct
import tempfile
from pathlib import Path

import h5py
import numpy as np
import scipy.io
from identification_examples import Function, dataset
from text_files import labview

from tests.field.make_inputs.folder import (
    ARRAYS,
    CHANNELS,
    UNIVERSAL,
    array_files,
    campaign,
    identify,
    measured,
    modes_are,
    npz,
    write_case,
)
from tests.field.make_inputs.units import universal
from tests.field.virtual_machine import FREQ_HZ, field_machine, layout_text


def write():
    """Write all cases of this module."""
    _odd_universal_files()
    _broken_universal_files()
    _arrays()
    _broken_arrays()
    _text_files()


def _files(content, test=UNIVERSAL, name="t.uff"):
    test = test.replace("t.uff", name)
    return {"campaign.toml": campaign(test), "layout.toml": layout_text(), name: content}


def _odd_universal_files():
    values, coherence = measured()
    whole = universal(values, coherence)
    right = modes_are(field_machine().modes()[0])
    groups = dataset("  2467", [f"{1:10d}{0:10d}{0:10d}{0:10d}{0:10d}{0:10d}{0:10d}{0:10d}", "ALL"])
    situations = {
        "dataset_2467": ("dataset 2467 beside FRFs, JSON on stdout", groups + whole, []),
        "malformed_other": (
            "a malformed dataset that nobody needs",
            dataset("  2414", ["not a number", "at all"]) + whole,
            ["2414"],
        ),
        "unknown_dataset": ("a dataset of unknown kind", dataset("  9999", ["x"]) + whole, []),
        "byte_order_mark": (
            "a byte-order mark before the first dataset",
            b"\xef\xbb\xbf" + whole,
            [],
        ),
        "crlf": ("lines that end with CR LF", universal(values, coherence, newline=b"\r\n"), []),
        "uneven_axis": (
            "58b with an axis of its own",
            universal(values, coherence, even=False),
            [],
        ),
        "ascii": ("58 in ASCII", universal(values, coherence, order=""), []),
        "d_exponents": (
            "58 in ASCII with the exponents of Fortran (1.0D+00)",
            universal(values, coherence, order="").replace(b"E+", b"D+").replace(b"E-", b"D-"),
            [],
        ),
        "wrong_byte_count": (
            "58b whose header counts too few bytes",
            universal(values, coherence, announced_bytes=1200),
            [],
        ),
    }
    for name, (situation, content, says) in situations.items():
        write_case(
            f"readers/{name}",
            situation,
            "the modes, and JSON alone on stdout",
            [identify("--json", "-", stdout="json", says=says, value=right)],
            _files(content),
        )
    write_case(
        "readers/suffix_ufb",
        "a universal file called .ufb",
        "the modes",
        [identify("--json", "r.json", value=right)],
        _files(whole, name="t.ufb"),
    )
    one = b"".join(
        Function(
            part[:, row, 0],
            single=True,
            x=FREQ_HZ,
            rsp=(row + 1, 0),
            ref=(1, 0),
            order="<",
            func=kind,
            ordinate=ordinate,
        ).content()
        for row in range(5)
        for part, kind, ordinate in ((values, 4, 12), (coherence, 6, 0))
    )
    write_case(
        "readers/direction_0",
        "direction 0 (scalar), the default of pyuff",
        "exit 3 and the key that says the direction",
        [identify(exit_code=3, says=["channels"])],
        _files(one),
    )
    write_case(
        "readers/direction_0_stated",
        "direction 0 (scalar), and campaign.toml says which direction it is",
        "the modes",
        [identify("--json", "r.json", value=right)],
        _files(one, f'{UNIVERSAL}\n{CHANNELS}\nreferences = ["1:+z"]'),
    )
    almost_zero = np.concatenate([[1e-5], FREQ_HZ])
    write_case(
        "readers/first_line_near_zero",
        "an axis whose first line is 1e-5 Hz",
        "the modes",
        [identify("--json", "r.json", value=right)],
        _files(universal(np.concatenate([values[:1] * 1e-9, values]), x=almost_zero, even=False)),
    )


def _broken_universal_files():
    values, coherence = measured()
    whole = universal(values, coherence)
    broken = {
        "negative_count": (
            "58b with a negative number of values",
            universal(values[:, :1], announced_values=-5),
        ),
        "truncated": ("a file that ends within a record", whole[: len(whole) // 2 + 77]),
        "not_universal": ("a picture called .uff", b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 20),
        "empty": ("an empty file", b""),
    }
    for name, (situation, content) in broken.items():
        write_case(
            f"readers/{name}",
            situation,
            "exit 3 and one sentence",
            [identify(exit_code=3, says=["t.uff"])],
            _files(content),
            limit_s=20,
        )
    write_case(
        "readers/many_end_marks",
        "20,000 end marks behind the records",
        "the modes, at once",
        [identify("--json", "r.json", value=modes_are(field_machine().modes()[0]))],
        _files(whole + b"    -1\n" * 20_000),
        limit_s=20,
    )
    files = array_files(values, coherence)
    files["campaign.toml"] = files["campaign.toml"].replace("1..5", "1..1000000000000")
    write_case(
        "readers/endless_nodes",
        "channels for a million million nodes",
        "exit 3 at once",
        [identify(exit_code=3, says=["channels"])],
        files,
        limit_s=20,
    )


def _mat(compressed=True, **arrays):
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, arrays, do_compression=compressed)
    header = b"MATLAB 5.0 MAT-file, written for a field case"
    return header.ljust(116) + buffer.getvalue()[116:]  # without the date of writing


def _arrays():
    values, coherence = measured()
    right = modes_are(field_machine().modes()[0])
    layout = {"layout.toml": layout_text()}
    named = ARRAYS.replace("t.npz", "t.mat")
    write_case(
        "readers/mat_5",
        "MATLAB 5, compressed",
        "the modes",
        [identify("--json", "r.json", value=right)],
        {
            "campaign.toml": campaign(named),
            "t.mat": _mat(FRFs=values, COHs=coherence, freqs=FREQ_HZ),
            **layout,
        },
    )


def _hdf5(fill):
    """Return the bytes of a MATLAB 7.3 file that ``fill`` writes."""
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "t.mat"
        with h5py.File(path, "w", userblock_size=512) as file:
            fill(file)
        content = bytearray(path.read_bytes())
    header = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, HDF5 schema 1.00 .".ljust(124)
    content[:128] = header + struct.pack("<HH", 0x0200, 0x4D49)
    return bytes(content)


def _broken_arrays():
    values, coherence = measured()
    layout = {"layout.toml": layout_text()}
    named = ARRAYS.replace("t.npz", "t.mat")
    whole = _mat(FRFs=values, COHs=coherence, freqs=FREQ_HZ)

    def outside(file):
        file["FRFs"] = h5py.ExternalLink("/etc/hostname", "/FRFs")
        file["freqs"] = FREQ_HZ

    flipped = bytearray(whole)
    flipped[132] ^= 0x40
    tagged = bytearray(_mat_plain(values))
    tagged[128] = 0xFF
    broken = {
        "mat_cut": ("a .mat that ends early", whole[:900]),
        "mat_count": ("a .mat with one byte of a count changed", bytes(flipped)),
        "mat_tag": ("a .mat with one byte of a tag changed", bytes(tagged)),
        "mat_outside": ("HDF5 with a link to another file", _hdf5(outside)),
    }
    for name, (situation, content) in broken.items():
        write_case(
            f"readers/{name}",
            situation,
            "exit 3 and one sentence",
            [identify(exit_code=3, says=["t.mat"])],
            {"campaign.toml": campaign(named), "t.mat": content, **layout},
            limit_s=30,
        )
    huge = {"frf": values, "freq_hz": FREQ_HZ}
    write_case(
        "readers/npz_pickle",
        "an .npz that holds objects",
        "exit 3 and one sentence",
        [identify(exit_code=3, says=["t.npz"])],
        {
            "campaign.toml": campaign(ARRAYS),
            "t.npz": npz(**huge, coherence=np.array([{"a": 1}], dtype=object)),
            **layout,
        },
    )


def _mat_plain(values):
    return _mat(compressed=False, FRFs=values[:20], freqs=FREQ_HZ[:20])


def _text_files():
    values, _ = measured()
    right = modes_are(field_machine().modes()[0])
    tests, files = [], {"layout.toml": layout_text()}
    for column, reference in enumerate(("1:+z", "3:+z")):
        tests.append(_text_test(f"force_{column}.csv", CHANNELS, reference))
        files[f"force_{column}.csv"] = "".join(
            ";".join(f"{complex(value)}".strip("()") for value in (freq, *row)) + "\n"
            for freq, row in zip(FREQ_HZ, values[:, :, column].tolist(), strict=True)
        )
    write_case(
        "readers/csv_complex",
        "a .csv for each force: complex frequency and FRFs such as 0.1-0.2j, separated by ;",
        "the modes",
        [identify("--json", "r.json", value=right)],
        {"campaign.toml": campaign("\n[[test]]\n".join(tests)), **files},
    )
    tests, files = [], {"layout.toml": layout_text()}
    for row in range(5):
        tests.append(_text_test(f"acc_{row}.txt", f'channels = ["{row + 1}:+z"]', "1:+z"))
        body = np.column_stack([FREQ_HZ, values[:, row, 0].real, values[:, row, 0].imag])
        files[f"acc_{row}.txt"] = "Frequency (Hz)\tReal\tImaginary\n" + "".join(
            "\t".join(f"{number:.7g}".replace(".", ",") for number in line) + "\n" for line in body
        )
    write_case(
        "readers/text_file_for_each_channel",
        "a text file for each channel: tabs, decimal comma, headings Real and Imaginary",
        "the modes",
        [identify("--json", "r.json", value=right)],
        {"campaign.toml": campaign("\n[[test]]\n".join(tests)), **files},
    )
    rate_hz, n_sample = 256.0, 1024
    sections = np.array([_hit(rate_hz, n_sample, seed) for seed in range(2)])
    names, units = ("Acc 1", "Acc 2", "Acc 3", "Acc 4", "Acc 5", "Hammer"), (*["g"] * 5, "N")
    write_case(
        "readers/labview_text",
        "two hits in a LabVIEW measurement file, accelerations in g, the force last",
        "the modes, and a remark on the unit",
        [identify("--json", "r.json", value=right, says=["g/N"])],
        {
            "campaign.toml": campaign(_text_test("t.lvm", CHANNELS, "1:+z")),
            "layout.toml": layout_text(),
            "t.lvm": labview(sections, rate_hz, names=names, units=units),
        },
    )


def _text_test(name, channels, reference):
    return f'file = "{name}"\n{channels}\nreferences = ["{reference}"]'


def _hit(rate_hz, n_sample, seed):
    """Return accelerations [g] and force [N] of one hit at sensor 1; (6, n_sample)."""
    rng = np.random.default_rng(seed)
    force = np.zeros(n_sample)
    force[20:24] = rng.uniform(80, 120) * np.array([0.5, 1.0, 1.0, 0.5])
    padded = 8 * n_sample  # the motion decays before the period of the transform ends
    freq = np.fft.rfftfreq(padded, 1 / rate_hz)
    motion = np.fft.irfft(
        field_machine().accelerance(freq, references=(0,))[:, :, 0].T * np.fft.rfft(force, padded),
        padded,
    )[:, :n_sample]
    noise = 1e-3 * np.abs(motion).max() * rng.normal(size=motion.shape)
    return np.vstack([(motion + noise) / 9.80665, force + 0.02 * rng.normal(size=n_sample)])
