"""Which point data of a mesh are displacement shapes, by their names and frequencies.

Programs write rotations, reactions and stresses beside the displacements, a field of each for every
mode. Fields whose names differ by numbers alone are one family. A family of another quantity is
left out; real and imaginary parts are joined.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from identification.words import InputError, Real, group_by_key

_NUMBER_PATTERN = r"(?<![\d.,])(?P<hz>[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?)"
_FREQUENCY_PATTERNS = (
    re.compile(_NUMBER_PATTERN + r"\s*Hz\b", re.IGNORECASE),
    re.compile(r"\bf(?:req(?:uency)?)?\s*[=:]\s*" + _NUMBER_PATTERN, re.IGNORECASE),
    re.compile(r"\[(?P<step>\d+)\]\s*-\s*" + _NUMBER_PATTERN + r"$"),
)
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
_IMAGINARY_WORDS, _REAL_WORDS = ("im", "imag", "imaginary"), ("re", "real")
# Beginnings of words for displacements, and symbols of Abaqus, Ansys and Code_Aster.
_DISPLACEMENT_STEMS, _DISPLACEMENT_SYMBOLS = ("disp", "depl", "transl", "defl"), ("u", "t")
# Words for quantities that are no displacement in English, and in the fields of Code_Aster.
_OTHER_STEMS = (
    *("rot", "reac", "forc", "moment", "stress", "strain", "velo", "accel", "grad", "normals"),
    *("phase", "angle", "magn", "amplitude", "pressure", "temper", "coord", "energ", "error"),
    *("sigm", "sief", "sieq", "epsi", "epeq", "vite", "acce", "erro", "ener", "flux"),
)
# Symbols that count only beside a family of displacements, since they may be anything.
_OTHER_SYMBOLS = (
    *("ur", "rf", "rm", "rt", "cf", "cm", "cu", "v", "vr", "a", "ar", "s", "e", "le", "pe", "ee"),
    *("r", "f", "m", "theta", "phi", "th", "drx", "dry", "drz"),
)
_MIN_FAMILY = 2  # fields of one name: a single "rigid rotation about x" describes a mode


@dataclass(frozen=True, eq=False)
class ShapeField:
    """A displacement shape among the point data.

    Args:
        name: name of the point data.
        number: number of the mode in the file; None if the name holds none.
        frequency: frequency that the name holds [Hz]; None without one.
        values: displacements; (n_point, 3).
    """

    name: str
    number: int | None
    frequency: float | None
    values: Real


@dataclass(frozen=True)
class _Name:
    """Parts of the name of point data.

    Attributes:
        text: the name.
        words: words without numbers, and without those for real and imaginary parts.
        integers: integers beside the frequency.
        frequency: [Hz]; None if the name holds none.
        part: ``real``, ``imaginary`` or empty.
    """

    text: str
    words: tuple[str, ...]
    integers: tuple[int, ...]
    frequency: float | None
    part: str

    @classmethod
    def parse(cls, text: str) -> "_Name":
        """Return the parts of a name."""
        match = next((m for pattern in _FREQUENCY_PATTERNS if (m := pattern.search(text))), None)
        rest = text if match is None else f"{text[: match.start()]} {text[match.end() :]}"
        integers = [int(digits) for digits in re.findall(r"\d+", rest)]
        if match is not None and "step" in match.groupdict():
            integers = [int(match["step"]) + 1]  # steps count from 0, modes from 1
        words = [word.lower() for word in _WORD.findall(rest)]
        part = ""
        if any(word in _IMAGINARY_WORDS for word in words):
            part = "imaginary"
        elif any(word in _REAL_WORDS for word in words):
            part = "real"
        plain = tuple(word for word in words if word not in (*_IMAGINARY_WORDS, *_REAL_WORDS))
        frequency = None if match is None else float(match["hz"])
        return cls(text, plain, tuple(integers), frequency, part)


@dataclass(frozen=True, eq=False)
class _Family:
    """Fields whose names differ by numbers and by real or imaginary part alone."""

    words: tuple[str, ...]
    names: tuple[_Name, ...]

    def number(self, name: _Name) -> int | None:
        """Return the mode's number: of the integers in a name, the first that varies."""
        counts = {len(member.integers) for member in self.names}
        if counts != {len(name.integers)} or not name.integers:
            return None
        columns = zip(*(member.integers for member in self.names), strict=True)
        varying = [k for k, column in enumerate(columns) if len(set(column)) > 1]
        return name.integers[varying[0] if varying else -1]

    def keys(self) -> set[tuple[str, float]]:
        """Return the frequencies of the fields, or their numbers where names hold none."""
        keys: set[tuple[str, float]] = set()
        for name in self.names:
            number = self.number(name)
            if name.frequency is not None:
                keys.add(("Hz", name.frequency))
            elif number is not None:
                keys.add(("number", number))
        return keys

    @property
    def is_displacement(self) -> bool:
        """Whether a word says that the fields are displacements."""
        return any(
            word in _DISPLACEMENT_SYMBOLS or word.startswith(_DISPLACEMENT_STEMS)
            for word in self.words
        )

    @property
    def is_other(self) -> bool:
        """Whether a word says that the fields are another quantity."""
        return any(word.startswith(_OTHER_STEMS) for word in self.words)

    @property
    def label(self) -> str:
        """Return the name of the first field, and their number."""
        count = len(self.names)
        return self.names[0].text if count == 1 else f"{self.names[0].text} .. ({count} fields)"


def choose_shapes(source: str, data: dict[str, Real]) -> tuple[list[ShapeField], tuple[str, ...]]:
    """Return the displacement shapes among point data, and remarks on what was left out.

    Args:
        source: name of the file, for messages.
        data: point data by name with at least three components; (n_point, n_component) each.

    Raises:
        InputError: no field is a displacement, or two fields a mode could be.
    """
    groups = group_by_key((name.words, name) for name in map(_Name.parse, data))
    families = [_Family(words, tuple(names)) for words, names in groups.items()]
    kept = _drop_rivals(source, _drop_other_quantities(families))
    left_out = [family for family in families if family not in kept]
    if not kept:
        raise InputError(
            f"{source} has no displacement shapes: by their names, its point data are "
            f"{_list_labels(left_out)}. Write displacements, named as 'U mode 1 (34.5 Hz)'."
        )
    remarks = []
    if left_out:
        verb = "is" if len(left_out) == 1 and len(left_out[0].names) == 1 else "are"
        remarks.append(
            f"{source}: {_list_labels(left_out)} {verb} not displacements beside "
            f"{_list_labels(kept)} and {verb} left out"
        )
    fields: list[ShapeField] = []
    for family in kept:
        shapes, part_remarks = _join_parts(source, family, data)
        fields += shapes
        remarks += part_remarks
    if not fields:
        raise InputError(
            f"{source} has imaginary parts alone ({_list_labels(kept)}). Write real parts too."
        )
    return fields, tuple(remarks)


def _drop_other_quantities(families: Sequence[_Family]) -> list[_Family]:
    """Return the families without those of another quantity, by their words and symbols."""
    plain = [family for family in families if not family.is_other]
    kept = [
        family
        for family in families
        if not family.is_other or (len(family.names) < _MIN_FAMILY and not _meets(family, plain))
    ]
    certain = [family for family in kept if not set(family.words) & set(_OTHER_SYMBOLS)]
    return [family for family in kept if family in certain or not _meets(family, certain)]


def _meets(family: _Family, rivals: Iterable[_Family]) -> bool:
    """Return whether another family has a field at a frequency of this one."""
    keys = family.keys()
    return any(keys & rival.keys() for rival in rivals if rival is not family)


def _drop_rivals(source: str, families: Sequence[_Family]) -> list[_Family]:
    """Return the families without those beside which another one is named as displacements.

    Raises:
        InputError: two families have fields at the same frequencies, and nothing says which of them
            are displacements.
    """
    named = [family for family in families if family.is_displacement]
    kept = [family for family in families if family in named or not _meets(family, named)]
    # "mode 1" beside "pseudo mode 1": the name without a further word is that of the shape.
    kept = [
        family
        for family in kept
        if not any(
            set(rival.words) < set(family.words) and _is_at_same_modes(family, rival)
            for rival in kept
        )
    ]
    for number, family in enumerate(kept):
        for rival in kept[:number]:
            if _is_at_same_modes(family, rival):
                raise InputError(
                    f"{source} has two fields a mode, {rival.label} and {family.label}, and "
                    "neither name says which are displacements. Write the displacements alone, or "
                    "name them as 'U mode 1 (34.5 Hz)'."
                )
    return kept


def _is_at_same_modes(first: _Family, second: _Family) -> bool:
    """Return whether all fields of the smaller family stand at modes of the other one."""
    smaller, larger = sorted((first.keys(), second.keys()), key=len)
    return len(smaller) >= _MIN_FAMILY and smaller <= larger


def _join_parts(
    source: str, family: _Family, data: dict[str, Real]
) -> tuple[list[ShapeField], list[str]]:
    """Return the shapes of a family, each complex one turned to its best real shape."""
    imaginary = {
        (family.number(name), name.frequency): name
        for name in family.names
        if name.part == "imaginary"
    }
    fields: list[ShapeField] = []
    rests: dict[str, float] = {}
    for name in family.names:
        if name.part == "imaginary":
            continue
        number, values = family.number(name), data[name.text][:, :3]
        pair = imaginary.pop((number, name.frequency), None)
        if pair is not None:
            values, rests[name.text] = best_real_shape(values + 1j * data[pair.text][:, :3])
        fields.append(ShapeField(name.text, number, name.frequency, values))
    remarks = []
    if rests:
        worst = max(rests, key=lambda name: rests[name])
        remarks.append(
            f"{source}: {len(rests)} complex modes were joined from real and imaginary parts and "
            f"turned to their best real shapes; up to {100 * rests[worst]:.2g} % of a shape stays "
            f"imaginary and is left out ({worst})"
        )
    if imaginary:
        alone = _Family(family.words, tuple(imaginary.values()))
        remarks.append(f"{source}: {alone.label}: imaginary without a real part, left out")
    return fields, remarks


def best_real_shape(shape: np.ndarray) -> tuple[Real, float]:
    """Return the real shape nearest to a complex one of any phase, and the share that it lacks.

    The turn z exp(-i a) has the largest real part, sum Re(z exp(-i a))^2, for
    2 a = arg(sum z^2).

    Args:
        shape: complex shape.

    Returns:
        The real part of the turned shape, and the norm of its imaginary part over that of z.
    """
    turned = shape * np.exp(-0.5j * np.angle(np.sum(shape**2)))
    size = float(np.linalg.norm(shape))
    return turned.real, float(np.linalg.norm(turned.imag)) / size if size else 0.0


def _list_labels(families: Sequence[_Family]) -> str:
    """Return the labels of families as text."""
    return ", ".join(family.label for family in families)
