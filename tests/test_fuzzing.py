"""The fuzz helper finds what it looks for: exceptions, crashes and output."""

import os

from identification.words import InputError
from tests.helpers.fuzzing import FuzzTarget, find_faults
from tests.helpers.mutations import mutate

TEXT = "1 2 3\n4 5 6\n" * 20
SEEDS = range(300)


def write(folder):
    path = folder / "numbers.txt"
    path.write_text(TEXT)
    return [path]


def read(path):
    content = path.read_bytes()
    if b"nan" in content:
        os.abort()
    if b"1e300" in content:
        raise InputError("1e300")
    if b"inf" in content:
        print("inf")
    if b"999" in content:
        raise IndexError


def test_each_kind_of_fault_is_found_and_made_again_by_its_seed(tmp_path):
    faults = find_faults(FuzzTarget("numbers", write, read), tmp_path, SEEDS)
    changed = {seed: mutate(TEXT.encode(), seed) for seed in SEEDS}
    assert {k for k, fault in faults.items() if fault == "SIGABRT"} == {
        k for k, content in changed.items() if b"nan" in content
    }
    rest = {k: content for k, content in changed.items() if k not in faults}
    assert any(b"1e300" in content for content in rest.values())
    assert not any(word in content for content in rest.values() for word in (b"inf", b"999"))
    kinds = {fault.partition(" ")[0] for fault in faults.values()}
    assert kinds == {"SIGABRT", "stdout", "IndexError:"}
    assert (tmp_path / "numbers.txt").read_text() == TEXT
