"""``python -m tests.docs.gallery_pictures [NAME ...]``: moving pictures of the gallery's machines.

Each is what ``mbw view`` writes of the mode that ``assets/gallery/gallery.toml`` names, in a size
that a page of many pictures bears.
"""

import io
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageSequence

from tests.docs.gallery_page import GALLERY_PICTURES
from tests.gallery.machines import GalleryMachine, gallery_machines, run_verb

SIZE, EVERY, FRAME_MS = (440, 330), 3, 180  # pixels; frame that is kept; of a frame
MOST_BYTES = 60_000
QUALITIES = (80, 70, 60, 50, 40, 30, 20, 10)


def draw_small(machine: GalleryMachine) -> bytes:
    """Return the picture of a machine in the best quality that is small enough."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mode.webp"
        mode = str(machine.row["mode"])
        run_verb("view", str(machine.model), "--mode", mode, "--out", str(path))
        frames = [frame.convert("RGB") for frame in ImageSequence.Iterator(Image.open(path))]
    first, *others = (each.resize(SIZE, Image.Resampling.LANCZOS) for each in frames[::EVERY])
    for quality in QUALITIES:
        content = io.BytesIO()
        first.save(
            content, "WEBP", save_all=True, append_images=others, duration=FRAME_MS, loop=0,
            quality=quality, method=6,
        )  # fmt: skip
        if content.tell() <= MOST_BYTES:
            break
    return content.getvalue()


def main(names: list[str]) -> int:
    """Write the pictures of the named machines, or of all."""
    GALLERY_PICTURES.mkdir(exist_ok=True)
    for machine in map(GalleryMachine, names) if names else gallery_machines():
        path = GALLERY_PICTURES / f"{machine.name}.webp"
        path.write_bytes(draw_small(machine))
        print(f"{path} written, {path.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
