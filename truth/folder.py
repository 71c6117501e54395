"""Write a campaign's folder, whole or not at all, and never over something else."""

import secrets
import shutil
from pathlib import Path

from truth.campaign import Campaign
from truth.errors import TruthError


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


def write_campaign(campaign: Campaign, folder: Path, *, overwrite: bool = False) -> None:
    """Write the folder as a whole: beside its place first, then by renaming.

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
        for name, content in campaign.files.items():
            (new / name).parent.mkdir(exist_ok=True)
            (new / name).write_bytes(content)
        if folder.exists():
            folder.rename(old)
        new.rename(folder)
    finally:
        if old.exists() and not folder.exists():
            old.rename(folder)
        shutil.rmtree(new, ignore_errors=True)
    shutil.rmtree(old, ignore_errors=True)
