"""FRFs of a model as CSV, and its state space as .npz or .mat."""

import csv
import sys
from pathlib import Path

import numpy as np
import scipy.io

from identification.words import InputError
from mbmodel import Evaluator, FrfRequest, Model, export_state_space
from mbw.messages import SCREEN
from mbw.predict.state_space_check import law_rows, law_sentences


def print_frf(model: Model, request: FrfRequest) -> None:
    """Print FRFs as CSV to stdout."""
    frf = Evaluator(model, request).at(model.drawn).frf()
    writer = csv.writer(sys.stdout, lineterminator="\n")
    pairs = [(out, inp) for out in frf.outputs for inp in frf.inputs]
    names = [f"{part} {out} / {inp}" for out, inp in pairs for part in ("Re", "Im")]
    writer.writerow(["frequency/Hz", *names])
    rows = frf.values.reshape(len(frf.freq_hz), -1)
    for frequency, row in zip(frf.freq_hz, rows, strict=True):
        parts = [repr(float(p)) for value in row for p in (value.real, value.imag)]
        writer.writerow([f"{frequency:.9g}", *parts])


def write_state_space(model: Model, request: FrfRequest, target: Path) -> None:
    """Write the state space with the names of its signals.

    Raises:
        InputError: the file cannot be written.
    """
    export = export_state_space(model, model.drawn, request)
    for sentence in law_sentences(law_rows(export.laws, model)):
        SCREEN.say(f"state space: {sentence}")
    system = export.system
    arrays = {name: getattr(system, name) for name in "ABCD"}
    labels = {
        "states": system.state_labels,
        "inputs": [str(dof) for dof in request.inputs],
        "outputs": [str(dof) for dof in request.outputs],
    }
    try:
        if target.suffix == ".mat":
            cells = {key: np.array(value, object) for key, value in labels.items()}
            scipy.io.savemat(target, {**arrays, **cells})
        else:
            texts = {key: np.array(value) for key, value in labels.items()}
            np.savez_compressed(target, allow_pickle=False, **arrays, **texts)
    except OSError as error:
        raise InputError(f"{target} cannot be written ({error.strerror}): name another") from error
