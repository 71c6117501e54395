"""Files of a virtual hammer test: records, campaign.toml, and the drawn errors of instruments."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from identification.readers.result_files import FORMAT, write_result_arrays
from identification.words import Records, Tolerance
from mbmodel import NonlinearJoint, RecordedFile, VirtualTest
from mbw.simulate.hammer_plan import PlannedTest

CAMPAIGN, MODEL, ANSWER = "campaign.toml", "model.xml", "answer.toml"
TRUE_MODEL = "simulated.xml"  # the machine that was hit, where campaign.toml names another
Laws = Sequence[tuple[str, NonlinearJoint]]  # effect and law
_CAMPAIGN_HEAD = "# Virtual hammer test, written by mbw simulate\n"
_ANSWER_HEAD = (
    "# Errors of the instruments that were drawn; no verb reads this file.\n"
    "# H_measured = gain exp(-i w delay) H for the force channel; vectors in world axes, SI.\n"
)


def write_campaign(
    place: Path, planned: PlannedTest, test: VirtualTest, seed: int, laws: Laws = ()
) -> None:
    """Write records, campaign.toml and answer.toml.

    Args:
        place: folder.
        planned: plan and stated tolerances.
        test: records and drawn errors.
        seed: of all random numbers.
        laws: effect and law of each joint that was made nonlinear.
    """
    files = planned.plan.files
    for file in files:
        _write_records(place / file.file, test.records[file.file])
    blocks = [
        f'{_CAMPAIGN_HEAD}format = {FORMAT}\nmodel = "{MODEL}"\n',
        *(_test_block(file) for file in files),
    ]
    (place / CAMPAIGN).write_text(
        "\n".join([*blocks, _tolerance_table(planned.stated)]), encoding="utf-8"
    )
    (place / ANSWER).write_text(_answer(planned, test, seed, laws), encoding="utf-8")


def _write_records(target: Path, records: Iterable[Records]) -> None:
    """Write force and response of all references of a file, as ``array_records`` reads them."""
    of_references = list(records)
    arrays = {
        "force": np.stack([record.force for record in of_references]),
        "response": np.stack([record.motion for record in of_references]),
    }
    if len(of_references) == 1:
        arrays = {name: array[0] for name, array in arrays.items()}
    arrays["rate_hz"] = np.array(of_references[0].rate_hz)
    if target.suffix == ".mat":
        scipy.io.savemat(target, arrays, do_compression=True)
    else:
        write_result_arrays(target, arrays)


def _test_block(file: RecordedFile) -> str:
    """Return the ``[[test]]`` of a file."""
    rows: dict[str, Any] = {
        "file": file.file,
        "level": float(file.level_n),
        "averages": file.hits,
        "setup": file.setup,
        "hammer": file.hammer,
        "references": [str(dof) for dof in file.references],
        "channels": [str(dof) for dof in file.outputs],
        "quantity": "accelerance",
    }
    stated = {name: value for name, value in rows.items() if value is not None}
    return "[[test]]\n" + _rows(stated)


def _tolerance_table(tolerance: Tolerance) -> str:
    """Return the table ``[tolerance]``."""
    return "[tolerance]  # one standard deviation\n" + _rows(vars(tolerance))


def _answer(planned: PlannedTest, test: VirtualTest, seed: int, laws: Laws) -> str:
    """Return the text of answer.toml."""
    effects = dict.fromkeys(effect for effect, _ in laws)
    parts = [f'{_ANSWER_HEAD}effect = "{" and ".join(effects) or "none"}"\nseed = {seed}\n']
    for effect, law in laws:
        parts.append("[[joint]]\n" + _rows({"effect": effect, **vars(law)}))
    plan, instruments = planned.plan, test.instruments
    parts.append("[noise]  # one-sided densities\n" + _rows(vars(plan.noise)))
    parts.append("[scatter]  # of the hits\n" + _rows(vars(plan.scatter)))
    for name, channel in instruments.force_channels.items():
        parts.append(f"[force_channel.{_quote(name)}]\n" + _rows(vars(channel)))
    for dof, hammer in instruments.hammers.items():
        parts.append(f"[hammer.{_quote(str(dof))}]\n" + _rows(vars(hammer)))
    for site, sensor in instruments.sensors.items():
        parts.append(f"[sensor.{_quote(site)}]\n" + _rows(vars(sensor)))
    return "\n".join(parts)


def _rows(values: dict[str, Any]) -> str:
    """Return lines ``key = value`` of a TOML table."""
    return "".join(f"{name} = {_value(value)}\n" for name, value in values.items())


def _value(value: Any) -> str:
    """Return a value as TOML writes it."""
    if isinstance(value, str):
        return _quote(value)
    if isinstance(value, list | np.ndarray):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    return repr(value) if isinstance(value, int) else repr(float(value))


def _quote(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
