"""Plan of a virtual hammer test from the options, or from a campaign that it shall be like."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification.words import (
    Dof,
    InputError,
    Real,
    Signal,
    Tolerance,
    UsageError,
    count_noun,
    shorten_names,
)
from mbmodel import (
    HammerTestPlan,
    HitScatter,
    Machine,
    Noise,
    RecordedFile,
    as_drawn,
    load_machine,
    model_modes,
)
from mbmodel.modes.modal_overlap import highest_separate_mode
from mbmodel.virtual_test.instruments import NO_ERRORS
from mbmodel.virtual_test.plan import BAND_SHARE
from mbw.simulate.imitated_test import DEFAULT_HITS, DEFAULT_LEVEL_N, imitate_campaign
from mbw.simulate.joint_laws import SimulatedMachine
from mbw.simulate.option_values import TestOptions
from mbw.site_kinds import hammer_sites, sensor_sites

_RECORDER_RATE_HZ = 512.0
_BAND_OVER_MODES = 1.2  # upper limit of the default band over the highest mode that counts
# Longest record by default: slow modes need time, fast ones many samples.
_MAX_RECORD_S, _MAX_RECORD_PERIODS = 4.0, 800
_MIN_RECORD_SAMPLES, _MAX_RECORD_SAMPLES = 2048, 16384


@dataclass(frozen=True)
class PlannedTest:
    """Plan of a test and the tolerances of its instruments.

    Args:
        plan: files, recorder, scatter and noise.
        drawn: tolerances within which errors are drawn.
        stated: tolerances that campaign.toml states.
    """

    plan: HammerTestPlan
    drawn: Tolerance
    stated: Tolerance


def plan_test(machine: Machine, options: TestOptions, suffix: str) -> PlannedTest:
    """Plan a virtual hammer test.

    Args:
        machine: with its sensors and hammer points.
        suffix: of the files, such as ``.npz``.

    Raises:
        UsageError: an option does not fit the machine.
        InputError: the campaign to be imitated cannot be read, or motors drive it.
    """
    for name, value in (
        ("--rate", options.rate_hz),
        ("--block", options.block_s),
        ("--pulse", options.pulse_s),
    ):
        if value is not None and value <= 0:
            raise UsageError(f"{name} {value:g}: give a number above 0, or leave it out")
    if options.like is None:
        files = _files(machine, options, suffix)
        rate = options.rate_hz or _default_rate(machine)
        block, stated = options.block_s or _default_block(machine, rate), Tolerance()
    else:
        imitated = imitate_campaign(options, options.like, suffix)
        files, stated = imitated.files, imitated.tolerance
        rate = options.rate_hz or imitated.rate_hz
        block = options.block_s or imitated.block_s
    if options.rate_hz is not None:
        _refuse_empty_band(machine, rate)
    scatter, noise, drawn = _scatter(options), _noise(options), stated
    if options.exact:
        scatter = replace(scatter, angle=0.0, place=0.0)
        noise, drawn = Noise(0.0, 0.0), NO_ERRORS
        machine_tolerances = ("mass", "inertia", "com", "joint_position")
        stated = replace(NO_ERRORS, **{name: getattr(stated, name) for name in machine_tolerances})
    plan = HammerTestPlan(files, rate, block, options.pulse_s or 0.0, scatter, noise)
    return PlannedTest(plan, drawn, stated)


def _scatter(options: TestOptions) -> HitScatter:
    """Return the scatter of the hits: that of the options, else the default of each quantity."""
    stated = {
        "peak": options.peak_scatter,
        "width": options.pulse_scatter,
        "angle": options.aim_scatter,
        "place": options.place_scatter,
    }
    given = {name: value for name, value in stated.items() if value is not None}
    return HitScatter(**given, double_share=options.double_share, bad_share=options.bad_share)


def _noise(options: TestOptions) -> Noise:
    """Return the noise of the channels: that of the options, else the default of each channel."""
    stated = {"motion": options.noise, "force": options.force_noise}
    return Noise(**{name: value for name, value in stated.items() if value is not None})


def _files(machine: Machine, options: TestOptions, suffix: str) -> tuple[RecordedFile, ...]:
    """Return a file for each visit to a level and each set-up, in the order of the levels."""
    references = _references(machine, options.hammer)
    outputs = tuple(_parse_channel(machine, text) for text in options.outputs) or tuple(
        Dof.of(site, axis) for site in sensor_sites(machine.layout) for axis in range(3)
    )
    sites = list(dict.fromkeys(dof.point for dof in outputs))
    setups = options.setups or 1
    if setups > len(sites):
        raise UsageError(
            f"--setups {setups}: the test has {count_noun(len(sites), 'accelerometer')}: give at "
            "most as many set-ups"
        )
    files = []
    levels = options.levels or (DEFAULT_LEVEL_N,)
    for visit, level in zip(_name_visits(levels), levels, strict=True):
        for number, group in enumerate(np.array_split(np.arange(len(sites)), setups)):
            setup = chr(ord("a") + number) if setups > 1 else None
            chosen = {sites[k] for k in group}
            files.append(
                RecordedFile(
                    file=f"hits_{visit}{f'_{setup}' if setup else ''}{suffix}",
                    level_n=level,
                    outputs=tuple(dof for dof in outputs if dof.point in chosen),
                    references=references,
                    hits=options.hits or DEFAULT_HITS,
                    setup=setup,
                )
            )
    return tuple(files)


def _parse_channel(machine: Machine, text: str) -> Dof:
    """Return the accelerometer and direction that a text names; refuse other outputs."""
    port = machine.layout.parse(text)
    if isinstance(port, Signal):
        example = next(iter(sensor_sites(machine.layout)), "acc1")
        raise UsageError(
            f"--output {text}: a hammer test records accelerometers, each by site and direction, "
            f"such as {example}:+tx; encoders, joints and MuJoCo sensors are outputs of a played "
            "signal (--signal or --input)"
        )
    return port


def _name_visits(levels: Sequence[float]) -> list[str]:
    """Return a name for each visit to a level, such as ``40N`` and ``40N_visit2``."""
    names = [f"{level:g}N" for level in levels]
    visits = [names[: k + 1].count(name) for k, name in enumerate(names)]
    return [
        name if visit == 1 else f"{name}_visit{visit}"
        for name, visit in zip(names, visits, strict=True)
    ]


def _references(machine: Machine, texts: Sequence[str]) -> tuple[Dof, ...]:
    """Return the directions of the hammer; three for a point without a direction."""
    layout = machine.layout
    references: list[Dof] = []
    for text in texts or hammer_sites(layout):
        is_directed = ":" in text and text not in layout.points
        point, direction = text.rsplit(":", 1) if is_directed else (text, "")
        if point.isdecimal():
            site = layout.hammer_at_node(int(point))
            if site is None:
                raise UsageError(f"--hammer {text}: no site of {machine.source} ends in {point}")
            point = site
        layout.body_name(point)  # refuses an unknown point
        references += (
            [Dof.parse(f"{point}:{direction}")]
            if is_directed
            else [Dof.of(point, axis) for axis in range(3)]
        )
    if not references:
        raise UsageError(
            f"{machine.source} has no hammer point hit<node>: name one by --hammer, such as "
            f"{next(iter(layout.points), 'a site')}"
        )
    return tuple(dict.fromkeys(references))


def _find_natural_frequencies(machine: Machine) -> Real:
    """Return the natural frequencies above zero, the lowest first [Hz]; (n_mode,)."""
    model = as_drawn(machine)
    modes = model_modes(model, model.drawn)
    natural: Real = np.sort(modes.freq_hz[modes.oscillates])
    return natural


def _refuse_empty_band(machine: Machine, rate_hz: float) -> None:
    """Refuse a rate whose band holds no mode: its hits would be long, and show nothing."""
    natural = _find_natural_frequencies(machine)
    if natural.size and natural[0] > BAND_SHARE * rate_hz:
        raise UsageError(
            f"--rate {rate_hz:g}: records show frequencies up to {BAND_SHARE * rate_hz:.3g} Hz, "
            f"and the lowest mode of {machine.source} lies at {natural[0]:.3g} Hz: give more than "
            f"{natural[0] / BAND_SHARE:.3g}, or leave --rate out"
        )


def _default_rate(machine: Machine) -> float:
    """Return 512 Hz, or more for a band that holds all modes that a test can tell apart [Hz]."""
    model = as_drawn(machine)
    modes = model_modes(model, model.drawn)
    natural, damping = (array[modes.oscillates] for array in (modes.freq_hz, modes.damping))
    top = _BAND_OVER_MODES * highest_separate_mode(natural, damping)
    return max(_RECORDER_RATE_HZ, float(np.ceil(top / BAND_SHARE)))


def _default_block(machine: Machine, rate_hz: float) -> float:
    """Return the length of a record [s]: 4 s, less for fast modes, of a power of two samples.

    It has 2048 to 16384 samples at any rate.
    """
    natural = _find_natural_frequencies(machine)
    periods = _MAX_RECORD_PERIODS / natural[0] if natural.size else np.inf
    samples = rate_hz * min(_MAX_RECORD_S, periods)
    limited = np.clip(samples, _MIN_RECORD_SAMPLES, _MAX_RECORD_SAMPLES)
    return float(2.0 ** round(np.log2(limited)) / rate_hz)


def load_nominal(simulated: SimulatedMachine, nominal: Path | None) -> Machine:
    """Return the model that the campaign names; refuse one that other verbs could not read."""
    try:
        return load_machine(nominal or simulated.source, key=simulated.machine.keyframe)
    except InputError as error:
        if nominal is not None:
            raise
        raise InputError(
            f"{error}, or name a nominal model without it by --nominal, which the campaign then "
            "states"
        ) from error


def refuse_missing_points(nominal: Machine, planned: PlannedTest) -> None:
    """Refuse a nominal model without the points of a test: its campaign could not be read."""
    names = (*nominal.layout.points, *nominal.layout.bodies)
    dofs = [dof for file in planned.plan.files for dof in (*file.outputs, *file.references)]
    missing = list(dict.fromkeys(dof.point for dof in dofs if dof.point not in names))
    if missing:
        raise InputError(
            f"--nominal {nominal.source} has no {shorten_names(missing)}, where the test measures "
            "or hits: add sites of these names to it, or test fewer points"
        )
