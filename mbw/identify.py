"""``mbw identify``: the measured modal model of a campaign."""

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import typer
from pydantic import BaseModel

from identification.modal import Identified, Measured, auto_mac, cmif, identify, mpc, mpd
from identification.words import ORDER, ModalModel, UsageError
from mbw.messages import SCREEN
from mbw.tune import check_json, write_json
from tuning import files_of, open_campaign

MODES_JSON, MODES_NPZ = "modes.json", "modes.npz"


class ModeRow(BaseModel):
    """One identified mode; standard deviations in the same units."""

    frequency: float
    frequency_sd: float
    damping: float
    damping_sd: float
    real: float
    imaginary: float
    modal_a_real: float | None
    modal_a_imaginary: float | None
    phase_collinearity: float
    phase_deviation: float
    orders: int | None


class ModesFile(BaseModel):
    """``modes.json``."""

    campaign: str
    band: tuple[float, float]
    lines: int
    outputs: list[str]
    inputs: list[str]
    misfit: float
    beside_band: int
    modes: list[ModeRow]


def run(
    campaign: Path, *, out: Path | None, json: Path | None, band: tuple[float, float] | None
) -> Path:
    """Identify, write the modal model, print the modes.

    Returns:
        The folder of the result.
    """
    _, _, chosen = open_campaign(campaign, band)
    folder = out or Path(f"{chosen.name}-modes")
    if json is not None:
        check_json(json)
    with SCREEN.console.status("poles, shapes, refinement") if not SCREEN.quiet else nullcontext():
        model, found, measured = identify(chosen)
    summary = _summary(chosen.name, model, found, measured)
    with files_of(folder) as place:
        (place / MODES_JSON).write_text(summary.model_dump_json(indent=1) + "\n", "utf-8")
        np.savez_compressed(
            place / MODES_NPZ, allow_pickle=False, **_arrays(model, found, measured)
        )
    if json is not None:
        write_json(summary.model_dump_json(indent=1), json)
    if json is None or str(json) != "-":
        _print(summary)
    SCREEN.say(f"modal model in {folder}")
    return folder


def _summary(name: str, model: ModalModel, found: Identified, measured: Measured) -> ModesFile:
    count = int(found.inside.sum())
    try:
        scale = list(model.modal_a)
    except UsageError:
        scale = [None] * len(model.poles)
    collinearity, deviation = mpc(model.shapes), mpd(model.shapes)
    rows = [
        ModeRow(
            frequency=float(model.freq_hz[mode]),
            frequency_sd=float(model.freq_sd[mode]),
            damping=float(model.damping[mode]),
            damping_sd=float(model.damping_sd[mode]),
            real=float(model.poles[mode].real),
            imaginary=float(model.poles[mode].imag),
            modal_a_real=None if scale[mode] is None else float(scale[mode].real),
            modal_a_imaginary=None if scale[mode] is None else float(scale[mode].imag),
            phase_collinearity=float(collinearity[mode]),
            phase_deviation=float(deviation[mode]),
            orders=_orders(model.poles[mode], found),
        )
        for mode in range(count)
    ]
    return ModesFile(
        campaign=name,
        band=(float(measured.freq_hz[0]), float(measured.freq_hz[-1])),
        lines=len(measured.freq_hz),
        outputs=[str(dof) for dof in model.outputs],
        inputs=[str(dof) for dof in model.inputs],
        misfit=found.misfit,
        beside_band=len(model.poles) - count,
        modes=rows,
    )


def _orders(pole: complex, found: Identified) -> int | None:
    """Model orders in which a mode came back before it was refined; None for one found later."""
    near = [
        cluster.count for cluster in found.clusters if abs(cluster.pole - pole) < 0.02 * abs(pole)
    ]
    return max(near) if near else None


def _arrays(model: ModalModel, found: Identified, measured: Measured) -> dict[str, Any]:
    """The model in full, and how it answers beside what was measured."""
    quantity = next(name for name, order in ORDER.items() if order == measured.order)
    return {
        "poles": model.poles,
        "shapes": model.shapes,
        "participation": model.participation,
        "lower": model.lower,
        "upper": model.upper,
        "freq_sd": model.freq_sd,
        "damping_sd": model.damping_sd,
        "inside_band": np.arange(len(model.poles)) < found.inside.sum(),
        "outputs": np.array([str(dof) for dof in model.outputs]),
        "inputs": np.array([str(dof) for dof in model.inputs]),
        "quantity": np.array(quantity),
        "freq_hz": measured.freq_hz,
        "measured": measured.values,
        "synthesised": found.fit.values(measured.laplace, measured.order),
        "is_measured": measured.measured,
        "cmif": cmif(measured.values),
        "auto_mac": auto_mac(model.shapes),
    }


def _print(summary: ModesFile) -> None:
    typer.echo("mode  frequency/Hz       sd  damping/%       sd  collinearity  orders")
    for number, row in enumerate(summary.modes, start=1):
        orders = "-" if row.orders is None else str(row.orders)
        typer.echo(
            f"{number:4d}  {row.frequency:12.3f}  {row.frequency_sd:7.4f}  "
            f"{100 * row.damping:9.3f}  {100 * row.damping_sd:7.4f}  "
            f"{row.phase_collinearity:12.3f}  {orders:>6}"
        )
    beside = f" and {summary.beside_band} poles beside it" if summary.beside_band else ""
    SCREEN.say(
        f"{len(summary.modes)} modes in {summary.band[0]:g}..{summary.band[1]:g} Hz{beside}; what "
        f"remains is {summary.misfit:.3g} times the variance of the noise"
    )
