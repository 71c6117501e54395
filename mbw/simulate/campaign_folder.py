"""Files of a virtual hammer test: records, campaign.toml, and the drawn errors of instruments."""

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from identification.readers.array_records import write_array_records
from identification.readers.result_files import FORMAT
from identification.words import Port, Tolerance
from mbmodel import NonlinearJoint, RecordedFile, VirtualTest
from mbmodel.virtual_test.bad_hits import BadHit
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
    place: Path,
    planned: PlannedTest,
    test: VirtualTest,
    seed: int,
    laws: Laws = (),
    *,
    by_hit: bool = False,
) -> None:
    """Write records, campaign.toml and answer.toml.

    Args:
        place: folder.
        planned: plan and stated tolerances.
        test: records and drawn errors.
        seed: that of ``strike``.
        laws: effect and law of each joint that was made nonlinear.
        by_hit: whether a file will hold one hit; ``write_hits`` then writes the records.
    """
    files: Sequence[RecordedFile] = planned.plan.files
    if by_hit:
        files = [
            replace(file, file=name_hits(file, reference, "*"), references=(reference,))
            for file in files
            for reference in file.references
        ]
    else:
        for file in files:
            write_array_records(place / file.file, test.records[file.file])
    blocks = [
        f'{_CAMPAIGN_HEAD}format = {FORMAT}\nmodel = "{MODEL}"\n',
        *(_test_block(file) for file in files),
    ]
    (place / CAMPAIGN).write_text(
        "\n".join([*blocks, _tolerance_table(planned.stated)]), encoding="utf-8"
    )
    answer = _answer(planned, test, seed, laws, by_hit=by_hit)
    (place / ANSWER).write_text(answer, encoding="utf-8")


def name_hits(file: RecordedFile, reference: Port, number: str) -> str:
    """Return the name of the file of one hit, or the pattern of all along a reference.

    Args:
        file: file of the plan.
        reference: place and direction.
        number: number of the hit, or ``*``.
    """
    path = Path(file.file)
    return f"{path.stem}_{str(reference).replace(':', '')}_{number}{path.suffix}"


def write_hits(folder: Path, planned: PlannedTest, test: VirtualTest, pause_s: float) -> None:
    """Write each hit as a file, in the order and with the pauses of a test.

    Args:
        folder: where campaign.toml is.
        planned: plan of the test.
        test: records.
        pause_s: time before each hit [s].
    """
    for file in planned.plan.files:
        for records in test.records[file.file]:
            for number in range(len(records.force)):
                time.sleep(pause_s)
                hit = replace(
                    records, force=records.force[[number]], motion=records.motion[[number]]
                )
                name = name_hits(file, records.reference, f"{number + 1:03}")
                write_array_records(folder / name, [hit])


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


def _answer(planned: PlannedTest, test: VirtualTest, seed: int, laws: Laws, *, by_hit: bool) -> str:
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
    parts += [
        "[[bad_hit]]\n" + _rows(_describe_bad_hit(file, reference, number, hit, by_hit=by_hit))
        for file in planned.plan.files
        for reference in file.references
        for number, hit in enumerate(test.bad_hits[file.file, reference], start=1)
        if hit is not None
    ]
    return "\n".join(parts)


def _describe_bad_hit(
    file: RecordedFile, reference: Port, number: int, hit: BadHit, *, by_hit: bool
) -> dict[str, Any]:
    """Return what is wrong with a hit, as answer.toml states it."""
    return {
        "file": name_hits(file, reference, f"{number:03}") if by_hit else file.file,
        "reference": str(reference),
        "hit": number,
        "kind": hit.kind,
        "struck": str(hit.struck),
        "channels": [str(file.outputs[k]) for k in hit.channels],
    }


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
