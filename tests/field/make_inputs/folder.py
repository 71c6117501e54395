"""Writer of a field case: its ``case.toml`` and its input files."""

import io
import json
import shutil

import numpy as np

from tests.field.cases import INPUTS, Case
from tests.field.virtual_machine import (
    FREQ_HZ,
    NOISE,
    add_noise,
    field_machine,
    layout_text,
    model_text,
)

CHANNELS = 'channels = "nodes 1..5, z"'
REFERENCES = 'references = ["1:+z", "3:+z"]'
ARRAYS = f'file = "t.npz"\naverages = 10\n{CHANNELS}\n{REFERENCES}\nquantity = "accelerance"'
UNIVERSAL = 'file = "t.uff"\naverages = 10'


def write_case(name, situation, expected, runs, files, *, limit_s=None):
    """Write a case; ``runs`` are dictionaries of ``Run``, ``files`` texts or bytes by name."""
    content = {"situation": situation, "expected": expected, "run": runs}
    if limit_s is not None:
        content["limit_s"] = limit_s
    Case.model_validate(content)
    folder = INPUTS / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    lines = [f"{key} = {_toml(value)}" for key, value in content.items() if key != "run"]
    for run in runs:
        values = run.get("value", [])
        lines += ["", "[[run]]"]
        lines += [f"{key} = {_toml(value)}" for key, value in run.items() if key != "value"]
        for value in values:
            lines += ["[[run.value]]", *(f"{key} = {_toml(v)}" for key, v in value.items())]
    (folder / "case.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    for file, data in files.items():
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_bytes(data.encode() if isinstance(data, str) else data)


def _toml(value):
    """Return a value as TOML, for the kinds that cases have."""
    if isinstance(value, list) and any(isinstance(item, str) and len(value) > 6 for item in value):
        return "[\n" + "".join(f"    {_toml(item)},\n" for item in value) + "]"
    if isinstance(value, list):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(item)}" for key, item in value.items()) + " }"
    return json.dumps(value, ensure_ascii=False)


def identify(*more, **run):
    """Return the run that identifies the folder; ``more`` are options."""
    return {"command": ["identify", ".", "--out", "out", "--no-pictures", *more], **run}


def modes_are(freq_hz, damping=None, tolerance=2e-3):
    """Return the values that a result of ``identify`` must hold."""
    values = [{"path": "modes.*.frequency", "near": _rounded(freq_hz), "tolerance": tolerance}]
    if damping is not None:
        values.append(
            {"path": "modes.*.damping", "near": _rounded(damping), "tolerance": 20 * tolerance}
        )
    return values


def _rounded(values):
    return [float(f"{value:.6g}") for value in np.asarray(values)]


def campaign(test, *, model=False, top=""):
    """Return campaign.toml with one ``[[test]]``, on the model or on the layout."""
    source = 'model = "model.xml"' if model else 'layout = "layout.toml"'
    return f"{source}\n{top}\n[[test]]\n{test}\n"


def npz(**arrays):
    """Return the bytes of an .npz file."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def measured(machine=None, freq_hz=FREQ_HZ, seed=1, noise=NOISE):
    """Return noisy FRFs (n_freq, n_out, n_ref) as single-precision numbers, and their coherence."""
    exact = (machine or field_machine()).accelerance(freq_hz)
    values, coherence = add_noise(exact, seed, noise)
    return values.astype(np.complex64), coherence.astype(np.float32)


def array_files(values, coherence, test=ARRAYS, *, model=False, freq_hz=FREQ_HZ, top="", scale=1.0):
    """Return the files of a campaign whose FRFs stand in an .npz."""
    source = {"model.xml": model_text(scale)} if model else {"layout.toml": layout_text(scale)}
    arrays = {"frf": values, "freq_hz": freq_hz}
    if coherence is not None:
        arrays["coherence"] = coherence
    return {"campaign.toml": campaign(test, model=model, top=top), "t.npz": npz(**arrays), **source}
