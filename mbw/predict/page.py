"""Page of ``mbw predict``: animated modes, energy shares, Bode plot."""

from collections.abc import Mapping
from html import escape
from pathlib import Path

import numpy as np

from identification.words import Real, count_noun
from identification.words.file_access import read_bytes
from mbmodel.geometry.surfaces import MachineGeometry
from mbw.page.html import fill_template, pack_complex, pack_real, warning_boxes
from mbw.page.picture import picture_data
from mbw.predict.before_after import comparison_section
from mbw.predict.curves import Curves
from mbw.predict.mode_rows import largest_shares
from mbw.predict.outcome import Outcome
from mbw.predict.state_space_check import check_curves, check_section
from mbw.prediction import Prediction

PAGE = "predict.html"
_MAX_ENERGY_MODES = 60  # columns of the energy table
_MIN_SHOWN_SHARE = 0.001  # largest share of a row of the energy table; rows below are left out


def render(outcome: Outcome, geometry: MachineGeometry, rates: Mapping[str, float]) -> str:
    """Return the HTML page of a prediction.

    Args:
        outcome: modes with their energy shares, and curves.
        geometry: surfaces of the machine.
        rates: of the hinges that spin [rad/s], by name.
    """
    prediction, machine = outcome.prediction, outcome.machine
    counts = (
        f"{count_noun(len(machine.layout.bodies), 'body', 'bodies')}, "
        f"{count_noun(len(machine.coordinates), 'joint coordinate')}, "
        f"{count_noun(len(prediction.model.parameters), 'parameter')} of stiffness and damping, "
        f"{count_noun(len(machine.layout.points), 'site')}"
    )
    gravity = "gravity on" if machine.gravity.any() else "gravity off"
    spins = ", ".join(f"{joint} spins at {rate:g} rad/s" for joint, rate in rates.items())
    comparison, check = outcome.comparison, outcome.state_space_row
    return fill_template(
        "predict/template.html",
        _data(outcome, geometry),
        title=escape(f"{machine.name}: modes and FRFs of the model"),
        subtitle=escape(", ".join(filter(None, (counts, gravity, spins)))),
        warnings=warning_boxes(outcome.remarks),
        comparison="" if comparison is None else comparison_section(comparison),
        state_space="" if check is None else check_section(check),
        scripts=["page/picture.js", "page/modes.js", "page/bode.js", "predict/page.js"],
    )


def read_page(path: Path) -> str:
    """Return the page in a folder that ``mbw predict`` wrote; it is the whole result.

    Raises:
        InputError: the page cannot be read.
    """
    file = path / PAGE if path.is_dir() else path
    return read_bytes(file, "run mbw predict again").decode("utf-8")


def _data(outcome: Outcome, geometry: MachineGeometry) -> dict[str, object]:
    prediction, curves = outcome.prediction, outcome.curves
    if curves is None:
        raise ValueError("a page needs curves")
    layout, check = prediction.machine.layout, outcome.state_space
    return {
        "picture": picture_data(layout, geometry, prediction.shapes[-6 * len(layout.bodies) :].T),
        "modes": _modes(prediction),
        "energy": _energy(prediction, 2 * float(curves.freq_hz[-1])),
        "bode": {
            "freq": pack_real(curves.freq_hz),
            "quantity": curves.quantity,
            "labels": curves.labels,
            "groups": curves.groups,
            "units": curves.units,
            "values": pack_complex(curves.values),
            "remark": curves.remark,
            **_interval(curves),
            **_before(outcome),
        },
        "check": None if check is None else check_curves(check, prediction.machine),
    }


def _interval(curves: Curves) -> dict[str, object]:
    """Return both ends of the intervals of the magnitudes; nothing without intervals."""
    if curves.interval is None:
        return {}
    low, high = curves.interval
    return {"low": pack_real(low), "high": pack_real(high)}


def _before(outcome: Outcome) -> dict[str, object]:
    """Return FRFs and natural frequencies of the machine alone; nothing without a comparison."""
    if outcome.comparison is None or outcome.curves is None:
        return {}
    modes = outcome.comparison.before.modes
    return {
        "before": pack_complex(outcome.curves.before),
        "frequencies": modes.freq_hz[modes.oscillates].tolist(),
    }


def _modes(prediction: Prediction) -> list[dict[str, object]]:
    modes = prediction.modes
    rows = zip(
        modes.freq_hz.tolist(),
        prediction.damping_words,
        modes.names,
        largest_shares(prediction),
        strict=True,
    )
    return [
        {
            "frequency": frequency,
            "damping": damping,
            "name": name,
            "spring": shares.spring,
            "body": shares.body,
            "damper": shares.damper,
        }
        for frequency, damping, name, shares in rows
    ]


def _energy(prediction: Prediction, highest: float) -> dict[str, object]:
    """Return the energy shares of at most 60 modes up to a frequency, in detail and summed."""
    shares, freq = prediction.energy, prediction.modes.freq_hz
    shown = np.flatnonzero(freq <= max(highest, float(freq.min())))[:_MAX_ENERGY_MODES]
    return {
        "modes": shown.tolist(),
        "strain": _tables(shares.springs, shares.stages, shares.strain[:, shown]),
        "dissipation": _tables(shares.springs, shares.stages, shares.dissipation[:, shown]),
        "kinetic": _tables(
            shares.motions,
            tuple(f"body:{body}" for body in shares.bodies),
            shares.kinetic[:, shown],
        ),
    }


def _tables(names: tuple[str, ...], owners: tuple[str, ...], table: Real) -> dict[str, object]:
    """Return the rows above the least share, sorted by owner, and their sums for each owner."""
    order = sorted(range(len(names)), key=lambda k: list(dict.fromkeys(owners)).index(owners[k]))
    kept = [k for k in order if np.abs(table[k]).max(initial=0.0) >= _MIN_SHOWN_SHARE]
    whole = list(dict.fromkeys(owners[k] for k in kept))
    sums = np.array(
        [np.sum([table[k] for k in kept if owners[k] == owner], axis=0) for owner in whole]
    )
    return {
        "names": [names[k] for k in kept],
        "owners": [owners[k] for k in kept],
        "values": pack_real(table[kept]),
        "whole": whole,
        "sums": pack_real(sums),
    }
