"""FRF tables saved as .mat and .npz files, and the sentence that refuses one."""

import numpy as np
import pytest
import scipy.io

from identification.readers.array_frfs import read_arrays
from identification.words import InputError

FREQ = np.array([0.0, 0.5, 1.25, 3.0, 3.5, 8.0, 9.0])
CHANNELS = ["7:+x", "7:-y", "2:+z", "acc1:+rx", "2:+x"]
REFERENCES = ["11:+z", "3:-x"]
NAMES = {".mat": ("FRFs", "COHs", "freqs"), ".npz": ("frf", "coherence", "freq_hz")}
OPTIONS = {
    "channels": CHANNELS,
    "references": REFERENCES,
    "quantity": "accelerance",
    "unit": None,
}


def tables(lines=7, outputs=5, inputs=2):
    """FRFs and coherences, (freq, out, in), no two values alike."""
    rng = np.random.default_rng(4)
    shape = (lines, outputs, inputs)
    values = rng.normal(size=shape) + 1j * rng.normal(size=shape)
    return values, rng.uniform(0.1, 0.99, shape)


def save(path, **variables):
    if path.suffix == ".mat":
        scipy.io.savemat(path, variables)
    else:
        np.savez(path, **variables)
    return path


def save_frfs(path, values, coherence=None, freq=FREQ):
    names = NAMES[path.suffix]
    extra = {} if coherence is None else {names[1]: coherence}
    return save(path, **extra, **{names[0]: values, names[2]: freq})


def refusal(path, **options):
    with pytest.raises(InputError) as caught:
        read_arrays(path, **{**OPTIONS, **options})
    assert str(path) in str(caught.value)
    return str(caught.value)
