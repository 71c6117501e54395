"""Equations of the built pages as MathML: browsers need no script for it.

Browsers ignore the attribute ``mathvariant`` on single letters, so that letters of another alphabet
are written as the characters that Unicode has for them.
"""

import html
import re
import unicodedata

from latex2mathml.converter import convert

EQUATION = re.compile(
    r'<(?P<tag>span|div) class="arithmatex">\\[(\[](?P<latex>.*?)\\[)\]]</(?P=tag)>', re.DOTALL
)
# Name of each alphabet in the names of Unicode's mathematical characters.
ALPHABETS = {
    "bold": "BOLD",
    "bold-italic": "BOLD ITALIC",
    "sans-serif": "SANS-SERIF",
    "script": "SCRIPT",
    "fraktur": "FRAKTUR",
    "double-struck": "DOUBLE-STRUCK",
    "monospace": "MONOSPACE",
}
VARIANT = re.compile(r'<m([in]) mathvariant="([a-z-]+)">(&#x[0-9A-F]+;|.)</m\1>')
BAR = re.compile(r'<mo(?: fence="false")?(?: stretchy="false")?>(&#x0007C;|&#x02016;)</mo>')
ACCENT = re.compile(r"<mover>(?=(?:<mi[^>]*>[^<]*</mi>|<mrow><mi[^>]*>[^<]*</mi></mrow>)<mo)")


def replace_equations(content: str) -> str:
    """Return the HTML of a page with every equation as MathML.

    Raises:
        ValueError: a command that the converter does not know.
    """

    def replacement(match: re.Match[str]) -> str:
        latex = html.unescape(match["latex"]).strip()
        try:
            return mathml(latex, "block" if match["tag"] == "div" else "inline")
        except ValueError as error:
            raise ValueError(f"{error} in {latex}") from error

    return EQUATION.sub(replacement, content)


def mathml(latex: str, display: str) -> str:
    r"""Return LaTeX as MathML.

    Args:
        latex: without its dollars.
        display: ``block`` or ``inline``.

    Raises:
        ValueError: a command that the converter does not know.
    """
    latex = re.sub(r"\\mathrm\s*(?:\{(\w+)\}|(\w))", r"\\text{\1\2}", latex)  # upright
    markup = convert(re.sub(r"\{aligned\}", "{align*}", latex), display=display)
    unknown = re.search(r">(\\[A-Za-z]+|&)<", markup)
    if unknown:
        raise ValueError(f"unknown LaTeX {unknown[1]}")
    markup = VARIANT.sub(_letter, markup)
    markup = BAR.sub(r'<mo stretchy="false" lspace="0" rspace="0">\1</mo>', markup)
    return ACCENT.sub('<mover accent="true">', markup)


def _letter(match: re.Match[str]) -> str:
    """Return an element whose letter is the one of its alphabet."""
    tag, variant, text = match.groups()
    letter = html.unescape(text)
    name = re.sub("LATIN |GREEK | LETTER", "", unicodedata.name(letter, ""))
    for prefix in ("MATHEMATICAL ", ""):  # some letters, such as that of real numbers, are older
        try:
            letter = unicodedata.lookup(f"{prefix}{ALPHABETS[variant]} {name}")
            break
        except KeyError:
            continue
    return f"<m{tag}>&#x{ord(letter):X};</m{tag}>"
