"""A model written as MJCF, read back and compared with the machine in memory."""

from dataclasses import replace
from pathlib import Path

from identification.words import Real
from identification.words.file_access import temporary_folder
from mbmodel.machine import Machine
from mbmodel.machine_loading import load_machine
from mbmodel.mjcf.difference import Difference
from mbmodel.mjcf.edit import NotInMjcf, write_mjcf
from mbmodel.mjcf.read import compile_with_remarks
from mbmodel.mjcf.written_file import WrittenModel, compare_with, in_place, write_and_compare
from mbmodel.model import Model
from mbmodel.writing.model_edits import held_parameters, model_edits, split_edits
from mbmodel.writing.read_back import compare_machines, compare_masses


def write_model(
    model: Model, theta: Real, target: Path, folder: Path | None = None
) -> WrittenModel:
    """Write a model at theta into a copy of its MJCF, read it back and compare.

    Laws of nonlinear joints act in tests alone. They are written last, and then every other value
    of the file must stay.

    Args:
        model: machine and Parts.
        theta: parameters in SI; (n_parameter,).
        target: the new file; its folder exists.
        folder: folder to which the new file will move, which exists; None if it stays.

    Raises:
        InputError: the source cannot be read any more.
    """
    not_held = tuple(edit for edit in model_edits(model, theta) if isinstance(edit, NotInMjcf))
    changes, laws = split_edits(model, theta)
    nominal, held = _following(model), held_parameters(model, theta)

    def compare(path: Path) -> Difference | None:
        written = load_machine(path, key=model.machine.keyframe)
        return compare_machines(nominal, held, written) or compare_masses(path)

    source = model.machine.source
    difference = write_and_compare(source, target, changes, folder, compare)
    if laws and difference is None:
        with in_place(target, folder) as path:
            linear, _ = compile_with_remarks(path)
        difference = write_and_compare(
            source, target, [*changes, *laws], folder, compare_with(linear, laws)
        )
    return WrittenModel(target.name, not_held, "" if difference is None else str(difference))


def read_as_written(model: Model, theta: Real) -> Machine:
    """Return the machine that an MJCF of a model at theta describes, by way of a temporary file.

    The file is in expanded form, so that two machines differ by their parameters alone.

    Args:
        model: machine and Parts; laws that act in tests alone are left out.
        theta: parameters in SI; (n_parameter,).

    Raises:
        InputError: the source cannot be read any more.
    """
    changes, _ = split_edits(model, theta)
    with temporary_folder() as folder:
        write_mjcf(model.machine.source, folder / "machine.xml", changes, expanded=True)
        return load_machine(folder / "machine.xml", key=model.machine.keyframe)


def _following(model: Model) -> Model:
    """Return a model whose equilibrium follows its parameters as that of the file does."""
    machine = model.machine
    if machine.statics is not None or machine.spinning:
        return model
    nominal = load_machine(machine.source, key=machine.keyframe, follow=True)
    return replace(model, machine=replace(machine, statics=nominal.statics))
