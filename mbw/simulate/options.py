"""Options of ``mbw simulate``."""

from pathlib import Path
from typing import Annotated

import typer

from mbw.loader import run_verb
from mbw.options import (
    Closed,
    Json,
    Key,
    Overwrite,
    Pictures,
    Quiet,
    Seed,
    SoftEqualities,
    Without,
    out_option,
)


def simulate(  # noqa: PLR0913  # one for each option
    model: Annotated[
        Path, typer.Argument(help="MJCF of a machine, a folder of a tuning, or a campaign.")
    ],
    *,
    hammer: Annotated[
        list[str] | None,
        typer.Option(
            metavar="POINT",
            help="Hammer point: hit11, 11, or one direction, acc11:+tx; repeatable. "
            "Default: all sites hit<node>.",
        ),
    ] = None,
    like: Annotated[
        Path | None,
        typer.Option(
            metavar="CAMPAIGN",
            help="Take hammer points, channels, levels, hits, set-ups, rate and tolerances of "
            "this campaign; --level then replaces each of its levels, in their order.",
        ),
    ] = None,
    levels: Annotated[
        list[float] | None,
        typer.Option(
            "--level",
            metavar="N",
            help="Mean peak force [N]; repeatable, in the order of the tests, and a level may "
            "return. Default: 200.",
        ),
    ] = None,
    hits: Annotated[
        int | None, typer.Option(min=1, max=1000, help="Hits along each direction. Default: 10.")
    ] = None,
    setups: Annotated[
        int | None,
        typer.Option(
            min=1, max=26, help="Roving set-ups that share the accelerometers. Default: 1."
        ),
    ] = None,
    rate_hz: Annotated[
        float | None,
        typer.Option(
            "--rate",
            metavar="HZ",
            help="Samples per second. Default: 512, or more: modes that do not overlap lie below "
            "rate / 2.56.",
        ),
    ] = None,
    block_s: Annotated[
        float | None,
        typer.Option(
            "--block",
            metavar="S",
            help="Length of the record of a hit [s]. Default: 4, less for fast modes.",
        ),
    ] = None,
    pulse_s: Annotated[
        float | None,
        typer.Option(
            "--pulse",
            metavar="S",
            help="Duration of the half-sine pulse [s]. Default: 2.9 over the rate.",
        ),
    ] = None,
    double_share: Annotated[
        float, typer.Option("--double-hits", min=0, max=1, help="Share of the hits that bounce.")
    ] = 0.0,
    bad_share: Annotated[
        float,
        typer.Option(
            "--bad-hits",
            min=0,
            max=0.9,
            help="Share of further hits that are bad in any way; see answer.toml.",
        ),
    ] = 0.0,
    pause_s: Annotated[
        float | None,
        typer.Option(
            "--live",
            min=0,
            metavar="S",
            help="Write each hit as a file of its own, with this pause between hits [s].",
        ),
    ] = None,
    exact: Annotated[
        bool, typer.Option("--exact", help="No noise, no errors of instruments, steady aim.")
    ] = False,
    noise: Annotated[
        float | None,
        typer.Option(
            min=0,
            metavar="DENSITY",
            help="White noise of accelerometers, one-sided [m/s^2/sqrt(Hz)]. Default: 5e-5.",
        ),
    ] = None,
    force_noise: Annotated[
        float | None,
        typer.Option(
            min=0,
            metavar="DENSITY",
            help="White noise of the force channel, one-sided [N/sqrt(Hz)]. Default: 5e-4.",
        ),
    ] = None,
    peak_scatter: Annotated[
        float | None,
        typer.Option(
            min=0,
            max=0.99,
            metavar="SHARE",
            help="Largest relative deviation of a hit's peak force. Default: 0.15.",
        ),
    ] = None,
    pulse_scatter: Annotated[
        float | None,
        typer.Option(
            min=0,
            max=0.99,
            metavar="SHARE",
            help="Largest relative deviation of a pulse's duration. Default: 0.15.",
        ),
    ] = None,
    aim_scatter: Annotated[
        float | None,
        typer.Option(
            min=0,
            max=1,
            metavar="RAD",
            help="Standard deviation of a hit's direction about each axis [rad]. Default: 0.01.",
        ),
    ] = None,
    place_scatter: Annotated[
        float | None,
        typer.Option(
            min=0,
            max=1,
            metavar="M",
            help="Standard deviation of a hit's place along each axis [m]. Default: 0.001.",
        ),
    ] = None,
    laws: Annotated[
        list[str] | None,
        typer.Option(
            "--law",
            metavar="JOINT:EFFECT:NAME=VALUE,...",
            help="Make a joint nonlinear, such as ty_ty:friction:k=2e7,limit=50, "
            "ty_ty:backlash:gap=2e-6 or ty_ty:hardening:k3=1e18; repeatable.",
        ),
    ] = None,
    nominal: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="MJCF that the campaign names instead of the simulated one."
        ),
    ] = None,
    signals: Annotated[
        Path | None,
        typer.Option(
            "--input",
            metavar="FILE",
            help="Play a CSV: a column of time [s], then one for each input's label.",
        ),
    ] = None,
    kind: Annotated[
        str | None,
        typer.Option(
            "--signal",
            metavar="KIND",
            help="Play step, move, chirp, noise or psd at the place --at.",
        ),
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(
            metavar="LABEL",
            help="Input: hit11:+tx, a body, floor:+tx, joint:<name>, a motor, or reference:<loop>.",
        ),
    ] = None,
    amplitude: Annotated[
        float | None,
        typer.Option(
            help="Height of a step or chirp, length of a move, rms of noise [SI unit of the "
            "input]. Default: 1."
        ),
    ] = None,
    duration_s: Annotated[
        float | None,
        typer.Option(
            "--duration",
            metavar="S",
            help="Length of the signal [s]. Default: 2, of a budget alone 10.",
        ),
    ] = None,
    band: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="LOW HIGH", help="Band of chirp and noise [Hz]. Default: 5 to 200."),
    ] = None,
    limits: Annotated[
        str | None,
        typer.Option(
            metavar="V,A,J[,S]",
            help="Largest velocity, acceleration, jerk, and perhaps snap of a move [SI].",
        ),
    ] = None,
    budget: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Close the loops of a budget.toml, play its sources and record its errors.",
        ),
    ] = None,
    closed: Closed = None,
    window: Annotated[
        float | None,
        typer.Option(
            min=0,
            help="Tracking error within which a move has settled [SI]. Default: 2 % of it.",
        ),
    ] = None,
    psd: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Table of frequency [Hz] and one-sided power density of a signal."
        ),
    ] = None,
    outputs: Annotated[
        list[str] | None,
        typer.Option(
            "--output",
            metavar="LABEL",
            help="Channel: acc7:+tx; of a played signal also a body, joint:<name> or a MuJoCo "
            "sensor; repeatable. Default: all accelerometers.",
        ),
    ] = None,
    quantity: Annotated[
        str,
        typer.Option(
            help="Motion of a played signal's outputs: receptance, mobility or accelerance."
        ),
    ] = "accelerance",
    file_format: Annotated[
        str | None,
        typer.Option(
            "--format",
            metavar="KIND",
            help="npz or mat for records; csv, npz or mat for a played signal.",
        ),
    ] = None,
    animate: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the motion as .gif, .webp, .mp4 or .webm."),
    ] = None,
    spin: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=RATE", help="Hinge that spins at this rate [rad/s]; repeatable."
        ),
    ] = None,
    key: Key = None,
    out: Annotated[Path | None, out_option("<model>-simulated beside it")] = None,
    pictures: Pictures = True,
    json: Json = None,
    seed: Seed = 0,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Number of threads. Default: all cores.")
    ] = None,
    without: Without = None,
    soft_equalities: SoftEqualities = False,
    quiet: Quiet = False,
    overwrite: Overwrite = False,
) -> None:
    """Simulate a machine in time: a virtual hammer test as a campaign, or a signal that is played.

    Without --input and --signal it is a hammer test.
    """
    run_verb("mbw.simulate.verb", **locals())
