"""Tests of a campaign from files that hold time records instead of FRFs."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import compress
from pathlib import Path

import numpy as np

from identification.continuous import ContinuousEstimate, estimate_continuous_frf, remove_hold
from identification.hits.detection import find_blows, is_continuous, refuse_exchanged_force
from identification.hits.hit_frfs import estimate_hit_frfs
from identification.hits.remarks import window_remarks
from identification.hits.settings import HitSettings
from identification.readers.array_files import load_arrays
from identification.readers.array_records import holds_time_records, read_array_records
from identification.readers.campaign_toml import (
    CampaignSettings,
    TestSettings,
)
from identification.readers.controller import find_controller
from identification.readers.drive_log import read_drive_log
from identification.readers.file_kinds import (
    array_description,
    is_arrays,
    is_universal,
)
from identification.readers.frf_units import parse_frf_units
from identification.readers.instrument_toml import SensorSettings
from identification.readers.log_toml import LogSettings
from identification.readers.uff_records import holds_uff_time_records, read_uff_records
from identification.words import Condition, HitEstimate, InputError, Port, Records, Test

# Keys of a [[test]] that only time records use.
_RECORD_KEYS = (
    "block_s",
    "pretrigger_s",
    "force_window_s",
    "exponential_tau",
    "estimator",
    "reject",
)

_Arrays = dict[str, np.ndarray]  # content of a .mat or .npz file, by name

# Returns responses and references of a file at sites instead of node numbers.
SiteNamer = Callable[
    [Path, tuple[Port, ...], tuple[Port, ...]], tuple[tuple[Port, ...], tuple[Port, ...]]
]


def tests_from_records(
    path: Path, settings: CampaignSettings, name_sites: SiteNamer
) -> tuple[dict[str, list[Test]], tuple[str, ...]]:
    """Estimate the tests of all files with time records, with common blocks and windows.

    Args:
        path: path of campaign.toml.
        name_sites: function that names the sites of responses and references of a file.

    Returns:
        Tests by file, and remarks on the hits.

    Raises:
        InputError: records cannot be used, or a key does not apply to the kind of file.
    """
    entries: list[TestSettings] = []
    records: list[Records] = []
    for entry in settings.test:
        for reference in read_records(path, entry, settings.sensor, name_sites):
            entries.append(entry)
            records.append(reference)
    if not records:
        return {}, ()
    is_hit = [
        entry.log is None
        and not each.further_references
        and not is_continuous(each, find_blows(each))
        for entry, each in zip(entries, records, strict=True)
    ]
    of_entries = [hit_settings(entry) for entry in entries]
    estimates = iter(
        estimate_hit_frfs(list(compress(records, is_hit)), list(compress(of_entries, is_hit)))
        if any(is_hit)
        else ()
    )
    tests: dict[str, list[Test]] = {}
    remarks: list[str] = []
    all_hits: list[HitEstimate] = []
    for entry, each, setting, is_of_hits in zip(entries, records, of_entries, is_hit, strict=True):
        if is_of_hits:
            hits = next(estimates)
            all_hits.append(hits)
            test = Test(_condition(entry, each), hits.estimate, hits)
            remarks += [*hits.remarks, *_hit_count_remarks(entry, hits)]
        else:
            if entry.log is None:
                refuse_exchanged_force(each)
            continuous = estimate_continuous_frf(each, setting)
            remarks += continuous.remarks
            if entry.log is not None:
                remarks += _bias_remark(entry.log, each, setting, continuous)
                if entry.log.hold:
                    continuous = remove_hold(continuous, each.rate_hz)
            test = Test(_condition(entry, each), continuous.estimate)
        tests.setdefault(entry.file, []).append(test)
    of_files = dict.fromkeys(remark for reference in records for remark in reference.remarks)
    once = dict.fromkeys(remarks)  # forces that act at once share what is said of them
    return tests, (*of_files, *once, *window_remarks(all_hits))


def _bias_remark(
    log: LogSettings, records: Records, setting: HitSettings, continuous: ContinuousEstimate
) -> list[str]:
    """Return a remark on the direct estimate in a closed loop, whose coherence hides its bias.

    Args:
        log: settings of the record.
        records: its signals.
        setting: settings of the estimate.
        continuous: FRFs by references, or direct ones.
    """
    if continuous.blocks.kind == "periodic":
        return []
    if not len(records.set_points):
        return [
            f"{log.file}: no reference is stated, so that FRFs are estimated from motors and "
            "encoders directly; if the loop was closed they are biased towards the inverse of the "
            "controller, which no coherence shows: record the reference or an injected "
            "disturbance, and name it under [log], or state controllers there"
        ]
    if motors := [name for name, column in log.motors.items() if column in log.references]:
        return [
            f"{log.file}: references name the column of {' and '.join(motors)}, which holds what a "
            "closed loop makes of the noise: right only where no loop was closed; else name the "
            "reference or an injected disturbance"
        ]
    unaided = replace(records, set_points=np.zeros((0, *records.force.shape)))
    direct = estimate_continuous_frf(unaided, setting).estimate
    estimate = continuous.estimate
    _, rows, lines = np.intersect1d(direct.frf.freq_hz, estimate.frf.freq_hz, return_indices=True)
    values, variance = estimate.frf.values[lines], estimate.variance[lines]
    square = np.abs(direct.frf.values[rows] - values) ** 2
    power = (np.abs(values) ** 2).sum()
    if not square.sum() > 2 * variance.sum() or not power > 0:
        return []
    bias = (square - variance).sum() / power
    return [
        f"{log.file}: estimated from motors and encoders directly, FRFs along {records.reference} "
        f"would be off by {100 * np.sqrt(bias):.2g} %, root mean square, as the loop was closed"
    ]


def _condition(entry: TestSettings, records: Records) -> Condition:
    units = parse_frf_units(Path(entry.file), records.quantity, entry.unit)
    return Condition(
        entry.file,
        records.reference,
        entry.level,
        entry.spindle_speed,
        entry.setup,
        entry.hammer,
        entry.variant,
        units.drive_unit(records.reference),
        entry.state,
    )


def read_records(
    path: Path, entry: TestSettings, corrections: dict[str, SensorSettings], name_sites: SiteNamer
) -> Iterator[Records]:
    """Yield the records of a file at their sites, without the channels that are ignored.

    A file of FRFs has none.

    Args:
        path, name_sites: as for ``tests_from_records``.
        entry: the file's ``[[test]]``.
        corrections: ``[sensor]`` tables of campaign.toml.

    Raises:
        InputError: the file cannot be read, or a key does not apply to it.
    """
    if "*" in entry.file:
        raise InputError(
            f"{path}: {entry.file} stands for hits that come one by one: mbw live reads them, and "
            "writes a campaign of the accepted ones for the other verbs"
        )
    file = path.parent / entry.file
    forces, arrays = len(entry.references or "1"), None
    if entry.log is not None:
        tables = entry.log.controllers.items()
        controllers = {
            motor: find_controller(path, f"log.controllers.{motor}", table.controller)
            for motor, table in tables
        }
        arrays = read_drive_log(file, entry.log, controllers)
    elif is_arrays(file):
        arrays = load_arrays(file, entry.columns, forces)
    if not _has_time_records(file, arrays):
        for key in _RECORD_KEYS:
            if getattr(entry, key) is not None:
                raise InputError(
                    f"{file} holds FRFs, but {key} is for time records: remove {key} from its "
                    "[[test]]"
                )
        return
    if entry.frequency_unit is not None:
        raise InputError(
            f"{file} holds time records, but frequency_unit is for FRFs: remove it from its "
            "[[test]]"
        )
    ignored = {(site, axis) for site, sensor in corrections.items() for axis in sensor.ignore}
    for records in _read_records(file, entry, arrays):
        outputs, (reference,) = name_sites(file, records.outputs, (records.reference,))
        kept = np.array([(dof.point, dof.direction[-1:]) not in ignored for dof in outputs])
        if not kept.any():
            raise InputError(
                f"{file}: all channels of reference {reference} are ignored: ignore fewer"
            )
        remarks = (*records.remarks, *_time_sign_remark(entry))
        located = replace(
            records, outputs=outputs, reference=reference, test=entry.file, remarks=remarks
        )
        yield located.select_channels(kept)


def _time_sign_remark(entry: TestSettings) -> list[str]:
    """Return a remark on a stated time sign, which time records do not have."""
    if entry.time_sign == "+":
        return []
    return [
        f"{entry.file}: time_sign has no effect on time records, whose FRFs are computed as "
        "exp(+i w t)"
    ]


def _has_time_records(file: Path, arrays: _Arrays | None) -> bool:
    """Return whether a file holds time records."""
    if arrays is not None:
        return holds_time_records(arrays)
    return is_universal(file) and holds_uff_time_records(file)


def _read_records(file: Path, entry: TestSettings, arrays: _Arrays | None) -> tuple[Records, ...]:
    """Read the time records of a file, with points named as in the file."""
    if arrays is not None:
        return read_array_records(file, arrays, **array_description(file, entry))
    return read_uff_records(
        file, entry.quantity, entry.unit, channels=entry.channels, references=entry.references
    )


def hit_settings(entry: TestSettings) -> HitSettings:
    """Return the settings of the hits of a ``[[test]]``."""
    return HitSettings(
        block_s=entry.block_s,
        pretrigger_s=entry.pretrigger_s,
        force_window_s=entry.force_window_s,
        exponential_tau=entry.exponential_tau,
        window_tau=entry.window_tau,
        estimator=entry.estimator or "H1",
        reject=entry.reject is not False,
        period_s=None if entry.log is None else entry.log.period,
    )


def _hit_count_remarks(entry: TestSettings, hits: HitEstimate) -> list[str]:
    """Return a remark if the number of hits is not that of campaign.toml."""
    n_hit = len(hits.kept) + len(hits.rejected)
    if entry.averages in (None, n_hit):
        return []
    return [
        f"{entry.file}, hammer at {hits.reference}: {n_hit} hits were found, but campaign.toml "
        f"says averages = {entry.averages}"
    ]
