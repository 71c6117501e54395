"""Campaigns of truth, opened: a small random tree with one known effect."""

from pathlib import Path

from truth import Cause, Plan, Protocol, Wanted, draw_campaign, write_campaign
from truth.trees import draw_tree
from tuning import Session, open_session


def drawn(
    folder: Path,
    seed: int,
    effect: str | None = None,
    *,
    ratio: float | None = 4.0,
    place: str | None = None,
    lines: int = 241,
) -> tuple[Session, str]:
    """A session, and its answer as text.

    Args:
        folder: where the campaign is written.
        seed: of machine, test and effect.
        effect: what the drawing lacks; None for nothing.
        ratio: survival ratio; None for a drawn size.
        place: of the effect; drawn if None.
        lines: of 1 Hz.
    """
    tree = draw_tree(seed, 3)
    cause = Cause() if effect is None else Cause((Wanted(effect, place, ratio),))
    protocol = Protocol(nodes=(tree.first_aim(),), lines=lines, resolution_hz=1.0)
    campaign = draw_campaign(tree, Plan(seed, cause, protocol=protocol))
    write_campaign(campaign, folder / "campaign")
    return open_session(folder / "campaign"), campaign.answer.decode()
