"""The page of ``mbw predict``: a machine moving in its modes, energy shares, Bode plot."""

from html import escape

import numpy as np

from identification.words import Real
from mbmodel.geometry.surfaces import Looks
from mbw.page.html import fill, packed, packed_complex, warnings
from mbw.page.picture import picture
from mbw.predict.curves import Curves
from mbw.predict.prediction import Prediction, leading

_MOST_COLUMNS = 60


def render(prediction: Prediction, looks: Looks, curves: Curves, spin: str = "") -> str:
    """The HTML of a prediction.

    Args:
        prediction: modes and all.
        looks: of the machine.
        curves: for the Bode plot.
        spin: what turns steadily, in words; empty if nothing does.
    """
    machine = prediction.machine
    counts = (
        f"{_count(len(machine.layout.bodies), 'body', 'bodies')}, "
        f"{_count(len(machine.coordinates), 'joint coordinate')}, "
        f"{_count(len(prediction.model.parameters), 'parameter')} of stiffness and damping, "
        f"{_count(len(machine.layout.points), 'site')}"
    )
    gravity = "gravity on" if machine.gravity.any() else "gravity off"
    return fill(
        "predict/template.html",
        _data(prediction, looks, curves),
        title=escape(f"{machine.name}: what the model says"),
        subtitle=escape(", ".join(filter(None, (counts, gravity, spin)))),
        warnings=warnings(prediction.remarks),
        scripts=["page/picture.js", "page/modes.js", "page/bode.js", "predict/page.js"],
    )


def _count(number: int, singular: str, plural: str = "") -> str:
    return f"{number} {singular if number == 1 else plural or singular + 's'}"


def _data(prediction: Prediction, looks: Looks, curves: Curves) -> dict[str, object]:
    layout = prediction.machine.layout
    return {
        "picture": picture(layout, looks, prediction.shapes[-6 * len(layout.bodies) :].T),
        "modes": _modes(prediction),
        "energy": _energy(prediction, 2 * float(curves.freq_hz[-1])),
        "bode": {
            "freq": packed(curves.freq_hz),
            "quantity": curves.quantity,
            "labels": curves.labels,
            "groups": curves.groups,
            "units": curves.units,
            "values": packed_complex(curves.values),
            "remark": curves.remark,
        },
    }


def _modes(prediction: Prediction) -> list[dict[str, object]]:
    found = prediction.modes
    rows = zip(
        found.freq_hz.tolist(),
        prediction.damping_words,
        found.names,
        leading(prediction),
        strict=True,
    )
    return [
        {
            "frequency": frequency,
            "damping": damping,
            "name": name,
            "spring": lead.spring,
            "body": lead.body,
            "damper": lead.damper,
        }
        for frequency, damping, name, lead in rows
    ]


def _energy(prediction: Prediction, highest: float) -> dict[str, object]:
    """Shares of the modes up to a frequency, at most 60, by spring and direction and summed."""
    shares, freq = prediction.energy, prediction.modes.freq_hz
    shown = np.flatnonzero(freq <= max(highest, float(freq.min())))[:_MOST_COLUMNS]
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
    """Rows that matter, owner by owner, and their sums."""
    order = sorted(range(len(names)), key=lambda k: list(dict.fromkeys(owners)).index(owners[k]))
    kept = [k for k in order if np.abs(table[k]).max(initial=0.0) >= 0.001]
    whole = list(dict.fromkeys(owners[k] for k in kept))
    sums = np.array(
        [np.sum([table[k] for k in kept if owners[k] == owner], axis=0) for owner in whole]
    )
    return {
        "names": [names[k] for k in kept],
        "owners": [owners[k] for k in kept],
        "values": packed(table[kept]),
        "whole": whole,
        "sums": packed(sums),
    }
