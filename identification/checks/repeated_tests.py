"""Check of whether one test is there twice, under another file name or another reference."""

from itertools import combinations
from pathlib import Path

import numpy as np

from identification.words import Campaign, Complex, InputError, Output, Test

_MAX_REPEATED_DIFFERENCE = (
    1e-5  # relative: what the six digits of text files leave of equal numbers
)


def refuse_repeated_tests(path: Path, campaign: Campaign) -> None:
    """Refuse a campaign in which two tests hold the same FRFs, up to signs of labels and rounding.

    Noise makes two real tests differ. A copy would count as new data, and two references with the
    same FRFs cannot be told apart.

    Raises:
        InputError: two tests are equal; the message names both.
    """
    columns = [_column(test) for test in campaign.tests]
    sizes = [_size(column) for column in columns]
    for first, second in combinations(range(len(columns)), 2):
        size = max(sizes[first], sizes[second])
        if size == 0 or abs(sizes[first] - sizes[second]) > _MAX_REPEATED_DIFFERENCE * size:
            continue
        if columns[first].keys() != columns[second].keys():
            continue
        difference = _size(
            {dof: columns[first][dof] - columns[second][dof] for dof in columns[first]}
        )
        if difference <= _MAX_REPEATED_DIFFERENCE * size:
            names = [_name(campaign.tests[number]) for number in (first, second)]
            raise InputError(
                f"{path}: {names[0]} and {names[1]} hold the same FRFs: one is a copy; remove it, "
                "or export the right one"
            )


def _column(test: Test) -> dict[Output, Complex]:
    """Return the FRFs of the measured channels, along positive axes of channel and reference."""
    frf = test.estimate.frf
    return {
        dof.positive: dof.sign * test.condition.reference.sign * frf.values[:, row, 0]
        for row, dof in enumerate(frf.outputs)
        if test.estimate.measured[row, 0]
    }


def _size(column: dict[Output, Complex]) -> float:
    """Return the norm of all FRFs of a test."""
    return float(np.sqrt(sum(float((np.abs(values) ** 2).sum()) for values in column.values())))


def _name(test: Test) -> str:
    """Return file and reference of a test."""
    return f"{test.condition.test} at {test.condition.reference}"
