"""Page of ``mbw predict``: animated modes, energy shares, Bode plot."""

from html import escape
from pathlib import Path

import numpy as np

from identification.words import Real
from identification.words.file_access import read_bytes
from mbmodel.geometry.surfaces import MachineGeometry
from mbw.page.html import fill_template, pack_complex, pack_real, warning_boxes
from mbw.page.picture import picture_data
from mbw.predict.curves import Curves
from mbw.predict.prediction import Prediction, largest_shares

PAGE = "predict.html"
_MAX_ENERGY_MODES = 60  # columns of the energy table
_MIN_SHOWN_SHARE = 0.001  # largest share of a row of the energy table; rows below are left out


def render(
    prediction: Prediction, geometry: MachineGeometry, curves: Curves, spin: str = ""
) -> str:
    """Return the HTML page of a prediction.

    Args:
        prediction: modes with their energy shares.
        geometry: surfaces of the machine.
        curves: FRFs of the Bode plot.
        spin: spinning joints and their rates in words; empty if none spins.
    """
    machine = prediction.machine
    counts = (
        f"{_count(len(machine.layout.bodies), 'body', 'bodies')}, "
        f"{_count(len(machine.coordinates), 'joint coordinate')}, "
        f"{_count(len(prediction.model.parameters), 'parameter')} of stiffness and damping, "
        f"{_count(len(machine.layout.points), 'site')}"
    )
    gravity = "gravity on" if machine.gravity.any() else "gravity off"
    return fill_template(
        "predict/template.html",
        _data(prediction, geometry, curves),
        title=escape(f"{machine.name}: modes and FRFs of the model"),
        subtitle=escape(", ".join(filter(None, (counts, gravity, spin)))),
        warnings=warning_boxes(prediction.remarks),
        scripts=["page/picture.js", "page/modes.js", "page/bode.js", "predict/page.js"],
    )


def read_page(path: Path) -> str:
    """Return the page in a folder that ``mbw predict`` wrote; it is the whole result.

    Raises:
        InputError: the page cannot be read.
    """
    file = path / PAGE if path.is_dir() else path
    return read_bytes(file, "run mbw predict again").decode("utf-8")


def _count(number: int, singular: str, plural: str = "") -> str:
    return f"{number} {singular if number == 1 else plural or singular + 's'}"


def _data(prediction: Prediction, geometry: MachineGeometry, curves: Curves) -> dict[str, object]:
    layout = prediction.machine.layout
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
        },
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
