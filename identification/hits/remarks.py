"""Remarks on the hits of a test, for a reader of its FRFs."""

from identification.words import HitEstimate

_MIN_KEPT_SHARE = 0.5  # of the hits: with fewer kept hits the test should be repeated
_MIN_KEPT_HITS = 2.0
# Residual response that matters without an exponential window.
_MAX_RESIDUAL_RESPONSE = 0.01


def hit_remarks(
    hits: HitEstimate, tau: float, recorded_tau: float | None = None
) -> tuple[str, ...]:
    """Return sentences on rejected hits, too few hits, single hits and exponential windows.

    Args:
        hits: FRFs and the hits from which they were estimated.
        tau: time constant of the exponential window that was applied to the records [s].
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
    if tau > 0:
        remarks.append(
            f"{test}: {100 * hits.residual_response:.2g} % of the response was left at the end "
            f"of the block of {hits.block_s:.4g} s: force and responses have an exponential window "
            f"with tau = {tau:.4g} s, which adds 1/(tau omega) to a damping ratio; the modal fit "
            "subtracts it"
        )
    elif hits.residual_response > _MAX_RESIDUAL_RESPONSE:
        remarks.append(
            f"{test}: {100 * hits.residual_response:.2g} % of the response is left at the end "
            f"of the block of {hits.block_s:.4g} s without an exponential window: shapes have "
            "errors of this size"
        )
    return tuple(remarks)
