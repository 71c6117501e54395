"""Files of a virtual hammer test that imitates a campaign."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification import read_settings
from identification.words import (
    MAX_FREQUENCY_HZ,
    Campaign,
    Dof,
    InputError,
    Signal,
    Tolerance,
    UsageError,
    count_noun,
    shorten_names,
)
from mbmodel import RecordedFile
from mbmodel.virtual_test.plan import BAND_SHARE
from mbw.messages import SCREEN
from mbw.simulate.option_values import TestOptions
from tuning import open_campaign

DEFAULT_LEVEL_N = 200.0
DEFAULT_HITS = 10


@dataclass(frozen=True)
class ImitatedTest:
    """Files, recorder and tolerances of a campaign.

    Args:
        files: one for each file of the campaign.
        rate_hz: samples per second [Hz].
        block_s: length of the record of a hit [s].
        tolerance: of machine and instruments.
    """

    files: tuple[RecordedFile, ...]
    rate_hz: float
    block_s: float
    tolerance: Tolerance


def imitate_campaign(options: TestOptions, like: Path, suffix: str) -> ImitatedTest:
    """Return files, recorder and tolerances of a campaign.

    Args:
        options: of the user, whose levels replace those of the campaign.
        like: the campaign.
        suffix: of the files, such as ``.npz``.

    Raises:
        UsageError: the options state another number of levels than the campaign has.
        InputError: the campaign cannot be read, or motors drive it.
    """
    source, settings = read_settings(like)
    if settings.model is None:
        raise InputError(f"{source} names no model: --like needs a campaign with one")
    if any(entry.variant for entry in settings.test):
        raise InputError(
            f"{source}: some [[test]] has a model or pose of its own: simulate a campaign without"
        )
    if settings.loop:
        raise InputError(
            f"{source}: loop.{next(iter(settings.loop))} was closed during the test, and a "
            "simulation in time has no controllers: predict its FRFs by mbw predict --closed"
        )
    _, _, campaign = open_campaign(source, (0.0, MAX_FREQUENCY_HZ))
    freq = campaign.freq_hz
    hits = [test.hits for test in campaign.tests if test.hits is not None]
    rate = hits[0].rate_hz if hits else float(np.round(freq[-1] / BAND_SHARE, 6))
    block = hits[0].block_s if hits else float(1 / np.median(np.diff(freq)))
    levels = _replace_levels(campaign, options, like)
    outputs = [dof for test in campaign.tests for dof in test.estimate.frf.outputs]
    signals = list(dict.fromkeys(str(dof) for dof in outputs if isinstance(dof, Signal)))
    if signals:
        SCREEN.say(
            f"{shorten_names(signals)}: left out, since a virtual hammer test records "
            "accelerometers alone"
        )
    names = list(dict.fromkeys(test.condition.test for test in campaign.tests))
    files = [_imitate_file(campaign, name, options, levels) for name in names]
    stems = [f"{_name_level(file)}{suffix}" for file in files] if options.levels else names
    renamed = [
        replace(file, file=name)
        for file, name in zip(files, name_records(stems, suffix), strict=True)
    ]
    return ImitatedTest(tuple(renamed), rate, block, campaign.tolerance)


def _replace_levels(
    campaign: Campaign, options: TestOptions, like: Path
) -> Mapping[float | None, float]:
    """Return the level of the virtual test for each different level of the campaign [N]."""
    levels = list(dict.fromkeys(test.condition.level_n for test in campaign.tests))
    stated = [level or DEFAULT_LEVEL_N for level in levels]
    if options.levels and len(options.levels) != len(levels):
        texts = ", ".join("unknown" if level is None else f"{level:g} N" for level in levels)
        raise UsageError(
            f"--like {like} has {count_noun(len(levels), 'level')} ({texts}): give --level once "
            "for each of them, in this order, or leave it out"
        )
    return dict(zip(levels, options.levels or stated, strict=True))


def _name_level(file: RecordedFile) -> str:
    """Return a name by level and set-up, such as ``hits_40N_a``."""
    return f"hits_{file.level_n:g}N{f'_{file.setup}' if file.setup else ''}"


def name_records(names: Sequence[str], suffix: str) -> list[str]:
    """Return names of files of records in one folder, each once, for any files of a campaign.

    Args:
        names: of the campaign's files, which may lie in folders.
        suffix: of the names that are returned, such as ``.npz``.
    """
    stems = [
        "_".join(part for part in Path(name).with_suffix("").parts if part not in ("..", "/"))
        for name in names
    ]
    return [
        f"{stem}{f'_{number + 1}' if stems.count(stem) > 1 else ''}{suffix}"
        for number, stem in enumerate(stems)
    ]


def _imitate_file(
    campaign: Campaign, name: str, options: TestOptions, levels: Mapping[float | None, float]
) -> RecordedFile:
    """Return the file of a virtual test that is like a file of a campaign."""
    tests = [test for test in campaign.tests if test.condition.test == name]
    references: list[Dof] = []
    for test in tests:
        if isinstance(test.condition.reference, Signal):
            raise InputError(
                f"{name}: {test.condition.reference} is a motor, which no hammer replaces: play a "
                "signal at it instead"
            )
        references.append(test.condition.reference)
    condition, estimate, hits = tests[0].condition, tests[0].estimate, tests[0].hits
    count = estimate.averages if hits is None else len(hits.kept) + len(hits.rejected)
    return RecordedFile(
        file=name,
        level_n=levels[condition.level_n],
        outputs=tuple(dof for dof in estimate.frf.outputs if isinstance(dof, Dof)),
        references=tuple(references),
        hits=options.hits or count or DEFAULT_HITS,
        setup=condition.setup,
        hammer=condition.hammer,
    )
