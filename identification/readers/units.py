"""Units of motion, force and frequency, as files label them and campaign.toml states them.

A unit of FRFs is a motion over a force, such as ``g/N``, ``(mm/s)/N`` or ``in/s^2/lbf``. One table
of motions and one of forces serve labels of universal files and the key ``unit``.
"""

from pathlib import Path

import numpy as np

from identification.words import Quantity

STANDARD_GRAVITY = 9.80665  # m/s^2 in one g
_POUND_FORCE = 4.4482216152605  # N in one lbf
SI_UNITS: dict[Quantity, str] = {
    "receptance": "m/N",
    "mobility": "m/s/N",
    "accelerance": "m/s^2/N",
}
_TIMES: dict[Quantity, str] = {"receptance": "", "mobility": "/s", "accelerance": "/s^2"}
_LENGTHS_M = {
    **{"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "micron": 1e-6, "nm": 1e-9},
    **{"in": 0.0254, "inch": 0.0254, "mil": 2.54e-5, "ft": 0.3048},
}
_GRAVITIES = {
    **dict.fromkeys(("g", "gn", "g's", "gs", "g_n", "g0"), STANDARD_GRAVITY),
    **{"mg": 1e-3 * STANDARD_GRAVITY, "ug": 1e-6 * STANDARD_GRAVITY, "gal": 1e-2},
}
_FORCES_N = {
    **{"N": 1.0, "mN": 1e-3, "daN": 10.0, "kN": 1e3, "MN": 1e6, "Newton": 1.0, "newton": 1.0},
    **{"n": 1.0, "kn": 1e3, "NEWTON": 1.0, "dyn": 1e-5},
    **dict.fromkeys(("lbf", "lb", "lbs", "LBF", "LB"), _POUND_FORCE),
    **{"kip": 1e3 * _POUND_FORCE, "kgf": STANDARD_GRAVITY, "kp": STANDARD_GRAVITY},
}
_ANGLES_RAD = {
    **{"rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "nrad": 1e-9, "arcsec": np.pi / 648000},
    **dict.fromkeys(("deg", "degree", "degrees", "°"), np.pi / 180),
}
_TORQUES_NM = {
    **dict.fromkeys(("Nm", "N.m", "N*m", "N-m", "Newtonmeter"), 1.0),
    **{"mNm": 1e-3, "kNm": 1e3, "Nmm": 1e-3, "Ncm": 1e-2},
    **dict.fromkeys(("lbfin", "lbf.in", "lbf*in", "inlbf", "lbin"), 0.0254 * _POUND_FORCE),
    **dict.fromkeys(("lbfft", "lbf.ft", "lbf*ft", "ftlbf", "lbft"), 0.3048 * _POUND_FORCE),
}
# Signals whose gain is unknown: their scale is found with the gain.
_ELECTRICAL_UNITS = ("count", "counts", "lsb", "digit", "digits", "v", "mv", "volt", "a", "ma")
_SPELLINGS = (
    ("²", "^2"),
    ("**", "^"),
    ("sec", "s"),
    ("s/s", "s^2"),
    ("s2", "s^2"),
    ("µ", "u"),
    ("μ", "u"),
)
# Units that exporters use, for messages and for the search of a wrong one.
_COMMON_LENGTHS, _COMMON_FORCES = ("m", "mm", "in"), ("N", "lbf", "kN")
TIME_UNITS_S = {
    **dict.fromkeys(("s", "sec", "second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "millisecond", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "\u00b5s", "\u03bcs", "usec", "microsecond", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nsec", "nanosecond", "nanoseconds"), 1e-9),
    **dict.fromkeys(("min", "minute", "minutes"), 60.0),
}
FREQUENCY_UNITS_HZ = {"Hz": 1.0, "rad/s": 1 / (2 * np.pi), "rpm": 1 / 60, "kHz": 1e3}


def motion_label_factor(label: str, quantity: Quantity) -> float | None:
    """Return the factor that converts a labelled motion to SI units; None for an unknown label.

    Args:
        label: unit of the motion, such as ``g`` or ``mm/s^2``.
        quantity: quantity of the FRF that has this motion.
    """
    text = _plain_label(label).lower()
    if quantity == "accelerance" and text in _GRAVITIES:
        return _GRAVITIES[text]
    time = _TIMES[quantity]
    length = text.removesuffix(time)
    return _LENGTHS_M.get(length) if text.endswith(time) else None


def force_label_factor(label: str) -> float | None:
    """Return the factor that converts a labelled force to newtons; None for an unknown label."""
    return _FORCES_N.get(_plain_label(label))


def rotation_label_factor(label: str, quantity: Quantity) -> float | None:
    """Return the factor that converts a labelled rotation to SI units; None for an unknown label.

    Args:
        label: unit of the rotation, such as ``deg/s^2``.
        quantity: quantity of the FRF that has this motion.
    """
    text, time = _plain_label(label).lower(), _TIMES[quantity]
    return _ANGLES_RAD.get(text.removesuffix(time)) if text.endswith(time) else None


def torque_label_factor(label: str) -> float | None:
    """Return the factor that converts a labelled torque to N m; None for an unknown label."""
    return _TORQUES_NM.get(_plain_label(label))


def is_electrical_label(label: str) -> bool:
    """Return whether a label gives a signal in counts, volts or amperes."""
    return _plain_label(label).lower() in _ELECTRICAL_UNITS


def is_unit_label(label: str) -> bool:
    """Return whether a label is a unit of motion, force, torque or a signal."""
    factors = [force_label_factor(label), torque_label_factor(label)]
    for quantity in SI_UNITS:
        factors += [motion_label_factor(label, quantity), rotation_label_factor(label, quantity)]
    return is_electrical_label(label) or any(factor is not None for factor in factors)


def is_gravity_label(label: str, quantity: Quantity) -> bool:
    """Return whether a label gives an acceleration in units of standard gravity."""
    return motion_label_factor(label, quantity) == STANDARD_GRAVITY


def frequency_label_factor(label: str) -> float | None:
    """Return the factor that converts a labelled frequency to hertz; None for an unknown label."""
    text = _plain_label(label).lower()
    return {name.lower(): factor for name, factor in FREQUENCY_UNITS_HZ.items()}.get(text)


def frequency_factor(path: Path, stated: str | None, label: str = "") -> tuple[float, list[str]]:
    """Return the factor that converts frequencies of a file to hertz, and remarks on it.

    Args:
        path: the file, for remarks.
        stated: unit that campaign.toml states, which counts first; None if it states none.
        label: unit that the file names; empty if it names none.
    """
    labelled = frequency_label_factor(label)
    if stated is not None:
        factor = FREQUENCY_UNITS_HZ[stated]
        overrides = labelled is not None and labelled != factor
        remark = (
            f'{path.name}: frequency_unit = "{stated}" of campaign.toml overrides '
            f"{label.strip()}, which the file names"
        )
        return factor, [remark] if overrides else []
    if labelled is None or labelled == 1.0:
        return 1.0, []
    return labelled, [
        f"{path.name}: frequencies are labelled {label.strip()} and converted to Hz; state "
        "frequency_unit in [[test]] if the label is wrong"
    ]


def parse_frf_unit(unit: str, quantity: Quantity) -> float | None:
    """Return the factor that converts FRFs in a unit to SI; None if it is no unit of the quantity.

    Args:
        unit: motion over force, such as ``g/N``, ``(m/s)/N`` or ``in/s^2/lbf``.
    """
    motion_text, slash, force_text = unit.rpartition("/")
    motion, force = motion_label_factor(motion_text, quantity), force_label_factor(force_text)
    return motion / force if slash and motion and force else None


def quantity_of_unit(unit: str) -> Quantity | None:
    """Return the quantity to which a unit of FRFs belongs, or None for an unknown unit.

    Args:
        unit: motion over force, torque or signal; of several with commas, the first counts.
    """
    motion, _, drive = unit.partition(",")[0].rpartition("/")
    is_drive = is_electrical_label(drive) or force_label_factor(drive) or torque_label_factor(drive)
    return next(
        (
            name
            for name in SI_UNITS
            if is_drive
            and (motion_label_factor(motion, name) or rotation_label_factor(motion, name))
        ),
        None,
    )


def common_frf_units(quantity: Quantity) -> dict[str, float]:
    """Return the units that exporters use for a quantity, each with its factor to SI."""
    motions = [f"{length}{_TIMES[quantity]}" for length in _COMMON_LENGTHS]
    motions += ["g"] if quantity == "accelerance" else []
    units = [f"{motion}/{force}" for force in _COMMON_FORCES for motion in motions]
    return {unit: parse_frf_unit(unit, quantity) or 1.0 for unit in units}


def _plain_label(label: str) -> str:
    """Return a label without brackets and spaces, in one spelling."""
    text = label.replace(" ", "").strip("[]()").replace(")", "").replace("(", "")
    for spelling, plain in _SPELLINGS:
        text = text.replace(spelling, plain)
    return text
