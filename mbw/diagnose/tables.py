"""The tables of a diagnosis' page: causes with their sizes, refits and scores that were tried."""

from collections.abc import Sequence
from html import escape

from diagnosis.inference.evidence import Gapped, Key, Scored
from diagnosis.labels import direction
from diagnosis.verdict.schema import CauseRow
from mbw.diagnose.effect_parameters import Line, may_be_nothing, number, parameter_lines
from mbw.diagnose.result import Result
from mbw.diagnose.sentences import (
    gate_sentences,
    percent_sure,
    place,
    shared_sentences,
    twin_sentences,
    untested_sentences,
)

_SCORED, _PAIRS = 12, 4  # hypotheses, and pairs of them, that are listed


def causes_section(result: Result) -> str:
    """HTML of every cause, of what is alike and of what was not tested."""
    verdict = result.verdict
    causes = zip(verdict.causes, result.shown.means, strict=True)
    rows = "".join(_cause(row, means) for row, means in causes)
    if rows:
        table = (
            '<table class="causes"><thead><tr><th class="name">effect</th>'
            '<th class="name">place</th><th class="name">direction</th>'
            '<th class="name">probability</th><th class="name">sizes, 95 % interval</th>'
            f"<th>excess after</th></tr></thead><tbody>{rows}</tbody></table>"
        )
    else:
        table = "<p>No effect of the catalogue is likely: none has a probability of 1 %.</p>"
    levels = len({test.level for test in result.shown.tests})
    shared = shared_sentences(result.evidence)
    alike = twin_sentences(verdict)
    said = _paragraphs([*shared, *alike, *untested_sentences(verdict, levels)])
    if verdict.next_experiment:
        said += f"<p><b>What to do next:</b> {escape(verdict.next_experiment)}.</p>"
    return table + said


def tried_section(result: Result) -> str:
    """HTML of the refits, of the best scores, and of what sensors alone say."""
    gates = gate_sentences(result.shown)
    solid = "".join(f"<li>{escape(text)}</li>" for text in result.shown.solid)
    left = f"{_refits(result)}{_scores(result)}"
    right = (
        f'<b>Sensors among each other</b>{_paragraphs(gates)}<ul class="plain soft">{solid}</ul>'
    )
    return f'<div class="tried"><div>{left}</div><div>{right}</div></div>'


def _cause(row: CauseRow, means: str) -> str:
    sizes = [line for name in row.parameters for line in _lines(row, name)]
    bar = f'<span class="bar"><i style="left:0;width:{100 * row.probability:.1f}%"></i></span>'
    name = f"<b>{escape(row.effect.replace('_', ' '))}</b><br><small>{escape(means)}</small>"
    return (
        f'<tr><td class="name">{name}</td><td class="name whole">{escape(place(row.location))}</td>'
        f'<td class="name">{escape(direction(row.dof))}</td>'
        f'<td class="name whole">{bar} {percent_sure(row.probability)}</td>'
        f'<td class="name">{_sizes(sizes)}</td>'
        f"<td>{_excess(row.excess_after)}</td></tr>"
    )


def _lines(row: CauseRow, name: str) -> list[Line]:
    """A parameter; one that goes with a size that may be nothing is not known."""
    doubtful = may_be_nothing(row.interval)
    if doubtful and name not in doubtful:
        return [Line(name.replace("_", " "), "not known", "")]
    ends = row.interval.get(name)
    return parameter_lines(row.effect, row.dof, name, row.parameters[name], ends)


def _sizes(lines: list[Line]) -> str:
    rows = "".join(
        f'<tr><td class="name">{escape(line.name)}</td><td>{escape(line.value)}</td>'
        f'<td class="soft">{escape(line.interval)}</td></tr>'
        for line in lines
    )
    return f'<table class="sizes">{rows}</table>' if rows else ""


def _excess(value: float | None) -> str:
    return "" if value is None else number(value)


def _refits(result: Result) -> str:
    """What was fitted at the weights of the noise: every effect, the best pairs, none."""
    seen = result.evidence
    fits: list[tuple[tuple[Key, ...], Gapped]] = [((), seen)]
    fits += [((one.key,), one) for one in seen.refits]
    fits += [(one.keys, one) for one in sorted(seen.pairs, key=lambda one: one.cost)[:_PAIRS]]
    ordered = sorted(fits, key=lambda row: row[1].nats())
    best = ordered[0][1].nats()
    cells = "".join(
        f'<tr><td class="name">{_together(keys)}</td><td>{one.chi_square**0.5:.3g}</td>'
        f"<td>{_nats(one.nats() - best)}</td></tr>"
        for keys, one in ordered
    )
    return (
        '<b>Fitted anew, all else tuned too</b><table class="tight"><thead><tr>'
        '<th class="name">with</th><th>residual over noise</th>'
        f"<th>nats worse than the best</th></tr></thead><tbody>{cells}</tbody></table>"
    )


def _scores(result: Result) -> str:
    """The most promising of all hypotheses, by what freeing them gains."""
    scored = result.evidence.scored
    if not scored:
        return '<p class="soft">Nothing was left to explain: no hypothesis was asked.</p>'
    cells = "".join(_score(one) for one in scored[:_SCORED])
    return (
        f"<details><summary>Scored: the first {min(_SCORED, len(scored))} of {len(scored)} effects "
        'and places</summary><table class="tight"><thead><tr><th class="name">hypothesis</th>'
        "<th>gain at 3 %</th><th>at the noise</th><th>at 10 %</th></tr></thead>"
        f"<tbody>{cells}</tbody></table>"
        '<p class="soft">What freeing it would gain [nats], all else tuned with it, about fits '
        "that allow the model an error of 3 % of the motion, of none, of 10 %.</p></details>"
    )


def _score(one: Scored) -> str:
    gains = "".join(f"<td>{_nats(gain)}</td>" for gain in one.gains)
    return f'<tr><td class="name">{_hypothesis(one.key)}</td>{gains}</tr>'


def _together(keys: Sequence[Key]) -> str:
    return " and ".join(map(_hypothesis, keys)) or "nothing added"


def _hypothesis(key: Key) -> str:
    effect, location, dof = key
    towards = direction(dof)
    text = f"{effect.replace('_', ' ')}, {place(location)}"
    return escape(f"{text} {towards}" if towards else text)


def _nats(value: float) -> str:
    """Three figures, thousands apart."""
    if not value:
        return "0"
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:,.0f}".replace(",", "\u202f")


def _paragraphs(sentences: list[str]) -> str:
    return "".join(f"<p>{escape(text)}</p>" for text in sentences)
