"""A planner in C, driven by states that a test writes, and its plans."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from carried_folder import compiled, run

import dmoc

MAIN = r"""
#include "NAME.h"
#include <stdio.h>
#include <stdlib.h>

static double memory[UPPER_PLANNER_MEMORY];

static double hours(void)
{
    static double now;
    return now += 3600;
}

int main(int count, char **words)
{
    const size_t bytes = dmoc_planner_memory(&NAME_rests);
    int phase, iterations, limited;
    double t, state[2*STATES], u[2];
    dmoc_planner *p = dmoc_planner_begin(&NAME_rests, memory, bytes - 1);
    if (p || bytes > sizeof memory)
        return 1;
    p = dmoc_planner_begin(&NAME_rests, memory, bytes);
    for (int i = 1; i + 1 < count; i += 2)
        dmoc_solver_set(dmoc_planner_solver(p), dmoc_solver_find(&NAME_problem, words[i]),
                        strtod(words[i + 1], NULL));
    while (scanf("%lf %d %d %d", &t, &phase, &iterations, &limited) == 4) {
        dmoc_limits limits = dmoc_solver_limits();
        for (int i = 0; i < 2*STATES; ++i)
            if (scanf("%lf", state + i) != 1)
                return 2;
        limits.iterations = iterations;
        if (limited)
            limits.clock = hours, limits.seconds = 1;
        const int own = limited || iterations;
        const int status = dmoc_planner_replan(p, t, state, phase, own ? &limits : NULL);
        const double end = dmoc_planner_end(p);
        const dmoc_end plan = dmoc_solver_end(dmoc_planner_solver(p));
        printf("%d %d %d %.17g %.17g %.17g", status, dmoc_planner_new(p), dmoc_planner_phase(p),
               dmoc_planner_origin(p), end, plan.cost);
        for (int i = 0; i <= 4; ++i) {
            dmoc_planner_input(p, t + 0.23*i*(end - t), u);
            printf(" %.17g", u[0]);
        }
        printf(" %s\n", dmoc_planner_sentence(status));
    }
    return 0;
}
"""


@dataclass(frozen=True)
class Step:
    """A state that is measured, in a phase that is known or not, with limits or without."""

    time: float
    state: tuple[float, ...]
    phase: int | None = None
    iterations: int = 0
    limited: bool = False


@dataclass(frozen=True)
class Planned:
    status: int
    new: bool
    phase: int
    origin: float
    end: float
    cost: float
    inputs: list[float]
    sentence: str


def planned(program: str, folder: Path, steps: list[Step], *words: str) -> list[Planned]:
    """What the planner of a folder makes of states, one after the other, with other numbers."""
    states = [
        (s.time, -1 if s.phase is None else s.phase, s.iterations, int(s.limited), *s.state)
        for s in steps
    ]
    text = "".join(" ".join(map(repr, row)) + "\n" for row in states)
    done = run(program, *words, folder=folder, stdin=text)
    assert done.returncode == 0, done.stderr
    rows = [line.split(" ", 11) for line in done.stdout.splitlines()]
    return [
        Planned(
            int(r[0]), r[1] == "1", int(r[2]), *map(float, r[3:6]), list(map(float, r[6:11])), r[11]
        )
        for r in rows
    ]


def folder_of(planner: dmoc.Planner, folder: Path) -> str:
    """The driver on the planner of a folder."""
    dmoc.generate_solver(planner, folder)
    names = {"NAME": folder.name, "UPPER": folder.name.upper()}
    text = MAIN.replace("STATES", str(planner.problem.model.nq))
    for word, name in names.items():
        text = text.replace(word, name)
    (folder / "driver.c").write_text(text)
    return compiled(folder, "driver.c")
