"""The files of a campaign that hold time records instead of FRFs."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from identification.hits.hit_frfs import estimate_all
from identification.hits.settings import HitSettings
from identification.readers.array_frfs import load_arrays
from identification.readers.array_records import are_records, read_array_records
from identification.readers.campaign_toml import CampaignSettings, SensorSettings, TestSettings
from identification.readers.file_kinds import is_arrays, is_universal, refuse_stated, stated
from identification.readers.uff_records import holds_records, read_uff_records
from identification.words import Condition, Dof, HitEstimate, InputError, Records, Test

_KEYS = (
    "block_s",
    "pretrigger_s",
    "force_window_s",
    "exponential_tau",
    "estimator",
    "reject",
)

_Arrays = dict[str, np.ndarray]  # of a .mat or .npz file, by name

# Sites instead of node numbers: of the responses and the references of a file.
Located = tuple[tuple[Dof, ...], tuple[Dof, ...]]
Locate = Callable[[Path, tuple[Dof, ...], tuple[Dof, ...]], Located]


def raw_tests(
    path: Path, settings: CampaignSettings, locate: Locate
) -> tuple[dict[str, list[Test]], tuple[str, ...]]:
    """Tests of all files with time records, cut, windowed and averaged alike.

    Args:
        path: of campaign.toml.
        settings: its content.
        locate: names the sites of a file's responses and references.

    Returns:
        Tests by file, and what a reader must know of the hits.

    Raises:
        InputError: records that cannot be used, keys that the kind of file has no use for.
    """
    entries: list[TestSettings] = []
    records: list[Records] = []
    for entry in settings.test:
        for own in _read(path, entry, settings.sensor, locate):
            entries.append(entry)
            records.append(own)
    if not records:
        return {}, ()
    found = estimate_all(records, [_hit_settings(entry) for entry in entries])
    tests: dict[str, list[Test]] = {}
    remarks: list[str] = []
    for entry, hits in zip(entries, found, strict=True):
        condition = Condition(
            entry.file, hits.reference, entry.level, entry.spindle_speed, entry.setup
        )
        tests.setdefault(entry.file, []).append(Test(condition, hits.estimate, hits))
        remarks += [*hits.remarks, *_counted(entry, hits)]
    return tests, tuple(remarks)


def _read(
    path: Path, entry: TestSettings, corrections: dict[str, SensorSettings], locate: Locate
) -> Iterator[Records]:
    """Records of a file at their sites, without the channels that are ignored."""
    file = path.parent / entry.file
    arrays = load_arrays(file) if is_arrays(file) else None
    if not _is_raw(file, arrays):
        for key in _KEYS:
            if getattr(entry, key) is not None:
                raise InputError(
                    f"{file} holds FRFs, and {key} is for time records: remove {key} from its "
                    "[[test]]"
                )
        return
    if entry.window_tau or entry.time_sign == "-":
        key = "window_tau" if entry.window_tau else "time_sign"
        raise InputError(
            f"{file} holds time records, and {key} is for FRFs: remove {key} from its [[test]]"
            + (", or state exponential_tau" if entry.window_tau else "")
        )
    ignored = {(site, axis) for site, wanted in corrections.items() for axis in wanted.ignore}
    for own in _records(file, entry, arrays):
        outputs, (reference,) = locate(file, own.outputs, (own.reference,))
        kept = np.array([(dof.point, dof.direction[-1]) not in ignored for dof in outputs])
        if not kept.any():
            raise InputError(f"{file}: no channel is left for reference {reference}: ignore fewer")
        yield replace(own, outputs=outputs, reference=reference, test=entry.file).channels(kept)


def _is_raw(file: Path, arrays: _Arrays | None) -> bool:
    if arrays is not None:
        return are_records(arrays)
    return is_universal(file) and holds_records(file)


def _records(file: Path, entry: TestSettings, arrays: _Arrays | None) -> tuple[Records, ...]:
    if arrays is not None:
        return read_array_records(file, arrays, **stated(file, entry))
    refuse_stated(file, entry)
    return read_uff_records(file, entry.quantity)


def _hit_settings(entry: TestSettings) -> HitSettings:
    return HitSettings(
        block_s=entry.block_s,
        pretrigger_s=entry.pretrigger_s,
        force_window_s=entry.force_window_s,
        exponential_tau=entry.exponential_tau,
        estimator=entry.estimator or "H1",
        reject=entry.reject is not False,
    )


def _counted(entry: TestSettings, hits: HitEstimate) -> list[str]:
    found = len(hits.kept) + len(hits.rejected)
    if entry.averages in (None, found):
        return []
    return [
        f"{entry.file}, hammer at {hits.reference}: {found} hits were found, campaign.toml says "
        f"averages = {entry.averages}"
    ]
