"""FRFs of a model as CSV, with the bands of a tuning."""

import sys

import numpy as np

from identification.words import Real
from identification.words.csv_cells import write_csv
from mbmodel import Evaluator, FrfRequest, Model


def print_frf(model: Model, request: FrfRequest, interval: tuple[Real, Real] | None = None) -> None:
    """Print FRFs as CSV to stdout.

    Args:
        model: at its nominal parameters.
        request: lines, outputs and inputs.
        interval: ends of the 95 % interval of each magnitude, two more columns each;
            (n_freq, n_out, n_in).
    """
    frf = Evaluator(model, request).at(model.drawn).frf()
    columns = [frf.values.real, frf.values.imag]
    parts = ["Re", "Im"]
    if interval is not None:
        columns += interval
        parts += ["low |H|", "high |H|"]
    pairs = [(out, inp) for out in frf.outputs for inp in frf.inputs]
    names = [f"{part} {out} / {inp}" for out, inp in pairs for part in parts]
    write_csv(sys.stdout, [["frequency/Hz", *names]])
    rows = np.stack(columns, axis=-1).reshape(len(frf.freq_hz), -1)
    for frequency, row in zip(frf.freq_hz, rows.tolist(), strict=True):
        write_csv(sys.stdout, [[f"{frequency:.9g}", *map(repr, row)]])
