"""The plant of a tuned or diagnosed machine for control design, with its uncertainty."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from identification.words import Quantity, Real, parse_quantity
from mbmodel import FrfRequest, load_machine, machine_model, with_loops
from mbworkbench.labels import (
    AnyLabel,
    AnyPath,
    as_labels,
    as_path,
    check_frequencies,
    parse_request,
)
from mbworkbench.tables import Shown, Table
from tuning import PosteriorOfModel, read_posterior
from tuning.control_loops.loops_file import choose_loops, known_loops
from tuning.files.plant_findings import PlantFindings
from tuning.files.plant_folder import plant_doubts, plant_file, read_held_out
from tuning.plant import (
    ControlPlant,
    FrfBands,
    UncertainPlant,
    assemble_uncertain_plant,
    bound_magnitudes,
    frf_bands,
    make_control_plant,
)
from tuning.plant.pose_grid import GridPoint, GridRequest, PoseGrid, pose_grid
from tuning.plant.uncertainty.multiplicative_error import held_out_input_error

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False)
class TunedPlant(Shown):
    """A tuned machine between some ports: FRFs with bands, state spaces, uncertain plant.

    Attributes:
        posterior: of the machine's parameters.
        request: outputs, inputs, lines and quantity.
        loops: names of the control loops that were closed during the test.
        remarks: on gains and lags of drives and encoders that the plant does not hold, and on
            lines outside the band of the test.
        doubts: about the fit, such as that something is missing; one sentence each.
        source: MJCF of the tuning or diagnosis.
    """

    posterior: PosteriorOfModel
    request: FrfRequest
    source: Path
    loops: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()

    @property
    def closed(self) -> tuple[str, ...]:
        """Names of the loops that are closed here; the others are open."""
        return tuple(part.loop.name for part in self.posterior.model.loops)

    def bands(self) -> FrfBands:
        """Compute the FRFs with the standard deviations of magnitude and phase."""
        return frf_bands(self.posterior, self.request)

    def state_space(self, delays_s: Sequence[float] | Real | None = None) -> ControlPlant:
        """Return the state space; ``reduce``, ``sample`` and ``to_control`` are its methods.

        Args:
            delays_s: of the inputs [s]; none if None.

        Raises:
            UsageError: delays that are negative or no numbers, or not one of each input.
        """
        model = self.posterior.model
        delays = None if delays_s is None else np.asarray(delays_s, float)
        return make_control_plant(model, model.drawn, self.request, delays)

    def to_control(self) -> "control.StateSpace":
        """Return the state space without delays, for python-control."""
        return self.state_space().to_control()

    def uncertain(self) -> UncertainPlant:
        """Return the plant as a linear fractional transformation of the parameters' changes."""
        return assemble_uncertain_plant(self.posterior, self.request)

    def weight(self, order: int) -> "control.TransferFunction":
        """Return W: the machine is within G (1 + W D), |D| <= 1, by the held-out lines of its test.

        A stable minimum-phase filter whose magnitude bounds the error at the inputs of the fit that
        left each line out (multiplicative uncertainty; Skogestad and Postlethwaite 2005, ch. 8).

        Args:
            order: of the filter, 0 to 20.

        Raises:
            InputError: the fit has no held-out predictions.
            UsageError: an order that cannot be used.
        """
        import control  # noqa: PLC0415  # with its matplotlib it would slow down every start

        error = held_out_input_error(read_held_out(self.source))
        return control.tf(*bound_magnitudes(error.freq_hz, error.quantile, order).polynomials())

    def table(self) -> Table:
        """Return a table of the FRFs: magnitude, its 95 % interval, and phase [degrees]."""
        bands = self.bands()
        low, high = bands.magnitude_interval()
        rows = [
            (
                float(freq),
                str(output),
                str(source),
                float(abs(bands.values[line, row, column])),
                float(low[line, row, column]),
                float(high[line, row, column]),
                float(np.angle(bands.values[line, row, column], deg=True)),
            )
            for row, output in enumerate(self.request.outputs)
            for column, source in enumerate(self.request.inputs)
            for line, freq in enumerate(self.request.freq_hz)
        ]
        header = ("frequency [Hz]", "output", "input", "magnitude", "low", "high", "phase")
        return Table(f"FRFs of {self.posterior.model.machine.name}", header, rows)

    def _repr_html_(self) -> str:
        """Return doubts and ports for a notebook."""
        kinds = (("output", self.request.outputs), ("input", self.request.inputs))
        rows = [(kind, str(label)) for kind, labels in kinds for label in labels]
        name = f"plant of {self.posterior.model.machine.name}"
        return Table("; ".join((name, *self.doubts)), ("port", "label"), rows).to_html()

    def __repr__(self) -> str:
        """Return doubts, machine, ports and posterior in a few lines."""
        request = self.request
        return "\n".join(
            (
                *self.doubts,
                f"plant of {self.posterior.model.machine.name}: {request.quantity}, "
                f"{len(request.freq_hz)} lines",
                f"  inputs: {', '.join(map(str, request.inputs))}",
                f"  outputs: {', '.join(map(str, request.outputs))}",
                *(
                    f"  loop {name} {'closed' if name in self.closed else 'open'}"
                    for name in self.loops
                ),
                f"  {self.posterior.posterior!r}",
                *(f"  {remark}" for remark in self.remarks),
            )
        )


def read_plant(
    folder: AnyPath,
    outputs: AnyLabel | Iterable[AnyLabel],
    inputs: AnyLabel | Iterable[AnyLabel],
    freq_hz: Sequence[float] | Real,
    quantity: Quantity | None = None,
    closed: Iterable[str] = (),
) -> TunedPlant:
    """Read the plant between some ports from the folder of a tuning or diagnosis.

    Control loops that were closed during the test are open, but for those that are named: a
    controller that is designed on the plant does not count them twice.

    Args:
        folder: that ``mbw tune``, ``mbw diagnose`` or ``TunedModel.write`` wrote, or its MJCF.
        outputs: labels of motions; none need have been measured.
        inputs: labels of forces or motors.
        freq_hz: frequencies [Hz], increasing; (n_freq,).
        quantity: receptance, mobility or accelerance; None for the receptance where all outputs are
            joints or sensors by name, as encoders read it, else the accelerance.
        closed: names of the loops of the test that stay closed; ``"*"`` for all.

    Raises:
        InputError: the folder holds no such result, or its model was changed after the fit.
        UsageError: a label that the machine does not have.
    """
    source = plant_file(as_path(folder))
    machine = load_machine(source)
    loops = known_loops(source, machine)
    patterns = (closed,) if isinstance(closed, str) else closed
    machine = with_loops(machine, choose_loops(loops, patterns))
    posterior = read_posterior(source.parent).on(machine_model(machine))
    request = parse_request(machine, outputs, inputs, freq_hz, quantity)
    findings = PlantFindings.beside(source)
    lags = findings.lag_remarks(machine.motors)
    ends = float(request.freq_hz[0]), float(request.freq_hz[-1])
    moved = findings.moved_sensor_remark([p.point for p in (*request.outputs, *request.inputs)])
    remarks = tuple(filter(None, (*lags, findings.untested_band_remark(ends), moved)))
    names, doubts = tuple(loop.name for loop in loops), tuple(plant_doubts(source))
    return TunedPlant(posterior, request, source, names, remarks, doubts)


def predict_poses(
    model: AnyPath,
    poses: Iterable[Mapping[str, float]],
    outputs: AnyLabel | Iterable[AnyLabel] = (),
    inputs: AnyLabel | Iterable[AnyLabel] = (),
    freq_hz: Sequence[float] | Real = (1.0,),
    quantity: Quantity | None = None,
    *,
    spin: Mapping[str, float] | None = None,
    budget: AnyPath | None = None,
) -> PoseGrid:
    """Predict modes, FRFs, state spaces and margins of a machine over its poses.

    Args:
        model: path of an MJCF, or folder of a tuning or diagnosis.
        poses: moves of slides and hinges from the drawing [m, rad], by name, for each pose.
        outputs: labels of motions.
        inputs: labels of forces or motors.
        freq_hz: frequencies [Hz], increasing; (n_freq,).
        quantity: receptance, mobility or accelerance; None for the usual one of the outputs.
        spin: rates of hinges that turn steadily [rad/s], by name.
        budget: path of a budget.toml whose loops have margins.

    Returns:
        The grid; ``to_control()`` lists the state spaces for a gain schedule.

    Raises:
        InputError: a pose that the machine does not have or cannot rest in.
        UsageError: a label that the machine does not have.
    """
    request = GridRequest(
        tuple(str(label) for label in as_labels(outputs)) if outputs else (),
        tuple(str(label) for label in as_labels(inputs)) if inputs else (),
        check_frequencies(freq_hz),
        None if quantity is None else parse_quantity(quantity),
        None if budget is None else as_path(budget),
    )
    points = [GridPoint(pose, dict(spin or {})) for pose in poses]
    return pose_grid(plant_file(as_path(model)), points, request)
