"""FRFs at the centres of mass (seed, eq. 2.5): ``body_frfs.npz``, ``.mat`` and ``.uff``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from identification import reduce_to_bodies, reduction_covariance
from identification.modal import MeasuredFrfs
from identification.readers.result_files import write_result_arrays
from identification.readers.uff_frfs_write import number_bodies, write_uff_frfs
from identification.words import DERIVATIVE_ORDER, Frf, FrfEstimate, Layout, Real
from mbw.page.numbers import frf_unit

BODY_NPZ, BODY_MAT, BODY_UFF = "body_frfs.npz", "body_frfs.mat", "body_frfs.uff"


@dataclass(frozen=True, eq=False)
class BodyFrfs:
    """FRFs from each input to the motions of the bodies' centres of mass, in world axes.

    Args:
        estimate: FRFs of the determined motions with their variance.
        covariance: of the six motions of each body; (n_freq, n_in, n_body, 6, 6).
    """

    estimate: FrfEstimate
    covariance: Real


def measured_estimate(measured: MeasuredFrfs) -> FrfEstimate:
    """Return the FRFs of all tests, combined in one matrix, with their variance."""
    quantity = next(name for name, order in DERIVATIVE_ORDER.items() if order == measured.order)
    frf = Frf(measured.freq_hz, measured.values, measured.outputs, measured.inputs, quantity)
    return FrfEstimate(frf, measured.variance, "differences", measured.measured)


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
        layout: bodies with their centres of mass.
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
