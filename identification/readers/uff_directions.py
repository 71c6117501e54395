"""Directions of the records of universal files, where campaign.toml may name those of scalars.

A record of direction 0 is a scalar: it names a node and no axis. Then ``channels`` and
``references`` of the ``[[test]]`` say the direction at each node.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from identification.readers.channel_labels import parse_channels
from identification.readers.uff_datasets import Record
from identification.words import Dof, InputError, Port

_KEY_OF_END = {"response": "channels", "reference": "references"}
_FIELD_OF_END = {"response": "rsp", "reference": "ref"}


@dataclass
class StatedDirections:
    """Degrees of freedom that campaign.toml states for a universal file.

    Attributes:
        path: the file.
        dofs: by ``response`` and ``reference``; absent if the key is.
        used: those of the two that a scalar record needed.
    """

    path: Path
    dofs: dict[str, tuple[Port, ...]] = field(default_factory=dict)
    used: set[str] = field(default_factory=set)

    @classmethod
    def parse(
        cls, path: Path, channels: str | list[str] | None, references: list[str] | None
    ) -> Self:
        """Parse the two keys of a ``[[test]]``.

        Raises:
            InputError: a key is malformed.
        """
        dofs = {} if channels is None else {"response": parse_channels(path, channels)}
        if references is not None:
            dofs["reference"] = parse_channels(path, references, "references")
        return cls(path, dofs)

    def response_and_reference(self, number: int, record: Record) -> tuple[Dof, Dof]:
        """Return response and reference of a dataset 58, with points named by node number.

        Raises:
            InputError: a direction is none of +-1..6, or 0 and not stated.
        """
        return self.read_dof(number, record, "response"), self.read_dof(number, record, "reference")

    def read_dof(self, number: int, record: Record, end: str, *, stated: str | None = None) -> Dof:
        """Return one degree of freedom of a dataset 58.

        Args:
            number: of the record.
            end: ``response`` or ``reference``.
            stated: the same, if another key than that of the end states its direction.

        Raises:
            InputError: the direction is none of +-1..6, or 0 and not stated.
        """
        node = str(int(record[f"{_FIELD_OF_END[end]}_node"]))
        direction = int(record[f"{_FIELD_OF_END[end]}_dir"])
        if 1 <= abs(direction) <= 6:
            return Dof.of(node, abs(direction) - 1, direction)
        name, key = f"{self.path}, record {number}", stated or end
        if direction:
            raise InputError(
                f"{name}: {end} direction {direction} is none of +-1..6: give the channel a "
                "direction"
            )
        stated_dofs = [dof for dof in self.dofs.get(key, ()) if isinstance(dof, Dof)]
        dofs = [dof for dof in stated_dofs if dof.point == node]
        if len(dofs) != 1:
            count = "no direction" if not dofs else f"{len(dofs)} directions"
            example = f'["{node}:+z"]' + (f' or "nodes {node}, z"' if key == "response" else "")
            raise InputError(
                f"{name}: {end} direction 0 (scalar) leaves the direction at node {node} open, and "
                f"its [[test]] states {count} there: state one for each such node, as in "
                f"{_KEY_OF_END[key]} = {example}"
            )
        self.used.add(key)
        return dofs[0]

    def refuse_unused(self) -> None:
        """Refuse keys that the file itself answers.

        Raises:
            InputError: a key is stated, and no record needs it.
        """
        for end in self.dofs:
            if end not in self.used:
                key = _KEY_OF_END[end]
                raise InputError(
                    f"{self.path} itself holds its {key}: remove {key} from its [[test]]"
                )
