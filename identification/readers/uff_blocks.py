"""Location of the datasets of a universal file: where each begins and ends, and of what kind it is.

A line of -1 begins and ends each dataset. The data of a binary dataset 58b may hold such a line, so
its end follows from the number of its values. Records are the datasets, counted from 1.
"""

import codecs
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from identification.readers.uff_binary import find_binary_data
from identification.words import InputError
from identification.words.file_access import read_bytes

_DATASET_MARK = re.compile(rb"(?m)^[ ]{4}-1[ ]*(\r?\n|\r?\Z)")


@dataclass(frozen=True)
class Block:
    """One dataset of a universal file.

    Args:
        number: of the record, from 1.
        kind: number of the dataset; 0 if its first line holds none.
        head: its first line.
        text: lines after the first; of binary data the header only.
        data: binary data; empty in an ASCII dataset.
    """

    number: int
    kind: int
    head: bytes
    text: bytes
    data: bytes | None = None

    def lines(self) -> list[str]:
        """Return the lines after the first as text."""
        return self.text.decode("utf-8", "replace").replace("\r", "").split("\n")


def locate_blocks(path: Path) -> list[Block]:
    """Return the datasets of a file, each checked for its end mark.

    Raises:
        InputError: the file is missing, truncated or no universal file.
    """
    content = read_bytes(path, "name the UFF file of the test").removeprefix(codecs.BOM_UTF8)
    blocks = list(_blocks(path, content))
    if not blocks:
        raise InputError(f"{path} holds no dataset between lines of -1: name a universal file")
    return blocks


def _blocks(path: Path, content: bytes) -> Iterator[Block]:
    """Yield the datasets in their order."""
    position, number = 0, 0
    while mark := _DATASET_MARK.search(content, position):
        number += 1
        name, start = f"{path}, record {number}", mark.end()
        data = None
        if content[start : start + 7].strip().lower() == b"58b":
            body, end = find_binary_data(name, content, start)
            text, data = content[start:body], content[body : end.start()]
        else:
            end = _end_of_text(name, content, start)
            text = content[start : end.start()]
        head, _, lines = text.partition(b"\n")
        kind = int(head[:6]) if head[:6].strip().isdigit() else 0
        yield Block(number, kind, head, lines, data)
        position = end.end()
    if content[position:].strip():
        raise InputError(f"{path} holds text after record {number} that is no dataset: remove it")


def _end_of_text(name: str, content: bytes, start: int) -> re.Match[bytes]:
    """Return the end mark of an ASCII dataset."""
    end = _DATASET_MARK.search(content, start)
    if end is None:
        raise InputError(f"{name} has no end mark: the file is truncated; copy it again")
    return end
