"""Campaigns of truth, opened: a small random tree with known effects."""

from pathlib import Path

from truth import Cause, Plan, Protocol, Wanted, draw_campaign, write_campaign
from truth.trees import draw_tree
from tuning import Session, open_session


def drawn(
    folder: Path,
    seed: int,
    *effects: str | None,
    ratio: float | None = 4.0,
    place: str | None = None,
    lines: int = 241,
) -> tuple[Session, str]:
    """A session, and its answer as text.

    Args:
        folder: where the campaign is written.
        seed: of machine, test and effect.
        effects: what the drawing lacks; none, or None, for nothing.
        ratio: survival ratio of each; None for a drawn size.
        place: of the effects; drawn if None.
        lines: of 1 Hz.
    """
    tree = draw_tree(seed, 3)
    cause = Cause(tuple(Wanted(effect, place, ratio) for effect in effects if effect is not None))
    protocol = Protocol(nodes=(tree.first_aim(),), lines=lines, resolution_hz=1.0)
    campaign = draw_campaign(tree, Plan(seed, cause, protocol=protocol))
    write_campaign(campaign, folder / "campaign")
    return open_session(folder / "campaign"), campaign.answer.decode()
