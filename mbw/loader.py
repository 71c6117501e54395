"""Loading of a verb's code when it runs, so that help and usage errors load no numpy or MuJoCo."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, fields, is_dataclass
from importlib import import_module
from typing import Any, get_origin

import typer

from mbw.interrupts import raise_on_interrupt
from mbw.memory_limit import describe_memory_limit
from mbw.streams import CANNOT_BE_USED


@dataclass
class Settings:
    """Settings of the whole command.

    Attributes:
        debug: whether errors show a traceback.
    """

    debug: bool = False


SETTINGS = Settings()


def run_verb(  # what all verbs share
    module: str,
    *,
    quiet: bool,
    gallery: str = "campaign",
    without: str | None = None,
    soft_equalities: bool = False,
    **options: object,
) -> None:
    """Run ``run`` of a module; turn its errors into one sentence and an exit code.

    Args:
        module: dotted name of the verb's module.
        quiet: whether only errors are printed.
        gallery: what ``gallery:NAME`` stands for: ``campaign``, ``model`` or ``diagnosed``.
        without: what is left out of the models that the verb reads, as ``--without`` lists it.
        soft_equalities: whether their equality constraints give way as MuJoCo's do.
        options: values of the verb's options by name, as ``fill_arguments`` hands them over.

    Raises:
        typer.Exit: the verb failed, was interrupted or did not converge.
    """
    if sentence := describe_memory_limit():
        typer.echo(f"mbw: {sentence}", err=True)
        raise typer.Exit(CANNOT_BE_USED)
    messages = import_module("mbw.messages")
    messages.SCREEN.quiet, messages.SCREEN.debug = quiet, SETTINGS.debug

    def run() -> None:
        code = import_module(module)
        raise_on_interrupt()
        values, stems = import_module("mbw.gallery").resolve_names(options.values(), gallery)
        arguments = fill_arguments(code.run, dict(zip(options, values, strict=True)))
        if options.get("json") is not None:
            import_module("mbw.files").check_json_target(options["json"])
        if options.get("band") is not None:
            import_module("mbw.any_campaign").check_band(options["band"])
        with ExitStack() as stack:
            if stems:
                stack.enter_context(import_module("mbw.output_folder").results_beside(stems))
            if without is not None or soft_equalities:
                models = import_module("mbmodel")
                kinds_left_out = tuple(filter(None, map(str.strip, (without or "").split(","))))
                reading = models.Reading(kinds_left_out, soft_equalities)
                stack.enter_context(models.read_as(reading))
            code.run(**arguments)

    messages.handle_errors(run)()


def fill_arguments(run: Callable[..., Any], options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of a function from the options of the same names.

    An argument whose type is a dataclass is a record of options: each of its fields is the option
    of the same name. A list that the user does not state is empty.

    Raises:
        TypeError: an option is no argument, and in no record.
    """
    used: set[str] = set()

    def fill(kinds: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values of arguments or fields; those that are no options keep defaults."""
        values: dict[str, Any] = {}
        for name, kind in kinds.items():
            if isinstance(kind, type) and is_dataclass(kind):
                values[name] = kind(**fill({each.name: each.type for each in fields(kind)}))
            elif name in options:
                used.add(name)
                is_list = get_origin(kind) in (list, Sequence)
                values[name] = [] if is_list and options[name] is None else options[name]
        return values

    arguments = fill({n: kind for n, kind in run.__annotations__.items() if n != "return"})
    if unused := options.keys() - used:
        raise TypeError(f"{run.__module__}.{run.__name__} takes no {', '.join(sorted(unused))}")
    return arguments
