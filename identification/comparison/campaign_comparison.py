"""Comparison of tests: modes of each on common lines, and FRFs cell by cell."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import chain, islice
from pathlib import Path

import numpy as np

from identification.comparison.compared_modes import (
    ComparedMode,
    TestedModes,
    pair_tests,
    select_modes,
)
from identification.modal import MeasuredFrfs, identify
from identification.readers.frequency_lines import keep_common_lines
from identification.roving_hammer import is_roving_hammer
from identification.words import (
    Campaign,
    Complex,
    InputError,
    Integers,
    Output,
    Real,
    group_by_key,
    shorten_names,
)

_MIN_AXIS_SHARE = 0.5  # of the fewest lines of a test: axes that meet now and then are not one
_MIN_COMPARED_LINES = 16  # lines that an identification needs
# Of two levels: peaks of hits by hand scatter by some ten per cent about the level that is stated.
_MAX_LEVEL_RATIO = 1.25


@dataclass(frozen=True)
class CellDifference:
    """Difference of one FRF between two tests.

    Args:
        output, input: labels of channel and reference.
        over_noise: root of the squared difference over the sum of both variances, over all lines;
            1 is noise alone.
        relative: norm of the difference over that of the first FRF.
    """

    output: str
    input: str
    over_noise: float
    relative: float


@dataclass(frozen=True, eq=False)
class TestComparison:
    """Tests beside each other.

    Args:
        names: names of the tests.
        band: lowest and highest frequency that was compared [Hz].
        outputs: channels that all tests share, at which shapes are compared.
        modes: modes of all tests, paired.
        frfs: measured FRFs of each test.
        remarks: sentences on what could not be compared.
    """

    __test__ = False  # tells pytest that this is no test case

    names: tuple[str, ...]
    band: tuple[float, float]
    outputs: tuple[Output, ...]
    modes: tuple[ComparedMode, ...]
    frfs: tuple[MeasuredFrfs, ...]
    remarks: tuple[str, ...] = ()

    @property
    def common_hz(self) -> Real:
        """Frequency lines that all tests have [Hz]; none without a common axis; (n_line,)."""
        axes = [frfs.freq_hz for frfs in self.frfs]
        common: Real = reduce(np.intersect1d, axes)
        is_axis = len(common) >= _MIN_AXIS_SHARE * min(map(len, axes))
        return common if is_axis else common[:0]


def name_campaigns(sources: Sequence[Path]) -> list[str]:
    """Return names of campaigns that differ: of their folders, with as many parents as that takes.

    Args:
        sources: folders, or their campaign.toml.
    """
    parts = [
        (path.resolve().parent if path.suffix == ".toml" else path.resolve()).parts
        for path in sources
    ]
    longest = max(map(len, parts))
    for count in range(1, longest + 1):
        names = ["-".join(each[-count:]).strip("/") for each in parts]
        if len(set(names)) == len(names):
            break
    return names


def compare_tests(campaigns: Sequence[Campaign], names: Sequence[str]) -> TestComparison:
    """Identify the modes of campaigns on their common lines, and pair them at shared channels.

    Args:
        campaigns: at least two, each in its own band.
        names: names of the campaigns, as ``name_campaigns`` gives them.

    Raises:
        InputError: the campaigns share no channel or too few frequency lines, or one of them
            cannot be identified, or states itself what is before and after a change.
    """
    for campaign, name in zip(campaigns, names, strict=True):
        if campaign.has_states:
            raise InputError(
                f"{name} states tests before and after a change itself: call mbw diagnose on it, "
                "or compare campaigns without states"
            )
    chosen, remarks = _select_levels(campaigns, names)
    chosen, of_lines = _share_lines(chosen, names)
    remarks += of_lines
    identifications = [identify(campaign) for campaign in chosen]
    outputs = _share_channels([model.outputs for model, _, _ in identifications], names)
    tested: list[TestedModes] = [
        select_modes(model, identified, outputs) for model, identified, _ in identifications
    ]
    low = max(float(c.freq_hz[c.freq_hz > 0][0]) for c in chosen)
    band = (low, min(float(c.freq_hz[-1]) for c in chosen))
    remarks += _describe_unshared(chosen, names, outputs)
    return TestComparison(
        tuple(names),
        band,
        outputs,
        tuple(pair_tests(tested, band)),
        tuple(frfs for _, _, frfs in identifications),
        tuple(remarks),
    )


def _select_levels(
    campaigns: Sequence[Campaign], names: Sequence[str]
) -> tuple[list[Campaign], list[str]]:
    """Return the tests at levels that all campaigns have, so that the level is no difference.

    Args:
        campaigns: tests with or without levels.
        names: names of the campaigns.

    Returns:
        The campaigns, and remarks on tests that are left out and on levels that differ.
    """
    levels = [{test.condition.level_n for test in campaign.tests} for campaign in campaigns]
    if any(None in each for each in levels):
        return list(campaigns), []
    kept = []
    for campaign in campaigns:
        tests = tuple(
            test
            for test in campaign.tests
            if all(_has_level(each, test.condition.level_n) for each in levels)
        )
        kept.append(tests)
    if not all(kept):
        texts = (
            f"{name} {', '.join(f'{level:g}' for level in sorted(filter(None, each)))}"
            for name, each in zip(names, levels, strict=True)
        )
        return list(campaigns), [
            f"the levels of the tests differ ({'; '.join(texts)}): what depends on the level "
            "seems to have changed"
        ]
    omitted = sum(len(c.tests) - len(tests) for c, tests in zip(campaigns, kept, strict=True))
    remarks = (
        [f"tests at levels that not all campaigns have are left out: {omitted}"] if omitted else []
    )
    return [replace(c, tests=tests) for c, tests in zip(campaigns, kept, strict=True)], remarks


def _has_level(levels: set[float | None], level: float | None) -> bool:
    """Return whether a set of levels holds about this one."""
    return level is not None and any(
        each is not None and max(each, level) <= _MAX_LEVEL_RATIO * min(each, level)
        for each in levels
    )


def _share_lines(
    campaigns: Sequence[Campaign], names: Sequence[str]
) -> tuple[list[Campaign], list[str]]:
    """Return the campaigns on the frequency lines that all of them have.

    Without a common axis each keeps its lines in the band that all have: modes need no more.

    Returns:
        The campaigns, and a remark if there is no common axis.

    Raises:
        InputError: too few lines in the band of all.
    """
    tests, _ = keep_common_lines([test for campaign in campaigns for test in campaign.tests])
    low = max(float(campaign.freq_hz[0]) for campaign in campaigns)
    high = min(float(campaign.freq_hz[-1]) for campaign in campaigns)
    axes = [test.estimate.frf.freq_hz for test in tests]
    if all(np.array_equal(axis, axes[0]) for axis in axes[1:]):
        remaining = iter(tests)
        shared = [
            replace(campaign, tests=tuple(islice(remaining, len(campaign.tests))))
            for campaign in campaigns
        ]
        remarks = []
    else:
        inside = [(c.freq_hz >= low) & (c.freq_hz <= high) for c in campaigns]
        pairs = zip(campaigns, inside, strict=True)
        shared = [c.select_lines(lines) if lines.any() else c for c, lines in pairs]
        remarks = ["the tests have no common frequency axis: modes are compared, FRFs are not"]
    if high <= low or min(len(campaign.freq_hz) for campaign in shared) < _MIN_COMPARED_LINES:
        lines = "; ".join(
            f"{name} has {len(c.freq_hz)} from {c.freq_hz[0]:g} to {c.freq_hz[-1]:g} Hz"
            for name, c in zip(names, campaigns, strict=True)
        )
        raise InputError(
            f"the tests share too few frequency lines to be compared ({lines}): export one band, "
            "or state a band that all have"
        )
    return shared, remarks


def _share_channels(
    outputs: Sequence[tuple[Output, ...]], names: Sequence[str]
) -> tuple[Output, ...]:
    """Return the channels that all tests have.

    Raises:
        InputError: there is none.
    """
    shared = tuple(dof for dof in outputs[0] if all(dof in each for each in outputs[1:]))
    if not shared:
        texts = "; ".join(
            f"{name}: {shorten_names(each)}" for name, each in zip(names, outputs, strict=True)
        )
        raise InputError(f"the tests have no channel in common ({texts}): name their sensors alike")
    return shared


def _describe_unshared(
    campaigns: Sequence[Campaign], names: Sequence[str], shared: Sequence[Output]
) -> list[str]:
    """Return which channels and references not all campaigns have, and what reciprocity replaces.

    Args:
        campaigns: as they were compared.
        names: their names.
        shared: channels at which shapes were compared.
    """
    texts: list[str] = []
    exchanged: set[Output] = set()
    if len({is_roving_hammer(campaign) for campaign in campaigns}) > 1:
        for campaign, name in zip(campaigns, names, strict=True):
            if hit := [dof for dof in shared if dof not in campaign.outputs]:
                where = shorten_names(hit)
                texts.append(f"{name}: motion at {where} is that of hits there, by reciprocity")
                exchanged |= set(hit)
    kinds = (
        ("is read by", "are read by", [campaign.outputs for campaign in campaigns]),
        (
            "is a reference of",
            "are references of",
            [[dof for dof in c.inputs if dof not in exchanged] for c in campaigns],
        ),
    )
    for singular, plural, lists in kinds:
        owned = list(zip(names, lists, strict=True))
        groups = group_by_key(
            (tuple(name for name, ports in owned if port in ports), port)
            for port in dict.fromkeys(chain(*lists))
        )
        texts += [
            f"{shorten_names(ports)} {plural if len(ports) > 1 else singular} "
            f"{shorten_names(owners)} alone"
            for owners, ports in groups.items()
            if len(owners) < len(names)
        ]
    return texts


def compare_frfs(comparison: TestComparison) -> tuple[CellDifference, ...]:
    """Return the difference of each FRF that both tests have, over noise, largest first.

    Args:
        comparison: two tests, perhaps of two quantities; without a common axis nothing is compared.
    """
    first, second = comparison.frfs
    lines = [np.searchsorted(frfs.freq_hz, comparison.common_hz) for frfs in comparison.frfs]
    rows = []
    for output in (dof for dof in first.outputs if dof in second.outputs):
        for source in (dof for dof in first.inputs if dof in second.inputs):
            cells = [
                (frfs.outputs.index(output), frfs.inputs.index(source)) for frfs in (first, second)
            ]
            if not (first.measured[cells[0]] and second.measured[cells[1]]):
                continue
            value, noise = _read_cell(first, cells[0], lines[0], first.order)
            second_value, second_noise = _read_cell(second, cells[1], lines[1], first.order)
            square = float((np.abs(second_value - value) ** 2).sum())
            total = float((noise + second_noise).sum())
            size = float((np.abs(value) ** 2).sum())
            if not (total > 0 and size > 0):
                continue
            over = square / total
            row = CellDifference(str(output), str(source), over**0.5, (square / size) ** 0.5)
            rows.append(row)
    return tuple(sorted(rows, key=lambda row: -row.over_noise))


def _read_cell(
    frfs: MeasuredFrfs, cell: tuple[int, int], lines: Integers, order: int
) -> tuple[Complex, Real]:
    """Return values and variance of a cell on some lines, as another number of derivatives."""
    factor = (2j * np.pi * frfs.freq_hz[lines]) ** (order - frfs.order)
    where = (lines, *cell)
    values: Complex = frfs.values[where] * factor
    return values, frfs.variance[where] * np.abs(factor) ** 2
