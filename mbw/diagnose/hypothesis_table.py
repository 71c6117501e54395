"""Table of hypotheses with the reasons of their rejection, for ``mbw diagnose --explain``."""

from rich.table import Table

from diagnosis import Diagnosis
from mbw.diagnose.fitted_sets import fitted_rows, key_words, rejection_reasons
from mbw.page.numbers import format_closed

_MAX_LISTED_SCORES = 8  # hypotheses without a refit
_MAX_LISTED_SETS = 16  # sets of causes
_MIN_ODDS_WIDTH = 18  # characters of log odds and reason, on a narrow terminal


def hypothesis_table(diagnosis: Diagnosis) -> Table:
    """Return a table of sets of causes, the best fit first, then of hypotheses with a score alone.

    Args:
        diagnosis: diagnosis with its evidence.
    """
    evidence = diagnosis.evidence
    table = Table(title=f"{evidence.hypotheses} effects and places, by score and after a refit")
    table.add_column("hypothesis", overflow="fold")
    for name in ("score", "error %", "closed %"):
        table.add_column(name, no_wrap=True, justify="right", min_width=len(name))
    table.add_column("log odds", min_width=_MIN_ODDS_WIDTH)
    table.caption = (
        "score and log odds: nats; error: of the model after the refit; closed: part of the gap, "
        "all where the residual falls below the noise, none where it grows"
    )
    rows = [row for row in fitted_rows(evidence, diagnosis.settings) if row.keys]
    proven = {hypothesis.key for hypothesis in diagnosis.gross_hypotheses}
    named = frozenset(cause.key for cause in diagnosis.present.causes) - proven
    scores = {score.key[:2]: score.gain for score in evidence.scored}
    for row, why in list(zip(rows, rejection_reasons(rows, named), strict=True))[:_MAX_LISTED_SETS]:
        score = scores.get(row.keys[0][:2]) if len(row.keys) == 1 else None
        table.add_row(
            " + ".join(map(key_words, row.keys)),
            "" if score is None else f"{score:.0f}",
            f"{100 * row.model_error:.2g}",
            "" if row.closed is None else _closed_cell(row.closed),
            ", ".join(filter(None, ["" if row.log_odds is None else f"{row.log_odds:.0f}", why])),
        )
    fitted = {key[:2] for row in rows for key in row.keys}
    unfitted = [score for score in evidence.scored if score.key[:2] not in fitted]
    for scored in unfitted[:_MAX_LISTED_SCORES]:
        table.add_row(key_words(scored.key), f"{scored.gain:.0f}", "", "", "small score")
    return table


def _closed_cell(closed: float) -> str:
    """Return the closed share of a gap in whole per cent, ``all`` or ``none``."""
    text = f"{100 * closed:.0f}"
    is_share = 0 <= closed < 1.005
    return text if is_share else format_closed(closed).removeprefix("about ")
