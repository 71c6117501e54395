"""SI factors of the FRFs of a universal file: from its labels, dataset 164 or campaign.toml.

What campaign.toml states counts first. Else a label ``g`` counts, which dataset 164 cannot express;
else dataset 164; else the labels. A factor that the file does not show plainly gives a remark.
"""

from dataclasses import dataclass, field
from pathlib import Path

from identification.readers.frf_units import parse_frf_units
from identification.readers.uff_datasets import Record
from identification.readers.units import (
    force_label_factor,
    is_gravity_label,
    motion_label_factor,
    quantity_of_unit,
    rotation_label_factor,
    torque_label_factor,
)
from identification.words import Dof, Quantity

_FACTOR_ROUNDING = 1e-6  # relative: factors that differ by less are equal


@dataclass
class UnitConverter:
    """Conversion of the FRFs of one file to SI units, with remarks on what was decided.

    Attributes:
        path: the file.
        unit: unit that campaign.toml states, such as ``g/N``; None if it states none.
        has_units_dataset: whether the file has a dataset 164.
        remarks: sentences on decisions, each once.
    """

    path: Path
    unit: str | None
    has_units_dataset: bool
    remarks: dict[str, None] = field(default_factory=dict)

    def factor(
        self,
        record: Record,
        quantity: Quantity,
        scales: tuple[float, float],
        response: Dof,
        reference: Dof,
    ) -> float:
        """Return the factor that converts one FRF to SI units.

        Args:
            record: content of the dataset 58.
            scales: units of length and force per SI unit, by dataset 164; 1 without it.
            response: response of the FRF.
            reference: reference of the FRF.

        Raises:
            InputError: the stated unit does not belong to the quantity.
        """
        motion_si = self._motion_factor(record, quantity, scales[0], response)
        force_si = self._force_factor(record, scales, reference)
        factor = motion_si / force_si
        if self.unit is None:
            return factor
        units = parse_frf_units(self.path, quantity, self.unit)
        stated = (units.motion_factor(response) or motion_si) / (
            units.drive_factor(reference) or force_si
        )
        if abs(stated / factor - 1.0) > _FACTOR_ROUNDING:
            self._remark_override()
        return stated

    def _motion_factor(
        self, record: Record, quantity: Quantity, length: float, response: Dof
    ) -> float:
        """Return the SI factor of the motion; dataset 164 has no unit of angles but the radian."""
        label = str(record.get("ordinate_axis_units_lab", ""))
        if response.is_rotation:
            angle = rotation_label_factor(label, quantity)
            return self._decide(1.0, angle, label, prefers_label=True)
        return self._decide(
            1.0 / length,
            motion_label_factor(label, quantity),
            label,
            prefers_label=is_gravity_label(label, quantity),
        )

    def _force_factor(self, record: Record, scales: tuple[float, float], reference: Dof) -> float:
        """Return the SI factor of the force or torque that an FRF is per unit of."""
        return self._drive_factor(str(record.get("orddenom_axis_units_lab", "")), scales, reference)

    def _drive_factor(self, label: str, scales: tuple[float, float], reference: Dof) -> float:
        """Return the SI factor of a labelled force or torque."""
        length, force = scales
        if reference.is_rotation:
            return self._decide(1.0 / (force * length), torque_label_factor(label), label)
        return self._decide(1.0 / force, force_label_factor(label), label)

    def channel_factor(
        self, record: Record, quantity: Quantity | None, scales: tuple[float, float], dof: Dof
    ) -> float:
        """Return the factor that converts a time record to SI units.

        Args:
            record, scales: as for ``factor``.
            quantity: quantity of the FRFs of a motion; None for a force.

        Raises:
            InputError: the stated unit does not belong to the quantity.
        """
        if quantity is None:
            label = str(record.get("ordinate_axis_units_lab", ""))
            factor = self._drive_factor(label, scales, dof)
        else:
            factor = self._motion_factor(record, quantity, scales[0], dof)
        if self.unit is None:
            return factor
        kind = quantity or quantity_of_unit(self.unit) or "accelerance"
        units = parse_frf_units(self.path, kind, self.unit)
        stated = units.drive_factor(dof) if quantity is None else units.motion_factor(dof)
        if stated is not None and abs(stated / factor - 1.0) > _FACTOR_ROUNDING:
            self._remark_override()
        return stated or factor

    def _remark_override(self) -> None:
        self.remark(
            f'unit = "{self.unit}" of campaign.toml overrides the units that the file names'
        )

    def _decide(
        self, by_dataset: float, by_label: float | None, label: str, *, prefers_label: bool = False
    ) -> float:
        """Return the SI factor of a motion or force, by its label or by dataset 164."""
        if by_label is None or abs(by_label / by_dataset - 1.0) < _FACTOR_ROUNDING:
            return by_dataset
        if prefers_label or not self.has_units_dataset:
            if self.unit is None:
                self.remark(
                    f"values are labelled {label.strip()} and converted to SI units; state unit "
                    "in [[test]] if the label is wrong"
                )
            return by_label
        if self.unit is None:
            self.remark(
                f"the label {label.strip()} contradicts dataset 164, which counts; state unit in "
                "[[test]] if the label is right"
            )
        return by_dataset

    def remark(self, text: str) -> None:
        """Add a remark on the file, once."""
        self.remarks.setdefault(f"{self.path.name}: {text}")
