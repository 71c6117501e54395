"""Files of ``mbw identify``: JSON, npz, CSV, universal file and .mat.

FRFs at the centres of mass (seed, eq. 2.5): ``body_frfs.npz``, ``.mat`` and ``.uff``.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, cast

import numpy as np
import scipy.io

from identification import reduce_to_bodies, reduction_covariance
from identification.modal import ScaledModes, full_matrix_model, modal_state_space
from identification.readers.result_files import write_result_arrays
from identification.readers.uff_frfs_write import number_bodies, write_uff_frfs
from identification.readers.uff_modes import NodeShapes, node_shapes, write_uff_modes
from identification.result.stored_result import (
    BODY_NPZ,
    MODES_JSON,
    MODES_NPZ,
    IdentificationResult,
)
from identification.words import (
    Dof,
    Frf,
    FrfEstimate,
    Layout,
    ModalModel,
    Quantity,
    Real,
)
from identification.words.csv_cells import write_csv
from mbw.identify.tips import TIPS_JSON, TIPS_PAGE
from mbw.page.numbers import frf_unit

BODY_MAT, BODY_UFF = "body_frfs.mat", "body_frfs.uff"


@dataclass(frozen=True, eq=False)
class BodyFrfs:
    """FRFs from each input to the motions of the bodies' centres of mass, in world axes.

    Args:
        estimate: FRFs of the determined motions with their variance.
        covariance: of the six motions of each body; (n_freq, n_in, n_body, 6, 6).
    """

    estimate: FrfEstimate
    covariance: Real


def reduce_to_centres(estimate: FrfEstimate, layout: Layout) -> BodyFrfs | None:
    """Reduce FRFs of channels to the centres of mass; None if no motion is determined."""
    reduced = reduce_to_bodies(estimate, layout)
    if not reduced.frf.outputs:
        return None
    return BodyFrfs(reduced, reduction_covariance(estimate, layout))


def write_body_frfs(reduced: BodyFrfs, layout: Layout, decay: float, folder: Path) -> None:
    """Write the FRFs at the centres of mass with their covariance, labels and units.

    Axes are (freq, out, in) in the .npz file and (out, in, freq) in the .mat file. The universal
    file holds the FRFs without their covariance.

    Args:
        reduced: FRFs to write.
        decay: 1 / tau of the exponential window that is still in the FRFs [1/s].
        folder: existing folder.
    """
    frf = reduced.estimate.frf
    labels = {
        "outputs": [str(dof) for dof in frf.outputs],
        "inputs": [str(dof) for dof in frf.inputs],
        "bodies": list(layout.bodies),
    }
    units = [
        [frf_unit(frf.quantity, out, source) for source in labels["inputs"]]
        for out in labels["outputs"]
    ]
    shared: dict[str, Any] = {
        "measured": reduced.estimate.measured,
        "centres": layout.centres,
        "window_decay": decay,
    }
    arrays = {
        "freq_hz": frf.freq_hz,
        "frf": frf.values,
        "variance": reduced.estimate.variance,
        "covariance": reduced.covariance,
        "quantity": np.array(frf.quantity),
        "units": np.array(units),
        **{name: np.array(texts) for name, texts in labels.items()},
        **shared,
    }
    write_result_arrays(folder / BODY_NPZ, arrays)
    content = {
        "freqs": frf.freq_hz.reshape(-1, 1),
        "FRFs": np.moveaxis(frf.values, 0, 2),
        "variance": np.moveaxis(reduced.estimate.variance, 0, 2),
        "covariance": reduced.covariance.transpose(3, 4, 2, 1, 0),
        "quantity": frf.quantity,
        "units": np.array(units, dtype=object),
        **{name: np.array([texts], dtype=object).T for name, texts in labels.items()},
        **shared,
    }
    scipy.io.savemat(folder / BODY_MAT, content, do_compression=True)
    write_uff_frfs(
        folder / BODY_UFF,
        reduced.estimate,
        number_bodies(layout.bodies, layout.points),
        dict(zip(layout.bodies, layout.centres, strict=True)),
    )


PAGE = "identify.html"
FULL_NPZ = "full_matrix.npz"
NAMES = (
    MODES_JSON, MODES_NPZ, PAGE, FULL_NPZ, "modes.csv", "shapes.csv", "synthesis.csv",
    "modes.unv", "modes.mat", BODY_NPZ, BODY_MAT, BODY_UFF,
    TIPS_JSON, TIPS_PAGE,
)  # fmt: skip


def write_files(result: IdentificationResult, folder: Path) -> None:
    """Write all files but the page into an existing folder."""
    (folder / MODES_JSON).write_text(result.summary.model_dump_json(indent=1) + "\n", "utf-8")
    write_result_arrays(folder / MODES_NPZ, result.arrays)
    _write_csv(folder / "modes.csv", _mode_rows(result))
    _write_csv(folder / "shapes.csv", _shape_rows(result))
    _write_csv(folder / "synthesis.csv", _synthesis_rows(result))
    title = f"{result.summary.campaign}: measured modes, {result.summary.normalisation}"
    write_uff_modes(folder / "modes.unv", nodes_of(result), title, datetime.now().astimezone())
    scipy.io.savemat(folder / "modes.mat", _matlab(result), do_compression=True)
    reduced = reduce_to_centres(_measured_estimate(result), result.layout)
    if reduced is not None:
        write_body_frfs(reduced, result.layout, float(result.arrays["decay"]), folder)


def _measured_estimate(result: IdentificationResult) -> FrfEstimate:
    """Return the measured FRFs of a result with their variance."""
    summary, arrays = result.summary, result.arrays
    frf = Frf(
        arrays["freq_hz"],
        arrays["measured"],
        tuple(result.layout.parse(label) for label in summary.outputs),
        tuple(result.layout.parse(label) for label in summary.inputs),
        cast(Quantity, summary.quantity),
    )
    variance = arrays["noise_sd"].astype(float) ** 2
    return FrfEstimate(frf, variance, "differences", arrays["is_measured"])


def nodes_of(result: IdentificationResult) -> NodeShapes:
    """Return the modes inside the band as vectors at the sensors' nodes."""
    arrays, count = result.arrays, len(result.summary.modes)
    channels = [result.layout.parse(label) for label in result.summary.outputs]
    rows = [row for row, dof in enumerate(channels) if isinstance(dof, Dof)]
    return node_shapes(
        arrays["poles"][:count],
        arrays["modal_a"][:count],
        arrays["shapes"][rows, :count],
        [dof for dof in channels if isinstance(dof, Dof)],
        result.layout,
    )


def write_full_matrix(result: IdentificationResult, folder: Path) -> None:
    """Write the synthesised FRFs between all outputs (seed, eq. 3.6), in single precision.

    Raises:
        UsageError: there is no drive point, so that the shapes have no scale.
    """
    arrays = result.arrays
    scaled = ScaledModes(
        _modal_model(result), result.summary.normalisation, arrays["modal_a"], np.zeros(0)
    )
    quantity = cast(Quantity, result.summary.quantity)
    values = (
        full_matrix_model(scaled, arrays["in_full_matrix"])
        .synthesise(arrays["freq_hz"], quantity)
        .values
    )
    content = {
        "freq_hz": arrays["freq_hz"],
        "frf": values.astype(np.complex64),
        "channels": arrays["outputs"],
        "quantity": arrays["quantity"],
    }
    write_result_arrays(folder / FULL_NPZ, content)


def _modal_model(result: IdentificationResult) -> ModalModel:
    names = ("poles", "shapes", "participation", "lower", "upper")
    return ModalModel(
        **{name: result.arrays[name] for name in names},
        outputs=tuple(result.layout.parse(label) for label in result.summary.outputs),
        inputs=tuple(result.layout.parse(label) for label in result.summary.inputs),
        freq_sd=result.arrays["freq_sd"],
        damping_sd=result.arrays["damping_sd"],
    )


def _write_csv(path: Path, rows: Iterable[Sequence[object]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        write_csv(file, rows, "\r\n")


def _mode_rows(result: IdentificationResult) -> Iterable[Sequence[object]]:
    """Yield one row for each mode; estimates by hand have columns of their own."""
    lists = {"shape_real", "shape_imaginary", "real_shape"}
    lists |= {"body_shape_real", "body_shape_imaginary", "by_hand"}
    rows = [
        row.model_dump(exclude=lists)
        | {f"by_hand_{name}": value for name, value in row.by_hand.model_dump().items()}
        for row in result.summary.modes
    ]
    yield ["mode", *(rows[0] if rows else [])]
    for number, row in enumerate(rows, start=1):
        cells = row | {"doubtful": "; ".join(row["doubtful"])}
        yield [number, *("" if value is None else value for value in cells.values())]


def _shape_rows(result: IdentificationResult) -> Iterable[Sequence[object]]:
    """Yield one row for each channel, then one for each direction of a body's centre of mass."""
    count = len(result.summary.modes)
    columns = [f"{part}_{mode}" for mode in range(1, count + 1) for part in ("re", "im", "real")]
    yield ["channel", *columns]
    shapes, real = result.arrays["shapes"][:, :count], result.arrays["real_shapes"]
    for label, shape, real_shape in zip(result.summary.outputs, shapes, real, strict=True):
        parts = zip(shape, real_shape, strict=True)
        yield [label, *(float(v) for s, r in parts for v in (s.real, s.imag, r))]
    for label, shape in zip(
        result.summary.body_directions, result.arrays["body_shapes"], strict=True
    ):
        yield [label, *(v for s in shape for v in (float(s.real), float(s.imag), ""))]


def _synthesis_rows(result: IdentificationResult) -> Iterable[Sequence[object]]:
    """Yield one row for each measured FRF."""
    yield ["output", "input", "error", "noise", "frac", "reciprocal_error"]
    arrays = result.arrays
    reciprocal = arrays["channel_reciprocal_error"]
    for out, inp in np.argwhere(arrays["is_measured"]):
        yield [
            result.summary.outputs[out],
            result.summary.inputs[inp],
            *(float(arrays[f"channel_{name}"][out, inp]) for name in ("error", "noise", "frac")),
            float(reciprocal[out, inp]) if reciprocal.size else "",
        ]


def _matlab(result: IdentificationResult) -> dict[str, Any]:
    """Return the variables of modes.mat; columns are modes, names follow MATLAB's habits."""
    arrays, count = result.arrays, len(result.summary.modes)
    poles = arrays["poles"][:count]

    def column(values: Any) -> Any:
        return np.asarray(values).reshape(-1, 1)

    def names(labels: Sequence[str]) -> Any:
        return column(np.array([*labels, ""], dtype=object)[:-1])

    return {
        **dict(zip("ABCD", modal_state_space(_modal_model(result)), strict=True)),
        "freqs": column(np.abs(poles) / (2 * np.pi)),
        "damping": column(-poles.real / np.abs(poles)),
        "freqs_sd": column(arrays["freq_sd"][:count]),
        "damping_sd": column(arrays["damping_sd"][:count]),
        "poles": column(poles),
        "shapes": arrays["shapes"][:, :count],
        "real_shapes": arrays["real_shapes"],
        "participation": arrays["participation"][:, :count],
        "modal_a": column(arrays["modal_a"][:count]),
        "body_shapes": arrays["body_shapes"],
        "lower_residual": arrays["lower"],
        "upper_residual": arrays["upper"],
        "poles_beside": column(arrays["poles"][count:]),
        "shapes_beside": arrays["shapes"][:, count:],
        "participation_beside": arrays["participation"][:, count:],
        "outputs": names(result.summary.outputs),
        "inputs": names(result.summary.inputs),
        "body_directions": names(result.summary.body_directions),
        "quantity": result.summary.quantity,
        "normalisation": result.summary.normalisation,
        "auto_mac": arrays["auto_mac"][:count, :count],
    }
