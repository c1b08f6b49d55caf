"""Make the mutants of the code, leave out those that no test could kill, and draw a sample.

A mutant is the code with one small change, as cosmic-ray makes it. Only changes of what the code
computes or decides are made: no annotations, decorators, or error messages (`left_out` says which
spots of a file are passed over).
"""

from __future__ import annotations

import ast
import hashlib
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

# What is changed into what, in the words of cosmic-ray. One or two changes of each kind: the other
# ones it offers (a bitwise operation on real numbers, say) end in a TypeError and would only
# make the share of killed mutants look better.
_BINARY = "Add_Sub Sub_Add Mul_Div Div_Mul Pow_Mul FloorDiv_Mul Mod_Mul BitAnd_BitOr BitOr_BitAnd"
_COMPARISON = (
    "Lt_LtE Lt_GtE LtE_Lt LtE_Gt Gt_GtE Gt_LtE GtE_Gt GtE_Lt Eq_NotEq NotEq_Eq "
    "Is_IsNot IsNot_Is"
)
OPERATORS = (
    *(f"core/ReplaceBinaryOperator_{kind}" for kind in _BINARY.split()),
    *(f"core/ReplaceComparisonOperator_{kind}" for kind in _COMPARISON.split()),
    "core/ReplaceUnaryOperator_Delete_USub",
    "core/ReplaceUnaryOperator_Delete_Not",
    "core/NumberReplacer",
    "core/AddNot",
    "core/ReplaceTrueWithFalse",
    "core/ReplaceFalseWithTrue",
    "core/ReplaceAndWithOr",
    "core/ReplaceOrWithAnd",
    "core/ReplaceBreakWithContinue",
    "core/ReplaceContinueWithBreak",
    "core/ExceptionReplacer",
    "core/ZeroIterationForLoop",
)
Spot = tuple[int, int]


@dataclass(frozen=True)
class Mutant:
    """One change of one file.

    Parameters
    ----------
    file : str
        Path below the package, as ``physics/optics/camera.py``.
    function : str
        Where the change lies; empty outside of functions and classes.
    line : int
        Of the change, from 1.
    operator, occurrence : str, int
        What cosmic-ray calls it, and the how many-th spot of the file it is.
    before : str
        The line that is changed.
    repeat : int
        How many changes like it stand before it in the same function.
    """

    file: str
    function: str
    line: int
    operator: str
    occurrence: int
    before: str
    repeat: int = 0

    @property
    def name(self) -> str:
        """Ten hexadecimal digits that stay the same while the changed line does."""
        parts = (self.file, self.function, self.operator, self.before, self.repeat)
        return hashlib.sha256("\n".join(map(str, parts)).encode()).hexdigest()[:10]


def left_out(source: str) -> list[tuple[Spot, Spot]]:
    """Return the spots of a file where no change is made.

    Annotations and decorators say nothing that a computation could show; a raised error is tested
    by its kind, not by the words or numbers in it; ``strict=`` of ``zip`` guards against slips of
    the programmer, as does ``TYPE_CHECKING`` against imports at run time.

    Parameters
    ----------
    source : str
        Text of the file.

    Returns
    -------
    list
        Start and end, each as line (from 1) and column (from 0).

    Examples
    --------
    >>> left_out("def double(x: int | float):\\n    return 2 * x\\n")
    [((1, 14), (1, 25))]
    """
    found: list[ast.AST | None] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.arg | ast.AnnAssign):
            found.append(node.annotation)
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            found += [*node.decorator_list, getattr(node, "returns", None)]
        elif isinstance(node, ast.Raise) or (
            isinstance(node, ast.keyword) and node.arg == "strict"
        ):
            found.append(node)
        elif isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            found.append(node.test)
    return [_span(node) for node in found if node is not None]


def _span(node: ast.AST) -> tuple[Spot, Spot]:
    # All nodes that come here stand in the source; the base class of nodes knows no lines.
    lines = (node.lineno, node.end_lineno)  # type: ignore[attr-defined]
    columns = (node.col_offset, node.end_col_offset)  # type: ignore[attr-defined]
    return (lines[0], columns[0]), (lines[1], columns[1])


def mutants(package: Path, folders: Sequence[str]) -> Iterator[Mutant]:
    """Yield every change of every file below some folders, in order of file.

    Parameters
    ----------
    package : pathlib.Path
        Folder of the package.
    folders : sequence of str
        Below it.

    Yields
    ------
    Mutant
        All that `OPERATORS` can make outside of `left_out`.
    """
    for folder in folders:
        for path in sorted((package / folder).rglob("*.py")):
            file = f"{folder}/{path.name}"
            yield from _numbered(_of_file(file, path.read_text(encoding="utf-8")))


def _of_file(file: str, source: str) -> Iterator[Mutant]:
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.ast.ast_query import ASTQuery
    from cosmic_ray.plugins import get_operator

    spared = left_out(source)
    lines = source.splitlines()
    nodes = list(ast_nodes(get_ast(source)))
    for name in OPERATORS:
        operator = get_operator(name)()
        spots = (
            (node, start)
            for node in nodes
            for start, _ in operator.mutation_positions(node)
        )
        for occurrence, (node, start) in enumerate(spots):
            if not any(low <= start < high for low, high in spared):
                function = ASTQuery(node).get_definition_name() or ""
                before = lines[start[0] - 1].strip()
                yield Mutant(file, function, start[0], name, occurrence, before)


def _numbered(found: Iterable[Mutant]) -> Iterator[Mutant]:
    seen: Counter[str] = Counter()
    for one in found:
        yield Mutant(**{**vars(one), "repeat": seen[one.name]})
        seen[one.name] += 1


def mutated(one: Mutant, source: str) -> tuple[str, str]:
    """Apply a change.

    Parameters
    ----------
    one : Mutant
        The change.
    source : str
        Text of its file.

    Returns
    -------
    str, str
        The file, and its first line that is new.

    Raises
    ------
    ValueError
        If the file has changed since and there is no such spot.
    """
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    text = mutate_code(source, get_operator(one.operator)(), one.occurrence) or source
    for old, new in zip(source.splitlines(), text.splitlines(), strict=False):
        if old != new:
            return text, new.strip()
    raise ValueError(
        f"expected {one.operator} to change {one.file}:{one.line}, got no change"
    )


def draw(everything: Iterable[Mutant], count: int, seed: int) -> list[Mutant]:
    """Draw a sample, stratified by file in proportion to the mutants of each.

    Within a file the mutants with the smallest hashes of seed and name are taken: any subset is as
    likely as another one, and a change elsewhere in the code leaves the draw alone.

    Parameters
    ----------
    everything : iterable of Mutant
        What to draw from.
    count : int
        How many to draw; all if there are fewer.
    seed : int
        Another seed draws another sample.

    Returns
    -------
    list of Mutant
        In order of file and line.
    """
    strata = defaultdict(list)
    for one in everything:
        strata[one.file].append(one)
    chosen: list[Mutant] = []
    for file, quota in _quotas({f: len(s) for f, s in strata.items()}, count).items():
        ranked = sorted(strata[file], key=lambda one: _rank(one, seed))
        chosen += ranked[:quota]
    return sorted(
        chosen, key=lambda one: (one.file, one.line, one.operator, one.occurrence)
    )


def _rank(one: Mutant, seed: int) -> str:
    return hashlib.sha256(f"{seed} {one.name}".encode()).hexdigest()


def _quotas(sizes: dict[str, int], count: int) -> dict[str, int]:
    """Share out by largest remainder."""
    total = sum(sizes.values())
    count = min(count, total)
    whole = {file: size * count // total for file, size in sizes.items()}
    left = count - sum(whole.values())
    by_remainder = sorted(
        sizes, key=lambda file: (-(sizes[file] * count % total), file)
    )
    return {file: whole[file] + (file in by_remainder[:left]) for file in sizes}
