"""What is written for people: lines that an editor shows whole, links that lead somewhere."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from common import filled, table
from pages import DOCS, ROOT, TROUBLESHOOTING

COLUMNS = 100
BUILT = ("_build", "examples", "names")
PAGES = (
    *sorted(ROOT.glob("*.md")),
    *sorted(p for p in DOCS.rglob("*.md") if not set(BUILT) & set(p.relative_to(DOCS).parts)),
    TROUBLESHOOTING,
)
REPORTS = sorted((ROOT / "benchmarks" / "results").glob("*.md"))
LONGEST = 35  # words of a sentence that is read once
# Pages that are read from above; known_answers.md is written by a benchmark.
EXPLAINING = [
    p
    for p in PAGES
    if p.stem not in ("CHANGELOG", "CONTRIBUTING", "changes", "contributing", "known_answers")
]
LINK = re.compile(r"(?<!\\)\]\(([^)\s]+)\)|<img[^>]* src=\"([^\"]+)\"|<a[^>]* href=\"([^\"]+)\"")


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_lines_of_a_page_have_100_columns(page: Path) -> None:
    long = [line for line in _breakable(page.read_text()) if len(line) > COLUMNS]
    assert not long, long


@pytest.mark.parametrize("page", REPORTS, ids=name)
def test_reports_of_the_benchmarks_have_100_columns(page: Path) -> None:
    """Their tables too: one that is wider is written as several."""
    assert not [line for line in page.read_text().splitlines() if len(line) > COLUMNS]


def test_a_wide_table_becomes_several_that_begin_alike() -> None:
    rows = [["a", 1, *"x" * 3, *"y" * 3], ["a", 2, *"x" * 3, *"y" * 3]]
    header = ["name", "N", f"ours: {'w' * 30}", "ms", "it", f"theirs: {'v' * 40}", "ms", "it"]
    first, second = (part.splitlines() for part in table(header, rows).split("\n\n"))
    assert (
        first[0] == f"| name | N | {header[2]} | ms | it |" and first[3] == "| a | 2 | x | x | x |"
    )
    assert second[0] == f"| name | N | {header[5]} | ms | it |" and len(first) == len(second) == 4
    assert table(header[:5], [r[:5] for r in rows]).splitlines() == first


def test_texts_of_reports_are_filled() -> None:
    text = f"{'a ' * 60}\n\nList:\n\n- {'b ' * 60}\n- c"
    assert [len(line) for line in filled(text).splitlines()] == [99, 19, 0, 5, 0, 99, 23, 3]


def _breakable(text: str) -> Iterator[str]:
    """The lines that can be broken: neither what a program prints, nor one word."""
    printed = False
    for line in text.splitlines():
        if line.startswith("```"):
            printed = line == "```output"
        if not printed and " " in line.strip():
            yield line


def test_lines_that_cannot_be_broken_are_told_from_others() -> None:
    row, word = f"| {'a ' * 60} |", "a" * 120
    page = f"{row}\n{word}\n```output\n{word} {word}\n```\n{word} {word}\n"
    assert [line for line in _breakable(page) if len(line) > COLUMNS] == [row, f"{word} {word}"]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_no_line_of_an_item_begins_another_list(page: Path) -> None:
    """As `- 1` or `2) x` do where a line is broken before them."""
    assert not re.findall(r"^ {1,3}(?:[-+*]|\d+[.)]) .*", _unquoted(page.read_text()), re.M)


@pytest.mark.parametrize("page", [ROOT / "README.md", DOCS / "searching.md"], ids=name)
def test_the_time_of_all_sequences_is_that_of_the_report(page: Path) -> None:
    (report,) = (p.read_text() for p in REPORTS if p.stem == "README")
    (seconds,) = re.findall(r"^\| 6 \| 127 \| 2 \| (\d+\.\d+) \|", report, re.MULTILINE)
    (line,) = (text for text in page.read_text().splitlines() if "127 sequences" in text)
    assert f" {seconds} s" in line


@pytest.mark.parametrize("page", [*PAGES, *REPORTS], ids=name)
def test_links_of_a_page_lead_to_a_file_or_a_heading_on_github(page: Path) -> None:
    """Where pages are read as they stand: what the manual makes of them is not there."""
    targets = [next(filter(None, match)) for match in LINK.findall(_unquoted(page.read_text()))]
    here = [t.partition("#")[::2] for t in targets if not re.match(r"\w+:", t)]
    assert not [(file, anchor) for file, anchor in here if not _leads(page, file, anchor)]


def _leads(page: Path, file: str, anchor: str) -> bool:
    path = (page.parent / file).resolve() if file else page
    if path.is_relative_to(DOCS) and set(BUILT) & set(path.relative_to(DOCS).parts):
        return False
    return path.exists() and (not anchor or anchor in _anchors(path.read_text()))


def _unquoted(text: str) -> str:
    return re.sub("^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)


def _anchors(text: str) -> set[str]:
    """The names that GitHub gives to headings, the second of a kind with a number, and others."""
    names, text = list[str](), _unquoted(text)
    for heading in re.findall("^#+ (.*)$", text, re.MULTILINE):
        words = re.sub(r"\]\([^)]*\)|[^\w\- ]", "", heading).lower().replace(" ", "-")
        count = sum(re.fullmatch(rf"{words}(-\d+)?", other) is not None for other in names)
        names.append(f"{words}-{count}" if count else words)
    return {*names, *re.findall(r'^<a id="([^"]+)"></a>$', text, re.MULTILINE)}


def test_headings_have_the_anchors_of_github() -> None:
    page = '# A `b_c`: d-e\n## [Kern](x.md) & $q$\n```\n# no\n```\n## A b_c d-e\n<a id="f"></a>\n'
    assert _anchors(page) == {"a-b_c-d-e", "kern--q", "a-b_c-d-e-1", "f"}


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_no_page_has_the_markers_of_a_merge(page: Path) -> None:
    assert not re.findall("^(?:<{7}|={7}|>{7})(?: .*)?$", page.read_text(), re.MULTILINE)


@pytest.mark.parametrize("page", EXPLAINING, ids=name)
def test_sentences_that_explain_are_short(page: Path) -> None:
    long = [s for s in _sentences(page.read_text()) if len(s.split()) > LONGEST]
    assert not long, long


def _sentences(text: str) -> Iterator[str]:
    """The sentences of the paragraphs of a page, without formulas; code is one word."""
    text = text.partition("\n## References")[0]
    for left_out, instead in (
        (r"^```.*?^```$|^    .*?$|<[^>]+>", ""),  # blocks, commands, HTML
        (r"^\$\$.*?^\$\$.*?$", ""),
        (r"\$[^$]+\$|\{eq\}`[^`]+`", ""),  # formulas and their numbers
        (r"`[^`]+`", "Code"),
        (r"\[([^]]*)\]\([^)]*\)", r"\1"),  # links
    ):
        text = re.sub(left_out, instead, text, flags=re.MULTILINE | re.DOTALL)
    for paragraph in re.split(r"\n\s*\n|\n(?=- )", text):
        if not paragraph.lstrip().startswith(("#", "|")):
            yield from re.split(r"(?<=[.?!])\s+(?=[A-Z*])", paragraph.strip())


def test_a_sentence_is_counted_without_its_formulas() -> None:
    formula = "$$\nx = y\n$$ (label)"
    page = f"# No\n\nIt is $a + b$ here, `x = y`.\nThen\n\n{formula}\n\nin {{eq}}`a` it is.\n"
    words = [s.split() for s in _sentences(page)]
    assert words == [["It", "is", "here,", "Code."], ["Then"], ["in", "it", "is."]]


def test_the_first_page_is_short_and_its_pictures_are_small() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= 150
    sizes = {p.name: p.stat().st_size for p in (DOCS / "pictures").iterdir()}
    assert sizes["swing_up.gif"] <= 600_000 and sum(sizes.values()) <= 1_000_000, sizes
