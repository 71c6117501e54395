"""Virtual hammer test of a machine in time: raw records of force and motion."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from identification.words import DEFAULT_HAMMER, Dof, Real, Records, Tolerance, UsageError
from mbmodel.machine import Machine
from mbmodel.simulation.drives import wrench_gain
from mbmodel.simulation.integration import InputMeans, TimeStep, integrate
from mbmodel.simulation.joint_reach import JointReach
from mbmodel.simulation.time_model import PROBE_CHANNELS, Probe, TimeModel, build_time_model
from mbmodel.simulation.time_step import Recorder, choose_time_step
from mbmodel.virtual_test.bad_hits import BadHit, draw_bad_hits, spoil_channels, spoil_hits
from mbmodel.virtual_test.hits import Hits, draw_hits
from mbmodel.virtual_test.instruments import (
    NO_ERRORS,
    ForceChannelErrors,
    HammerErrors,
    Instruments,
    draw_instruments,
    hit_wrench,
    sensor_rows,
)
from mbmodel.virtual_test.plan import HammerTestPlan, RecordedFile

_ESTIMATED_S = 0.25  # s after the hit, over which the error of the step is estimated
_MAX_RECORDS_AT_ONCE = 8  # that are integrated side by side


@dataclass(frozen=True, eq=False)
class VirtualTest:
    """Result of a virtual hammer test.

    Args:
        records: of each file, one for each reference.
        instruments: drawn errors of the instruments.
        step: integrator and step, with the estimated error.
        remarks: sentences on stops that the motion reaches, and on laws that it misses.
        bad_hits: of each file and reference, what is wrong with each hit; None for a good one.
    """

    records: Mapping[str, tuple[Records, ...]]
    instruments: Instruments
    step: TimeStep
    remarks: tuple[str, ...] = ()
    bad_hits: Mapping[tuple[str, Dof], tuple[BadHit | None, ...]] = field(default_factory=dict)


def strike(
    machine: Machine,
    plan: HammerTestPlan,
    *,
    tolerance: Tolerance = NO_ERRORS,
    spin: Mapping[str, float] | None = None,
    seed: int = 0,
    threads: int = 1,
    count_hits: Callable[[int], object] = lambda _: None,
) -> VirtualTest:
    """Hit a machine as planned, and record force and accelerations.

    Every hit starts at rest. Its record is one block: the pre-trigger, the pulse, the decay. The
    errors of the instruments are the same in all files.

    Args:
        tolerance: standard deviations of the instruments.
        spin: rates of the hinges that turn steadily [rad/s], by name.
        seed: of all random numbers.
        threads: that work at the same time.
        count_hits: called with the number of hits done since its last call.

    Raises:
        UsageError: a channel or reference that the machine does not have.
        ConvergenceError: the motion grows without bound.
    """
    sites = _sites(machine, plan)
    streams = np.random.SeedSequence(seed).spawn(2 + len(plan.files))
    references = [reference for file in plan.files for reference in file.references]
    instruments = draw_instruments(
        sites,
        references,
        [file.hammer or DEFAULT_HAMMER for file in plan.files],
        tolerance,
        np.random.default_rng(streams[0]),
    )
    layout = machine.layout
    probes = [
        Probe(layout.body_name(site), layout.positions[layout.points.index(site)]) for site in sites
    ]
    model = build_time_model(machine, probes, spin=spin)
    test = _Test(model, plan, instruments, sites, threads, JointReach(model))
    series = [
        _draw_series(plan, file, reference, np.random.default_rng(part))
        for file, stream in zip(plan.files, streams[2:], strict=True)
        for reference, part in zip(file.references, stream.spawn(len(file.references)), strict=True)
    ]
    if not series:
        raise UsageError("the plan has no file: state at least one level")
    step = test.choose_step(max(series, key=lambda hits: hits.hits.peaks.max()))
    records: dict[str, tuple[Records, ...]] = {}
    bad_hits = {}
    for hits in series:
        record, bad = test.record(hits, step, count_hits)
        records[hits.file.file] = (*records.get(hits.file.file, ()), record)
        bad_hits[hits.file.file, hits.reference] = tuple(bad)
    return VirtualTest(records, instruments, step, test.reach.remarks(), bad_hits)


@dataclass(frozen=True, eq=False)
class _Series:
    """Hits along one reference of a file.

    Args:
        file: the file.
        reference: point and direction.
        hits: drawn hits.
        random: source of the noise.
        bad: what is wrong with each hit; None for a good one.
    """

    file: RecordedFile
    reference: Dof
    hits: Hits
    random: np.random.Generator
    bad: Sequence[BadHit | None]


def _draw_series(
    plan: HammerTestPlan, file: RecordedFile, reference: Dof, random: np.random.Generator
) -> _Series:
    """Draw the hits along one reference, with bad ones among them."""
    if not plan.scatter.bad_share:
        hits = draw_hits(plan, file, random)
        return _Series(file, reference, hits, random, [None] * file.hits)
    planned = [dof for each in plan.files for dof in each.references]
    bad = draw_bad_hits(file.hits, plan.scatter.bad_share, reference, planned, random)
    hits = draw_hits(plan, replace(file, hits=len(bad)), random)
    return _Series(file, reference, spoil_hits(hits, bad, random), random, bad)


def _sites(machine: Machine, plan: HammerTestPlan) -> list[str]:
    """Return the sites of all channels; refuse channels that no accelerometer reads."""
    outputs = dict.fromkeys(dof for file in plan.files for dof in file.outputs)
    for dof in outputs:
        if dof.point not in machine.layout.points:
            raise UsageError(
                f"{dof}: an accelerometer needs a site of the model: choose one of "
                f"{', '.join(machine.layout.points)}"
            )
        if dof.is_rotation:
            raise UsageError(f"{dof}: accelerometers read translations: choose tx, ty or tz")
    return list(dict.fromkeys(dof.point for dof in outputs))


@dataclass(frozen=True, eq=False)
class _Test:
    """Machine, plan and instruments of a virtual test.

    Args:
        model: the machine at rest.
        plan: of the test.
        instruments: with their errors.
        sites: of the accelerometers, in the order of the probes.
        threads: that work at the same time.
        reach: takes note of how far the joints move.
    """

    model: TimeModel
    plan: HammerTestPlan
    instruments: Instruments
    sites: list[str]
    threads: int
    reach: JointReach

    def recorder(self, outputs: Sequence[Dof]) -> Recorder:
        """Return what the accelerometers of some channels read."""
        layout = self.model.machine.layout
        readout = np.zeros((len(outputs), PROBE_CHANNELS * len(self.sites)))
        delays = np.zeros(len(outputs))
        for row, dof in enumerate(outputs):
            errors, start = self.instruments.sensors[dof.point], self.sites.index(dof.point)
            rows = sensor_rows(layout, dof.point, errors)
            span = slice(PROBE_CHANNELS * start, PROBE_CHANNELS * (start + 1))
            readout[row, span] = dof.sign * rows[dof.axis]
            delays[row] = errors.delays[dof.axis]
        return Recorder(readout, self.plan.rate_hz, delays)

    def gains(self, struck: Sequence[Dof], hits: Hits) -> Real:
        """Return the control vector per N of each hit; (n_hit, n_control, 1)."""
        steady = HammerErrors(np.zeros(3), np.zeros(3))  # where no hit is planned
        wrenches = [
            dof.sign
            * hit_wrench(
                self.model.machine.layout,
                dof.positive,
                self.instruments.hammers.get(dof.positive, steady),
                turn,
                place,
            )
            for dof, turn, place in zip(struck, hits.turns, hits.places, strict=True)
        ]
        return wrench_gain(self.model, np.stack(wrenches, axis=1)).T[:, :, None]

    def choose_step(self, series: _Series) -> TimeStep:
        """Return integrator and step for the hardest hit of a series."""
        hardest = series.hits.select([int(np.argmax(series.hits.peaks[:, 0]))])
        return choose_time_step(
            self.model,
            self.gains([series.reference], hardest),
            hardest.means,
            self.recorder(series.file.outputs),
            self.plan.pretrigger_s + self.plan.mean_pulse_s + _ESTIMATED_S,
        )

    def record(
        self, series: _Series, step: TimeStep, count_hits: Callable[[int], object]
    ) -> tuple[Records, list[BadHit | None]]:
        """Record all hits along one reference; return them with what is wrong with each."""
        file, reference, random = series.file, series.reference, series.random
        recorder, samples = self.recorder(file.outputs), self.plan.samples
        channel = self.instruments.force_channels[file.hammer or DEFAULT_HAMMER]
        struck = [reference if bad is None else bad.struck for bad in series.bad]
        force, motion = [], []
        for numbers in _batches(len(series.bad), max(self.threads, 1)):
            batch = series.hits.select(numbers)
            means = batch.means(step.step_s)
            count = round((self.plan.block_s + recorder.lead_s) / step.step_s)
            chunks = integrate(
                self.model,
                self.gains([struck[k] for k in numbers], batch),
                means,
                count,
                step,
                threads=self.threads,
                reach=self.reach,
            )
            motion.append(recorder.record(chunks, step.step_s)[:, :, :samples])
            force.append(_record_force(means, count, step, recorder, channel)[:, :samples])
            count_hits(len(numbers))
        noise, rate = self.plan.noise, self.plan.rate_hz
        clean_force, clean_motion = np.concatenate(force), np.concatenate(motion)
        noisy_force = clean_force + _white(noise.force, rate, random, clean_force.shape)
        noisy_motion = clean_motion + _white(noise.motion, rate, random, clean_motion.shape)
        recorded, bad = spoil_channels(noisy_motion, series.bad, random)
        records = Records(
            rate, noisy_force, recorded, file.outputs, reference, "accelerance", test=file.file
        )
        return records, bad


def _record_force(
    means: InputMeans, count: int, step: TimeStep, recorder: Recorder, channel: ForceChannelErrors
) -> Real:
    """Return the force as its channel reads it: f / gain, ahead by the delay; (n_hit, n_sample)."""
    force = Recorder(np.ones((1, 1)), recorder.rate_hz, np.array([-channel.delay]))
    return force.record([means(0, count)], step.step_s)[:, 0] / channel.gain


def _white(
    density: float, rate_hz: float, random: np.random.Generator, shape: tuple[int, ...]
) -> Real:
    """Return white noise of a one-sided density: its variance is density^2 rate / 2."""
    return density * np.sqrt(rate_hz / 2) * random.standard_normal(shape)


def _batches(count: int, threads: int) -> Iterator[range]:
    """Yield the numbers of the hits that are integrated side by side."""
    size = min(count, max(threads, (_MAX_RECORDS_AT_ONCE // threads) * threads))
    for start in range(0, count, size):
        yield range(start, min(start + size, count))
