"""Sensor whose channels are exchanged or reversed, as by its cables or by a turn of 90 degrees.

No small change of a tolerance leads there, so that a fit pulls other tolerances instead. For each
sensor, its readings in every order and with every sign are compared with a tuned model:

    misfit = sum over tests and lines of |readings - model|^2 / |readings|^2

The order that leaves the least is named, if it explains the sensor's readings.
"""

from collections.abc import Iterator, Sequence
from itertools import permutations, product

import numpy as np

from identification.words import Campaign, Complex, Dof, Real

# Part of the misfit that another order may leave. The sensor's channels then fit the model better
# than all else that is wrong, since the model itself was fitted to the wrong order.
MAX_LEFT_SHARE = 0.5
_MAX_TIE = 1.1  # ratio of misfits: of orders alike, that with the fewest changes is named


def name_exchanged_channels(predicted: Sequence[Complex], campaign: Campaign) -> str | None:
    """Return a clause on the sensor whose channels fit the model best in another order.

    Args:
        predicted: answers of the tuned model to each test; (n_freq, n_out, 1) each.

    Returns:
        The clause; None if each sensor fits best as it is, or no order explains it.
    """
    best: tuple[float, str] | None = None
    for site in dict.fromkeys(dof.point for dof in campaign.outputs if isinstance(dof, Dof)):
        candidate = _find_order(site, predicted, campaign)
        if candidate is not None and (best is None or candidate[0] < best[0]):
            best = candidate
    return None if best is None else best[1]


def _find_order(
    site: str, predicted: Sequence[Complex], campaign: Campaign
) -> tuple[float, str] | None:
    """Return the share of the misfit that another order of a sensor leaves, and its clause."""
    axes, pairs = _collect_readings(site, predicted, campaign)
    if not pairs:
        return None
    given = _misfit(pairs, range(len(axes)), np.ones(len(axes)))
    misfits = {
        (order, signs): _misfit(pairs, order, np.array(signs))
        for order in permutations(range(len(axes)))
        for signs in product((1.0, -1.0), repeat=len(axes))
    }
    least = min(misfits.values())
    close = (key for key, misfit in misfits.items() if misfit <= _MAX_TIE * least)
    order, signs = min(close, key=lambda key: len(list(_changes(axes, *key))))
    left = misfits[order, signs] / given if given > 0 else 1.0
    if left > MAX_LEFT_SHARE:
        return None
    changes = ", ".join(_changes(axes, order, signs))
    return left, (
        f"{site} reads as if its cables were exchanged or its axes turned by right angles: "
        f"{changes}"
    )


def _collect_readings(
    site: str, predicted: Sequence[Complex], campaign: Campaign
) -> tuple[tuple[str, ...], list[tuple[Complex, Complex]]]:
    """Return the axes that a sensor has in every test, and its readings beside the model's.

    Both are along the positive axes, (n_freq, n_axis) for each test.
    """
    tables = []
    for model, test in zip(predicted, campaign.tests, strict=True):
        estimate = test.estimate
        outputs = estimate.frf.outputs
        rows = {
            dof.direction[1:]: row
            for row, dof in enumerate(outputs)
            if isinstance(dof, Dof) and dof.point == site and estimate.measured[row, 0]
            if not dof.is_rotation
        }
        if rows:
            signs = np.array([dof.sign for dof in outputs])
            tables.append((rows, estimate.frf.values[..., 0] * signs, model[..., 0] * signs))
    axes = tuple(sorted(set.intersection(*(set(rows) for rows, _, _ in tables)))) if tables else ()
    picked = [[rows[axis] for axis in axes] for rows, _, _ in tables]
    return axes, [
        (values[:, rows], model[:, rows])
        for rows, (_, values, model) in zip(picked, tables, strict=True)
        if axes
    ]


def _misfit(pairs: Sequence[tuple[Complex, Complex]], order: Sequence[int], signs: Real) -> float:
    """Return the misfit of readings in another order with other signs."""
    total = 0.0
    for values, model in pairs:
        size = (np.abs(values) ** 2).sum(axis=1)
        difference = (np.abs(values[:, list(order)] * signs - model) ** 2).sum(axis=1)
        total += float((difference[size > 0] / size[size > 0]).sum())
    return total


def _changes(axes: Sequence[str], order: Sequence[int], signs: Sequence[float]) -> Iterator[str]:
    """Yield which motion each channel reads, where it is not its own."""
    for true, (place, sign) in enumerate(zip(order, signs, strict=True)):
        if place != true or sign < 0:
            yield f"channel {axes[place]} is {'-' if sign < 0 else '+'}{axes[true]}"
