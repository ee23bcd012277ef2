"""Pages that plan: what they hold, how large they are, and what is refused.  What they do is tried
in a browser: tests/browser/test_planner.py."""

from __future__ import annotations

import base64
import gzip
import json
import re
import sys
from pathlib import Path
from typing import Any

import pytest
from systems import block_system

import dmoc
from dmoc.base.errors import MissingExtraError, OutputError, ProblemError
from dmoc.export.numbers import Number
from dmoc.export.page import _slider
from dmoc.models.registry import find

DATA = re.compile(r'<script type="application/json" id="film">(.*?)</script>', re.S)
MOST = 400_000  # bytes of the page of the swing-up
# What WebAssembly begins with, and its section of what it asks for.
MAGIC, IMPORTS = b"\0asm\1\0\0\0", 2
PURE = {"memcpy", "memmove", "memset", "sin", "cos", "log", "pow", "fmin", "fmax"}


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, without_library: None) -> str:
    reference = find("cart_pendulum")
    problem = dmoc.Problem(reference.kernels(2), **reference.defaults).but(steps=50)
    target = tmp_path_factory.mktemp("page") / "swing_up.html"
    assert dmoc.generate_page(problem, target) == target
    return target.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def plan(page: str) -> dict[str, Any]:
    (text,) = DATA.findall(page)
    problem: dict[str, Any] = json.loads(text)["plan"]
    return problem


@pytest.mark.slow
def test_a_page_is_small_and_fetches_nothing(page: str) -> None:
    assert len(page.encode()) < MOST
    outside = page.replace("http://www.w3.org/2000/svg", "")  # the name of a language
    fetching = r"https?:|//[a-z]+\.|\ssrc\s*=|@import|url\(|<link|<iframe|fetch\("
    assert not re.search(fetching, outside)
    policy = r"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-[^']*'"
    assert re.search(policy + " 'wasm-unsafe-eval'; worker-src blob:\"", page)


def sections(code: bytes) -> dict[int, bytes]:
    """Sections of WebAssembly by their numbers."""
    contents, at = dict[int, bytes](), len(MAGIC)
    while at < len(code):
        kind, size, shift = code[at], 0, 0
        while True:
            at += 1
            size |= (code[at] & 127) << shift
            shift += 7
            if code[at] < 128:
                break
        contents[kind] = code[at + 1 : at + 1 + size]
        at += 1 + size
    return contents


def imports(code: bytes) -> set[str]:
    """The functions that WebAssembly asks for, with the names of what has them."""
    content, at, names = sections(code)[IMPORTS], 1, set[str]()
    for _ in range(content[0]):
        words = []
        for _ in range(2):
            words.append(content[at + 1 : at + 1 + content[at]].decode())
            at += 1 + content[at]
        names.add(".".join(words))
        at += 2  # that it is a function, and its type
    return names


@pytest.mark.slow
def test_the_solver_asks_for_the_time_alone(plan: dict[str, Any]) -> None:
    """And for functions of numbers and memory, where it is linked without C's library."""
    code = gzip.decompress(base64.b64decode(plan["solver"]))
    assert code.startswith(MAGIC)
    assert imports(code) - {f"env.{name}" for name in PURE} == {"page.seconds"}


@pytest.mark.slow
def test_every_number_of_the_solver_has_a_slider(plan: dict[str, Any]) -> None:
    """Those of docs/carrying.md; the value lies between the ends."""
    names = {number["name"] for number in plan["numbers"]}
    assert {"start.alpha", "start.x", "goal.alpha", "final_time.high", "bounds.F.low"} <= names
    assert {f"parameters.{p}" for p in ("m_p", "m_c", "l", "g", "alpha_min", "alpha_max")} <= names
    for number in plan["numbers"]:
        most = number["group"] == "restitution"  # which is 1
        assert number["low"] < number["value"] < number["high"] + most
        assert number["group"] in plan["groups"]


@pytest.mark.parametrize(
    ("number", "low", "high"),
    [
        (Number(("parameters", "m"), 4.0), 0.4, 8.0),
        (Number(("parameters", "m"), -4.0), -8.0, -0.4),
        (Number(("parameters", "m"), 0.0), -1.0, 1.0),
        (Number(("restitution", "wall"), 0.5, kind="share"), 0.05, 1.0),
        (Number(("bounds", "F"), -3.0, side=0), -6.0, -0.3),
        (Number(("bounds", "x"), 3.0, side=1), 0.3, 6.0),  # is no state
        (Number(("final_time",), 5.0), 0.5, 10.0),
        (Number(("start", "x"), 0.5), -2.5, 3.5),  # half of what the motion covers
        (Number(("goal", "x"), -9.0), -13.5, -4.5),  # half of itself
        (Number(("via", 0, "x"), 0.0), -3.0, 3.0),
        (Number(("start", "y"), 0.0), -1.0, 1.0),
        (Number(("start", "y"), 0.5), 0.25, 0.75),
    ],
)
def test_a_slider_reaches_around_its_number(number: Number, low: float, high: float) -> None:
    """The motion covers 6 m along x, and nothing along y."""
    slider = _slider(number, {}, {}, {"x": 6.0, "y": 0.0})
    assert (slider["low"], slider["high"]) == pytest.approx((low, high))
    assert slider["value"] == number.value and slider["name"] == number.name


def throw(**changes: Any) -> dmoc.Problem:
    return dmoc.Problem(
        dmoc.build(block_system("thrown")), start={"x": 0, "x_dot": 0}, goal={"x": 0, "x_dot": 0},
        sequence=["wall"], steps=10, final_time=1.0, **changes,
    )  # fmt: skip


def test_pages_that_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    reference = find("puck_table")
    puck = dmoc.Problem(reference.kernels(), **reference.defaults)
    with pytest.raises(ProblemError, match="'thrown' has no drawing, which a page shows: give it"):
        dmoc.generate_page(throw(), tmp_path / "page.html")
    with pytest.raises(OutputError, match=r"page\.htm is no page: end it in \.html"):
        dmoc.generate_page(puck, tmp_path / "page.htm")
    with pytest.raises(OutputError, match="cannot be written"):
        dmoc.generate_page(puck, "/proc/nowhere/page.html")
    monkeypatch.setitem(sys.modules, "ziglang", None)
    with pytest.raises(MissingExtraError, match=r"install it with `pip install 'dmoc\[cc\]'`"):
        dmoc.generate_page(puck, tmp_path / "page.html")
    assert not list(tmp_path.iterdir())
