"""Faults planted in the code that acts, one at a time: how many of them the worlds find.

    python -m tests.worlds.mutants --seed 1 -n 200 --seconds 60

Each is drawn by one of five operators over all lines of `planted.ROOMS`. How it is counted:

- One that changes nothing (the same byte code, other names of local values, an order that no value or call can tell,
  words of a message, a docstring, a type) is not drawn.
- One that fails a world without any fault, with any device, does not count: a test of the happy path finds it.
- One whose lines none of `--reach` drawn worlds reaches is *never reached*: their share is told, and it does not count.
- One that *changes nothing* does not count either, and their share is told: every world of its budget takes the same
  course as without it (`planted.course`), to the last digit and millisecond. It changes words for people, or a value
  that nobody uses, or only what no drawn world brings about; no law could notice it.
- All others count. One is *found* when an invariant is broken in a drawn world within its processor time, and holds
  there in the code without a fault; where it breaks there too, the next world is tried. Worlds that reach its lines
  come first, with rare lines before others; which those are was found once, in the code without a fault.
"""

from __future__ import annotations

import argparse
import ast
import collections
import random
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import CodeType
from typing import TYPE_CHECKING, Any, NamedTuple

from tests.worlds.planted import ROOMS, ROOT, Planted, blocks, course, module_of, reach, reached_in

if TYPE_CHECKING:
    from tests.worlds.world import Ran, World

OPERATORS = ("line left out", "condition turned", "order changed", "stale value", "mend taken back")
_SIMPLE = (ast.Expr, ast.Assign, ast.AugAssign, ast.AnnAssign, ast.Raise, ast.Delete)
_WORDS = {"debug", "info", "warning", "add_note", "format", "_"}  # calls whose arguments are words for people
_MENDS = 60  # commits of a file that are looked at
_FRESH = 10_000_000  # seeds from here on: worlds that nobody has chosen
DOES_NOT_COUNT, FOUND, MISSED, NO_PLACE, NEVER_REACHED, CHANGES_NOTHING = range(10, 16)


class Mutant(NamedTuple):
    """One of them: its code, the lines that it changes, and what it is."""

    code: CodeType
    lines: set[int]
    what: str


def main() -> int:
    """Draw them, try them, and count."""
    options = _options()
    if options.one:
        return _try(*options.one, options)
    options.reached = options.reached or str(reach(options.reach, options.jobs))
    print(f"{len(reached_in(Path(options.reached)).seeds)} lines are reached by {options.reach} worlds", flush=True)
    draw = random.Random(options.seed)
    counts: collections.Counter[str] = collections.Counter()
    by_operator: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    with ThreadPoolExecutor(options.jobs) as pool:
        while counts["found"] + counts["missed"] < options.n:
            left = options.n - counts["found"] - counts["missed"]
            drawn = [_drawn(draw) for _ in range(min(4 * options.jobs, 2 * left))]
            for mutant, (status, line) in zip(drawn, pool.map(lambda one: _status(one, options), drawn), strict=True):
                how = _HOW[status]
                counts[how] += 1
                if status in (FOUND, MISSED):
                    by_operator[mutant[1]][how] += 1
                if status not in (DOES_NOT_COUNT, NO_PLACE):
                    print(f"{how:7} {' '.join(mutant)}: {line}", flush=True)
    tried = counts["found"] + counts["missed"]
    print(f"found {counts['found']} of {tried} ({100.0 * counts['found'] / tried:.0f} %); seed {options.seed}")
    for operator in OPERATORS:
        print(f"  {operator}: {by_operator[operator]['found']} of {sum(by_operator[operator].values())}")
    others = ("never reached", "changes nothing", "does not count")
    print("; ".join(f"{how}: {counts[how]}" for how in others) + " (fail without a fault)")
    return 0


_HOW = {DOES_NOT_COUNT: "does not count", FOUND: "found", MISSED: "missed", NO_PLACE: "no place",
        NEVER_REACHED: "never reached", CHANGES_NOTHING: "changes nothing"}  # fmt: skip


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.worlds.mutants", description=__doc__)
    parser.add_argument("-n", type=int, default=200, help="so many that count (200)")
    parser.add_argument("--seed", type=int, default=1, help="of the draw")
    parser.add_argument("--seconds", type=float, default=60.0, help="processor time of each (60)")
    parser.add_argument("--reach", type=int, default=2000, help="worlds whose lines are looked at (2000)")
    parser.add_argument("--reached", help="the file that an earlier run has kept of them")
    parser.add_argument("--jobs", type=int, default=2, help="at a time (2)")
    parser.add_argument("--one", nargs=3, metavar=("FILE", "OPERATOR", "NUMBER"), help="one of them")
    return parser.parse_args()


def _drawn(draw: random.Random) -> tuple[str, str, str]:
    """A file by its number of lines, an operator, and a number that chooses the place."""
    sizes = [len((ROOT / room).read_text(encoding="utf-8").splitlines()) for room in ROOMS]
    return draw.choices(ROOMS, sizes)[0], draw.choice(OPERATORS), str(draw.randrange(1 << 30))


def _status(mutant: tuple[str, str, str], options: argparse.Namespace) -> tuple[int, str]:
    words = [sys.executable, "-m", "tests.worlds.mutants", "--one", *mutant, "--seconds", str(options.seconds),
             "--seed", str(options.seed), "--reached", options.reached]  # fmt: skip
    try:
        done = subprocess.run(
            words, cwd=ROOT, capture_output=True, text=True, check=False, timeout=30.0 * options.seconds + 300
        )
    except subprocess.TimeoutExpired:  # it goes round and round, and no seam stops it
        return DOES_NOT_COUNT, "does not end"
    lines = done.stdout.splitlines() or [""]
    if done.returncode not in _HOW:  # what does not even begin is no mutant
        return DOES_NOT_COUNT, (done.stderr.splitlines() or [""])[-1]
    return done.returncode, lines[-1]


def _breaks_without(code: str) -> bool:
    """Whether a world breaks a law in the code as it is."""
    words = [sys.executable, "-m", "tests.worlds", code]
    return subprocess.run(words, cwd=ROOT, stdout=subprocess.DEVNULL, check=False).returncode != 0


def _try(room: str, operator: str, number: str, options: argparse.Namespace) -> int:
    """In a process of its own: plant it, and let worlds go by."""
    source = (ROOT / room).read_text(encoding="utf-8")
    planted = mutated(source, operator, int(number), room)
    if planted is None:
        return NO_PLACE
    reached, courses = reached_in(Path(options.reached))
    chosen = _in_turn([reached.get((room, line), []) for line in sorted(planted.lines)])
    if not chosen:
        print(planted.what)
        return NEVER_REACHED
    Planted({module_of(room): planted.code}, {"_kept": kept})
    from tests.worlds.judge import judge
    from tests.worlds.schedule import THIRDS, Schedule, drawn
    from tests.worlds.world import one

    for third, procedure in (("", "plain"), ("", "steps"), *((third, "plain") for third in THIRDS.values())):
        sound = one(Schedule(0, procedure=procedure, third=third), judge)
        if sound.broken or sound.status != 0:
            return DOES_NOT_COUNT
    begun_s, tried, is_another = time.process_time(), 0, False

    def judged(world: World, ran: Ran) -> None:
        nonlocal is_another
        judge(world, ran)
        seed = ran.schedule.seed
        is_another = is_another or (seed in courses and course(world, ran) != courses[seed])

    while time.process_time() - begun_s < options.seconds:
        seed = chosen[tried] if tried < len(chosen) else _FRESH + 1_000_000 * options.seed + tried
        ran = one(drawn(seed), judged)
        tried += 1
        if ran.broken and not _breaks_without(ran.schedule.code):
            print(f"{planted.what}; world {tried}: {ran.broken[0]} ({ran.schedule.code})")
            return FOUND
    print(f"{planted.what}; {tried} worlds")
    return MISSED if is_another else CHANGES_NOTHING


def _in_turn(lists: list[list[int]]) -> list[int]:
    """Each seed once; of several lines by turns."""
    longest = max(map(len, lists), default=0)
    return list(dict.fromkeys(seeds[at] for at in range(longest) for seeds in lists if at < len(seeds)))


class _Kept(dict[str, Any]):
    """Values of a process, by where they were made."""


def kept(place: str, value: Any) -> Any:
    """The value that was made there before, in this process."""
    from hil.system import system

    try:
        mine = system.of_process(_Kept)
    except AttributeError:  # nobody's task
        return value
    before, mine[place] = mine.get(place, value), value
    return before


def mutated(source: str, operator: str, number: int, room: str) -> Mutant | None:
    """The code of a file with one fault in it; None where the operator finds no place, or it changes nothing."""
    if operator == "mend taken back":
        return _taken_back(source, number, room)
    tree = ast.parse(source)
    places = [*_PLACES[operator](tree)]
    if not places:
        return None
    plant, line = places[number % len(places)]
    plant()
    text = source.splitlines()[line - 1].strip()
    code = compile(ast.fix_missing_locations(tree), room, "exec")
    what = f"{operator} at {room}:{line} `{text}`"
    return None if _same(code, compile(source, room, "exec")) else Mutant(code, {line}, what)


def _same(one: CodeType, other: CodeType) -> bool:
    """Whether two codes do the same, whatever lines they stand on."""
    if one.co_code != other.co_code or one.co_names != other.co_names or len(one.co_consts) != len(other.co_consts):
        return False
    if _arguments(one) != _arguments(other):  # other local names do the same
        return False
    pairs = zip(one.co_consts, other.co_consts, strict=True)
    return all(_same(a, b) if isinstance(a, CodeType) and isinstance(b, CodeType) else a == b for a, b in pairs)


def _arguments(code: CodeType) -> tuple[str, ...]:
    return code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]


Planting = tuple[Callable[[], None], int]


def _words(tree: ast.Module) -> set[int]:
    """Nodes that make words for people: messages of errors, logs, sentences; whole functions that return a sentence."""
    found: set[int] = set()
    for node in ast.walk(tree):
        is_call = isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in _WORDS
        if isinstance(node, ast.JoinedStr) or is_call:
            found |= {id(one) for one in ast.walk(node)}
        if isinstance(node, ast.Raise):
            found |= {id(one) for one in ast.walk(node)} - {id(node)}
        if isinstance(node, ast.FunctionDef) and getattr(node.returns, "id", "") == "str" and _is_prose(node):
            found |= {id(one) for one in ast.walk(node)}
    return found


def _is_prose(function: ast.FunctionDef) -> bool:
    return any(isinstance(node, ast.Return) and isinstance(node.value, ast.JoinedStr) for node in ast.walk(function))


def _simple(tree: ast.Module, statement: ast.stmt, words: set[int]) -> bool:
    """Whether it can be left out or moved, and is more than words."""
    if not isinstance(statement, _SIMPLE) or id(statement) in words:
        return False
    if isinstance(statement, ast.AnnAssign) and statement.value is None:
        return False
    value = getattr(statement, "value", None)
    return not isinstance(value, ast.Constant | ast.JoinedStr) and id(value) not in words


def _left_out(tree: ast.Module) -> Iterator[Planting]:
    words = _words(tree)
    for _, body in blocks(tree):
        for at, statement in enumerate(body):
            if _simple(tree, statement, words):

                def plant(body: list[ast.stmt] = body, at: int = at) -> None:
                    body[at] = ast.copy_location(ast.Pass(), body[at])

                yield plant, statement.lineno


def _turned(tree: ast.Module) -> Iterator[Planting]:
    words = _words(tree)
    for _, body in blocks(tree):
        for statement in body:
            for node in _of_statement(statement):
                if isinstance(node, ast.If | ast.While | ast.IfExp) and id(node) not in words:
                    if isinstance(node.test, ast.Constant):
                        continue

                    def plant(node: ast.If | ast.While | ast.IfExp = node) -> None:
                        node.test = ast.copy_location(ast.UnaryOp(ast.Not(), node.test), node.test)

                    yield plant, statement.lineno


def _of_statement(statement: ast.stmt) -> Iterator[ast.AST]:
    """It, and the expressions in it, without the statements in it."""
    yield statement
    todo: list[ast.AST] = [one for one in ast.iter_child_nodes(statement) if not isinstance(one, ast.stmt)]
    while todo:
        node = todo.pop()
        yield node
        todo += ast.iter_child_nodes(node)


def _swapped(tree: ast.Module) -> Iterator[Planting]:
    words = _words(tree)
    for function, body in blocks(tree):
        for at in range(len(body) - 1):
            pair = body[at : at + 2]
            if function.name != "__init__" and all(_simple(tree, one, words) for one in pair) and _depend(*pair):

                def plant(body: list[ast.stmt] = body, at: int = at) -> None:
                    body[at], body[at + 1] = body[at + 1], body[at]

                yield plant, pair[0].lineno


def _depend(one: ast.stmt, other: ast.stmt) -> bool:
    """Whether the order of two statements can be told: one sets what the other uses, both call, or one leaves."""
    (sets, uses), (sets_too, uses_too) = _names(one), _names(other)
    call = [isinstance(node, ast.Expr) and isinstance(node.value, ast.Call) for node in (one, other)]
    leaves = isinstance(one, ast.Raise) or isinstance(other, ast.Raise)
    return bool(sets & uses_too or sets_too & uses or sets & sets_too) or all(call) or leaves


def _names(statement: ast.stmt) -> tuple[set[str], set[str]]:
    """What a statement sets, and what it uses: names, and attributes with what they are of."""
    sets, uses, own = set[str](), set[str](), set[str]()
    for node in ast.walk(statement):
        if isinstance(node, ast.Name | ast.Attribute):
            (sets if isinstance(node.ctx, ast.Store) else uses).add(ast.unparse(node))
        if isinstance(node, ast.comprehension):  # its names are its own
            own |= {one.id for one in ast.walk(node.target) if isinstance(one, ast.Name)}
    return sets - own, uses - own


def _stale(tree: ast.Module) -> Iterator[Planting]:
    """A value is that of the call before, in the same process."""
    words = _words(tree)
    for function, body in blocks(tree):
        for statement in body:
            if function.name == "__init__" or not isinstance(statement, ast.Return | ast.Assign):
                continue
            value = statement.value
            if isinstance(value, ast.Call | ast.BinOp | ast.Compare) and id(value) not in words:

                def plant(statement: ast.Return | ast.Assign = statement) -> None:
                    place = f"{statement.lineno}.{statement.col_offset}"
                    call = ast.parse(f"_kept({place!r}, 0)", mode="eval").body
                    assert isinstance(call, ast.Call) and statement.value is not None
                    call.args[1] = statement.value
                    statement.value = call

                yield plant, statement.lineno


_PLACES: dict[str, Callable[[ast.Module], Iterator[Planting]]] = {
    "line left out": _left_out, "condition turned": _turned, "order changed": _swapped, "stale value": _stale,
}  # fmt: skip


def _taken_back(source: str, number: int, room: str) -> Mutant | None:
    """A piece of an earlier commit, where what it made still stands as it made it."""
    log = _git("log", f"-{_MENDS}", "--format=%h", "--", room).split()
    found: list[tuple[str, str, set[int]]] = []
    for commit in log:
        shown = _git("show", "--format=", "-U1", commit, "--", room)
        for hunk in re.split(r"^@@.*@@.*$", shown, flags=re.MULTILINE)[1:]:
            lines = hunk.strip("\n").splitlines()
            made, before = (_side(lines, drop) for drop in "-+")
            is_moved = "system." in made and "system." not in before  # the seam itself: what it took away is not there
            if made != before and not is_moved and source.count(made) == 1 and len(made.strip()) > 40:
                other = source.replace(made, before)
                try:
                    differs = not _same(_meaning(other), _meaning(source))
                except SyntaxError:
                    continue
                if differs:
                    first = source[: source.index(made)].count("\n") + 1
                    found.append((commit, other, set(range(first, first + made.count("\n") + 1))))
    if not found:
        return None
    commit, other, changed = found[number % len(found)]
    what = f"a piece of {commit} taken back in {room}:{min(changed)}"
    return Mutant(compile(other, room, "exec"), changed, what)


def _meaning(source: str) -> CodeType:
    """What a source does, without types, words and docstrings."""
    tree = ast.parse(source)
    words = _words(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            node.returns = None
            for argument in (*node.args.args, *node.args.kwonlyargs):
                argument.annotation = None
        for name, value in ast.iter_fields(node):
            if isinstance(value, list):
                kept = [ast.Expr(ast.Constant("")) if _is_prose_alone(one) else one for one in value]
                setattr(node, name, [ast.Constant("") if _is_words(one, words) else one for one in kept])
            elif _is_words(value, words):
                setattr(node, name, ast.Constant(""))
    return compile(ast.fix_missing_locations(tree), "", "exec")


def _is_prose_alone(node: Any) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _is_words(node: Any, words: set[int]) -> bool:
    is_read = not isinstance(getattr(node, "ctx", None), ast.Store | ast.Del)
    return isinstance(node, ast.expr) and is_read and id(node) in words


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout


def _side(lines: Sequence[str], drop: str) -> str:
    return "\n".join(line[1:] for line in lines if not line.startswith((drop, "\\")))


if __name__ == "__main__":
    sys.exit(main())
