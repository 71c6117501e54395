"""Loading of a verb's code when it runs, so that help and usage errors load no numpy or MuJoCo."""

from contextlib import ExitStack
from dataclasses import dataclass
from importlib import import_module
from typing import get_origin

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
    *arguments: object,
    quiet: bool,
    gallery: str = "campaign",
    without: str | None = None,
    soft_equalities: bool = False,
    **options: object,
) -> None:
    """Run ``run_options`` of a module; turn its errors into one sentence and an exit code.

    Args:
        module: dotted name of the verb's module.
        arguments: positional arguments of ``run_options``.
        quiet: whether only errors are printed.
        gallery: what ``gallery:NAME`` stands for: ``campaign``, ``model`` or ``diagnosed``.
        without: what is left out of the models that the verb reads, as ``--without`` lists it.
        soft_equalities: whether their equality constraints give way as MuJoCo's do.
        options: values of the verb's options; None becomes [] where ``run_options`` takes a list.

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
        kinds = code.run_options.__annotations__
        lists = {name for name in options if get_origin(kinds[name]) is list}
        stated = options | {name: [] for name in lists if options[name] is None}
        words = [*arguments, *stated.values()]
        values, stems = import_module("mbw.gallery").resolve_names(words, gallery)
        n = len(arguments)
        with ExitStack() as stack:
            if stems:
                stack.enter_context(import_module("mbw.output_folder").results_beside(stems))
            if without is not None or soft_equalities:
                models = import_module("mbmodel")
                kinds_left_out = tuple(filter(None, map(str.strip, (without or "").split(","))))
                reading = models.Reading(kinds_left_out, soft_equalities)
                stack.enter_context(models.read_as(reading))
            code.run_options(*values[:n], **dict(zip(stated, values[n:], strict=True)))

    messages.handle_errors(run)()
