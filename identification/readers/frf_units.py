"""Units of FRFs that campaign.toml states, by kind of motion and of what drives.

The key ``unit`` holds one unit or several, such as ``g/N, rad/s^2/(N m)``. Each states the unit of
one kind of motion (along an axis, about it) and of one kind of drive (force, torque, or a signal in
counts, volts or amperes). Kinds that no unit states are in SI units.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification.readers.toml_files import toml_key
from identification.readers.units import (
    common_frf_units,
    force_label_factor,
    is_electrical_label,
    motion_label_factor,
    parse_frf_unit,
    quantity_of_unit,
    rotation_label_factor,
    torque_label_factor,
)
from identification.words import Campaign, Dof, Input, InputError, Output, Quantity, Real, Signal
from identification.words.ports import FLOOR

_TRANSLATION, _ROTATION, _FORCE, _TORQUE, _SIGNAL = (
    "translations",
    "rotations",
    "forces",
    "torques",
    "signals",
)
_CONTROL_UNIT = "control"  # unit of a motor in the files of mbw: what its actuator takes


@dataclass(frozen=True, eq=False)
class FrfUnits:
    """Factors from the units of a file to SI units.

    Args:
        motion: factor of each kind of motion that is stated.
        drive: factor of each kind of drive that is stated.
        quantity: of the FRFs, to which the motions belong.
        signal_unit: unit of the signals that drive, such as V; empty without any.
    """

    motion: dict[str, float]
    drive: dict[str, float]
    quantity: Quantity
    signal_unit: str = ""

    def motion_factor(self, output: Output) -> float | None:
        """Return the factor of the motion at an output, or None if no unit states it.

        A joint or MuJoCo sensor goes by the unit of signals, else by the only one of motions. A
        MuJoCo sensor reads its own quantity, so that only the unit of a position can be its.
        """
        if self.reads_signal(output):
            return self.motion[_SIGNAL]
        if isinstance(output, Signal) and not output.is_directed:
            is_own = output.is_joint or self.quantity == "receptance"
            return next(iter(self.motion.values())) if is_own and len(self.motion) == 1 else None
        return self.motion.get(_ROTATION if output.is_rotation else _TRANSLATION)

    def reads_signal(self, output: Output) -> bool:
        """Return whether an output is in counts, volts or amperes.

        Motions of points are so only where no unit of their kind is stated.
        """
        if isinstance(output, Signal) and not output.is_directed:
            return _SIGNAL in self.motion
        kind = _ROTATION if output.is_rotation else _TRANSLATION
        return _SIGNAL in self.motion and kind not in self.motion

    def drives_by_signal(self, reference: Input) -> bool:
        """Return whether what drives at a reference is in counts, volts or amperes.

        Forces and torques are so only where no unit of their kind is stated.
        """
        if isinstance(reference, Signal) and not reference.is_directed:
            return _SIGNAL in self.drive
        kind = _TORQUE if reference.is_rotation else _FORCE
        return _SIGNAL in self.drive and kind not in self.drive

    def drive_factor(self, reference: Input) -> float | None:
        """Return the factor of what drives at a reference, or None if no unit states it."""
        if self.drives_by_signal(reference):
            return self.drive[_SIGNAL]
        if isinstance(reference, Signal) and not reference.is_directed:
            return None
        return self.drive.get(_TORQUE if reference.is_rotation else _FORCE)

    def drive_unit(self, reference: Input) -> str:
        """Return the unit in which what drives at a reference is held, such as N, N m or V.

        Forces and torques are converted to SI units, signals are not. The control of a motor has
        no unit that is known, unless it is stated.
        """
        if self.drives_by_signal(reference):
            return self.signal_unit
        if isinstance(reference, Signal) and not reference.is_directed and not reference.is_joint:
            return ""
        if reference.point == FLOOR:
            return "rad/s^2" if reference.is_rotation else "m/s^2"
        return "N m" if reference.is_rotation else "N"

    def factors(self, outputs: tuple[Output, ...], references: tuple[Input, ...]) -> Real:
        """Return the factors of FRFs, SI where no unit states a kind; (n_out, n_in).

        Transmissibilities of the floor are plain ratios of accelerations.
        """
        motion = [self.motion_factor(output) or 1.0 for output in outputs]
        drive = [self.drive_factor(reference) or 1.0 for reference in references]
        factors: Real = np.divide.outer(np.array(motion), np.array(drive))
        factors[:, [reference.point == FLOOR for reference in references]] = 1.0
        return factors

    @property
    def scalar(self) -> float:
        """Factor of translations per force."""
        output = reference = Dof("any", "+tx")
        return (self.motion_factor(output) or 1.0) / (self.drive_factor(reference) or 1.0)

    def list_kinds_in_si(
        self, outputs: tuple[Output, ...], references: tuple[Input, ...]
    ) -> list[str]:
        """List what a file holds and no unit states, where some unit is not SI.

        Joints and MuJoCo sensors are listed by their names, all else by kinds.
        """
        values = (*self.motion.values(), *self.drive.values())
        if all(value == 1.0 for value in values):
            return []
        motions = [dof for dof in outputs if self.motion_factor(dof) is None]
        drives = [
            dof for dof in references if isinstance(dof, Dof) and self.drive_factor(dof) is None
        ]
        kinds = [
            str(dof)
            if isinstance(dof, Signal) and not dof.is_directed
            else _ROTATION
            if dof.is_rotation
            else _TRANSLATION
            for dof in motions
        ]
        kinds += [_TORQUE if dof.is_rotation else _FORCE for dof in drives]
        return list(dict.fromkeys(kinds))


def parse_frf_units(path: Path, quantity: Quantity, unit: str | None) -> FrfUnits:
    """Return the units that campaign.toml states for a file.

    Args:
        unit: one unit or several with commas, such as ``g/N``; None for SI.

    Raises:
        InputError: a unit does not belong to the quantity, or two contradict each other.
    """
    units, signal_unit = FrfUnits({}, {}, quantity), ""
    for entry in unit.split(",") if unit is not None else ():
        motion_text, slash, drive_text = entry.rpartition("/")
        motion = _motion(motion_text, quantity) if slash else None
        drive = _drive(drive_text)
        if motion is None or drive is None:
            raise InputError(f"{path}: {_describe_wrong_unit(entry.strip(), quantity)}")
        if drive[0] == _SIGNAL:
            signal_unit = drive_text.strip()
        for known, (kind, factor) in ((units.motion, motion), (units.drive, drive)):
            if known.setdefault(kind, factor) != factor:
                raise InputError(
                    f"{path}: unit {unit!r} states two units of {kind}: leave one of them"
                )
    return replace(units, signal_unit=signal_unit)


def labelled_unit(
    path: Path, arrays: dict[str, np.ndarray], quantity: Quantity, stated: str | None
) -> tuple[str | None, tuple[str, ...]]:
    """Return the unit of a text file, by campaign.toml or else by its headings, and remarks.

    Args:
        path: the file, for remarks.
        arrays: content of the file; ``unit_label`` holds the unit of its headings.
        stated: unit that campaign.toml states; None if it states none.
    """
    label = str(arrays.get("unit_label", ""))
    if stated is not None or not label:
        return stated, ()
    motion, _, drive = label.rpartition("/")
    if drive == _CONTROL_UNIT and (_motion(motion, quantity) or ("", 0.0))[1] == 1:
        return None, ()  # as the drive's own unit is not known, nothing is read otherwise
    if motion == drive and not is_electrical_label(drive):
        return None, ()  # a ratio, as of accelerations of table and floor
    if signals := [part for part in (motion, drive) if is_electrical_label(part)]:
        is_unit = _motion(motion, quantity) is not None and _drive(drive) is not None
        return label if is_unit else None, (
            f"{path.name}: its headings name {label}: {' and '.join(signals)} count as the units "
            'of sensors and motors in the model; if they are others, state gain = "unknown" under '
            "[sensor.NAME] or [hammer.NAME]",
        )
    if parse_frf_unit(label, quantity) is None:
        return None, (
            f"{path.name}: its headings name {label}, which is no single unit of {quantity}, so "
            "that the numbers count as SI: state unit and quantity beside its file",
        )
    return label, (
        f"{path.name}: its headings name the unit {label}: state unit beside its file if they "
        "are wrong",
    )


def unit_remarks(
    path: Path, units: FrfUnits, outputs: tuple[Output, ...], references: tuple[Input, ...]
) -> tuple[str, ...]:
    """Return a remark if a file holds kinds of motion or drive that its unit does not state."""
    kinds = units.list_kinds_in_si(outputs, references)
    if not kinds:
        return ()
    return (
        f"{path.name}: unit states no unit of {' and '.join(kinds)}, which are read in SI units; "
        'state it too, as in unit = "g/N, rad/s^2/(N m)"',
    )


def refuse_signals_of_known_gain(path: Path, campaign: Campaign, units: dict[str, str]) -> None:
    """Raise InputError for channels or forces in counts, volts or amperes whose gain is known.

    Args:
        path: path of campaign.toml.
        campaign: tests with the gains that are unknown.
        units: unit that campaign.toml states, by file.
    """
    unknown = campaign.unknown_gains
    for test in campaign.tests:
        estimate, condition = test.estimate, test.condition
        unit = units.get(condition.test)
        stated = parse_frf_units(path, estimate.frf.quantity, unit)
        reference = condition.reference
        is_force = isinstance(reference, Dof) or reference.is_directed or reference.is_joint
        if (
            is_force
            and stated.drives_by_signal(reference)
            and condition.instrument not in unknown.hammers
        ):
            raise InputError(
                f"{path}: {condition.test}: unit {unit!r} gives what drives {reference} as a "
                f'signal: add [hammer.{toml_key(condition.instrument)}] with gain = "unknown", or '
                "state the unit of the force"
            )
        read = {dof.point for dof in estimate.frf.outputs if stated.reads_signal(dof)}
        if sites := read - unknown.sensors:
            raise InputError(
                f"{path}: {condition.test}: unit {unit!r} gives the motion as a signal: add "
                f'[sensor.{toml_key(min(sites))}] with gain = "unknown", or state the unit of the '
                "motion"
            )


def _motion(text: str, quantity: Quantity) -> tuple[str, float] | None:
    """Return kind and factor of a motion; None if it is no motion of the quantity."""
    if (factor := motion_label_factor(text, quantity)) is not None:
        return _TRANSLATION, factor
    if (factor := rotation_label_factor(text, quantity)) is not None:
        return _ROTATION, factor
    return (_SIGNAL, 1.0) if is_electrical_label(text) else None


def _drive(text: str) -> tuple[str, float] | None:
    """Return kind and factor of a force, torque or signal; None if it is none."""
    if (factor := force_label_factor(text)) is not None:
        return _FORCE, factor
    if (factor := torque_label_factor(text)) is not None:
        return _TORQUE, factor
    return (_SIGNAL, 1.0) if is_electrical_label(text) else None


def _describe_wrong_unit(unit: str, quantity: Quantity) -> str:
    """Return what is wrong with a unit, and what to write."""
    belongs = quantity_of_unit(unit)
    remedy = f'set quantity = "{belongs}", or ' if belongs else ""
    return (
        f"unit {unit!r} is not a unit of {quantity}: {remedy}write a motion over a force such as "
        f"{', '.join(common_frf_units(quantity))}, with rad for rotations, N m for torques, and "
        "count, V or A for signals"
    )
