"""XML files of an MJCF, the main one and those that it names, checked before MuJoCo reads them.

MuJoCo reads any number that the C library reads, such as ``nan(1)`` or ``infinity``, and any bytes
as text. Its own messages about either come late or never, so that both are refused here.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree
from xml.parsers import expat

from identification.words import InputError
from identification.words.file_access import real_path

# Attributes that hold names or text, in which "nan" or "1e400" is no number.
_TEXT_ATTRIBUTE = re.compile(
    r"name|class|childclass|file(right|left|up|down|front|back)?|model|prefix|suffix|content_type|"
    r"(mesh|texture|asset)dir|body[12]?|joint[12]?|jointinparent|(ref|crank|slider|side)?site[12]?|"
    r"geom[12]?|mesh|hfield|material|texture|tendon[12]?|actuator|camera|target|flex|frame|"
    r"objname|refname|plugin|instance|node|data|key|value"
)
_WORD_OF_NO_NUMBER = re.compile(r"(?i)[+-]?(nan(\([^)]*\))?|inf|infinity)")
# Double precision holds 16 digits: beside a larger number the softer springs have none left.
_LARGEST_NUMBER = 1e15
# Coefficients of x^2 and x^3 are larger: a joint that moves by 1e-6 m has k3 x^2 below 1e18.
_LARGEST_COEFFICIENT = 1e30
_POLYNOMIAL_ATTRIBUTES = ("stiffness", "damping")
# MuJoCo refuses elements nested deeper than this, and a body in a body needs but one level.
_MAX_XML_DEPTH = 400
_DECLARED_ENCODING = re.compile(rb"""^\s*<\?xml[^>]*encoding\s*=\s*["']([^"']+)["']""")
_XML_SUFFIXES = (".xml", ".mjcf")  # of attached models; others, such as URDF, are MuJoCo's
# Elements after <replicate> has copied them: machines have hundreds of bodies. MuJoCo's time grows
# with the square: 10,000 bodies with a joint and a geom each, 30,000 elements, took it 45 s.
_MAX_REPLICATED_ELEMENTS = 30_000
# Values that an element makes MuJoCo allocate, by its attributes: 40 MB in single precision.
_MAX_ALLOCATED_VALUES = 10_000_000
_SIZE_ATTRIBUTES = {
    "hfield": ("nrow", "ncol"),
    "texture": ("width", "height"),
    "composite": ("count",),
    "flexcomp": ("count",),
}
_UTF8_NAMES = ("utf-8", "utf8", "us-ascii", "ascii")


@dataclass(frozen=True, eq=False)
class SourceFile:
    """One XML file of an MJCF.

    Args:
        path: of the file.
        model: the main file of its model, from whose folder MuJoCo looks for all that it names.
        root: its top-level element.
    """

    path: Path
    model: Path
    root: ElementTree.Element


def read_source_files(path: Path) -> tuple[SourceFile, ...]:
    """Read an MJCF, the files that it includes, and the models that it attaches.

    Returns:
        The main file first.

    Raises:
        InputError: a file that is missing, is included twice or in a loop, is no UTF-8, is not
            well-formed, declares entities, is nested too deeply, or holds a number that is not
            finite or absurdly large, or makes MuJoCo allocate absurdly much.
    """
    return tuple(_read_model(path, ()))


def is_model(path: Path) -> bool:
    """Return whether a file looks like an MJCF or URDF of its own: it has bodies or includes them.

    One that is cut off counts, since its reader says so.

    Args:
        path: of an XML or URDF file.
    """
    content = path.read_bytes()
    is_mjcf = re.search(rb"<mujoco[\s>]", content) and re.search(rb"<(body|include)[\s>]", content)
    is_urdf = re.search(rb"<robot[\s>]", content) and re.search(rb"<link[\s>]", content)
    is_cut = re.search(rb"<(mujoco|robot)[\s>]", content) and not re.search(
        rb"</(mujoco|robot)\s*>", content
    )
    return bool(is_mjcf or is_urdf or is_cut) or path.suffix.lower() == ".urdf"


def _read_model(path: Path, parents: tuple[Path, ...]) -> list[SourceFile]:
    """Read a model: its file, included files, attached models.

    Args:
        path: the main file of the model.
        parents: main files of the models that attach it, from the outermost.
    """
    chain = (*parents, real_path(path))
    files = [SourceFile(path, path, _parse(path, parents[-1] if parents else None))]
    seen = {real_path(path)}
    for file in files:  # grows while it is walked
        for element in file.root.iter("include"):
            included = _included_file(file, element, seen)
            files.append(SourceFile(included, path, _parse(included, file.path)))
    for file in tuple(files):
        for element in file.root.iter():
            _check_numbers(file.path, element)
            _check_size(file.path, element)
        _check_replication(file.path, file.root)
        for element in file.root.iter("model"):
            attached = path.parent / element.get("file", "")
            if not attached.is_file():
                continue  # MuJoCo says so
            if real_path(attached) in chain:
                raise InputError(
                    f"{file.path}: {element.get('file')} attaches itself: attach other models"
                )
            if attached.suffix.lower() in _XML_SUFFIXES:
                files += _read_model(attached, chain)
    return files


def _included_file(file: SourceFile, element: ElementTree.Element, seen: set[Path]) -> Path:
    """Return the file that an <include> names, and add it to those seen in this model."""
    name = element.get("file")
    if not name:
        raise InputError(f'{file.path}: an <include> names no file: give it file="..."')
    included = file.model.parent / name
    if real_path(included) in seen:
        raise InputError(
            f"{file.path}: {name} is included more than once, or includes itself: include each "
            "file once"
        )
    seen.add(real_path(included))
    return included


def _parse(path: Path, parent: Path | None = None) -> ElementTree.Element:
    """Return the top-level element of an XML file.

    Args:
        parent: the file that includes it, for messages.
    """
    if not path.is_file():
        state = "is a folder" if path.is_dir() else "does not exist"
        if parent is not None:
            raise InputError(
                f"{parent}: the file {path}, which it names, {state}: add it, or correct the name"
            )
        raise InputError(f"{path} {state}: give the path of an MJCF file")
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"{path} cannot be read ({error.strerror}): check its permissions"
        ) from error
    _check_encoding(path, content)
    builder = _Builder(path)
    try:
        return builder.build(content)
    except expat.ExpatError as error:
        raise InputError(
            f"{path}, line {error.lineno}: not well-formed XML ({error}): correct it"
        ) from error


def _check_encoding(path: Path, content: bytes) -> None:
    """Refuse text that MuJoCo, which reads UTF-8 only, would read as something else."""
    advice = "save it as UTF-8"
    try:
        content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise InputError(f"{path}, line {line}: the text is not UTF-8: {advice}") from error
    declared = _DECLARED_ENCODING.match(content.removeprefix(b"\xef\xbb\xbf")[:200])
    name = declared[1].decode("ascii", "replace") if declared else "utf-8"
    if name.lower() not in _UTF8_NAMES and not content.isascii():
        raise InputError(
            f"{path} declares the encoding {name}, but MuJoCo reads UTF-8 only: {advice}"
        )


class _Builder:
    """A tree of elements that declares no entities and is not nested too deeply."""

    def __init__(self, path: Path) -> None:
        """Prepare the parser."""
        self._path, self._depth = path, 0
        self._tree = ElementTree.TreeBuilder()
        self._parser = expat.ParserCreate("utf-8")
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.EntityDeclHandler = self._refuse_entity

    def build(self, content: bytes) -> ElementTree.Element:
        """Return the top-level element."""
        self._parser.Parse(content, True)  # expat takes it by position
        return self._tree.close()

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        if self._depth > _MAX_XML_DEPTH:
            line = self._parser.CurrentLineNumber
            raise InputError(
                f"{self._path}, line {line}: elements are nested more than {_MAX_XML_DEPTH} deep: "
                "write the bodies beside each other"
            )
        self._tree.start(tag, attributes)

    def _end(self, tag: str) -> None:
        self._depth -= 1
        self._tree.end(tag)

    def _refuse_entity(self, name: str, *_: object) -> NoReturn:
        raise InputError(
            f"{self._path}, line {self._parser.CurrentLineNumber}: declares the entity {name!r}, "
            "which MJCF does not have: write its text where it is used"
        )


def _check_numbers(path: Path, element: ElementTree.Element) -> None:
    """Refuse numbers that are not finite, swallow all others, or are missing between the quotes.

    MuJoCo takes an empty attribute for its default, such as no stiffness.
    """
    for attribute, value in element.items():
        if _TEXT_ATTRIBUTE.fullmatch(attribute):
            continue
        if words := value.split():
            advice = f"give finite numbers below {_LARGEST_NUMBER:g}"
        else:
            advice = "give a value, or leave it out"
        is_polynomial = attribute in _POLYNOMIAL_ATTRIBUTES
        is_limit = element.tag == "limit"  # of a URDF, where a huge number means none
        limits = [
            _LARGEST_COEFFICIENT if (is_polynomial and place) or is_limit else _LARGEST_NUMBER
            for place in range(len(words))
        ]
        if not words or not all(map(_is_usable_number, words, limits)):
            name = f" {element.get('name')!r}" if element.get("name") else ""
            raise InputError(
                f"{path}: {element.tag}{name} has {attribute}={_shorten(value)!r}: {advice}"
            )


def _check_size(path: Path, element: ElementTree.Element) -> None:
    """Refuse an element that makes MuJoCo allocate more values than any model needs."""
    attributes = [
        f'{key}="{value}"'
        for key in _SIZE_ATTRIBUTES.get(element.tag, ())
        if (value := element.get(key))
    ]
    words = [word for text in attributes for word in text.split('"')[1].split()]
    count = math.prod(_read_count(word) for word in words)
    if count > _MAX_ALLOCATED_VALUES:
        raise InputError(
            f"{path}: <{element.tag} {_shorten(' '.join(attributes))}> makes {count:.3g} points, "
            f"more than {_MAX_ALLOCATED_VALUES:g}: give fewer"
        )


def _check_replication(path: Path, root: ElementTree.Element) -> None:
    """Refuse <replicate> elements that copy to more elements than any machine has."""
    replicates = list(root.iter("replicate"))
    if not replicates:
        return
    count = _count_elements(root)
    if count > _MAX_REPLICATED_ELEMENTS:
        largest = max(replicates, key=lambda element: _read_count(element.get("count", "1")))
        raise InputError(
            f'{path}: <replicate count="{_shorten(largest.get("count", ""))}"> makes {count:.3g} '
            f"elements of the model, more than {_MAX_REPLICATED_ELEMENTS}: replicate fewer"
        )


def _count_elements(element: ElementTree.Element) -> float:
    """Return the number of elements after replication, with the element itself."""
    copies = _read_count(element.get("count", "1")) if element.tag == "replicate" else 1.0
    return 1.0 + copies * sum(_count_elements(child) for child in element)


def _read_count(word: str) -> float:
    """Return the number of a word, at least 1; 1 for a word that is no number."""
    try:
        return max(float(word), 1.0)
    except ValueError:
        return 1.0


def _is_usable_number(word: str, limit: float) -> bool:
    """Return whether a word is text, or a finite number of at most a limit."""
    if _WORD_OF_NO_NUMBER.fullmatch(word):
        return False
    try:
        number = float.fromhex(word) if "x" in word.lower() else float(word)
    except OverflowError:
        return False
    except ValueError:
        return True  # a keyword; MuJoCo says so if it is none
    return math.isfinite(number) and abs(number) <= limit


def _shorten(text: str) -> str:
    """Return the first words of a long list of numbers."""
    limit = 60
    return text if len(text) <= limit else text[:limit] + " ..."


def named_files(source_files: tuple[SourceFile, ...]) -> tuple[Path, ...]:
    """Return every file that an MJCF reads: itself, included files, models, meshes and pictures.

    Returns:
        Paths of the files that exist, sorted.
    """
    files = {file.path for file in source_files}
    files |= {path for _, _, path in possible_files(source_files)}
    return tuple(sorted({file for file in files if file.is_file()}))


def possible_files(source_files: tuple[SourceFile, ...]) -> Iterator[tuple[str, str, Path]]:
    """Yield where each file that an element names may lie, in an order that the texts decide.

    An element names a file in an attribute ``file`` or ``file<side>``, and ``<compiler>`` names
    folders for meshes and textures. Each name is looked up from each of the folders, with and
    without the path that ``strippath`` drops: a file that MuJoCo reads is among them.

    Yields:
        Tag of the element, the name that it gives, and a path, at which nothing may be.
    """
    names = dict.fromkeys(name for file in source_files for name in _asset_folders(file.root))
    for file in source_files:
        folders = [file.model.parent / name for name in ("", *names)]
        for element in file.root.iter():
            for forms in _file_names(element):
                for folder in folders:
                    yield from ((element.tag, forms[0], folder / form) for form in forms)


def _asset_folders(root: ElementTree.Element) -> Iterator[str]:
    """Yield the folders that the <compiler> elements name."""
    for compiler in root.iter("compiler"):
        for attribute in ("assetdir", "meshdir", "texturedir"):
            if name := compiler.get(attribute):
                yield name


def _file_names(element: ElementTree.Element) -> Iterator[tuple[str, str]]:
    """Yield each file that an element names, with its path and without."""
    for attribute, value in element.items():
        if value and (attribute.startswith("file") or element.get("key") == "file"):
            yield value, Path(value.replace("\\", "/")).name
