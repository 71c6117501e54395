"""Animated pictures and videos: .gif and .webp by Pillow, .mp4 and .webm by ffmpeg, .png still."""

import shutil
import subprocess
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from identification.words import InputError, UsageError
from identification.words.file_access import temporary_folder, write_bytes
from mbw.animation.draw import FRAME_S

ANIMATED = (".gif", ".webp")
VIDEO = (".mp4", ".webm")
STILL = (".png",)
_GIF_COLOURS = 128  # of 256: the pictures have few, and the file becomes smaller
_NEARLY_WHITE = 246  # of 255: a picture of a machine has no other colours as light
_VIDEO_CYCLES = 4  # a video does not repeat itself


def check_picture_target(target: Path) -> None:
    """Refuse a picture or video that cannot be written, before the computation starts.

    Raises:
        UsageError: the kind of file is unknown.
        InputError: the folder does not exist, or a video needs ffmpeg, which is not installed.
    """
    kinds = (*ANIMATED, *VIDEO, *STILL)
    if target.suffix.lower() not in kinds:
        raise UsageError(
            f"{target}: this kind of picture is not written: name a file that ends in "
            f"{', '.join(kinds[:-1])} or {kinds[-1]}"
        )
    if target.is_dir() or not target.absolute().parent.is_dir():
        raise InputError(f"{target} cannot be written: name a file in a folder that exists")
    if target.suffix.lower() in VIDEO and shutil.which("ffmpeg") is None:
        raise InputError(
            f"{target}: a video needs the program ffmpeg, which is not installed: install it, or "
            "name a .gif or .webp"
        )


def write_pictures(target: Path, pictures: Sequence[Image.Image]) -> None:
    """Write one cycle of a mode; a still picture shows its first instant.

    Args:
        target: file that ``check_picture_target`` accepts.
        pictures: pictures of one cycle, or a single one.

    Raises:
        InputError: the file cannot be written, or ffmpeg fails.
    """
    kind, content = target.suffix.lower(), BytesIO()
    animation: dict[str, Any] = {"save_all": True, "duration": round(1000 * FRAME_S), "loop": 0}
    if kind in VIDEO:
        content.write(_encode_video([*pictures] * _VIDEO_CYCLES, target))
    elif kind in STILL:
        pictures[0].save(content, "PNG", optimize=True)
    else:
        shown = _with_common_palette(pictures) if kind == ".gif" else pictures
        shown[0].save(content, kind[1:].upper(), append_images=shown[1:], **animation)
    write_bytes(target, content.getvalue())


def _with_common_palette(pictures: Sequence[Image.Image]) -> list[Image.Image]:
    """Return pictures with one palette, so that colours do not flicker.

    Nearly white colours become white: a mean of them would be a grey box on a slide.
    """
    width, height = pictures[0].size
    sheet = Image.new("RGB", (width, 3 * height))
    for row in range(3):
        sheet.paste(pictures[row * len(pictures) // 3], (0, row * height))
    palette = sheet.quantize(_GIF_COLOURS, method=Image.Quantize.MEDIANCUT)
    colours = np.array(palette.getpalette(), np.uint8).reshape(-1, 3)
    colours[(colours >= _NEARLY_WHITE).all(axis=1)] = 255
    palette.putpalette(colours.ravel().tolist())
    return [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]


def _encode_video(pictures: Sequence[Image.Image], target: Path) -> bytes:
    """Return a video by the program ffmpeg, which reads the pixels from its standard input."""
    width, height = pictures[0].size
    command = ["ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    command += ["-s", f"{width}x{height}", "-r", f"{1 / FRAME_S:.6g}", "-i", "-"]
    pixels = b"".join(picture.tobytes() for picture in pictures)
    with temporary_folder() as folder:
        place = folder / f"mode{target.suffix.lower()}"
        command += ["-pix_fmt", "yuv420p", str(place)]
        done = subprocess.run(command, input=pixels, capture_output=True, check=False)
        if done.returncode == 0 and place.exists():
            return place.read_bytes()
    reason = " ".join(done.stderr.decode(errors="replace").split())[-200:] or "no message"
    raise InputError(
        f"{target} cannot be written, because ffmpeg failed ({reason}): name a .gif or .webp"
    )
