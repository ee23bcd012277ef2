"""Change the sources at random places, by their syntax, and see whether the nearest tests notice.

Run:  .venv/bin/python tools/random_changes.py [FOLDER ...] [--count N] [--seed N] [--jobs N]

Python, Cython and C are read as tokens by one grammar.  A change is of one of these kinds, which
come equally often, as the folders do (all layers, unless some are named)::

    sign         a + b becomes a - b, -a becomes a
    factor       a * b becomes a / b or a
    comparison   a < b becomes a > b, n < 3 also n <= 3, == becomes !=
    index        a[0] becomes a[-1], a[2] becomes a[1], a[1:] becomes a[0:]
    term         a + b becomes a; a and b becomes a or a or b
    arguments    f(a, b) becomes f(b, a)
    end          min becomes max, any becomes all, .first becomes .last

What is in texts, comments, errors that are raised and heads of functions stays.  What tries the
changes is ``tools/mutations.py``.  One that survives needs a test, and a place in the list
(``tools/mutations.toml``) with it, unless it changes nothing.  The exit status is 1 if one does.

Cosmic Ray and mutmut change Python alone, in one package that lies in one folder.
"""

from __future__ import annotations

import argparse
import random
import re
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from mutations import ROOT, Change, fates

LAYERS = sorted(
    path.parent.name for path in ROOT.glob("*/__init__.py") if path.parent.name != "generated"
)
SUFFIXES = {".py", ".pyx", ".pxi", ".c"}
TOKEN = re.compile(
    r"""
    (?P<text>     [rbfRBF]{0,2} (?: \"{3}.*?\"{3} | "(?:\\.|[^"\\\n])*" | '(?:\\.|[^'\\\n])*' ) )
  | (?P<comment>  \#[^\n]* | /\*.*?\*/ )
  | (?P<number>   (?:\d[\d_]*\.?[\d_]*|\.\d+)(?:[eE][-+]?\d+)? )
  | (?P<name>     [^\W\d]\w* )
  | (?P<operator> -> | \+\+ | -- | && | \|\| | (?:\*\*|//|<<|>>|[-+*/%@&|^:<>=!])=? | ~ )
  | (?P<mark>     [()\[\]{},;.?] )
  | (?P<line>     \n )
    """,
    re.VERBOSE | re.DOTALL,
)
KEYWORDS = set(
    "and or not in is if else elif for while return yield lambda del assert raise from import as "
    "with await except case sizeof nogil".split()
)
# Heads of functions and classes, and statements whose words no test compares in full.
HEADS = {"def", "class", "cdef", "cpdef", "raise", "import", "from", "assert", "static"}
BINDING = (
    {"or", "||"}, {"and", "&&"}, {"<", "<=", ">", ">=", "==", "!=", "in", "is", "not"}, {"|"},
    {"^"}, {"&"}, {"<<", ">>"}, {"+", "-"}, {"*", "/", "//", "%", "@"},
)  # fmt: skip
STRENGTH = {operator: i for i, group in enumerate(BINDING) for operator in group}
SIGNS = {"+": "-", "-": "+"}
FACTORS = {"*": "/", "/": "*"}
TURNED = {"<": ">", ">": "<", "<=": ">=", ">=": "<=", "==": "!=", "!=": "=="}
EDGES = {"<": "<=", "<=": "<", ">": ">=", ">=": ">"}
OTHER_CONNECTIVE = {"and": "or", "or": "and", "&&": "||", "||": "&&"}
# Functions whose arguments may come in any order.
COMMUTING = {"min", "max", "minimum", "maximum", "fmin", "fmax", "hypot", "isdisjoint"}
# Functions, where they are called or named in full, whose results are the other end of a range, and
# fields that are.
ENDS = "min max|any all|minimum maximum|fmin fmax|argmin argmax|nanmin nanmax|ceil floor|sin cos"
FIELDS = "first last|start stop|lower upper|low high|before after|begins ends|u0 u1"
OPEN, CLOSE = set("([{"), set(")]}")


def _both_ways(pairs: str) -> dict[str, str]:
    """Each word of pairs by the other one."""
    words = [pair.split() for pair in pairs.split("|")]
    return {a: b for one, other in words for a, b in ((one, other), (other, one))}


OTHER_END, OTHER_FIELD = _both_ways(ENDS), _both_ways(FIELDS)


@dataclass(frozen=True)
class Token:
    """A token with its kind, and where it begins and ends in its text."""

    kind: str
    word: str
    begin: int
    end: int


@dataclass(frozen=True)
class Edit:
    """A part of a text that is replaced, and by what kind of change."""

    kind: str
    begin: int
    end: int
    new: str


class Source:
    """The tokens of a text, and the edits that they offer."""

    def __init__(self, text: str) -> None:
        self.text = text
        words = (
            Token(str(m.lastgroup), m.group(), m.start(), m.end()) for m in TOKEN.finditer(text)
        )
        self.tokens = [t for t in words if t.kind != "comment"]

    def edits(self) -> Iterator[Edit]:
        """All edits, statement by statement."""
        brackets: list[int] = []
        head = first = True
        for i, token in enumerate(self.tokens):
            if token.kind == "line" or token.word in (";", "{", "}"):
                first = first or not brackets or token.word in (";", "{", "}")
            elif first:
                head, first = token.word in HEADS or token.word == "@", False
            if token.word in OPEN and token.word != "{":
                brackets.append(i)
            elif token.word in CLOSE and token.word != "}" and brackets:
                brackets.pop()
            if not head:
                yield from self._at(i, brackets[-1] if brackets else None)

    def _at(self, i: int, bracket: int | None) -> Iterator[Edit]:
        """The edits at a token in the innermost bracket around it."""
        token = self.tokens[i]
        word, begin, end = token.word, token.begin, token.end
        if self._is_binary(i):
            for kind, table in (("sign", SIGNS), ("factor", FACTORS), ("comparison", TURNED)):
                if word in table:
                    yield Edit(kind, begin, end, table[word])
            if word in EDGES and "number" in (self._kind(i - 1), self._kind(i + 1)):
                yield Edit("comparison", begin, end, EDGES[word])
            if word in SIGNS or word in FACTORS or word in OTHER_CONNECTIVE:
                kind = "factor" if word in FACTORS else "term"
                yield Edit(kind, self.tokens[i - 1].end, self._operand_end(i), "")
            if word in OTHER_CONNECTIVE:
                yield Edit("term", begin, end, OTHER_CONNECTIVE[word])
        elif (
            word == "-"
            and self._kind(i + 1) in ("name", "number")
            and not self._subscribes(bracket)
        ):
            yield Edit("sign", begin, end, "")
        if token.kind == "number" and word.isdigit() and self._subscribes(bracket):
            yield from self._index(i)
        if token.kind == "name":
            after_point = i > 0 and self.tokens[i - 1].word in (".", "->")
            called = self.tokens[i + 1 : i + 2] and self.tokens[i + 1].word == "("
            new = OTHER_END.get(word) if after_point or called else None
            new = new or (OTHER_FIELD.get(word) if after_point else None)
            if new and (self._kind(i + 1) != "operator" or self.tokens[i + 1].word != "="):
                yield Edit("end", begin, end, new)
            yield from self._arguments(i)

    def _index(self, i: int) -> Iterator[Edit]:
        """Of a number in a subscript, alone or beside a colon."""
        token, before = self.tokens[i], self.tokens[i - 1]
        if before.word == "-" and self.tokens[i - 2].word in ("[", ":", ","):
            yield Edit("index", before.begin, token.end, "0")
        elif before.word in ("[", ",", ":"):
            other = str(int(token.word) - 1)
            if token.word == "0" and self.tokens[i + 1].word == ":":
                other = "1"
            yield Edit("index", token.begin, token.end, other)

    def _arguments(self, i: int) -> Iterator[Edit]:
        """Of a call: its first two arguments exchanged."""
        if i + 1 >= len(self.tokens) or self.tokens[i + 1].word != "(":
            return
        if self.tokens[i].word in KEYWORDS | COMMUTING or self._ends_operand(i - 1):
            return
        parts, begin, depth = list[tuple[int, int]](), i + 2, 0
        for k in range(i + 2, len(self.tokens)):
            word = self.tokens[k].word
            if depth == 0 and word in (",", ")"):
                parts.append((begin, k))
                begin = k + 1
                if word == ")" or len(parts) == 2:
                    break
            depth += (word in OPEN) - (word in CLOSE)
        if len(parts) < 2 or any(a == b for a, b in parts):
            return
        spans = [(self.tokens[a].begin, self.tokens[b - 1].end) for a, b in parts]
        if any(self.tokens[a].kind == "line" or self._is_special(a, b) for a, b in parts):
            return
        one, two = (self.text[a:b] for a, b in spans)
        if one != two:
            between = self.text[spans[0][1] : spans[1][0]]
            yield Edit("arguments", spans[0][0], spans[1][1], two + between + one)

    def _is_special(self, begin: int, end: int) -> bool:
        """Whether an argument has a name, is unpacked, or is a comprehension."""
        words = [t.word for t in self.tokens[begin:end]]
        return words[0] in ("*", "**") or "=" in words or "for" in words

    def _operand_end(self, i: int) -> int:
        """Where the right operand of an operator ends."""
        strength, depth, k = STRENGTH[self.tokens[i].word], 0, i + 1
        while k < len(self.tokens):
            token = self.tokens[k]
            if depth == 0 and k > i + 1:
                weaker = STRENGTH.get(token.word, len(BINDING)) <= strength
                stops = token.word in {*CLOSE, ",", ":", ";", "?", "=", "if", "else", "for"}
                if (weaker and self._is_binary(k)) or stops or token.kind == "line":
                    break
            depth += (token.word in OPEN) - (token.word in CLOSE)
            k += 1
        return self.tokens[k - 1].end

    def _kind(self, i: int) -> str:
        return self.tokens[i].kind if 0 <= i < len(self.tokens) else ""

    def _subscribes(self, bracket: int | None) -> bool:
        """Whether a bracket is that of a subscript."""
        return (
            bracket is not None
            and self.tokens[bracket].word == "["
            and bracket > 0
            and self._ends_operand(bracket - 1)
        )

    def _ends_operand(self, i: int) -> bool:
        if i < 0:
            return False
        token = self.tokens[i]
        if token.kind == "name":
            return token.word not in KEYWORDS
        return token.kind in ("number", "text") or token.word in CLOSE - {"}"}

    def _is_binary(self, i: int) -> bool:
        """Whether an operator stands between two operands, with as much space on both sides: a
        pointer and an unpacked argument do not."""
        token = self.tokens[i]
        if token.word in OTHER_CONNECTIVE and token.kind == "name":
            return True
        if token.kind != "operator" or not self._ends_operand(i - 1) or self._kind(i + 1) == "line":
            return False
        around = self.text[token.begin - 1], self.text[token.end : token.end + 1]
        return around[0].isspace() == around[1].isspace()


def drawn(folders: Sequence[str], count: int, seed: int) -> list[Change]:
    """Distinct changes: of the folders in turn, of a kind and a place in each by lot."""
    lot, changes = random.Random(seed), dict[Change, None]()
    kinds = [_by_kind(folder) for folder in folders]
    while len(changes) < count and any(kinds):
        for by_kind in kinds:
            if by_kind and len(changes) < count:
                kind = lot.choice(sorted(by_kind))
                places = by_kind[kind]
                change = _change(*places.pop(lot.randrange(len(places))))
                if not places:
                    del by_kind[kind]
                if change is not None:
                    changes[change] = None
    return list(changes)


def _by_kind(folder: str) -> dict[str, list[tuple[Path, Edit]]]:
    """The edits of all files of a folder."""
    by_kind = defaultdict[str, list[tuple[Path, Edit]]](list)
    for path in sorted((ROOT / folder).rglob("*")):
        if path.suffix in SUFFIXES:
            for edit in Source(path.read_text(encoding="utf-8")).edits():
                by_kind[edit.kind].append((path, edit))
    return by_kind


def _change(path: Path, edit: Edit) -> Change | None:
    """An edit with as many whole lines as make its text unique; none if Python cannot read it."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py" and not _compiles(text[: edit.begin] + edit.new + text[edit.end :]):
        return None
    begin, end = text.rfind("\n", 0, edit.begin) + 1, text.find("\n", edit.end)
    while begin > 0 and text.count(text[begin:end]) > 1:
        begin = text.rfind("\n", 0, begin - 1) + 1
    changed = text[begin : edit.begin] + edit.new + text[edit.end : end]
    return Change(str(path.relative_to(ROOT)), text[begin:end], changed)


def _compiles(text: str) -> bool:
    try:
        compile(text, "", "exec", dont_inherit=True)
    except SyntaxError:
        return False
    return True


def main(arguments: Sequence[str] | None = None) -> int:
    """Try changes drawn from folders and print their fates."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folders", nargs="*", default=LAYERS, help="folders of the sources")
    parser.add_argument("--count", type=int, default=20, help="how many changes")
    parser.add_argument("--seed", type=int, default=0, help="which ones")
    parser.add_argument("--jobs", type=int, default=2, help="copies that work side by side")
    options = parser.parse_args(arguments)
    changes = drawn(options.folders, options.count, options.seed)
    tried = survivors = 0
    with tempfile.TemporaryDirectory() as folder:
        for fate in fates(changes, Path(folder), max(options.jobs, 1)):
            tried += fate.word != "unfit"
            survivors += fate.word == "survived"
            mark = "!" if fate.word == "survived" else " "
            print(f"{mark} {fate.word:9}{fate.change}: {fate.evidence[:160]}", flush=True)
    print(f"{tried} changes that tests may notice, {survivors} survived")
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
