"""What programs, which start often, leave unloaded because it takes long."""

from __future__ import annotations

import sys

import pytest
from commands import printed

pytestmark = pytest.mark.slow

COMMAND = "import sys, dmoc.cli; sys.argv = ['dmoc'{}]\ntry: dmoc.cli.main()\n"
COMMAND += "except SystemExit: pass"
SOLVE = (
    "import dmoc; from dmoc.models.registry import find; r = find('cart_pendulum'); "
    "dmoc.solve(dmoc.Problem(r.kernels(), **{{**r.defaults, 'steps': {}}}){})"
)
COMPLETED = {
    "_DMOC_COMPLETE": "complete_bash",
    "COMP_CWORD": "4",
    "COMP_WORDS": "dmoc solve cart_pendulum --set m_p",
}


@pytest.mark.parametrize(
    ("code", "modules", "line"),
    [
        (
            COMMAND.format(", '--help'"),
            "numpy scipy sympy sqlite3 matplotlib multiprocessing",
            "Usage: dmoc",
        ),
        (
            COMMAND.format(", 'solve', '--help'"),
            "numpy dmoc.cli.search dmoc.cli.sweep dmoc.cli.animate dmoc.cli.doctor",
            "Usage: dmoc solve",
        ),
        (COMMAND.format(""), "numpy scipy sympy", "m_p="),
        ("import dmoc.solving.methods", "numpy scipy sympy", ""),
        ("import dmoc.check.check", "scipy sympy", ""),
        ("import dmoc; dmoc.solve_many", "multiprocessing", ""),
        ("import dmoc; dmoc.read_robot", "mujoco", ""),
        (
            SOLVE.format(100, ", 'ipm'"),
            "scipy sympy matplotlib sqlite3 rich typer multiprocessing",
            "",
        ),
        (SOLVE.format(10, ""), "sympy", ""),
    ],
    ids=[
        "help",
        "help of a command",
        "completion",
        "methods",
        "check",
        "many",
        "robots",
        "solve",
        "solve by default",
    ],
)
def test_it_loads_none_of_these(
    request: pytest.FixtureRequest, code: str, modules: str, line: str
) -> None:
    env = COMPLETED if "completion" in request.node.name else {}
    code += f"\nimport sys; print(sorted(set({modules.split()}) & set(sys.modules)))"
    *text, loaded = printed(sys.executable, "-c", code, env=env).splitlines()
    assert loaded == "[]" and line in "\n".join(text)


def test_a_command_does_not_look_through_what_its_modules_made() -> None:
    code = (
        "import gc, sys; from dmoc.__main__ import main; sys.argv = 'dmoc solve "
        "cart_pendulum --method ipm --json -'.split()\n"
        "try: main()\nexcept SystemExit: print(gc.get_stats()[2]['collections'])"
    )
    before = printed(sys.executable, "-c", "import gc; print(gc.get_stats()[2]['collections'])")
    assert printed(sys.executable, "-c", code).splitlines()[-1] == before.strip()
