"""Tables of a diagnosis' page: causes with their sizes, refits and scores of the hypotheses."""

from collections.abc import Mapping, Sequence
from html import escape

from diagnosis.inference.evidence import Key
from diagnosis.labels import name_direction
from diagnosis.verdict.schema import CauseRow
from diagnosis.verdict.sentences import other_places, place_name
from mbw.diagnose.effect_parameters import (
    ParameterText,
    depends_on_doubtful_size,
    frame_words,
    number,
    parameter_lines,
    parameters_that_may_be_zero,
)
from mbw.diagnose.fitted_sets import fitted_rows
from mbw.diagnose.headline import findings
from mbw.diagnose.link_axis import axis_words
from mbw.diagnose.sentences import format_probability, sensor_check_sentences
from mbw.page.numbers import format_closed, format_percent
from mbw.results.diagnosed_files import StoredDiagnosis
from mbw.results.diagnosed_schema import PlaceRow

_MAX_SCORE_ROWS = 12  # hypotheses of the table of scores
_MAX_SET_ROWS = 16  # sets of causes in the table of refits
_BETWEEN_LEVELS = (
    " Between levels: differences of the residuals of one hammer point from level to level, over "
    "the noise. Errors that all levels share cancel in them, so they count as further evidence."
)


def causes_section(result: StoredDiagnosis) -> str:
    """Return HTML of all causes, of confounded causes and of effects that were not tested."""
    verdict = result.verdict
    causes = zip(verdict.causes, result.shown.means, strict=True)
    closed = {row.cause: row.closed for row in result.shown.established}
    rows = "".join(
        _cause(row, meaning, result.shown.places, closed.get(number))
        for number, (row, meaning) in enumerate(causes)
    )
    if rows:
        table = (
            '<table class="causes"><thead><tr><th class="name">effect</th>'
            '<th class="name">place</th><th class="name">direction</th>'
            '<th class="name">probability</th><th class="name">parameters, 95 % interval</th>'
            "<th>gap closed, fitted lines</th><th>excess with all</th></tr></thead>"
            f"<tbody>{rows}</tbody></table>"
        )
    else:
        table = "<p>No effect of the catalogue is likely: none has a probability of 1 %.</p>"
    text = _paragraphs(findings(result))
    if verdict.next_experiment:
        text += f"<p><b>Next experiment:</b> {escape(verdict.next_experiment)}.</p>"
    return table + text


def hypotheses_section(result: StoredDiagnosis) -> str:
    """Return HTML of the refits, of the best scores, and of the sensor checks."""
    checks = sensor_check_sentences(result.shown)
    solid = "".join(f"<li>{escape(text)}</li>" for text in result.shown.solid)
    left = f"{_refits(result)}{_scores(result)}"
    right = (
        f"<b>Sensor checks by rigid bodies</b>{_paragraphs(checks)}"
        f'<ul class="plain soft">{solid}</ul>'
    )
    return f'<div class="tried"><div>{left}</div><div>{right}</div></div>'


def _cause(
    row: CauseRow, meaning: str, places: Mapping[str, PlaceRow], closed: float | None = None
) -> str:
    """Return the row of a cause, with the part of the gap that an established one closes."""
    sizes = [text for name in row.parameters for text in _parameter_texts(row, name)]
    bar = f'<span class="bar"><i style="left:0;width:{100 * row.probability:.1f}%"></i></span>'
    name = f"<b>{escape(row.effect.replace('_', ' '))}</b><br><small>{escape(meaning)}</small>"
    place = escape(" or ".join(map(place_name, [row.location, *other_places(row)])))
    return (
        f'<tr><td class="name">{name}</td><td class="name whole">{place}</td>'
        f'<td class="name">{escape(_direction(row, places))}</td>'
        f'<td class="name whole">{bar} {format_probability(row.probability)}</td>'
        f'<td class="name">{_sizes(sizes)}</td>'
        f"<td>{'' if closed is None else format_closed(closed)}</td>"
        f"<td>{_excess(row.excess_after)}</td></tr>"
    )


def _direction(row: CauseRow, places: Mapping[str, PlaceRow]) -> str:
    """Return the direction of a cause; of a link its stiffest axis, in world axes."""
    place = places.get(row.location)
    if place is None or not place.line or row.dof is not None:
        return name_direction(row.dof)
    if row.excess_after is None:  # a rival: its stiffness matrix is not kept
        return ""
    return f"{axis_words(place.axis)}, world axes" if place.axis else axis_words(None)


def _parameter_texts(row: CauseRow, name: str) -> list[ParameterText]:
    """Return the texts of a parameter; it is not known if the size of the effect may be zero."""
    is_doubtful = name in parameters_that_may_be_zero(row.interval)
    if not is_doubtful and depends_on_doubtful_size(name, row.parameters, row.interval):
        return [ParameterText(name.replace("_", " "), "not known", "")]
    ends = row.interval.get(name)
    texts = parameter_lines(row.effect, row.dof, name, row.parameters[name], ends)
    frame = frame_words(row.effect, name)
    return [*texts, ParameterText("", frame, "")] if frame else texts


def _sizes(texts: list[ParameterText]) -> str:
    rows = "".join(
        f'<tr><td class="name">{escape(text.name)}</td><td>{escape(text.value)}</td>'
        f'<td class="soft">{escape(text.interval)}</td></tr>'
        if text.name
        else f'<tr><td class="name soft" colspan="3">{escape(text.value)}</td></tr>'
        for text in texts
    )
    return f'<table class="sizes">{rows}</table>' if rows else ""


def _excess(value: float | None) -> str:
    return "" if value is None else number(value)


def _refits(result: StoredDiagnosis) -> str:
    """Return the fits of sets of causes, each at its own model error, the best first."""
    rows = fitted_rows(result.evidence)[:_MAX_SET_ROWS]
    has_levels = result.evidence.null.level_excess is not None
    cells = "".join(
        f'<tr><td class="name">{_effect_names(row.fit.keys)}</td>'
        f"<td>{format_percent(row.fit.floor)}</td><td>{row.fit.chi_square**0.5:.3g}</td>"
        f"{_level_cell(row.fit.level_excess) if has_levels else ''}"
        f"<td>{'' if row.closed is None or not row.fit.keys else format_closed(row.closed)}</td>"
        f"<td>{row.rejection if row.log_odds is None else _nats(row.log_odds)}</td></tr>"
        for row in rows
    )
    return (
        '<b>Refits, with all other parameters tuned too</b><table class="tight"><thead><tr>'
        '<th class="name">with</th><th>model error</th><th>residual over noise</th>'
        f"{'<th>between levels</th>' if has_levels else ''}"
        "<th>gap closed</th><th>log odds [nats]</th></tr></thead>"
        f'<tbody>{cells}</tbody></table><p class="soft">Model error: relative error of the motion '
        "at each sensor that the fit had to tolerate beside the noise. Gap closed: about all if "
        "the residual falls to the noise or below, none if it grows. Log odds: against a model "
        "without any effect, by the number of independent values of the residual."
        f"{_BETWEEN_LEVELS if has_levels else ''}</p>"
    )


def _level_cell(excess: float | None) -> str:
    """Return the root mean square over the noise, whose square is the excess plus one."""
    return f"<td>{'' if excess is None else f'{max(1 + excess, 0.0) ** 0.5:.3g}'}</td>"


def _scores(result: StoredDiagnosis) -> str:
    """Return the hypotheses with the best score tests."""
    scored = result.evidence.scored
    if not scored:
        return '<p class="soft">No gap was left to explain: no hypothesis was tested.</p>'
    cells = "".join(
        f'<tr><td class="name">{_hypothesis(score.key)}</td><td>{_nats(score.gain)}</td></tr>'
        for score in scored[:_MAX_SCORE_ROWS]
    )
    return (
        f"<details><summary>Score tests: the first {min(_MAX_SCORE_ROWS, len(scored))} of "
        f"{len(scored)} effects and places</summary>"
        '<table class="tight"><thead><tr><th class="name">hypothesis</th>'
        f"<th>score [nats]</th></tr></thead><tbody>{cells}</tbody></table>"
        '<p class="soft">Score test: predicted gain in log likelihood [nats] at the null model\'s '
        "model-error floor if the parameters of the hypothesis are added to all others. "
        "Model-error floor: relative error of the motion that the fit tolerates in addition to the "
        "noise.</p></details>"
    )


def _effect_names(keys: Sequence[Key]) -> str:
    return " and ".join(map(_hypothesis, keys)) or "no effect (null model)"


def _hypothesis(key: Key) -> str:
    effect, location, dof = key
    towards = name_direction(dof)
    text = f"{effect.replace('_', ' ')}, {place_name(location)}"
    return escape(f"{text} {towards}" if towards else text)


def _nats(value: float) -> str:
    """Return a number with three digits, or with separated thousands."""
    if not value:
        return "0"
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:,.0f}".replace(",", "\u202f")


def _paragraphs(sentences: list[str]) -> str:
    return "".join(f"<p>{escape(text)}</p>" for text in sentences)
