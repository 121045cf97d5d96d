"""What the green is worth: which small faults in the code the tests find, and which the product alone.

    python -m benchmarks.mutants --seed 7 --count 600 --out mutants.jsonl [--minutes 60] [--only fem]

Faults are drawn by seed over the equations, the verdicts and what carries them: operators, constants and
indices, signs, dropped terms, comparisons, swapped arguments.  Each is put into a worktree of the last commit
and judged by the everyday tests that are nearest to its file by imports, which are green without it, and by
`compare` at a small size, which must turn red or end.  A line of the file says what became of it; those that
are there are not tried again.
"""

import argparse
import ast
import copy
import json
import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from grimp import ImportGraph

ROOT = Path(__file__).parents[1]
JUDGED = (
    "actin_xcheck/core",
    "fem",
    "fv",
    *(f"actin_xcheck/{name}" for name in ("theory", "verdicts", "runs")),
)
PRODUCT = ("compare", "growing-disk", "mode-11-wall", "lopsided-cell", "--refine", "3", "--quiet", "--force")
EVERYDAY = ("pytest", "-x", "-q", "-p", "no:cacheprovider", "-m", "not slow and not nightly")
NEAREST, PATIENCE = 3, 200.0
"""Files of tests a mutant is judged by, and seconds that they, or the product, may take."""

_OTHER: dict[type, type] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult,
    ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.And: ast.Or, ast.Or: ast.And, ast.MatMult: ast.Add,
}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """A fault: the number of its place in the walk over a file, its line, its kind and what is written."""

    file: str
    place: int
    line: int
    kind: str
    before: str
    after: str


def mutants(file: str) -> Iterator[tuple[Mutant, ast.Module]]:
    """Yield every fault of a file with the tree that has it."""
    tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    skipped = {id(inner) for node in ast.walk(tree) for part in _aside(node) for inner in ast.walk(part)}
    for place, node in enumerate(ast.walk(tree)):
        if id(node) in skipped or not isinstance(node, ast.expr):
            continue
        for kind, changed in _changes(node):
            before, after = ast.unparse(node), ast.unparse(changed)
            if before != after:
                yield Mutant(file, place, node.lineno, kind, before[:120], after[:120]), tree


def mutated(mutant: Mutant) -> str:
    """The text of a mutant's file."""
    for one, tree in mutants(mutant.file):
        if one == mutant:
            target = list(ast.walk(tree))[mutant.place]
            assert isinstance(target, ast.expr)
            changed = next(new for kind, new in _changes(target) if ast.unparse(new)[:120] == mutant.after)
            return ast.unparse(ast.fix_missing_locations(_Replaced(target, changed).visit(tree)))
    raise ValueError(f"{mutant} is none of its file")


class _Replaced(ast.NodeTransformer):
    def __init__(self, old: ast.expr, new: ast.expr) -> None:
        self.old, self.new = old, new

    def visit(self, node: ast.AST) -> ast.AST:
        return self.new if node is self.old else self.generic_visit(node)


def _aside(node: ast.AST) -> Iterator[ast.AST]:
    """What says nothing of what is computed: annotations, docstrings, decorators, messages of errors."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        yield from filter(
            None, [node.returns, *(one.annotation for one in ast.walk(node.args) if isinstance(one, ast.arg))]
        )
        yield from node.decorator_list
    if isinstance(node, ast.AnnAssign):
        yield node.annotation
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        yield node
    if isinstance(node, ast.Raise | ast.JoinedStr | ast.Import | ast.ImportFrom | ast.Assert):
        yield node


def _changes(node: ast.AST) -> Iterator[tuple[str, ast.expr]]:
    """Every fault at a node, by its kind."""
    new = copy.deepcopy(node)
    match new:
        case ast.BinOp(left=left, op=op) if type(op) in _OTHER:
            new.op = _OTHER[type(op)]()
            yield "operator", new
            if isinstance(op, ast.Add | ast.Sub):
                yield "dropped term", left
        case ast.BoolOp(op=op):
            new.op = _OTHER[type(op)]()
            yield "operator", new
        case ast.Compare(ops=[op]) if type(op) in _OTHER:
            new.ops = [_OTHER[type(op)]()]
            yield "comparison", new
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            yield "sign", operand
        case ast.Constant(value=bool(value)):
            yield "constant", ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield "constant", ast.Constant(value + 1)
        case ast.Constant(value=float(value)):
            yield "constant", ast.Constant(1.1 * value if value else 0.1)
        case ast.Call(args=[first, second, *rest]) if not isinstance(first, ast.Starred):
            if not isinstance(second, ast.Starred):
                new.args = [second, first, *rest]
                yield "swapped arguments", new


@cache
def _imports() -> "ImportGraph":
    import grimp

    return grimp.build_graph("actin_xcheck", "fem", "fv", "tests", cache_dir=None)


@cache
def nearest_tests(file: str) -> list[str]:
    """Files of tests by how few imports lie between them and a file, at most `NEAREST`."""
    graph = _imports()
    module = file[:-3].replace("/", ".").removesuffix(".__init__")
    far: dict[str, int] = {}
    ring, steps = {module}, 0
    while ring and sum(name.startswith("tests.test_") for name in far) < NEAREST:
        far |= {name: steps for name in ring if name not in far}
        ring = {one for name in ring for one in graph.find_modules_that_directly_import(name)} - far.keys()
        steps += 1
    stem = module.rpartition(".")[2]
    found = sorted(
        (steps, stem not in name, name) for name, steps in far.items() if name.startswith("tests.test_")
    )
    return [f"{name.replace('.', '/')}.py" for *_, name in found[:NEAREST]]


def fails(command: list[str], folder: Path) -> bool:
    """Whether a command in a copy of the tree turns red, breaks down or never ends."""
    environment = os.environ | {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    process = subprocess.Popen(
        [sys.executable, "-m", *command], cwd=folder, env=environment, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        return process.wait(PATIENCE) != 0
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, 9)
        process.wait()
        return True


@cache
def green(tests: str, folder: Path) -> bool:
    """Whether a file of tests is green without a mutant."""
    return not fails([*EVERYDAY, tests], folder)


def judge(mutant: Mutant, folder: Path) -> dict[str, object]:
    """Put a mutant into a copy of the tree, judge it both ways and take it out again."""
    target, begin = folder / mutant.file, time.monotonic()
    whole = target.read_text(encoding="utf-8")
    tests = [one for one in nearest_tests(mutant.file) if green(one, folder)]
    target.write_text(mutated(mutant), encoding="utf-8")
    try:
        by_tests = bool(tests) and fails([*EVERYDAY, *tests], folder)
        by_product = fails(["actin_xcheck", *PRODUCT, "--out", str(folder / "mutant-report")], folder)
    finally:
        target.write_text(whole, encoding="utf-8")
    seconds = round(time.monotonic() - begin, 1)
    return asdict(mutant) | {"tests": by_tests, "product": by_product, "by": tests, "seconds": seconds}


@contextmanager
def worktree() -> Iterator[Path]:
    """A worktree of the last commit, for as long as it is needed."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name).resolve() / "tree"
        git = ["git", "-C", str(ROOT), "worktree"]
        subprocess.run([*git, "add", "-q", "--detach", str(folder)], check=True)
        try:
            yield folder
        finally:
            subprocess.run([*git, "remove", "--force", str(folder)], check=True)


def table(lines: list[dict[str, object]]) -> str:
    """The share that is found, by package, and the survivors."""
    rows = [f"{'':28}{'mutants':>8}{'tests':>8}{'product':>9}"]
    for part in (*JUDGED, ""):
        mine = [one for one in lines if str(one["file"]).startswith(part)]
        if mine:
            shares = (sum(bool(one[how]) for one in mine) / len(mine) for how in ("tests", "product"))
            rows.append(f"{part or 'all':28}{len(mine):8d}" + "".join(f"{share:9.0%}" for share in shares))
    rows += [
        f"survives the tests: {one['file']}:{one['line']} {one['kind']}: {one['before']} -> {one['after']}"
        for one in lines
        if not one["tests"]
    ]
    return "\n".join(rows)


def main() -> None:
    """Judge mutants until there are as many as asked for, or the time is over, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=600)
    parser.add_argument("--minutes", type=float, default=float("inf"))
    parser.add_argument("--only", default="", help="beginning of the files' names")
    parser.add_argument("--out", type=Path, default=Path("mutants.jsonl"))
    asked = parser.parse_args()
    files = sorted(str(one.relative_to(ROOT)) for part in JUDGED for one in (ROOT / part).rglob("*.py"))
    every = [one for file in files if file.startswith(asked.only) for one, _ in mutants(file)]
    drawn = random.Random(asked.seed).sample(every, min(asked.count, len(every)))
    lines = [json.loads(line) for line in asked.out.read_text().splitlines()] if asked.out.exists() else []
    known, end = (
        {(one["file"], one["place"], one["after"]) for one in lines},
        time.monotonic() + 60 * asked.minutes,
    )
    with worktree() as folder:
        if fails(["actin_xcheck", *PRODUCT, "--out", str(folder / "mutant-report")], folder):
            sys.exit("without a mutant the product is not green")
        for mutant in drawn:
            if time.monotonic() > end:
                break
            if (mutant.file, mutant.place, mutant.after) in known:
                continue
            lines.append(judge(mutant, folder))
            with asked.out.open("a") as file:
                file.write(json.dumps(lines[-1]) + "\n")
    print(f"{len(every)} places, {len(lines)} judged\n{table(lines)}")


if __name__ == "__main__":
    main()
