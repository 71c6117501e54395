"""One test that is there twice is found by its content, whatever its file and reference."""

import numpy as np
import pytest
import scipy.io

from identification import correct_layout, read_campaign, read_layout, read_settings
from identification.words import InputError

FREQ = np.arange(1.0, 41.0)
LAYOUT = "".join(f"[site.acc{k}]\nposition = [0.{k}, 0.0, 0.0]\n" for k in range(1, 4))


def values(seed):
    random = np.random.default_rng(seed)
    parts = random.normal(size=(2, len(FREQ), 3))
    return parts[0] + 1j * parts[1]


@pytest.fixture
def read(tmp_path):
    """Return a function that writes files of FRFs, (reference, values) each, and reads them."""

    def build(*files):
        blocks = ['layout = "layout.toml"\n']
        for number, (references, frf) in enumerate(files):
            if number == 0:
                np.savez(tmp_path / "0.npz", frf=frf, freq_hz=FREQ)
            else:
                frequency_last = {"FRFs": np.moveaxis(frf, 0, 2), "freqs": FREQ}
                scipy.io.savemat(tmp_path / f"{number}.mat", frequency_last)
            file = "0.npz" if number == 0 else f"{number}.mat"
            blocks.append(
                f'[[test]]\nfile = "{file}"\nchannels = "nodes 1..3, z"\n'
                f"references = {list(references)}\n"
            )
        (tmp_path / "layout.toml").write_text(LAYOUT, "utf-8")
        (tmp_path / "campaign.toml").write_text("".join(blocks), "utf-8")
        path, settings = read_settings(tmp_path)
        layout = read_layout(tmp_path / "layout.toml")
        return read_campaign(path, settings, correct_layout(path, settings, layout))

    return build


def columns(*seeds):
    return np.stack([values(seed) for seed in seeds], axis=2)


def test_repetitions_with_their_own_noise_are_no_copies(read):
    noisy = columns(1) * (1 + 1e-3 * columns(5))
    assert len(read((["1:+z"], columns(1)), (["1:+z"], noisy)).tests) == 2


@pytest.mark.parametrize("reference", ["1:+z", "2:+z", "1:+x"])
def test_a_copy_of_a_file_is_refused_and_both_are_named(read, reference):
    rounded = columns(1).astype(np.complex64)
    with pytest.raises(InputError, match=r"0\.npz at acc1:\+tz and 1\.mat at .* same FRFs"):
        read((["1:+z"], columns(1)), ([reference], rounded))


def test_a_copy_with_the_opposite_label_is_refused(read):
    with pytest.raises(InputError, match="hold the same FRFs"):
        read((["1:+z"], columns(1)), (["1:-z"], -columns(1)))


def test_two_references_of_one_file_with_equal_frfs_are_refused(read):
    with pytest.raises(InputError, match=r"at acc1:\+tz and 0\.npz at acc2:\+tz hold the same"):
        read((["1:+z", "2:+z", "3:+z"], columns(1, 1, 2)))
