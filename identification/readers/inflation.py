"""Limit on what a compressed file may become in memory."""

# Measured values have noise in their last digits and hardly compress. A file that grows more than
# this is no measurement; below the number of bytes it does no harm.
_MAX_INFLATION_RATIO, _MAX_HARMLESS_BYTES = 100, 256 << 20


def max_inflated_bytes(file_bytes: int) -> int:
    """Return how many bytes the arrays of a file of some size may take in memory."""
    return max(_MAX_HARMLESS_BYTES, _MAX_INFLATION_RATIO * file_bytes)


def refuse_inflation(inflated_bytes: int, file_bytes: int) -> None:
    """Refuse to unpack far more bytes than the file has, before they are allocated.

    Args:
        inflated_bytes: bytes that the arrays of a file take in memory, as it announces them.
        file_bytes: size of the file.

    Raises:
        ValueError: the arrays are too large for the file.
    """
    if inflated_bytes > max_inflated_bytes(file_bytes):
        raise ValueError(
            f"it announces {inflated_bytes} bytes of arrays, far more than its "
            f"{file_bytes} bytes can hold"
        )
