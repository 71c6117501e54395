"""``make gallery``: draws, tunes, diagnoses and predicts the machines of the gallery.

What exists with the same inputs is kept. ``python -m tests.gallery NAME ...`` makes these machines
anew. Pages of tunings, diagnoses and predictions lie in ``build/gallery``.
"""

import sys
import time

from tests.gallery.machines import WORK, GalleryMachine, gallery_machines


def main(names: list[str]) -> int:
    """Make what is missing, or the named machines; print their verdicts."""
    WORK.mkdir(parents=True, exist_ok=True)
    for machine in map(GalleryMachine, names) if names else gallery_machines():
        began, is_kept = time.process_time(), False
        if not names and machine.record.get("inputs") == machine.hash_inputs():
            is_kept = True
        else:
            machine.run()
        how = "kept" if is_kept else f"{time.process_time() - began:.0f} core seconds"
        print(f"{machine.name}: {machine.verdict.verdict} ({how})", flush=True)
        for line in machine.grade():
            print(f"  {line}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
