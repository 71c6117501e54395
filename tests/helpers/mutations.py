"""Mutations of files for fuzz tests: a seed and a file's bytes always give one and the same change.

A fault that a fuzz test reports is made again with ``mutate(content, seed)``.
"""

import os
import random
import re
from collections.abc import Callable

# Number of mutations of each reader in the tests; a bench tries many more.
MUTATIONS = int(os.environ.get("MUTATIONS", "100"))
_CHANGES = (
    1,
    1,
    1,
    2,
    4,
)  # changes of one mutation: mostly one, so that much of a file stays whole
_MAX_RUN_BYTES = 64  # bytes inserted or deleted at once
_NUMBER = re.compile(rb"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?")
_ODD_NUMBERS = (
    *(b"nan", b"-nan", b"inf", b"-inf", b"1e300", b"-1e300", b"1e-300", b"1e999", b"0x10"),
    *(b"-1", b"0", b"-0.0", b"1", b"2147483648", b"-2147483649", b"18446744073709551616"),
    *(b"1000000000000", b"99999", b"9" * 60, b"1.0D+00", b"1,5", b"true", b"", b"''", b"[]"),
)
# Little-endian words of 4 and 8 bytes: counts, sizes and floating-point values of binary files.
_ODD_WORDS = (
    *(b"\xff" * 4, b"\xff" * 8, b"\x00" * 4, b"\x00" * 8, b"\xff\xff\xff\x7f", b"\x00\x00\x00\x80"),
    *(b"\xff" * 7 + b"\x7f", b"\x00" * 7 + b"\x80", b"\x00\x00\x00\x40", b"\x01\x00\x00\x00"),
    *(b"\x00" * 6 + b"\xf8\x7f", b"\x00" * 6 + b"\xf0\x7f", b"\x9c\x75\x00\x88\x3c\xe4\x37\x7e"),
)
_ODD_BYTES = b"\x00\x01\x7f\x80\xff\t\n\r \"'#-.0:;<>[]{}\\/"


def mutate(content: bytes, seed: int) -> bytes:
    """Return the content with one to four changes, which the seed determines."""
    rng = random.Random(seed)
    for _ in range(rng.choice(_CHANGES)):
        content = rng.choice(_KINDS)(content, rng)
    return content


def _flip_bit(content: bytes, rng: random.Random) -> bytes:
    """Flip one bit."""
    place = rng.randrange(max(len(content), 1))
    return _replace(content, place, bytes(b ^ 1 << rng.randrange(8) for b in content[place:][:1]))


def _change_byte(content: bytes, rng: random.Random) -> bytes:
    """Replace one byte by any byte, or by one that means something in a text."""
    byte = rng.choice((rng.randrange(256), rng.choice(_ODD_BYTES)))
    return _replace(content, rng.randrange(max(len(content), 1)), bytes([byte]))


def _change_head(content: bytes, rng: random.Random) -> bytes:
    """Replace one of the first 256 bytes, where formats have their counts and kinds."""
    place = rng.randrange(min(max(len(content), 1), 256))
    return _replace(content, place, bytes([rng.randrange(256)]))


def _change_word(content: bytes, rng: random.Random) -> bytes:
    """Replace a binary word by an extreme count, NaN, infinity or 1e300."""
    place = 4 * rng.randrange(len(content) // 4 + 1)
    return _replace(content, place, rng.choice(_ODD_WORDS))


def _change_number(content: bytes, rng: random.Random) -> bytes:
    """Replace a number of a text by an odd one."""
    found = list(_NUMBER.finditer(content))
    if not found:
        return _change_word(content, rng)
    number = rng.choice(found)
    return content[: number.start()] + rng.choice(_ODD_NUMBERS) + content[number.end() :]


def _insert(content: bytes, rng: random.Random) -> bytes:
    """Insert random bytes, or a copy of other bytes of the file."""
    place, length = rng.randrange(len(content) + 1), rng.randrange(1, _MAX_RUN_BYTES)
    source = rng.randrange(len(content) + 1)
    run = rng.choice((rng.randbytes(length), content[source : source + length]))
    return content[:place] + run + content[place:]


def _delete(content: bytes, rng: random.Random) -> bytes:
    """Delete a run of bytes."""
    place, length = rng.randrange(len(content) + 1), rng.randrange(1, _MAX_RUN_BYTES)
    return content[:place] + content[place + length :]


def _truncate(content: bytes, rng: random.Random) -> bytes:
    """Cut the end off."""
    return content[: rng.randrange(len(content) + 1)]


def _double_line(content: bytes, rng: random.Random) -> bytes:
    """Write one line twice."""
    lines = content.splitlines(keepends=True) or [b""]
    place = rng.randrange(len(lines))
    return b"".join([*lines[:place], lines[place], *lines[place:]])


def _delete_line(content: bytes, rng: random.Random) -> bytes:
    """Leave one line out."""
    lines = content.splitlines(keepends=True) or [b""]
    place = rng.randrange(len(lines))
    return b"".join([*lines[:place], *lines[place + 1 :]])


def _swap_lines(content: bytes, rng: random.Random) -> bytes:
    """Exchange two lines."""
    lines = content.splitlines(keepends=True) or [b""]
    first, second = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[first], lines[second] = lines[second], lines[first]
    return b"".join(lines)


def _replace(content: bytes, place: int, text: bytes) -> bytes:
    """Write bytes over those at a place."""
    return content[:place] + text + content[place + len(text) :]


_KINDS: tuple[Callable[[bytes, random.Random], bytes], ...] = (
    *(_flip_bit, _change_byte, _change_head, _change_word, _change_number, _change_number),
    *(_insert, _delete, _truncate, _double_line, _delete_line, _swap_lines),
)
