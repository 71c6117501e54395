"""Faults of exported FRFs that a common factor, slope or frequency ratio against the model shows.

A fault has three numbers: the file's values as read over the true ones, the derivative order of the
true quantity minus that of the stated one, ``n``, and the file's frequencies ``f`` as read over the
true ones, ``axis``. With the stated quantity of order q, the values as read times (i w)^(2 - q)
have the level

    ln A(f / axis) + ln factor + n ln(2 pi f) + (2 - q - n) ln axis

where ln A is the level of the true accelerances.

Sensor whose channels are exchanged or reversed, as by its cables or by a turn of 90 degrees.

No small change of a tolerance leads there, so that a fit pulls other tolerances instead. For each
sensor, its readings in every order and with every sign are compared with a tuned model:

    misfit = sum over tests and lines of |readings - model|^2 / |readings|^2

The order that leaves the least is named, if it explains the sensor's readings.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations, product
from typing import Literal

import numpy as np

from identification.readers.units import FREQUENCY_UNITS_HZ, SI_UNITS, common_frf_units
from identification.words import DERIVATIVE_ORDER, Campaign, Complex, Dof, Quantity, Real

_MIN_LOG_FACTOR = np.log(2)  # ln of the smallest common factor that is a fault
_MILLIMETRE = 1e-3  # m
_ANGLES = {"deg": float(np.pi / 180), "mrad": 1e-3}  # rad
_RARE_FREQUENCY_UNITS = ("rpm",)  # of order analyses, hardly ever of FRFs


@dataclass(frozen=True)
class StatedExport:
    """Quantity and units with which a file was read.

    Args:
        quantity: quantity of the FRFs.
        unit: unit that campaign.toml states, or None.
        factor: factor of this unit to SI; 1 for None.
        frequency_unit: unit of the frequencies that campaign.toml states, or None.
        has_labels: whether the file may have labelled its units, and these were converted.
        columns: column of each motor and encoder of a log, by its name.
    """

    quantity: Quantity
    unit: str | None = None
    factor: float = 1.0
    frequency_unit: str | None = None
    has_labels: bool = False
    columns: Mapping[str, int | str] = field(default_factory=dict)


@dataclass(frozen=True)
class ExportFault:
    """A wrong unit, quantity or frequency unit of one file, and the key that corrects it.

    Args:
        reason: what the file holds instead, as a clause.
        remedy: keys of campaign.toml with their values.
        log_factor: ln of the values as read over the true ones.
        order: order of the true quantity minus that of the stated one.
        axis: frequencies as read over the true ones.
        is_rare: whether FRFs are hardly ever exported so.
        is_elsewhere: whether no key of the file corrects it, but the model or another export.
        parameters: parts of the names of the model's parameters that are wrong.
        parameter_factor: their true values over the nominal ones.
    """

    reason: str
    remedy: str
    log_factor: float = 0.0
    order: int = 0
    axis: float = 1.0
    is_rare: bool = False
    is_elsewhere: bool = False
    parameters: tuple[str, ...] = ()
    parameter_factor: float = 1.0

    def level_change(self, log_freq: Real, quantity: Quantity) -> Real:
        """Return what the fault adds to the level at frequencies as read.

        Args:
            log_freq: ln of the frequencies [ln Hz]; (n_bin,).
            quantity: stated quantity.
        """
        power = 2 - DERIVATIVE_ORDER[quantity] - self.order
        constant = self.log_factor + power * np.log(self.axis)
        return constant + self.order * (np.log(2 * np.pi) + log_freq)


def list_faults(stated: StatedExport, encoder: Literal["", "m", "rad"] = "") -> list[ExportFault]:
    """Return the faults that a file may have, given how it was read.

    Args:
        stated: how it was read.
        encoder: unit of what an encoder reads; empty for accelerometers.
    """
    return [
        *(_encoder_faults(stated, encoder) if encoder else ()),
        *(_unit_faults(stated) if encoder != "rad" else ()),
        *_quantity_faults(stated),
        *_axis_faults(stated),
        *_model_faults(),
    ]


DECIBELS = ExportFault(
    "magnitudes in decibels were read as linear values",
    "export linear complex FRFs",
    is_elsewhere=True,
)


def _model_faults() -> list[ExportFault]:
    """Return the faults of the model's units: masses in grams or in tonnes."""
    return [
        ExportFault(
            f"masses of the model were 1000 times too {size}, {unit}",
            f"{action} masses and inertias of the model by 1000",
            is_elsewhere=True,
            parameters=(".mass", ".inertia"),
            parameter_factor=factor,
        )
        for size, unit, action, factor in (
            ("large", "in grams", "divide", 1e-3),
            ("small", "in tonnes", "multiply", 1e3),
        )
    ]


def _unit_faults(stated: StatedExport) -> list[ExportFault]:
    """Return the faults of the unit: other units of the file, or SI values read in another unit."""
    read_as = stated.unit or SI_UNITS[stated.quantity]
    units = common_frf_units(stated.quantity)
    si_unit = SI_UNITS[stated.quantity]
    faults = [
        ExportFault(
            f"values in {unit} were read as {read_as}",
            f'unit = "{unit}"',
            float(np.log(stated.factor / factor)),
        )
        for unit, factor in units.items()
    ]
    if stated.has_labels and stated.unit is None:
        faults += [
            ExportFault(
                f"values in {si_unit} were labelled {unit}",
                f'unit = "{si_unit}"',
                float(np.log(factor)),
            )
            for unit, factor in units.items()
            if unit.endswith("/N") or unit.startswith(si_unit.removesuffix("/N"))
        ]
    return [fault for fault in faults if abs(fault.log_factor) >= _MIN_LOG_FACTOR]


def _encoder_faults(stated: StatedExport, unit: Literal["m", "rad"]) -> list[ExportFault]:
    """Return the faults of the unit of an encoder that no accelerometer has."""
    time = SI_UNITS[stated.quantity].removeprefix("m").removesuffix("/N")
    labels = [f"um{time}/N"] if unit == "m" else [f"{a}{time}/(N m)" for a in _ANGLES]
    read_as = stated.unit or (SI_UNITS[stated.quantity] if unit == "m" else f"rad{time}/(N m)")
    factors = [1e-6] if unit == "m" else list(_ANGLES.values())
    return [
        ExportFault(
            f"values in {label} were read as {read_as}",
            f'unit = "{label}"',
            float(np.log(stated.factor / factor)),
        )
        for label, factor in zip(labels, factors, strict=True)
        if label != stated.unit
    ]


def _quantity_faults(stated: StatedExport) -> list[ExportFault]:
    """Return the faults of the quantity, in SI units and in millimetres."""
    faults = []
    for quantity, order in DERIVATIVE_ORDER.items():
        if quantity == stated.quantity:
            continue
        si_unit = SI_UNITS[quantity]
        for unit, factor in ((si_unit, 1.0), (f"m{si_unit}", _MILLIMETRE)):
            needs_unit = stated.unit is not None or factor != 1.0
            faults.append(
                ExportFault(
                    f"{quantity} was read as {stated.quantity}",
                    f'quantity = "{quantity}"' + (f' and unit = "{unit}"' if needs_unit else ""),
                    float(np.log(stated.factor / factor)),
                    order - DERIVATIVE_ORDER[stated.quantity],
                )
            )
    return faults


def _axis_faults(stated: StatedExport) -> list[ExportFault]:
    """Return the faults of the frequency unit."""
    if stated.columns:  # the frequencies of a log are those of its times
        return [ExportFault("times in ms were read as s", 'time_unit = "ms"', axis=1e-3)]
    read_as = stated.frequency_unit or "Hz"
    read_hz = FREQUENCY_UNITS_HZ[read_as]
    return [
        ExportFault(
            f"frequencies in {unit} were read as {read_as}",
            f'frequency_unit = "{unit}"',
            axis=read_hz / hertz,
            is_rare=unit in _RARE_FREQUENCY_UNITS,
        )
        for unit, hertz in FREQUENCY_UNITS_HZ.items()
        if unit != read_as
    ]


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
