"""Reader of controllers of one input and one output: from zeros, poles and gain, or a .mat file.

Tables of control loops, as they stand in campaign.toml and budget.toml.
"""

import re
from collections.abc import Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Discriminator, Field, Tag

from identification.readers.matlab5 import read_matlab5
from identification.readers.toml_files import (
    FILE_TAG,
    TABLE_TAG,
    FileName,
    TomlTable,
    tag_file_or_table,
)
from identification.words import Controller, InputError, Quantity, Real

_MAX_ROOTS = 100  # of a controller
MIN_PERIOD_S = 1e-7  # of a sampled controller
Root = float | Annotated[list[float], Field(min_length=2, max_length=2)]


class ControllerTable(TomlTable):
    """A controller by its zeros and poles [rad/s]; a complex one is ``[real, imaginary]``.

    With the sampling period ``period`` [s] it is sampled, and zeros and poles are those in z.
    """

    zeros: list[Root] = Field(default_factory=list, max_length=_MAX_ROOTS)
    poles: list[Root] = Field(default_factory=list, max_length=_MAX_ROOTS)
    gain: float
    period: float | None = Field(default=None, ge=MIN_PERIOD_S, le=1.0)


# A file beside the TOML file, or zeros, poles and gain.
ControllerSource = Annotated[
    Annotated[FileName, Tag(FILE_TAG)] | Annotated[ControllerTable, Tag(TABLE_TAG)],
    Discriminator(tag_file_or_table),
]


class LoopTable(TomlTable):
    """Settings of ``[loop.NAME]``: a controller between an output and an input.

    Simulations in time have the ``resolution`` of the encoder, the ``quantisation`` of the control
    and its ``limit``, which linear predictions leave out.
    """

    input: str
    output: str
    minus: str | None = None
    quantity: Quantity = "receptance"
    controller: ControllerSource
    delay: float = Field(default=0.0, ge=0, le=1.0)
    resolution: float = Field(default=0.0, ge=0)
    quantisation: float = Field(default=0.0, ge=0)
    limit: float | None = Field(default=None, gt=0)


class CampaignLoopTable(LoopTable):
    """Settings of ``[loop.NAME]`` in campaign.toml: a loop that was closed during the test.

    ``as_stated = true`` says that it is right, even if the nominal machine is unstable with it.
    """

    as_stated: bool = False


def as_roots(values: Sequence[Root]) -> list[complex]:
    """Return zeros or poles as complex numbers."""
    return [complex(*value) if isinstance(value, list) else complex(value) for value in values]


# A complex zero or pole without its conjugate: relative distance that counts as none.
_MAX_CONJUGATE_ERROR = 1e-6
_DELAY_NAME = re.compile(r"delays?(_s)?$", re.IGNORECASE)
_CONTROLLER_REMEDY = "give A, B, C, D, or num, den, or zeros, poles, gain"


def find_controller(path: Path, key: str, source: str | ControllerTable) -> Controller:
    """Return the controller that a TOML file names, or describes by zeros, poles and gain.

    Args:
        path: the TOML file.
        key: key of the table that holds the controller, for messages.
        source: file beside the TOML file, or zeros, poles and gain.

    Raises:
        InputError: the controller cannot be read.
    """
    if isinstance(source, str):
        return read_controller(path.parent / source)
    try:
        return controller_from_roots(
            as_roots(source.zeros), as_roots(source.poles), source.gain, source.period or 0.0
        )
    except ValueError as error:
        raise InputError(f"{path}: {key}.controller: {error}") from error


def controller_from_roots(
    zeros: Sequence[complex], poles: Sequence[complex], gain: float, period_s: float = 0.0
) -> Controller:
    """Return ``gain prod(s - zero) / prod(s - pole)``, zeros and poles in rad/s.

    Args:
        zeros: [rad/s], or in z.
        poles: likewise.
        gain: of the product.
        period_s: sampling period [s], for zeros and poles in z; 0 for a continuous controller.

    Raises:
        ValueError: more zeros than poles, or a complex root without its conjugate.
    """
    import scipy.signal  # noqa: PLC0415  # slow to load, and few commands need it

    for name, roots in (("zeros", zeros), ("poles", poles)):
        values = np.array(roots, complex)
        scale = max(1.0, float(np.abs(values).max(initial=0.0)))
        pairs = np.abs(np.sort_complex(values) - np.sort_complex(values.conj()))
        if (pairs > _MAX_CONJUGATE_ERROR * scale).any():
            raise ValueError(f"{name} hold a complex number without its conjugate: add it")
    if len(zeros) > len(poles):
        remedy = "poles at 0 for its delay" if period_s else "the poles that limit its bandwidth"
        raise ValueError(f"{len(zeros)} zeros and {len(poles)} poles: add {remedy}")
    if not poles:
        return Controller(
            np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[gain]]), period_s
        )
    # One after the other, sections of second order keep the digits that one polynomial loses.
    blocks = [
        _real_arrays(scipy.signal.tf2ss(np.real(np.poly(top)), np.real(np.poly(bottom))))
        for top, bottom in _sections(zeros, poles)
    ]
    states, entry, output, through = reduce(_in_series, blocks)
    return Controller(states, entry, gain * output, gain * through, period_s)


def read_controller(path: Path) -> Controller:
    """Read a controller from a .mat file with A, B, C, D, with num, den, or zeros, poles, gain.

    A sampling period ``Ts`` or ``dt`` above 0 says that it is sampled.

    Raises:
        InputError: the file cannot be read, or holds no controller, or one with a delay.
    """
    import scipy.signal  # noqa: PLC0415  # slow to load, and few commands need it

    try:
        arrays = read_matlab5(path)
    except OSError as error:
        raise InputError(
            f"{path} cannot be read ({error.strerror}): name a .mat file of a controller"
        ) from error
    except ValueError as error:
        raise InputError(
            f"{path}: {error}: {_CONTROLLER_REMEDY}, saved with -v7 or older"
        ) from error
    period = _period_of(path, arrays)
    late = stated_delay(arrays)
    if late:
        raise InputError(f"{path}: {late}")
    try:
        if set("ABCD") <= set(arrays):
            matrices = [np.atleast_2d(np.real(arrays[name])) for name in "ABCD"]
            return Controller(matrices[0], matrices[1], matrices[2], matrices[3], period)
        if {"num", "den"} <= set(arrays):
            numerator, denominator = (np.ravel(arrays[name]) for name in ("num", "den"))
            a, b, c, d = _real_arrays(scipy.signal.tf2ss(numerator, denominator))
            return Controller(a, b, c, d, period)
        if {"zeros", "poles", "gain"} <= set(arrays):
            zeros, poles, gain = (np.ravel(arrays[name]) for name in ("zeros", "poles", "gain"))
            return controller_from_roots(
                zeros.tolist(), poles.tolist(), float(gain[0].real), period
            )
    except (ValueError, TypeError, IndexError) as error:
        raise InputError(f"{path} holds no controller ({error}): {_CONTROLLER_REMEDY}") from error
    raise InputError(f"{path} holds no controller: {_CONTROLLER_REMEDY}")


def stated_delay(values: Mapping[str, Any]) -> str:
    """Return what to do about a delay that a controller states beside its matrices; or empty.

    Args:
        values: such as InputDelay or output_delay, by name.
    """
    for name, value in values.items():
        if _DELAY_NAME.search(name) and np.any(np.asarray(value, float) != 0):
            return (
                f"{name} is not zero, but would be left out: set it to zero and "
                "state delay [s] of the loop, or put Pade's fraction or samples of delay into the "
                "controller"
            )
    return ""


def _period_of(path: Path, arrays: Mapping[str, Any]) -> float:
    """Return the sampling period of a controller [s]; 0 if it is continuous.

    Raises:
        InputError: it is sampled with a period that is not known, or cannot be used.
    """
    for step in ("dt", "Ts"):
        if step not in arrays:
            continue
        values = np.ravel(np.asarray(arrays[step], float))
        period = float(values[0]) if len(values) == 1 else float("nan")
        if period == 0:
            return 0.0
        if MIN_PERIOD_S <= period <= 1:
            return period
        raise InputError(
            f"{path}: {step} = {period:g} s is no sampling period from {MIN_PERIOD_S:g} s to 1 s: "
            "state it, or 0 for a continuous controller"
        )
    return 0.0


def _sections(
    zeros: Sequence[complex], poles: Sequence[complex]
) -> list[tuple[list[complex], list[complex]]]:
    """Return zeros and poles of sections of first or second order, near each other."""
    remaining = sorted(_in_pairs(zeros), key=len)
    sections = []
    for pair in sorted(_in_pairs(poles), key=len, reverse=True):
        fitting = [top for top in remaining if len(top) <= len(pair)]
        # Two zeros fit two poles only: they come first.
        most = max((len(top) for top in fitting), default=0)
        nearest = min(
            (top for top in fitting if len(top) == most),
            key=lambda top: abs(np.log((abs(top[0]) + 1e-300) / (abs(pair[0]) + 1e-300))),
            default=[],
        )
        if nearest:
            remaining.remove(nearest)
        sections.append((nearest, pair))
    return sections


def _in_pairs(roots: Sequence[complex]) -> list[list[complex]]:
    """Return conjugate pairs, and real roots two by two in the order of their size."""
    complex_roots = [root for root in roots if root.imag > 0]
    real = sorted((complex(root.real) for root in roots if root.imag == 0), key=abs)
    pairs = [[root, root.conjugate()] for root in complex_roots]
    return pairs + [real[k : k + 2] for k in range(0, len(real), 2)]


def _in_series(first: list[Real], second: list[Real]) -> list[Real]:
    """Return A, B, C, D of two systems one after the other."""
    (a1, b1, c1, d1), (a2, b2, c2, d2) = first, second
    zero = np.zeros((len(a1), len(a2)))
    return [
        np.block([[a1, zero], [b2 @ c1, a2]]),
        np.vstack([b1, b2 @ d1]),
        np.hstack([d2 @ c1, c2]),
        d2 @ d1,
    ]


def _real_arrays(matrices: Sequence[Any]) -> list[Real]:
    return [np.atleast_2d(np.real(matrix)) for matrix in matrices]
