"""Campaigns of truth, opened: a small random tree with known effects."""

from itertools import repeat
from pathlib import Path

from identification.words import Campaign, Complex, Real
from mbmodel import Evaluator, FrfRequest, Model
from truth import Cause, Plan, Protocol, Wanted, draw_campaign, write_campaign
from truth.machine.random_tree import draw_tree
from tuning import Session, open_session


def drawn(
    folder: Path,
    seed: int,
    *effects: str | None,
    ratio: float | tuple[float, ...] | None = 4.0,
    place: str | None = None,
    lines: int = 241,
    stages: int = 3,
) -> tuple[Session, str]:
    """A session, and its answer as text.

    Args:
        folder: where the campaign is written.
        seed: of machine, test and effect.
        effects: what the drawing lacks; none, or None, for nothing.
        ratio: survival ratio of each, or that of all; None for a drawn size.
        place: of the effects; drawn if None.
        lines: of 1 Hz.
        stages: of the tree.
    """
    tree = draw_tree(seed, stages)
    names = [effect for effect in effects if effect is not None]
    ratios = ratio if isinstance(ratio, tuple) else (ratio,) * len(names)
    cause = Cause(tuple(Wanted(*row) for row in zip(names, repeat(place), ratios, strict=False)))
    protocol = Protocol(nodes=(tree.first_aim(),), lines=lines, resolution_hz=1.0)
    campaign = draw_campaign(tree, Plan(seed, cause, protocol=protocol))
    write_campaign(campaign, folder / "campaign")
    return open_session(folder / "campaign"), campaign.answer.decode()


def line_by_line(
    model: Model, theta: Real, campaign: Campaign, freq_hz: Real | None = None
) -> Complex:
    """FRFs without the modal form, (n_freq, n_out, n_in): differences of tiny steps stay exact."""
    estimate = campaign.tests[0].estimate
    inputs = tuple(test.condition.reference for test in campaign.tests)
    lines = campaign.freq_hz if freq_hz is None else freq_hz
    question = FrfRequest(lines, estimate.frf.outputs, inputs, estimate.frf.quantity)
    return Evaluator(model, question, direct=True).at(theta).values
