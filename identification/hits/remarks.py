"""Remarks on the hits of a test, for a reader of its FRFs."""

from collections.abc import Sequence

from identification.words import HitEstimate, group_by_key, percent_text

_MIN_KEPT_SHARE = 0.5  # of the hits: with fewer kept hits the test should be repeated
_MIN_KEPT_HITS = 2.0
# Residual response that matters without an exponential window.
_MAX_RESIDUAL_RESPONSE = 0.01


def hit_remarks(hits: HitEstimate, recorded_tau: float | None = None) -> tuple[str, ...]:
    """Return sentences on rejected hits, too few hits, single hits and windows of the analyser.

    Args:
        hits: FRFs and the hits from which they were estimated.
        recorded_tau: time constant of a window that the records seem to carry, although no key
            states it [s].
    """
    test = f"{hits.test}, hammer at {hits.reference}"
    kept, total = len(hits.kept), len(hits.kept) + len(hits.rejected)
    remarks = []
    if hits.rejected:
        reasons = "; ".join(map(str, hits.rejected))
        remarks.append(f"{test}: {total - kept} of {total} hits were left out: {reasons}")
    if total > kept and kept < max(_MIN_KEPT_HITS, _MIN_KEPT_SHARE * total):
        remarks.append(f"{test}: only {kept} of {total} hits are left: repeat this test")
    if kept == 1:
        remarks.append(
            f"{test}: a single hit has no coherence: the variance comes from differences along "
            "frequency, which is less certain"
        )
    if recorded_tau is not None:
        remarks.append(
            f"{test}: the noise of the force falls in the block like exp(-t / {recorded_tau:.2g} "
            "s): the analyser seems to have applied an exponential window; state its time constant "
            "as window_tau in the [[test]], or damping is too large by 1/(tau omega)"
        )
    return tuple(remarks)


def window_remarks(estimates: Sequence[HitEstimate]) -> tuple[str, ...]:
    """Return sentences on responses that the blocks cut off, one for all tests of one window.

    Args:
        estimates: FRFs and the hits from which they were estimated.
    """
    groups = group_by_key(
        ((f"{hits.block_s:.4g}", f"{hits.tau_s:.4g}"), hits)
        for hits in estimates
        if hits.tau_s > 0 or hits.residual_response > _MAX_RESIDUAL_RESPONSE
    )
    return tuple(
        _describe_window(group, block_s, tau_s) for (block_s, tau_s), group in groups.items()
    )


def _describe_window(group: Sequence[HitEstimate], block_s: str, tau_s: str) -> str:
    """Return the sentence on the tests of one window."""
    first = group[0]
    tests = f"{first.test}, hammer at {first.reference}"
    largest = percent_text(max(hits.residual_response for hits in group))
    if len(group) > 1:
        tests, largest = f"{len(group)} tests, the first of them {tests}", f"up to {largest}"
    if first.tau_s > 0:
        return (
            f"{tests}: {largest} of the response was left at the end of the block of {block_s} s: "
            f"force and responses have an exponential window with tau = {tau_s} s, which adds "
            "1/(tau omega) to a damping ratio; the modal fit subtracts it"
        )
    return (
        f"{tests}: {largest} of the response is left at the end of the block of {block_s} s "
        "without an exponential window: shapes have errors of this size"
    )
