"""Large tests: a part of their lines or channels stands for all where a check needs no more."""

# Values of FRFs that a check takes: three times the usual 69 x 3 x 801, some seconds and 200 MB.
MAX_CHECKED_VALUES = 500_000
# Values whose curves a page and files hold: a page of 60 MB, which browsers still open.
MAX_SHOWN_VALUES = 2_000_000


def thinning_step(n_values: int, limit: int = MAX_CHECKED_VALUES) -> int:
    """Return n such that every n-th of these values is few enough; 1 for all of them.

    Args:
        n_values: number of values of all FRFs: lines times channels times references.
        limit: number of values that is few enough.
    """
    return max(1, -(-n_values // limit))
