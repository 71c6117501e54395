"""Memory that the process may take: too little of it becomes one sentence.

This module needs the standard library alone: it runs before numpy is loaded.
"""

try:
    import resource
except ImportError:  # Windows has no such limits
    resource = None  # type: ignore[assignment]

# numpy, SciPy, MuJoCo and the smallest test take 450 MB; where less can be had, OpenBLAS asks for
# its buffer again and again without an end.
MIN_ADDRESS_SPACE_BYTES = 500_000_000
REMEDY = "raise the limit of memory (ulimit -v), or take fewer channels or frequency lines"
# Texts of errors that other libraries raise in place of MemoryError.
_TEXTS = ("failed to map segment", "cannot allocate memory", "could not allocate memory")


def describe_memory_limit() -> str | None:
    """Return a sentence if the process may take less memory than any verb needs, else None."""
    if resource is None or not hasattr(resource, "RLIMIT_AS"):
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY or limit >= MIN_ADDRESS_SPACE_BYTES:
        return None
    return (
        f"the address space is limited to {limit / 1e6:.0f} MB, and mbw needs "
        f"{MIN_ADDRESS_SPACE_BYTES / 1e6:.0f} MB at least: raise the limit (ulimit -v)"
    )


def is_out_of_memory(error: BaseException | None) -> bool:
    """Return whether an error, or one that caused it, is a lack of memory."""
    while error is not None:
        text = str(error).lower()
        if isinstance(error, MemoryError) or any(part in text for part in _TEXTS):
            return True
        error = error.__cause__ or error.__context__
    return False
