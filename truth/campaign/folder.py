"""Write a campaign's folder, whole or not at all, and never over something else."""

import secrets
import shutil
from pathlib import Path

from truth.campaign.virtual_test import VirtualCampaign
from truth.errors import TruthError

ANSWER = "answer.toml"


def check_folder(folder: Path, *, overwrite: bool) -> None:
    """Refuse a folder that holds something else, or a campaign that is not to be overwritten."""
    if not folder.exists():
        return
    if not folder.is_dir():
        raise TruthError(f"{folder}: is a file; name a folder")
    if not any(folder.iterdir()):
        return
    if not (folder / "campaign.toml").is_file():
        raise TruthError(f"{folder}: holds files but no campaign.toml; name another folder")
    if not overwrite:
        raise TruthError(f"{folder}: holds a campaign; give --overwrite to replace it")


def write_answer(campaign: VirtualCampaign, path: Path) -> None:
    """Write the answer to a place of its own, whole or not at all.

    Raises:
        OSError: the place cannot be written.
    """
    path = path.resolve()
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_name(f".{path.name}-{secrets.token_hex(4)}")
    try:
        new.write_bytes(campaign.answer)
        new.replace(path)
    finally:
        new.unlink(missing_ok=True)


def write_campaign(
    campaign: VirtualCampaign, folder: Path, *, overwrite: bool = False, sealed: bool = False
) -> None:
    """Write the folder as a whole: beside its place first, then by renaming.

    The answer is left out if it is sealed elsewhere.

    Raises:
        TruthError: the folder holds something else, or a campaign without ``overwrite``.
        OSError: the place cannot be written.
    """
    folder = folder.resolve()
    check_folder(folder, overwrite=overwrite)
    folder.parent.mkdir(parents=True, exist_ok=True)
    mark = secrets.token_hex(4)
    new, old = (folder.with_name(f".{folder.name}-{mark}-{age}") for age in ("new", "old"))
    new.mkdir()
    try:
        inside = {} if sealed else {ANSWER: campaign.answer}
        for name, content in {**campaign.files, **inside}.items():
            (new / name).parent.mkdir(parents=True, exist_ok=True)
            (new / name).write_bytes(content)
        if folder.exists():
            folder.rename(old)
        new.rename(folder)
    finally:
        if old.exists() and not folder.exists():
            old.rename(folder)
        shutil.rmtree(new, ignore_errors=True)
    shutil.rmtree(old, ignore_errors=True)
