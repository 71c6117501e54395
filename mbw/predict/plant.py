"""The plant with its uncertainty: bands, samples, uncertain plant and weight, from a fit."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from identification.words import InputError, Real, percent_text
from mbmodel import FrfRequest, Model
from mbw.page.numbers import format_percent
from mbw.predict.alternative_plants import alternatives_sentence, read_alternatives
from mbw.predict.machines import MachineRequest, Machines
from mbw.predict.plant_files import (
    BANDS_NPZ,
    SAMPLES_NPZ,
    WEIGHT_MAT,
    WEIGHT_NPZ,
    plant_state_space,
    reduction_row,
    reduction_sentence,
    write_bands,
    write_plant,
    write_samples,
    write_uncertain_plant,
    write_weight,
)
from mbw.predict.plant_request import PlantRequest
from mbw.predict.schema import BandsRow, PlantRow, UncertainPlantRow, WeightRow
from mbw.predict.state_space_check import law_rows, law_sentences
from tuning import POSTERIOR_NPZ, PosteriorOfModel, read_posterior
from tuning.files.plant_findings import PlantFindings
from tuning.files.plant_folder import has_posterior
from tuning.plant import AlternativePlants, FrfBands, frf_bands

FOLDER_NAMES = (BANDS_NPZ, SAMPLES_NPZ, WEIGHT_NPZ, WEIGHT_MAT)
_MANY_LINES_SHARE = 0.95  # of the lines of all FRFs, whose interval is stated
_MIXED_UNITS = "; it depends on the units of the inputs, which differ: tune each kind apart"


@dataclass(frozen=True, eq=False)
class PlantResult:
    """State space and uncertainty of the plant, and where they are written.

    Args:
        model: at its nominal parameters.
        machine: MJCF and state of the machine.
        frfs: outputs, inputs and lines; None if no port is requested.
        request: what is asked for.
        posterior: posterior of a fit; None if nothing asks for it.
        bands: of the FRFs; None without a posterior or ports.
        alternatives: plants with and without the causes of a diagnosis; None without one.
        rows: of the JSON file, by key.
        sentences: for the terminal.
    """

    model: Model
    machine: MachineRequest
    frfs: FrfRequest | None
    request: PlantRequest
    posterior: PosteriorOfModel | None = None
    bands: FrfBands | None = None
    alternatives: AlternativePlants | None = None
    rows: dict[str, PlantRow] = field(default_factory=dict)
    sentences: list[str] = field(default_factory=list)

    @property
    def interval(self) -> tuple[Real, Real] | None:
        """Ends of the 95 % interval of the magnitudes, over all alternatives."""
        if self.alternatives is not None:
            return self.alternatives.magnitude_interval()
        return None if self.bands is None else self.bands.magnitude_interval()

    def find_interval_at(self, freq_hz: Real) -> tuple[Real, Real] | None:
        """Return the ends of the 95 % interval at other lines; None without bands.

        Args:
            freq_hz: frequency lines [Hz]; (n_freq,).

        Returns:
            Both ends of |H|; (n_freq, n_out, n_in) each.
        """
        if self.posterior is None or self.frfs is None or not self.request.bands:
            return None
        frfs = replace(self.frfs, freq_hz=freq_hz)
        bands = frf_bands(self.posterior, frfs)
        if self.alternatives is None:
            return bands.magnitude_interval()
        plants = read_alternatives(
            self.machine, self.request.diagnosed, self.posterior, frfs, bands
        )
        return (plants or bands).magnitude_interval()

    def write_into(self, place: Path) -> None:
        """Write bands, samples and weight into the folder of the result.

        Raises:
            InputError: a file cannot be written, or the fit has no held-out predictions.
        """
        frfs, request, posterior = self.frfs, self.request, self.posterior
        if self.bands is not None and self.interval is not None and request.bands:
            machine, target = self.model.machine, place / BANDS_NPZ
            write_bands(machine, self.bands, self.interval, self.alternatives, target)
        if posterior is not None and frfs is not None and request.samples:
            write_samples(posterior, frfs, request.samples, request.seed, place / SAMPLES_NPZ)
            self.sentences.append(
                f"samples: {request.samples} of the posterior, seed {request.seed}: parameters, "
                "FRFs and state spaces"
            )
        if request.weight is not None:
            row = write_weight(self.machine.path, request.weight, place)
            self.rows["weight"] = row
            self.sentences.append(_weight_sentence(row))

    def write_named_files(self) -> None:
        """Write state space and uncertain plant to the files that the user names.

        Raises:
            InputError: a file cannot be written.
        """
        frfs, request = self.frfs, self.request
        if frfs is None:
            return
        if self.posterior is not None and request.uncertain is not None:
            row = write_uncertain_plant(self.posterior, frfs, request.uncertain, request.seed)
            self.rows["uncertain_plant"] = row
            self.sentences.append(_uncertain_sentence(row))
        if request.statespace is not None:
            plant = plant_state_space(self.model, frfs, request, self.bands)
            write_plant(plant, self.model.machine, request.statespace)
            self.sentences.extend(
                f"state space: {sentence}"
                for sentence in law_sentences(law_rows(plant.laws, self.model))
            )
            if (reduction := reduction_row(plant)) is not None:
                self.rows["reduction"] = reduction
                self.sentences.append(reduction_sentence(reduction))


def compute_plant(
    machines: Machines,
    machine_request: MachineRequest,
    frfs: FrfRequest | None,
    request: PlantRequest,
) -> PlantResult:
    """Read the posterior beside a fitted MJCF, if it is needed, and compute the bands.

    A reduction without an order takes it too where it is there: it says which states matter.

    Args:
        machines: the machine, with what is put on it.
        machine_request: MJCF and state of the machine.
        frfs: outputs, inputs and lines; None if no port is requested.

    Raises:
        InputError: no posterior, or one of another model.
    """
    model, source = machines.model, machine_request.path
    file = source.parent / POSTERIOR_NPZ
    is_useful = request.method is not None and request.order is None and has_posterior(source)
    if not (request.needs_fit or is_useful):
        return PlantResult(model, machine_request, frfs, request)
    if not file.is_file():
        raise InputError(
            f"{file} is missing, which mbw tune and mbw diagnose write: name the folder of a "
            f"tuning or diagnosis, or its MJCF"
        )
    posterior = read_posterior(file).on(machines.whole)
    if frfs is None:
        return PlantResult(model, machine_request, frfs, request, posterior)
    bands = frf_bands(posterior, frfs)
    alternatives = None
    if request.bands:
        alternatives = read_alternatives(machine_request, request.diagnosed, posterior, frfs, bands)
    plant = PlantResult(model, machine_request, frfs, request, posterior, bands, alternatives)
    if request.bands:
        row = _bands_row(plant, bands, posterior)
        plant.rows["bands"] = row
        plant.sentences.append(
            f"bands: the 95 % interval of the magnitude is +-{format_percent(row.median, 2)} in "
            f"the median and at most +-{format_percent(row.most, 2)} at 95 % of the frequency "
            "lines; " + _model_error_phrase(row)
        )
        if row.remark:
            plant.sentences.append(f"bands: {row.remark}")
    if alternatives is not None:
        points = model.machine.layout.points
        plant.sentences.append(alternatives_sentence(alternatives, request.diagnosed, points))
    return plant


def _bands_row(plant: PlantResult, bands: FrfBands, posterior: PosteriorOfModel) -> BandsRow:
    """Return the relative half widths of the intervals."""
    size, lines = np.abs(bands.values), bands.request.freq_hz.tolist()
    moving = size > 0
    low, high = plant.interval or bands.magnitude_interval()
    half = ((high - low) / 2)[moving] / size[moving]
    findings = PlantFindings.beside(plant.machine.path)
    moved = findings.moved_sensor_remark(
        [port.point for port in (*bands.request.outputs, *bands.request.inputs)]
    )
    untested = findings.untested_band_remark((lines[0], lines[-1]))
    return BandsRow(
        median=float(np.median(half)) if half.size else 0.0,
        most=float(np.quantile(half, _MANY_LINES_SHARE)) if half.size else 0.0,
        error_floor=posterior.posterior.error_floor,
        discrepancy=posterior.posterior.discrepancy,
        coordinates=posterior.posterior.size,
        remark="; ".join(filter(None, (untested, moved))),
    )


def _model_error_phrase(row: BandsRow) -> str:
    """Return what of the bands is no error of the parameters."""
    if not row.discrepancy:
        return "the fit showed no model error beside the noise"
    return f"it holds a model error, {percent_text(row.discrepancy)} of the machine's forces"


def _uncertain_sentence(row: UncertainPlantRow) -> str:
    """Return size and error of the uncertain plant."""
    return (
        f"uncertain plant: {row.blocks} parameters, {row.exact_blocks} of them exact, Delta of "
        f"{row.width} x {row.width}, {row.states} states; its error is at most "
        f"{row.max_error:.2g} of the peak at {row.samples} samples of the posterior"
    )


def _weight_sentence(row: WeightRow) -> str:
    """Return what the weight bounds, and how closely."""
    units = "" if row.has_one_unit else _MIXED_UNITS
    return (
        f"weight: |W| of order {row.order} bounds the held-out error at the inputs, "
        f"{format_percent(row.median, 2)} in the median and {format_percent(row.largest, 2)} at "
        f"most, from above within a factor of {row.ratio:.3g}{units}"
    )
