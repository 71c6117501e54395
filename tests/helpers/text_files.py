"""LabVIEW measurement files, written as its express block writes them."""

import numpy as np


def labview(  # one argument for each choice of the express block
    sections,
    rate_hz,
    *,
    names=("Force", "Acc 1"),
    units=("N", "g"),
    x_columns="No",
    separator="\t",
    decimal=".",
    dimension="Time",
    start=0.0,
):
    """Return the text of sections (section, channel, sample)."""
    word = {"\t": "Tab", ",": "Comma"}[separator]
    count = len(names)

    def number(value):
        return f"{value:.9E}".replace(".", decimal)

    def line(*cells):
        return separator.join(cells)

    lines = [
        line("LabVIEW Measurement", ""),
        line("Writer_Version", "2"),
        line("Separator", word),
        line("Decimal_Separator", decimal),
        line("Multi_Headings", "Yes"),
        line("X_Columns", x_columns),
        line("Time_Pref", "Absolute"),
        line("***End_of_Header***", ""),
        separator,
    ]
    for section in np.asarray(sections):
        per_channel = [""] if x_columns == "Multi" else []
        x_of = start + np.arange(section.shape[1]) / rate_hz
        spread = [cell for unit in units for cell in (unit, *per_channel)]
        lines += [
            line("Channels", str(count), *[""] * count),
            line("Samples", *[str(section.shape[1])] * count),
            line("Date", *["2020/09/08"] * count),
            line("Y_Unit_Label", *spread),
            line("X_Dimension", *[dimension, *per_channel] * count),
            line("X0", *[number(start), *per_channel] * count),
            line("Delta_X", *[number(1 / rate_hz), *per_channel] * count),
            line("***End_of_Header***", *[""] * count),
        ]
        if x_columns == "Multi":
            lines.append(line(*[cell for name in names for cell in ("X_Value", name)], "Comment"))
        else:
            lines.append(line("X_Value", *names, "Comment"))
        for x, values in zip(x_of, section.T, strict=True):
            cells = [number(value) for value in values]
            if x_columns == "Multi":
                cells = [cell for value in cells for cell in (number(x), value)]
            else:
                cells = [number(x) if x_columns == "One" else "", *cells]
            lines.append(line(*cells))
        lines.append("")
    return "\n".join(lines)
