"""MATLAB files of versions 4 to 7, whose every size is checked before it is used.

The format is that of "MAT-File Format" (The MathWorks, R2024a). A variable is an element: a tag
with its kind and its number of bytes, then flags, dimensions, name and values as further elements.
Version 7 compresses each variable by zlib. scipy's reader trusts these numbers, and a
changed byte then ends the whole program; a child process for it takes a hundred times as long.
"""

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from identification.readers.inflation import refuse_inflation

_HEADER_BYTES, _VERSION_OFFSET = 128, 124
# Kinds of elements; names and dimensions have another kind in files of some writers.
_NAME, _SHAPE_KINDS, _FLAGS, _MATRIX, _COMPRESSED = (1, 16), (5, 6), (6,), 14, 15
_TYPE_OF_KIND = {
    **{1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"},
}
_NUMERIC_CLASSES = range(6, 16)  # double, single and integers
_STRUCT_CLASS, _MAX_STRUCT_DEPTH = 2, 16
_OPAQUE_CLASS = 17  # objects, which have no dimensions
_COMPLEX_FLAG = 0x800
_MAX_SHAPE_KINDS = 32
_TYPES_OF_VERSION_4 = ("f8", "f4", "i4", "i2", "u2", "u1")
_MAX_TRAILING_BYTES = 8  # after a compressed variable: writers may pad it
_NO_NUMBERS = np.empty(0, object)  # stands for text, cells, structures and sparse matrices


def read_matlab5(path: Path) -> dict[str, np.ndarray]:
    """Read the numeric variables by name, in the number types in which they are stored.

    What lies in a structure has its names before, as in ``log/signals/values``. Other variables are
    there without their content, as arrays of objects.

    Raises:
        ValueError: the file is damaged, or another format.
    """
    content = path.read_bytes()
    if len(content) < 4:
        raise ValueError("it is empty")
    if 0 in content[:4]:
        return dict(_read_version_4(content))
    order = {b"IM": "<", b"MI": ">"}.get(content[_VERSION_OFFSET + 2 : _HEADER_BYTES])
    if order is None or content[_VERSION_OFFSET + (order == "<")] != 1:
        raise ValueError("it has no header of MATLAB")
    return dict(_read_version_5(content, order))


@dataclass
class _Element:
    """Kind and bytes of one element."""

    kind: int
    data: memoryview


@dataclass
class _Elements:
    """Elements that follow each other in a buffer.

    Args:
        buffer: bytes of the elements.
        order: ``<`` or ``>``, the order of bytes.
        position: of the next element.
    """

    buffer: memoryview
    order: str
    position: int = 0

    def has_next(self) -> bool:
        """Return whether there are bytes beyond the last element."""
        return self.position < len(self.buffer)

    def next(self) -> _Element:
        """Return the next element; numbers up to 4 bytes stand within the tag."""
        begin = self.position + 8
        if begin > len(self.buffer):
            raise ValueError("it ends within a variable")
        kind, size = struct.unpack_from(self.order + "II", self.buffer, self.position)
        if kind >> 16:
            kind, size, begin = kind & 0xFFFF, kind >> 16, begin - 4
            if size > 4:
                raise ValueError("a short element is too long")
            self.position += 8
        else:
            # Elements begin at multiples of 8 bytes, but for compressed ones.
            self.position = begin + size + (0 if kind == _COMPRESSED else -size % 8)
        if begin + size > len(self.buffer):
            raise ValueError("it ends within a variable")
        return _Element(kind, self.buffer[begin : begin + size])

    def next_of(self, kinds: tuple[int, ...]) -> memoryview:
        """Return the bytes of the next element, which has to be of one of some kinds."""
        element = self.next()
        if element.kind not in kinds:
            raise ValueError("the parts of a variable are out of order")
        return element.data


def _read_version_5(content: bytes, order: str) -> Iterator[tuple[str, np.ndarray]]:
    """Yield name and values of each variable of versions 5 to 7."""
    elements = _Elements(memoryview(content), order, _HEADER_BYTES)
    inflated = 0
    while elements.has_next():
        element = elements.next()
        if element.kind == _COMPRESSED:
            element = _inflate(element.data, order, len(content), inflated)
            inflated += len(element.data)
        if element.kind != _MATRIX:
            raise ValueError("it holds an element that is no variable")
        yield from _read_matrix(_Elements(element.data, order))


def _inflate(data: memoryview, order: str, file_bytes: int, inflated: int) -> _Element:
    """Return the element that is compressed in another.

    Args:
        data: compressed bytes.
        order: of bytes.
        inflated: bytes of earlier variables of the file.
    """
    stream = zlib.decompressobj()
    tag = stream.decompress(data, 8)
    if len(tag) < 8:
        raise ValueError("it ends within a variable")
    kind, size = struct.unpack(order + "II", tag)
    refuse_inflation(inflated + size, file_bytes)
    content = stream.decompress(stream.unconsumed_tail, size) if size else b""
    if len(content) < size:
        raise ValueError("a compressed variable is shorter than it says")
    stream.decompress(stream.unconsumed_tail, _MAX_TRAILING_BYTES)
    if not stream.eof:
        raise ValueError("a compressed variable is longer than it says")
    return _Element(kind, memoryview(content))


def _read_matrix(
    parts: _Elements, known: str = "", depth: int = 0
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield name and values of one variable, and of what lies in it.

    Args:
        parts: elements of the variable.
        known: its name as a field of a structure.
        depth: number of structures about it.
    """
    flags, _ = struct.unpack(parts.order + "II", parts.next_of(_FLAGS)[:8])
    array_class = flags & 0xFF
    if array_class == _OPAQUE_CLASS:
        yield known or _name(parts.next_of(_NAME)), _NO_NUMBERS
        return
    shape = tuple(map(int, np.frombuffer(parts.next_of(_SHAPE_KINDS), parts.order + "i4")))
    stated = _name(parts.next_of(_NAME))
    name = known or stated
    if array_class not in _NUMERIC_CLASSES:
        yield name, _NO_NUMBERS
        if array_class == _STRUCT_CLASS and depth < _MAX_STRUCT_DEPTH:
            yield from _read_structure(name, parts, shape, depth)
        return
    if not 2 <= len(shape) <= _MAX_SHAPE_KINDS or min(shape) < 0:
        raise ValueError(f"{name} has the dimensions {shape}")
    values = _read_numbers(name, parts, shape)
    if flags & _COMPLEX_FLAG:
        values = _as_complex(values, _read_numbers(name, parts, shape))
    yield name, values


def _read_structure(
    name: str, parts: _Elements, shape: tuple[int, ...], depth: int
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the fields of a structure; those of an array of structures have a number, from 1."""
    length = int(np.frombuffer(parts.next_of(_SHAPE_KINDS), parts.order + "i4")[0])
    names = bytes(parts.next_of(_NAME))
    if not 0 < length <= max(len(names), 1):
        raise ValueError(f"{name} has field names of {length} bytes")
    fields = [_name(memoryview(names[k : k + length])) for k in range(0, len(names), length)]
    place = 0
    while fields and parts.has_next():
        number, field = divmod(place, len(fields))
        group = name if math.prod(shape) == 1 else f"{name}({number + 1})"
        element = parts.next_of((_MATRIX,))
        if len(element):  # an empty field may have no parts
            inner = _Elements(element, parts.order)
            yield from _read_matrix(inner, f"{group}/{fields[field].split(chr(0))[0]}", depth + 1)
        place += 1


def _read_numbers(name: str, parts: _Elements, shape: tuple[int, ...]) -> np.ndarray:
    """Return the real or imaginary part of a variable, the first index fastest in the file."""
    element = parts.next()
    kind = _TYPE_OF_KIND.get(element.kind)
    if kind is None:
        raise ValueError(f"{name} has numbers of the unknown kind {element.kind}")
    return _as_array(name, element.data, parts.order + kind, shape)


def _as_array(name: str, data: memoryview, kind: str, shape: tuple[int, ...]) -> np.ndarray:
    """Return bytes as an array of the native order of bytes, if they fit its shape."""
    numbers = np.dtype(kind)
    if math.prod(shape) * numbers.itemsize != len(data):
        raise ValueError(f"{name} of {len(data)} bytes does not fit the dimensions {shape}")
    values = np.frombuffer(data, numbers).astype(numbers.newbyteorder("="))
    return values.reshape(shape, order="F")


def _as_complex(real: np.ndarray, imaginary: np.ndarray) -> np.ndarray:
    """Return complex values; their sum would make NaN of an infinite part."""
    is_single = real.dtype == imaginary.dtype == np.float32
    values = np.empty(real.shape, np.complex64 if is_single else np.complex128, order="F")
    values.real, values.imag = real, imaginary
    return values


def _name(data: memoryview) -> str:
    """Return the name of a variable."""
    return bytes(data).rstrip(b"\0").decode("latin-1")


def _read_version_4(content: bytes) -> Iterator[tuple[str, np.ndarray]]:
    """Yield name and values of each variable of version 4, which are matrices."""
    data, position = memoryview(content), 0
    while position < len(data):
        if position + 20 > len(data):
            raise ValueError("it ends within a variable")
        order = "<" if int.from_bytes(data[position : position + 4], "little") < 5000 else ">"
        kind, rows, columns, is_complex, length = struct.unpack_from(f"{order}5i", data, position)
        machine, precision, form = kind // 1000, kind // 10 % 10, kind % 10
        if (
            machine != (order == ">")
            or kind // 100 % 10
            or precision >= len(_TYPES_OF_VERSION_4)
            or min(rows, columns) < 0
            or length < 2  # a character and the final zero
            or is_complex not in (0, 1)
        ):
            raise ValueError("it has no header of MATLAB")
        begin = position + 20 + length
        numbers = order + _TYPES_OF_VERSION_4[precision]
        size = rows * columns * np.dtype(numbers).itemsize
        position = begin + size * (1 + is_complex)
        if position > len(data):
            raise ValueError("it ends within a variable")
        name = _name(data[begin - length : begin])
        if form:
            yield name, _NO_NUMBERS  # text or a sparse matrix
            continue
        parts = [
            _as_array(name, data[at : at + size], numbers, (rows, columns))
            for at in (begin, begin + size)[: 1 + is_complex]
        ]
        yield name, _as_complex(*parts) if is_complex else parts[0]
