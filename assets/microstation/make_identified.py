"""Tune station.xml to the modes in modes.csv, and write station_identified.xml: ``make station``.

Masses and geometry stay those of the drawing; stiffness and damping become those with which the
model has the measured modes. The figures of README.md are written anew.
"""

import re
from pathlib import Path

from identification.readers.mode_table import read_mode_table
from mbmodel import as_drawn, load_machine, modes_of_matrices, refuse_difference, write_model
from tuning.files.mode_table_result import summarise_mode_table
from tuning.files.schema import ModePairRow, ModePartnerRow, ModeTableFile
from tuning.mode_table_tuning import ModeTableTuning, tune_to_modes

HERE = Path(__file__).resolve().parent
STATION, MODES = HERE / "station.xml", HERE / "modes.csv"
IDENTIFIED, README = HERE / "station_identified.xml", HERE / "README.md"
HIGHEST_HZ = 200.0  # the report found 16 modes below, and no others
COMPLETE_BELOW_HZ = 205.0  # the limit of a fit is soft, with a standard deviation of 1 %
STARTS, SEED = 60, 0
_HEADER = """<!--
  The micro-station of station.xml, tuned to the measured modes in modes.csv; make_identified.py
  makes it from both (make station). The stiffness and damping of its joints differ; all else is as
  in station.xml, whose header follows.
-->
"""


def main() -> None:
    """Write the tuned machine, and the figures of the README."""
    tuned = identify()
    written = write_model(tuned.model, tuned.fit.theta, IDENTIFIED)
    refuse_difference(written.file, written.difference)
    text = IDENTIFIED.read_text(encoding="utf-8")
    named = text.replace(
        '<mujoco model="microstation">', '<mujoco model="microstation_identified">'
    )
    # The header follows the XML declaration, with which the file begins.
    IDENTIFIED.write_text(named.replace("<!--", f"{_HEADER}<!--", 1), encoding="utf-8")
    README.write_text(with_figures(README.read_text(encoding="utf-8"), tuned), encoding="utf-8")


def identify(starts: int = STARTS) -> ModeTableTuning:
    """Tune the nominal model to the table of modes, from the committed parameters on.

    Many machines have these modes. A search that begins at the committed one ends there, on any
    computer, unless a step away from it finds a better one.

    Args:
        starts: 1 for a search from the committed parameters alone.
    """
    begin = None
    if IDENTIFIED.exists():
        committed = as_drawn(load_machine(IDENTIFIED))
        begin = {parameter.name: parameter.drawn for parameter in committed.parameters}
    return tune_to_modes(
        load_machine(STATION),
        read_mode_table(MODES),
        complete_below_hz=COMPLETE_BELOW_HZ,
        starts=starts,
        seed=SEED,
        begin=begin,
    )


def with_figures(text: str, tuned: ModeTableTuning) -> str:
    """Return the README with the figures of a tuning between its markers."""
    summary = summarise_mode_table(tuned)
    figures = {
        "modes": _modes(summary),
        "counts": _counts(tuned),
        "parameters": _parameters(summary),
    }
    for key, figure in figures.items():
        begin = f"<!-- make_identified: {key} -->"
        pattern = rf"{re.escape(begin)}.*?<!-- end -->"
        whole = f"{begin}\n\n{figure}\n\n<!-- end -->"
        text, count = re.subn(pattern, lambda _, new=whole: new, text, flags=re.DOTALL)
        if count != 1:
            raise RuntimeError(f"{README} has {count} figures {key!r}, expected one: mend it")
    return text


def _modes(summary: ModeTableFile) -> str:
    lines = [
        "| | measured | | | `station.xml` | | | `station_identified.xml` | | |",
        "|---|---|---|---|---|---|---|---|---|---|",
        "| mode | f / Hz | damping / % | moves most | f / Hz | damping / % | moves most | f / Hz "
        "| damping / % | moves most |",
    ]
    for number, row in enumerate(summary.modes, start=1):
        damping = "" if row.damping is None else f"{100 * row.damping:.1f}"
        cells = [str(number), f"{row.frequency:.1f}", damping, row.motion or ""]
        cells += _partner(row, row.as_drawn) + _partner(row, row.tuned)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _partner(row: ModePairRow, partner: ModePartnerRow | None) -> list[str]:
    if partner is None:
        return ["none", "", ""]
    moves = row.motion if partner.moves_most and row.motion else partner.largest
    return [f"{partner.frequency:.1f}", f"{100 * partner.damping:.1f}", moves]


def _counts(tuned: ModeTableTuning) -> str:
    drawn, identified = (
        modes_of_matrices(tuned.model.matrices(theta)).freq_hz
        for theta in (tuned.model.drawn, tuned.fit.theta)
    )
    below = [int((freq < HIGHEST_HZ).sum()) for freq in (drawn, identified)]
    beyond = identified[identified >= HIGHEST_HZ].min()
    return (
        f"Below {HIGHEST_HZ:g} Hz, `station.xml` has {below[0]} modes and "
        f"`station_identified.xml` has {below[1]}; its next mode lies at {beyond:.0f} Hz."
    )


def _parameters(summary: ModeTableFile) -> str:
    rows = [row for row in summary.parameters if row.name in summary.determined]
    rows.sort(key=lambda row: row.ratio)
    lines = [
        f"The table determines {len(rows)} of {len(summary.parameters)} parameters to less than "
        "half of that; the others stay near `station.xml`.",
        "",
        "| parameter | factor on `station.xml` | uncertainty that remains of the prior's |",
        "|---|---|---|",
    ]
    lines += [
        f"| `{row.name}` | {row.tuned / row.drawn:.2f} | {100 * row.ratio:.0f} % |" for row in rows
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
