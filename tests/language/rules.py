"""Rules of the project's language, checked in the syntax trees of the source.

Each rule yields violations; ``tests/language/exceptions.toml`` lists those that stay, with reasons.
``python -m tests.language PACKAGE ...`` prints what a package still breaks.
"""

import ast
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = (
    "identification",
    "mbmodel",
    "tuning",
    "diagnosis",
    "mbw",
    "mbworkbench",
    "truth",
    "gapbench",
)
PRONOUNS = {"one", "own", "found", "made", "told", "other", "others", "ours", "theirs", "mine"}
IRREGULAR = {
    *("begun", "bent", "bound", "built", "cut", "drawn", "dealt", "foreseen", "foretold", "found"),
    *("given", "held", "hit", "hung", "kept", "known", "laid", "left", "made", "met", "put"),
    *("read_out", "seen", "set", "shown", "split", "spoken", "spun", "stuck", "struck", "swung"),
    *("taken", "told", "thought", "torn", "won", "written", "chosen", "sought", "lost"),
}
VERBS_IN_ED = {"need", "feed", "embed", "proceed", "seed", "speed", "exceed"}
FORBIDDEN_FILES = {
    *("known", "nothing", "gathered", "spoken", "looks", "question", "wishes", "views", "rest"),
    *("still", "crossed", "foreseen", "stated", "lead"),
}
LONGEST_SENTENCE = 35
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
DEFINITIONS = (*FUNCTIONS, ast.ClassDef)


@dataclass(frozen=True)
class Violation:
    """One place that breaks a rule.

    Attributes:
        rule: name of the rule.
        path: file, relative to the root.
        name: name that breaks it.
    """

    rule: str
    path: str
    name: str

    def __str__(self) -> str:
        return f"{self.rule}: {self.path}: {self.name}"


@cache
def check_package(package: str) -> list[Violation]:
    """Return what the files of one package break by themselves."""
    violations: list[Violation] = []
    for path, tree in parse_package(package).items():
        violations += check_tree(str(path.relative_to(ROOT)), tree)
    return violations


def parse_package(package: str) -> Mapping[Path, ast.Module]:
    """Return the syntax tree of every file of a package."""
    files = sorted(file for file in (ROOT / package).rglob("*.py") if not file.is_symlink())
    return {path: ast.parse(path.read_text(encoding="utf-8")) for path in files}


def check_tree(path: str, tree: ast.Module) -> list[Violation]:
    """Return what one file breaks by itself: its name, variables, functions and docstrings."""
    violations = []
    if Path(path).stem in FORBIDDEN_FILES:
        violations.append(Violation("file name", path, Path(path).stem))
    names = {name for node in ast.walk(tree) for name in _bound_names(node)}
    names |= {node.name for node in ast.walk(tree) if isinstance(node, DEFINITIONS)}
    pronouns = sorted(name for name in names if name.lstrip("_") in PRONOUNS)
    violations += [Violation("pronoun", path, name) for name in pronouns]
    for node in ast.walk(tree):
        if isinstance(node, FUNCTIONS) and is_participle(node.name) and not _is_value(node):
            violations.append(Violation("participle", path, node.name))
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Lambda):
            lambdas = [name for name in _bound_names(node) if is_participle(name)]
            violations += [Violation("participle", path, name) for name in lambdas]
        if isinstance(node, (*DEFINITIONS, ast.Module)):
            text = ast.get_docstring(node) or ""
            if re.match(r"(the same|likewise|as before)\b", text, re.IGNORECASE):
                name = getattr(node, "name", "module")
                violations.append(Violation("docstring", path, name))
    return violations


def check_together(trees: Mapping[Path, ast.Module]) -> list[Violation]:
    """Return what files of all packages break together: constants and classes of one name."""
    constants, classes = defaultdict(set), defaultdict(set)
    for path, tree in trees.items():
        where = str(path.relative_to(ROOT))
        for node in (*tree.body, *_conditional_body(tree)):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                classes[node.name].add(where)
            if isinstance(node, ast.Assign | ast.AnnAssign):
                for name in _bound_names(node):
                    if re.fullmatch(r"_[A-Z][A-Z0-9_]*", name):
                        constants[name].add(where)
    return [
        Violation(rule, where, name)
        for rule, table in (("constant twice", constants), ("class twice", classes))
        for name, places in sorted(table.items())
        if len(places) > 1
        for where in sorted(places)
    ]


def check_exports(package: str) -> list[Violation]:
    """Return the modules that bear the name of a function which their parent exports."""
    violations = []
    for init in sorted((ROOT / package).rglob("__init__.py")):
        tree = ast.parse(init.read_text(encoding="utf-8"))
        exported = {
            alias.asname or alias.name
            for node in tree.body
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        }
        children = {path.stem for path in init.parent.iterdir() if path.suffix in ("", ".py")}
        where = str(init.relative_to(ROOT))
        violations += [Violation("module", where, name) for name in sorted(exported & children)]
    return violations


def count_repeated_entries(trees: Iterable[ast.Module]) -> int:
    """Return how many entries of arguments and fields repeat an earlier one word for word."""
    entries: Counter[str] = Counter()
    for node in (node for tree in trees for node in ast.walk(tree)):
        text = ast.get_docstring(node) or "" if isinstance(node, DEFINITIONS) else ""
        section = re.search(r"^(?:Args|Attributes):\n((?:    .*\n?)*)", text, re.MULTILINE)
        if section:
            lines = re.split(r"\n(?=    \S)", section[1].rstrip())
            entries.update(" ".join(entry.split()) for entry in lines)
    return entries.total() - len(entries)


def is_participle(name: str) -> bool:
    """Return whether a function's name is a bare participle, such as ``asked`` or ``begun``."""
    word = name.lstrip("_")
    return word in IRREGULAR or (
        "_" not in word and word.endswith("ed") and word not in VERBS_IN_ED
    )


def long_sentences(text: str, longest: int = LONGEST_SENTENCE) -> Iterator[str]:
    """Yield the sentences of a Markdown text that have more words than allowed.

    Code blocks, tables, headings and markers do not count; a list item is a text of its own.

    Args:
        text: Markdown.
        longest: number of words that is still allowed.
    """
    text = re.sub(r"```.*?```|<!--.*?-->|^---\n.*?\n---\n", "\n\n", text, flags=re.DOTALL)
    lines = [
        "" if re.match(r"\s*(\||#|!!!|\?\?\?|:::|=== )", line) else line
        for line in text.splitlines()
    ]
    text = re.sub(r"^\s*([-*]|\d+\.)\s", "\n", "\n".join(lines), flags=re.MULTILINE)
    for paragraph in re.split(r"\n\s*\n", text):
        plain = re.sub(r"`[^`]*`", "code", " ".join(paragraph.split()))
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", plain)
        for sentence in re.split(r"(?<=[.!?:;])\s+", plain):
            if len(sentence.split()) > longest:
                yield sentence


def excepted(violation: Violation, exceptions: Sequence[Mapping[str, str]]) -> bool:
    """Return whether a violation stands in the list of exceptions."""
    return any(
        violation.rule in entry["rule"].split(", ")
        and any(map(Path(violation.path).match, entry["path"].split(", ")))
        and violation.name in entry.get("name", violation.name).split(", ")
        for entry in exceptions
    )


def _conditional_body(tree: ast.Module) -> Iterator[ast.stmt]:
    """Yield the statements of a module that stand under ``if``, ``try`` or ``with``."""
    for node in tree.body:
        if isinstance(node, ast.If | ast.Try | ast.With):
            yield from (part for part in ast.walk(node) if isinstance(part, ast.stmt))


def _bound_names(node: ast.AST) -> Iterator[str]:
    """Yield the names that a node binds: variables, arguments and fields."""
    if isinstance(node, ast.Assign | ast.AnnAssign):
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        for target in targets:
            yield from (part.id for part in ast.walk(target) if isinstance(part, ast.Name))
    elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        yield node.id
    elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
        yield node.attr
    elif isinstance(node, ast.arg):
        yield node.arg
    elif isinstance(node, ast.alias):
        yield node.asname or ""
    elif isinstance(node, ast.ExceptHandler | ast.MatchAs | ast.MatchStar):
        yield node.name or ""


def _is_value(node: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Whether a function is read as a value: a property, or a test's fixture."""
    names = {
        part.id
        for item in node.decorator_list
        for part in ast.walk(item)
        if isinstance(part, ast.Name)
    }
    return bool(names & {"property", "cached_property"})
