"""What the reader of a result must know about its hits, in sentences."""

from identification.words import HitEstimate

_HALF = 0.5
_LEFT = 0.01  # of the response, cut off the blocks without an exponential window


def remarks_of(found: HitEstimate) -> tuple[str, ...]:
    """Rejections, too few hits left, windows; nothing of what went without saying."""
    where = f"{found.test}, hammer at {found.reference}"
    kept, total = len(found.kept), len(found.kept) + len(found.rejected)
    remarks = []
    if found.rejected:
        reasons = "; ".join(map(str, found.rejected))
        remarks.append(f"{where}: {total - kept} of {total} hits were left out: {reasons}")
    if total > kept and kept < max(2.0, _HALF * total):
        remarks.append(f"{where}: only {kept} of {total} hits are left: repeat this test")
    if kept == 1:
        remarks.append(
            f"{where}: one hit has no coherence: the variance comes from differences along "
            "frequency, which is less certain"
        )
    tau = found.estimate.window_tau
    if tau > 0:
        remarks.append(
            f"{where}: {100 * found.left:.2g} % of the response was left at the end of its block "
            f"of {found.block_s:.4g} s: force and responses have an exponential window of tau = "
            f"{tau:.4g} s, which adds 1/(tau omega) to a damping ratio; it is taken off again"
        )
    elif found.left > _LEFT:
        remarks.append(
            f"{where}: {100 * found.left:.2g} % of the response is left at the end of its block of "
            f"{found.block_s:.4g} s, and there is no exponential window: shapes are off by as much"
        )
    return tuple(remarks)
