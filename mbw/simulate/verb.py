"""``mbw simulate``: a virtual hammer test as a campaign, or the response to a signal."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import typer

from identification.readers.toml_files import load_toml
from identification.words import (
    Dof,
    InputError,
    Quantity,
    UsageError,
    count_noun,
    parse_quantity,
)
from mbmodel import (
    refuse_difference,
    strike,
    write_copy,
)
from mbmodel.simulation.drives import Reading, parse_drive, parse_reading
from mbw.animation.files import check_picture_target
from mbw.any_campaign import find_model
from mbw.files import write_json
from mbw.messages import SCREEN
from mbw.option_texts import parse_spin_rates
from mbw.output_folder import ResultOptions
from mbw.simulate.animation import write_animation
from mbw.simulate.campaign_folder import (
    ANSWER,
    CAMPAIGN,
    MODEL,
    TRUE_MODEL,
    write_campaign,
    write_hits,
)
from mbw.simulate.encoder_readings import read_resolutions, round_readings
from mbw.simulate.hammer_plan import load_nominal, plan_test, refuse_missing_points
from mbw.simulate.joint_laws import SimulatedMachine, open_machine
from mbw.simulate.option_values import TestOptions, refuse_conflicts
from mbw.simulate.page import (
    PAGE,
    PageView,
    hit_views,
    input_unit,
    loop_columns,
    output_unit,
    render,
)
from mbw.simulate.played_signal import (
    PlayOptions,
    find_definition,
    load_signal,
    write_response,
)
from mbw.simulate.summary import (
    SimulationSummary,
    error_rows,
    error_sentences,
    loop_row,
    loop_sentences,
    step_fields,
    step_sentence,
)
from mbw.site_kinds import sensor_sites
from tuning.plant.error_budget.definition import BudgetDefinition
from tuning.plant.error_budget.simulated_budget import (
    SimulatedErrors,
    simulate_budget,
)

_RECORD_FORMATS, _RESPONSE_FORMATS = ("npz", "mat"), ("csv", "npz", "mat")
_RESPONSE_STEM = "response"


def run(  # noqa: PLR0913  # one for each option
    model: Path,
    outputs: ResultOptions,
    *,
    test: TestOptions,
    played: PlayOptions,
    laws: list[str],
    nominal: Path | None,
    file_format: str | None,
    spin: list[str],
    key: str | None,
    seed: int,
    jobs: int | None,
) -> None:
    """Run the verb with the values of its options, as ``mbw.simulate.options`` describes them."""
    refuse_conflicts(test, played, nominal)
    rates = parse_spin_rates(spin)
    mjcf, loops_source, key = find_model(model, key)
    with open_machine(mjcf, laws, rates, key) as simulated:
        for remark in simulated.machine.remarks:
            SCREEN.say(remark)
        if played.is_asked:
            definition = find_definition(simulated.machine, loops_source, played)
            summary = play_signal(
                simulated,
                played,
                definition,
                outputs,
                rates,
                file_format or "csv",
                steps=read_resolutions(loops_source),
                seed=seed,
            )
        else:
            summary = make_test(
                simulated,
                test,
                outputs,
                rates,
                file_format or "npz",
                nominal=nominal,
                seed=seed,
                threads=jobs or os.cpu_count() or 1,
            )
    write_json(summary.model_dump_json(indent=1), outputs.json)


def make_test(
    simulated: SimulatedMachine,
    options: TestOptions,
    outputs: ResultOptions,
    rates: Mapping[str, float],
    file_format: str,
    *,
    nominal: Path | None,
    seed: int,
    threads: int,
) -> SimulationSummary:
    """Make a virtual hammer test and write it as a campaign.

    Args:
        simulated: machine to be hit.
        outputs: where the campaign is written.
        rates: of spinning hinges [rad/s].
        file_format: of the records.
        nominal: MJCF that campaign.toml names; None for the one that the user has named.
        seed: of all random numbers.
        threads: that work at the same time.
    """
    _check_format(file_format, _RECORD_FORMATS)
    machine = simulated.machine
    drawing = load_nominal(simulated, nominal)
    planned = plan_test(machine, options, f".{file_format}")
    plan = planned.plan
    refuse_missing_points(drawing, planned)
    names = [CAMPAIGN, MODEL, TRUE_MODEL, ANSWER, PAGE, *(file.file for file in plan.files)]
    is_live = options.pause_s is not None
    total = sum(file.hits * len(file.references) for file in plan.files)
    with outputs.open("simulate", simulated.source, "simulated", names) as output:
        with SCREEN.progress() as progress:
            task = progress.add_task("hits", total=total)
            test = strike(
                machine,
                plan,
                tolerance=planned.drawn,
                spin=rates,
                seed=seed,
                threads=threads,
                count_hits=lambda count: progress.advance(task, count),
            )
        with output.write() as place:
            write_campaign(place, planned, test, seed, simulated.laws, by_hit=is_live)
            copies = {MODEL: nominal or simulated.source}
            if simulated.laws or nominal is not None:
                copies[TRUE_MODEL] = machine.source
            written = [write_copy(s, place / n, (), output.path) for n, s in copies.items()]
            if outputs.pictures:
                text = render(
                    f"{machine.name}: virtual hammer test",
                    f"{count_noun(total, 'hit')}; the first along each direction is shown",
                    step_sentence(test.step),
                    (*machine.remarks, *test.remarks),
                    hit_views(plan, test),
                )
                (place / PAGE).write_text(text, encoding="utf-8")
            names = sorted(path.name for path in place.iterdir())
        if options.pause_s is not None:
            SCREEN.say(f"hits come into {output.path}, one by one: mbw live {output.path}")
            write_hits(output.path, planned, test, options.pause_s)
    for remark in test.remarks:
        SCREEN.say(remark)
    SCREEN.say(step_sentence(test.step))
    counts = f"{count_noun(total, 'hit')}, {count_noun(len(plan.files), 'file')}"
    SCREEN.say(f"{counts}: campaign in {output.path}")
    for copy in written:
        refuse_difference(copy.file, copy.difference)
    outputs.say_page(output.path / PAGE)
    if outputs.has_tables:
        typer.echo(f"mbw {'live' if is_live else 'identify'} {output.path}")
    return SimulationSummary(
        model=str(simulated.source),
        kind="hammer test",
        **step_fields(test.step),
        files=names,
        hits=total,
        rate=plan.rate_hz,
        duration=plan.block_s,
        seconds=total * plan.block_s,
    )


def play_signal(
    simulated: SimulatedMachine,
    options: PlayOptions,
    definition: BudgetDefinition,
    outputs: ResultOptions,
    rates: Mapping[str, float],
    file_format: str,
    *,
    steps: Mapping[str, float],
    seed: int,
) -> SimulationSummary:
    """Play a signal, with the loops and sources of a definition, and write the response.

    Args:
        simulated: machine to be driven.
        options: of the signal.
        definition: loops that are closed, sources and errors.
        outputs: where the response is written.
        rates: of spinning hinges [rad/s].
        file_format: of the response.
        steps: of encoders, by label.
        seed: of noise.
    """
    _check_format(file_format, _RESPONSE_FORMATS)
    machine = simulated.machine
    if options.animate is not None:
        check_picture_target(options.animate)
    quantity = parse_quantity(options.quantity)
    signal = load_signal(options, seed, definition)
    drives = tuple(parse_drive(machine, label, definition.loops) for label in signal.labels)
    labels = options.outputs or [
        str(Dof.of(site, axis))
        for site in ([] if definition.errors else sensor_sites(machine.layout))
        for axis in range(3)
    ]
    readings = tuple(parse_reading(machine, label) for label in labels)
    if not (readings or definition.errors or definition.loops):
        raise UsageError(f"{machine.source} has no site: name --output, such as body:+tx")
    name = f"{_RESPONSE_STEM}.{file_format}"
    names = [PAGE, *(f"{_RESPONSE_STEM}.{kind}" for kind in _RESPONSE_FORMATS)]
    duration = float(signal.time_s[-1] - signal.time_s[0])

    def respond(readings: Sequence[Reading], quantity: Quantity) -> SimulatedErrors:
        """Return the response of some outputs."""
        return simulate_budget(
            machine,
            definition,
            signal.time_s,
            dict(zip(drives, signal.values.T, strict=True)),
            readings,
            quantity=quantity,
            spin=rates,
            seed=seed,
        )

    with outputs.open("simulate", simulated.source, "simulated", names) as output:
        _refuse_open_loops(output.path, name, [loop.name for loop in definition.loops])
        with SCREEN.status(f"{duration:.3g} s in time"):
            result = respond(readings, quantity)
        response = result.response
        of_readings = [steps.get(str(reading), 0.0) for reading in readings]
        read = round_readings(response.outputs, of_readings, seed)
        inputs = [
            (str(drive), input_unit(machine, drive, definition.loops), signal.values[:, k])
            for k, drive in enumerate(drives)
        ]
        errors = [
            (f"error:{error.name}", error.unit, response.watched[:, k])
            for k, error in enumerate(definition.errors)
            if response.watched is not None
        ]
        motion = [
            (str(reading), output_unit(machine, reading, quantity), read[:, k])
            for k, reading in enumerate(readings)
        ]
        sentences = [
            *error_sentences(result, duration),
            *(f"{label} reads steps of {steps[label]:g}" for label in labels if label in steps),
            *(text for loop in response.loops for text in loop_sentences(loop, options.window)),
        ]
        with output.write() as place:
            names_of_inputs = [label for label, _, _ in inputs]
            further = [
                each for each in loop_columns(response.loops) if each[0] not in names_of_inputs
            ]
            columns = [*inputs, *motion, *errors, *further]
            write_response(place / name, signal.time_s, columns)
            if outputs.pictures:
                text = render(
                    f"{machine.name}: response in time",
                    f"{count_noun(len(inputs), 'input')}, "
                    f"{count_noun(len(errors) + len(motion), 'output')}, "
                    f"{count_noun(len(response.loops), 'closed loop')}",
                    step_sentence(response.step),
                    (*machine.remarks, *response.remarks, *result.remarks),
                    [PageView("", signal.time_s, inputs, [*errors, *motion], loops=response.loops)],
                    sentences,
                )
                (place / PAGE).write_text(text, encoding="utf-8")
    if options.animate is not None:
        places = respond(machine.layout.body_dofs(), "receptance").response
        write_animation(options.animate, machine, signal.time_s, places.outputs)
    for remark in (*response.remarks, *result.remarks):
        SCREEN.say(remark)
    for sentence in sentences:
        (SCREEN.say if outputs.has_json_on_stdout else typer.echo)(sentence)
    SCREEN.say(step_sentence(response.step))
    counts = f"{count_noun(len(columns) - len(inputs), 'channel')}, {len(signal.time_s)} samples"
    SCREEN.say(f"{counts} in {output.path / name}")
    outputs.say_page(output.path / PAGE)
    rate = float((len(signal.time_s) - 1) / duration)
    return SimulationSummary(
        model=str(simulated.source),
        kind="signal",
        **step_fields(response.step),
        files=[name],
        hits=None,
        rate=rate,
        duration=duration,
        seconds=duration,
        errors=error_rows(result),
        loops=[loop_row(loop, options.window) for loop in response.loops],
    )


def _refuse_open_loops(folder: Path, name: str, closed: Sequence[str]) -> None:
    """Refuse to put a response with open loops into the place of a record in closed loops."""
    file = folder / CAMPAIGN
    content: dict[str, Any] = load_toml(file) if file.is_file() else {}
    tests = [content.get("log"), *content.get("test", [])]
    is_open = set(content.get("loop", {})) - set(closed)
    if is_open and any(isinstance(t, dict) and t.get("file") == name for t in tests):
        raise InputError(
            f"{file} reads {name} and closes [loop.*], but this signal is played with "
            f"{', '.join(sorted(is_open))} open: name the campaign and add --closed '*', or name "
            "another folder by --out"
        )


def _check_format(text: str, allowed: tuple[str, ...]) -> None:
    if text not in allowed:
        raise UsageError(f"--format {text!r}: write one of {', '.join(allowed)}")
