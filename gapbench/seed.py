"""The seed of a run: nobody can choose it, and everybody can check it."""

import hashlib


def seed_of(archive: bytes, beacon: str) -> int:
    """Return the seed of an entry's run: the first 8 bytes of sha256(sha256(archive) + beacon).

    The archive is published first. The beacon is a value that nobody knows before: the randomness
    of a drand round, say, or of another public draw, of a date that was named with the archive.

    Args:
        archive: content of the entry's archive.
        beacon: the value as published; blanks at its ends and upper case do not matter.
    """
    published = beacon.strip().lower().encode("utf-8")
    digest = hashlib.sha256(hashlib.sha256(archive).digest() + published).digest()
    return int.from_bytes(digest[:8], "big")
