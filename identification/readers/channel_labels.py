"""Channels and references that campaign.toml names: labels, or a range of nodes."""

import re
from collections import Counter
from pathlib import Path

from identification.words import (
    Dof,
    Input,
    InputError,
    Output,
    Port,
    UsageError,
    parse_port,
    shorten_names,
)

_NODE_RANGE = re.compile(r"(?P<first>[0-9]{1,18})(\.\.(?P<last>[0-9]{1,18}))?")
_MAX_CHANNELS = 100_000  # of a campaign: a range beyond it is a slip of the pen
_MAX_QUOTED_LETTERS = 40  # of a wrong text in a message


def parse_channels(
    path: Path, channels: str | list[str], key: str = "channels"
) -> tuple[Output, ...]:
    """Return the channels of ``"nodes 1..4 7, xyz"`` (node by node), or of a list.

    An item of a list is a label, the name of a signal, or such a range.

    Raises:
        InputError: the text is neither, there is no channel, or a channel appears twice.
    """
    dofs: tuple[Output, ...]
    if isinstance(channels, str):
        dofs = _expand_range(path, channels, key)
    else:
        dofs = tuple(dof for text in channels for dof in _parse_item(path, text, key))
    return _refuse_duplicates(path, key, dofs)


def _refuse_duplicates(path: Path, key: str, dofs: tuple[Port, ...]) -> tuple[Port, ...]:
    """Return the degrees of freedom unless there is none or one appears twice."""
    if not dofs:
        raise InputError(f"{path}: {key} are empty: name those of the file")
    counts = Counter(dof.positive for dof in dofs)
    repeated = [str(dof) for dof, count in counts.items() if count > 1]
    if repeated:
        named = shorten_names(repeated)
        raise InputError(f"{path}: {key} name {named} twice: correct the labels")
    return dofs


def parse_references(path: Path, references: list[str]) -> tuple[Input, ...]:
    """Return the references of a list of labels, names of motors and ranges of nodes.

    Raises:
        InputError: a label is malformed, there is no reference, or one appears twice.
    """
    inputs = tuple(dof for text in references for dof in _parse_item(path, text, "references"))
    return _refuse_duplicates(path, "references", inputs)


def is_range(text: str) -> bool:
    """Return whether an item of a list is a range of nodes such as ``"nodes 1..15, xyz"``."""
    first, *more = text.replace(",", " ").split() or [""]
    return first == "nodes" and bool(more)


def _parse_item(path: Path, text: str, key: str) -> tuple[Port, ...]:
    """Return the port of a label or name, or those of a range."""
    return _expand_range(path, text, key) if is_range(text) else (_parse(path, text),)


def _expand_range(path: Path, text: str, key: str) -> tuple[Dof, ...]:
    """Return the channels of ``"nodes 1..4 7, xyz"``, node by node."""
    first, *items = text.replace(",", " ").split() or [""]
    axes = items.pop() if items else ""
    if first != "nodes" or not items or not set(axes) <= set("xyz"):
        raise InputError(
            f'{path}: {key} = "{text[:_MAX_QUOTED_LETTERS]}" is not a range of channels: write '
            '"nodes 1..23, xyz" or a list of labels'
        )
    ranges = [_node_range(path, item, key) for item in items]
    count = len(axes) * sum(map(len, ranges))
    if count > _MAX_CHANNELS:
        raise InputError(
            f"{path}: {key} name {count} degrees of freedom, more than {_MAX_CHANNELS}: correct "
            "the range of nodes"
        )
    return tuple(Dof(str(node), f"+t{axis}") for nodes in ranges for node in nodes for axis in axes)


def _node_range(path: Path, text: str, key: str) -> range:
    """Return the nodes of ``7`` or ``1..23``."""
    match = _NODE_RANGE.fullmatch(text)
    if match is None:
        raise InputError(
            f"{path}: {key} name {text[:_MAX_QUOTED_LETTERS]!r}, which is not a range of nodes: "
            "write 1..23"
        )
    nodes = range(int(match["first"]), int(match["last"] or match["first"]) + 1)
    if not nodes:
        raise InputError(f"{path}: {key} name the empty range {text!r}: write the lower node first")
    return nodes


def _parse(path: Path, text: str) -> Port:
    """Parse a label, or the name of a signal, which is no number; failures name the file."""
    name = text.strip()
    try:
        if name.isdecimal() or not name:
            raise UsageError(
                f"{text!r} is not a label: write <point>:<sign><direction>, such as acc11:+tx"
            )
        return parse_port(name)
    except UsageError as error:
        raise InputError(f"{path}: {error}") from error
