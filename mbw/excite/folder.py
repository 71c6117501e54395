"""Campaign of an excitation: the signals, and the record that the nominal machine would give."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from identification.readers.result_files import FORMAT
from identification.words import Loop, Real
from identification.words.csv_cells import write_csv
from mbmodel import input_unit, output_unit, refuse_difference, write_copy
from mbw.excite.summary import find_steps
from tuning.excitation.design import Excitation
from tuning.excitation.prediction import predict_record
from tuning.excitation.tested_machine import TestedMachine
from tuning.session import instrument_priors

SIGNALS, RESPONSE, MODEL, CAMPAIGN = "excitation.csv", "response.csv", "model.xml", "campaign.toml"
_LOOP_QUANTITIES = ("receptance", "mobility", "accelerance")
_CAMPAIGN_COMMENT = (
    "# Written by mbw excite. response.csv is what the nominal machine would record: put the trace "
    "of\n# your drive in its place. mbw simulate plays [loop.*] with --closed '*'.\n"
)


def folder_names(tested: TestedMachine) -> list[str]:
    """Return the names of all files of the campaign."""
    return [SIGNALS, RESPONSE, MODEL, CAMPAIGN, *_controller_files(tested.machine.loops)]


def write_folder(
    place: Path, home: Path, excitation: Excitation, tested: TestedMachine, seed: int
) -> None:
    """Write signals, model, record and campaign.toml.

    Args:
        place: folder in which they are written.
        home: folder to which they move.
        tested: machine for which they were designed.
        seed: seed of the record's noise.
    """
    machine, request = tested.machine, excitation.request
    copy = write_copy(machine.source, place / MODEL, (), home)
    refuse_difference(copy.file, copy.difference)
    signals = excitation.repeat(excitation.periods)
    time_s = np.arange(signals.shape[1]) / excitation.plan.rate_hz
    _write_columns(place / SIGNALS, ["time", *map(str, request.drives)], [time_s, *signals])
    record = predict_record(excitation, np.random.default_rng(seed))
    motors = {
        str(drive): _heading(str(drive), input_unit(machine, drive)) for drive in request.drives
    }
    encoders = {
        str(port): _heading(str(port), output_unit(machine, port, request.quantity))
        for port in request.outputs
    }
    names = ["time [s]", *motors.values(), *encoders.values()]
    _write_columns(place / RESPONSE, names, [time_s, *signals, *record])
    for name, loop in zip(_controller_files(machine.loops), machine.loops, strict=True):
        _write_controller(place / name, loop)
    log = {
        "file": RESPONSE,
        "motors": motors,
        "encoders": encoders,
        "quantity": request.quantity,
        "level": float(f"{np.abs(signals).max():.6g}"),
        "realisations": excitation.plan.realisations,
    }
    key = {"key": machine.keyframe} if machine.keyframe else {}
    tables = {"log": log, **_loop_tables(machine.loops), **_kept_tables(excitation, tested)}
    text = _CAMPAIGN_COMMENT + _rows({"format": FORMAT, "model": MODEL, **key})
    text += "".join(f"\n[{name}]\n{_rows(table)}" for name, table in tables.items())
    (place / CAMPAIGN).write_text(text, encoding="utf-8")


def _kept_tables(excitation: Excitation, tested: TestedMachine) -> dict[str, Mapping[str, Any]]:
    """Return the tables of the campaign that hold for its machine in this test too."""
    tables: dict[str, Mapping[str, Any]] = {"tolerance": vars(tested.tolerance)}
    tables |= {f"spring.{json.dumps(name)}": table for name, table in tested.springs.items()}
    stated = excitation.specification
    names = {"free", "fix", "prior", "bounds"}
    tuning = {name: value for name, value in vars(stated).items() if name in names}
    if stated.ties:
        tuning["tie"] = stated.ties
    for port, step in find_steps(excitation).items():
        tables[f"sensor.{json.dumps(str(port))}"] = {"resolution": float(f"{step:.3g}")}
    if tested.settings is not None:
        for kind in ("sensor", "hammer"):
            for name, table in getattr(tested.settings, kind).items():
                row = table.model_dump(exclude_defaults=True)
                key = f"{kind}.{json.dumps(name)}"
                tables |= {key: {**tables.get(key, {}), **row}} if row else {}
        elsewhere = instrument_priors(tested.settings).items()  # in the tables of instruments
        tuning["prior"] = {
            n: value for n, value in stated.prior.items() if (n, value) not in elsewhere
        }
    tuning = {name: value for name, value in tuning.items() if value}
    return {**tables, **({"tuning": tuning} if tuning else {})}


def _loop_tables(loops: Sequence[Loop]) -> dict[str, Mapping[str, Any]]:
    """Return the tables of closed loops."""
    tables: dict[str, Mapping[str, Any]] = {}
    for file, loop in zip(_controller_files(loops), loops, strict=True):
        (output, _), *further = loop.measured.terms
        tables[f"loop.{json.dumps(loop.name)}"] = {
            "input": str(loop.input),
            "output": str(output),
            **({"minus": str(further[0][0])} if further else {}),
            "quantity": _LOOP_QUANTITIES[loop.measured.derivative],
            "controller": file,
            "delay": float(loop.delay),
            **{
                key: float(value)
                for key in ("resolution", "quantisation", "limit")
                if (value := getattr(loop, key))
            },
            "as_stated": True,  # stated and checked before
        }
    return tables


def _controller_files(loops: Sequence[Loop]) -> list[str]:
    """Return names of files; a loop's own name may hold what no file's name can."""
    return [f"controller_{number}.mat" for number in range(1, len(loops) + 1)]


def _write_controller(target: Path, loop: Loop) -> None:
    """Write the state space of a controller."""
    controller = loop.controller
    arrays = {
        "A": controller.dynamics,
        "B": controller.input_matrix,
        "C": controller.output_matrix,
        "D": controller.feedthrough,
        "Ts": controller.period_s,
    }
    scipy.io.savemat(target, arrays)


def _heading(label: str, unit: str) -> str:
    """Return the heading of a column, as ``mbw simulate`` writes it."""
    return f"{label} [{unit}]".replace("²", "^2")


def _write_columns(target: Path, names: Sequence[str], columns: Sequence[Real]) -> None:
    with target.open("w", newline="", encoding="utf-8") as file:
        write_csv(file, [names])
        write_csv(file, ([f"{value:.9g}" for value in row] for row in zip(*columns, strict=True)))


def _rows(values: Mapping[str, Any]) -> str:
    """Return lines ``key = value`` of a TOML table."""
    return "".join(f"{_key(name)} = {_value(value)}\n" for name, value in values.items())


def _key(name: str) -> str:
    return name if name.replace("_", "").isalnum() and name.isascii() else json.dumps(name)


def _value(value: Any) -> str:
    """Return a value as TOML writes it."""
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_key(name)} = {_value(item)}" for name, item in value.items())
        return "{ " + inner + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False)
    return repr(value)
