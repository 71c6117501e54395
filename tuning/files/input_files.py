"""Files that a tuning read, with their hashes."""

import hashlib
import json
import os
from collections.abc import Collection, Mapping
from pathlib import Path

from identification import read_settings
from mbmodel import mjcf_files
from tuning.files.schema import InputRow
from tuning.session import Session


def input_rows(session: Session) -> list[InputRow]:
    """Return every file that was read, relative to campaign.toml, with its SHA-256."""
    folder = session.source.parent
    files = {session.source, *mjcf_files(session.model.machine.source)}
    files |= {folder / test.condition.test for test in session.campaign.tests}
    for variant in session.model.machine.variants.values():
        files |= {*mjcf_files(variant.source)}
    controllers = (table.controller for table in read_settings(session.source)[1].loop.values())
    files |= {folder / name for name in controllers if isinstance(name, str)}
    return hash_files(files, folder)


def hash_files(files: Collection[Path], folder: Path) -> list[InputRow]:
    """Return those files that exist, relative to a folder, with their SHA-256."""
    return [
        InputRow(
            file=os.path.relpath(file, folder),
            sha256=hashlib.sha256(file.read_bytes()).hexdigest(),
        )
        for file in sorted(files)
        if file.is_file()
    ]


def fingerprint(session: Session, options: Mapping[str, object]) -> str:
    """Return a hash of all that determines a tuning's result.

    It covers the input files, the masses of meshes, the lines and the options.
    """
    digest = hashlib.sha256()
    for row in input_rows(session):
        digest.update(f"{row.file} {row.sha256}\n".encode())
    machine, model = session.model.machine, session.model
    for array in (machine.body_mass, model.drawn, session.campaign.freq_hz):
        digest.update(array.tobytes())
    digest.update(json.dumps(dict(options), sort_keys=True, default=str).encode())
    return digest.hexdigest()
