"""Reports of solutions for somebody else."""

from __future__ import annotations

import base64
import re
import zlib
from dataclasses import replace
from math import inf
from pathlib import Path
from xml.dom.minidom import parseString

import numpy as np
import pytest
from matplotlib.figure import Figure

import dmoc
from dmoc.base.errors import OutputError
from dmoc.base.table import Table, plain
from dmoc.problem.problem import Problem
from dmoc.results import solution_report
from dmoc.results.solution import Mesh, Minimum
from dmoc.results.solution_report import CHARACTERS, tables
from dmoc.solvers.outcome import Status


@pytest.fixture(scope="module")
def solution(seed: Problem) -> dmoc.Solution:
    """The solution of the source, with another minimum beside it."""
    solution = dmoc.solve(seed.but(steps=60), "ipm", starts=1)
    other = Minimum(200.5, 3, Status.SOLVED, (60, 60))
    return replace(solution, starts=16, agreeing_starts=13, others=(other,))


def test_a_start_is_told_in_its_own_size(solution: dmoc.Solution) -> None:
    """Coordinates in a unit 1e14 times larger are no rounding errors; beside them these are."""
    motion, texts = solution.trajectory, []
    for unit in (1.0, 1e14):
        phases = tuple(replace(p, q=p.q / unit, v=p.v / unit, p=p.p / unit) for p in motion.phases)
        phases[0].q[0, 0], phases[0].v[0, 0] = 1e-17 / unit, 0.25 / unit
        tiny = replace(solution, trajectory=replace(motion, phases=phases))
        rows = dict(tuple(map(plain, row)) for row in next(tables(tiny)).rows)
        pairs = (pair.split(" = ") for pair in rows["start"].split(", "))
        texts.append({name: float(value) * unit for name, value in pairs})
    alpha = motion.coordinates[0]
    assert texts[0][alpha] == texts[1][alpha] == 0.0 and texts[1][f"{alpha}_dot"] == 0.25
    assert texts[0] == pytest.approx(texts[1], rel=1e-4)


@pytest.mark.parametrize("lines", [1, 7, 1000])
def test_pages_have_every_line_once_and_in_order(
    solution: dmoc.Solution, lines: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    pages, real = list[list[tuple[str, bool]]](), solution_report._printed

    def printed(page: list[tuple[str, bool]]) -> Figure:
        pages.append(page)
        return real(page)

    monkeypatch.setattr(solution_report, "_printed", printed)
    monkeypatch.setattr(solution_report, "LINES", lines)
    monkeypatch.setattr(solution_report, "_lines", lambda _: ((str(k), not k) for k in range(15)))
    solution.report(tmp_path / "report.pdf")
    assert [int(line) for page in pages for line, _ in page] == list(range(15))
    assert [len(page) for page in pages[:-1]] == [lines] * (len(pages) - 1)


def test_other_minima_are_told_with_their_mesh(solution: dmoc.Solution) -> None:
    same = replace(solution.others[0], agreeing_starts=1)
    other = replace(solution.others[0], steps=(24, 24))
    rows = [
        row for row in str(replace(solution, others=(same, other))).splitlines() if "minim" in row
    ]
    assert "200.5 (solved), from 1 start" in rows[-2] and "starts" not in rows[-2]
    assert "200.5 (solved in 24+24 steps), from 3 starts" in rows[-1]


def test_the_first_mesh_of_a_table_has_no_estimate(solution: dmoc.Solution) -> None:
    meshes = (
        Mesh((30, 30), 128.0, 5, inf, None, 1e-2),
        Mesh((60, 60), 129.0, 7, 2e-3, 1e-4),
    )
    first, last = (
        row for row in str(replace(solution, meshes=meshes)).splitlines() if "steps  " in row
    )
    assert "30+30" in first and "estimated" not in first and "finest 1.0e-02" in first
    assert "estimated error 2.0e-03" in last


@pytest.mark.slow
def test_a_page_holds_everything_and_needs_nothing(solution: dmoc.Solution, tmp_path: Path) -> None:
    text = solution.report(tmp_path / "r.html").read_text()
    parseString(text[text.index("<main>") : text.index("</body>")])
    assert "prefers-color-scheme:dark" in text and "<script" not in text
    assert not re.search(r'(src|href)="(?!data:)', text)
    for part in ("Problem", "Result", "Figure", "Minima found", "Check by an independent"):
        assert f"<h2>{part}" in text, part
    dark, light = re.findall(r'"data:image/png;base64,([^"]+)"', text)
    for data in (dark, light):
        assert base64.b64decode(data).startswith(b"\x89PNG")
    assert dark != light


@pytest.mark.slow
def test_a_pdf_has_its_text_and_the_figure(solution: dmoc.Solution, tmp_path: Path) -> None:
    content = solution.report(tmp_path / "r.pdf").read_bytes()
    assert content.startswith(b"%PDF-") and b"/Count 2" in content
    streams = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", content, re.DOTALL)
    pages = [s for s in map(_inflated, streams) if b"Tf" in s]
    assert len(pages) == 2
    assert solution.report(tmp_path / "again.pdf").read_bytes() == content


def _inflated(stream: bytes) -> bytes:
    try:
        return zlib.decompress(stream)
    except zlib.error:
        return b""


def test_a_report_says_what_was_found(solution: dmoc.Solution) -> None:
    parts = {table.title: table for table in tables(solution)}
    facts = {plain(row[0]): " ".join(plain(c) for c in row[1:]) for row in parts["Problem"].rows}
    assert (
        facts["sequence"] == "lower" and facts["mesh"] == "60 + 60 steps, order 2, constant inputs"
    )
    assert "m_p = 1" in facts["parameters"] and "F: -200 to 200" in facts["bounds"]
    assert facts["start"].startswith("alpha = 0.47124, alpha_dot = 0")
    rows = [[plain(c) for c in row] for row in parts["Minima found"].rows]
    assert rows[1] == ["200.5", "3", "solved", "60+60"] and rows[0][1] == "13"
    check = {
        plain(row[0]): plain(row[1]) for row in parts["Check by an independent simulation"].rows
    }
    assert check["passed"] == "yes" and check["missed contacts"] == "none"


@pytest.mark.slow
def test_reports_are_named_by_their_endings(solution: dmoc.Solution, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"end it in \.html or \.pdf"):
        solution.report(tmp_path / "r.docx")


def test_long_cells_of_a_pdf_go_on_below_themselves(
    solution: dmoc.Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Within the characters of a line, or in 20 where the cells before leave less."""
    words, wide = " ".join(["word"] * 60), "w" * 80
    shown = (
        Table((("a", words), ("longer", "x")), title="One", notes=(words,)),
        Table(((wide, words),), ("left", "right"), title="Two"),
    )
    monkeypatch.setattr(solution_report, "tables", lambda _: iter(shown))
    lines = list(solution_report._lines(solution))
    headings = [line for line, heading in lines if heading]
    assert headings == [solution_report.title_of(solution), "One", "Two"]
    texts = [line for line, _ in lines]
    one, two = texts.index("One"), texts.index("Two")
    first = texts[one + 1 : two - 1]
    assert max(map(len, first)) <= CHARACTERS and min(map(len, first[:3])) > CHARACTERS - 10
    assert [line[:8] for line in first[:5]] == ["a       "] + 3 * [" " * 8] + ["longer  "]
    second = texts[two + 1 :]
    assert second[0] == f"{'left':<82}right" and second[1][:82] == f"{wide}  "
    assert {line[:82] for line in second[2:]} == {" " * 82}
    assert {len(line) - 82 for line in second[1:]} == {19}


def test_what_is_stated_names_its_own_sides(solution: dmoc.Solution) -> None:
    """The start from the first node of the first phase, the end from the last node of the last."""
    motion = solution.trajectory
    phases = tuple(
        replace(p, q=p.q + 1 + i + np.arange(len(p.q))[:, None], v=p.v + 5 + i + p.t[:, None])
        for i, p in enumerate(motion.phases)
    )
    motion = replace(motion, phases=phases)
    moved = replace(solution, trajectory=motion)
    rows = dict(tuple(map(plain, row)) for row in next(tables(moved)).rows)
    for what, i in (("start", 0), ("end", -1)):
        pairs = dict(pair.split(" = ") for pair in rows[what].split(", "))
        phase = motion.phases[i]
        for name, q, v in zip(motion.coordinates, phase.q[i], phase.v[i], strict=True):
            assert float(pairs[name]) == pytest.approx(q, rel=1e-4, abs=1e-8)
            assert float(pairs[f"{name}_dot"]) == pytest.approx(v, rel=1e-4, abs=1e-8)
