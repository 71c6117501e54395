"""Fuzz of every reader: 10,000 mutated files each, in chunks that are kept one by one.

Targets are listed by their helpers: ``FILE_TARGETS``, ``MEASUREMENT_TARGETS``, ``MESH_TARGETS``.
Seeds begin at 100,000, beyond those of the tests.
"""

import sys
import tempfile
from pathlib import Path

from tests.bench.kept import cases

# Helpers import each other by their plain names, as pytest finds them.
sys.path.append(str(Path(__file__).parents[1] / "helpers"))
from tests.helpers.fuzz_files import FILE_TARGETS
from tests.helpers.fuzz_measurements import MEASUREMENT_TARGETS, MESH_TARGETS
from tests.helpers.fuzzing import find_faults

MUTATIONS, CHUNK, FIRST_SEED = 10_000, 500, 100_000
TARGETS = (*MEASUREMENT_TARGETS, *MESH_TARGETS, *FILE_TARGETS)
_NUMBERS_OF_TARGET = 1_000  # case numbers that each target has for its chunks


def run() -> list[dict[str, object]]:
    """Mutate and read; the first chunk of all targets comes before the second of any."""
    numbers = [
        target * _NUMBERS_OF_TARGET + chunk
        for chunk in range(MUTATIONS // CHUNK)
        for target in range(len(TARGETS))
    ]
    chunks, _ = cases("fuzz", numbers, read_chunk)
    return [summarise(target.name, chunks) for target in TARGETS]


def read_chunk(number: int) -> dict[str, object]:
    """Read one chunk of mutations of one target, and return its faults by seed."""
    place, chunk = divmod(number, _NUMBERS_OF_TARGET)
    first = FIRST_SEED + chunk * CHUNK
    with tempfile.TemporaryDirectory() as folder:
        faults = find_faults(TARGETS[place], Path(folder), range(first, first + CHUNK))
    return {"target": TARGETS[place].name, "mutations": CHUNK, "faults": faults}


def summarise(name: str, chunks: list[dict]) -> dict[str, object]:
    """Return how many mutations of a target were read, and which faults they showed."""
    own_chunks = [chunk for chunk in chunks if chunk["target"] == name]
    faults = {seed: fault for chunk in own_chunks for seed, fault in chunk["faults"].items()}
    return {
        "target": name,
        "mutations": sum(chunk["mutations"] for chunk in own_chunks),
        "faults": len(faults),
        "first": next((f"{seed}: {fault}" for seed, fault in faults.items()), ""),
    }
