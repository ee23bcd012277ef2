"""Twenty-three problems whose sequence nobody names: proposals, the tree and nosnoc with one budget
of time, all motions judged by the referee.

python benchmarks/twenty.py                        all, into results/twenty.md and twenty.json
python benchmarks/twenty.py --only puck,hops       some of them
python benchmarks/twenty.py --tools propose,tree --again --seconds 120

What twenty.json has is kept: a run that was stopped goes on where it was.  Each solve has a process
of its own, whose seconds and CPU seconds are those of the search or the solve, without kernels and
referee; nosnoc's have its building.  `pip install nosnoc==0.2.0` adds nosnoc.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from math import inf, isfinite
from pathlib import Path
from typing import Any

import nosnoc_problems
from common import Section, filled, machine
from referee import judge
from referee_motion import read_claim
from twenty_problems import CASES, NOT_STATED, Case

import dmoc
from dmoc.base.files import write_whole

SECONDS = 40.0
STARTING = 60.0  # seconds for kernels and the referee beside a budget
STARTING_NOSNOC = 15.0  # less, because it is stopped: a solve of it does not know its budget
DEPTH = 3  # of the tree, where the best known word is no longer
CLOCKS = ("seconds", "cpu")
SAME = 0.01  # share of a cost within which it is that of the best known motion
FOLDER = Path(__file__).parent / "results"
MOTIONS = Path(__file__).parent.parent / "build" / "twenty"  # tables, as the referee takes them
MISSING = "not installed"

Record = dict[str, Any]


# One solve ----------------------------------------------------------------------------------------


def named(case: Case, seconds: float, motion: Path) -> Iterator[Record]:
    """The best known word, solved as a user would who knows it."""
    problem = case.named
    begin = clocks()
    solution = dmoc.solve(problem, seconds=seconds)
    record: Record = {"status": str(solution.status), **_since(begin)}
    record |= {"contacts": list(problem.contacts), "word": list(case.word)}
    if solution.solved:
        solution.to_csv(motion)
        record |= _verdict(problem, motion, solution.cost)
    yield record


def searched(strategy: str) -> Callable[[Case, float, Path], Iterator[Record]]:
    """A search that is told nothing of the sequence; the tree goes as deep as the best known."""

    def search(case: Case, seconds: float, motion: Path) -> Iterator[Record]:
        depth = max(DEPTH, len(case.word)) if strategy == "tree" else DEPTH
        problem = case.problem()
        begin = clocks()
        result = dmoc.search(problem, depth, strategy=strategy, seconds=seconds)
        record: Record = {
            "status": "complete" if result.complete else "stopped", **_since(begin),
            "verdicts": {str(verdict): n for verdict, n in result.counts.items()},
            "proposals": [p.to_dict() for p in result.proposals],
        }  # fmt: skip
        best = result.best
        if best is None or best.solution is None:
            yield record
            return
        own = sum(p.starts for p in result.proposals if p.sequence == best.sequence)
        record |= {"contacts": list(result.problem.contacts), "word": list(best.sequence)}
        record["often"] = [own, sum(p.starts for p in result.proposals)]
        best.solution.to_csv(motion)
        yield record | _verdict(result.problem.but(sequence=best.sequence), motion, best.cost)

    return search


def by_nosnoc(case: Case, seconds: float, motion: Path) -> Iterator[Record]:
    """What nosnoc finds with one setting after the other; it is stopped at the end of its
    budget."""
    if nosnoc_problems.version() is None:
        yield {"status": MISSING}
        return
    problem, system, begin = case.problem(), case.system(), clocks()
    for setting in nosnoc_problems.SETTINGS:
        record: Record = {"setting": asdict(setting)}
        try:
            status, cost = nosnoc_problems.solve(system, problem, setting, motion)
        except nosnoc_problems.NotStatedError as reason:
            yield {"status": f"not stated: {reason}"}
            return
        record |= {"status": status, **_since(begin)}
        yield record | _verdict(problem, motion, cost)


TOOLS = {
    "named": named, "propose": searched("propose"), "tree": searched("tree"), "nosnoc": by_nosnoc,
}  # fmt: skip


def clocks() -> tuple[float, float]:
    return time.perf_counter(), time.process_time()


def _since(begin: tuple[float, float]) -> Record:
    wall, cpu = clocks()
    return {"seconds": wall - begin[0], "cpu": cpu - begin[1]}


def _verdict(problem: dmoc.Problem, motion: Path, claimed: float) -> Record:
    """What the referee says of a motion."""
    judged: Record = {"claimed": claimed}
    try:
        judgement = judge(problem, read_claim(motion, problem), claimed)
    except dmoc.DmocError as error:
        return judged | {"agrees": False, "refused": str(error)}
    against = [v.text for v in judgement.violations]
    if not judgement.agrees and not against:
        against = [f"{judgement.deviation:.2g} of its size off, {judgement.deviation_of}"]
    return judged | {
        "cost": judgement.cost if isfinite(judgement.cost) else None,
        "agrees": judgement.agrees, "refused": "; ".join(against),
        "followed": judgement.followed, "frozen": judgement.frozen_cost,
    }  # fmt: skip


def unit(name: str, tool: str, seconds: float, folder: Path) -> Iterator[Record]:
    """The motions of one tool, found in this process."""
    case = next(case for case in CASES if case.name == name)
    return TOOLS[tool](case, seconds, folder / f"{name}_{tool}.csv")


def run(name: str, tool: str, seconds: float) -> Record:
    """The same in a process of its own, which ends with its budget."""
    command = [sys.executable, __file__, "--unit", name, tool, "--seconds", str(seconds)]
    threads = {f"{kind}_NUM_THREADS": "1" for kind in ("OMP", "OPENBLAS")}
    output, error, late = "", "no message", False
    try:
        done = subprocess.run(
            command, capture_output=True, text=True,
            timeout=seconds + (STARTING_NOSNOC if tool == "nosnoc" else STARTING),
            env=os.environ | threads,
        )  # fmt: skip
        output, error = done.stdout, (done.stderr.strip().splitlines() or [error])[-1]
    except subprocess.TimeoutExpired as stopped:
        output, late = (stopped.stdout or b"").decode(), True
    records = [json.loads(line) for line in output.splitlines() if line.startswith("{")]
    head = {"problem": name, "tool": tool, "budget": seconds}
    if not records:
        return head | {"status": f"more than {seconds:.0f} s" if late else f"error: {error[:200]}"}
    best = min(records, key=lambda r: (not r.get("agrees"), r.get("cost") or inf))
    times = {"seconds": seconds} if late else {k: v for k, v in records[-1].items() if k in CLOCKS}
    return head | best | times


# The report ---------------------------------------------------------------------------------------


def section(records: Sequence[Mapping[str, Any]], seconds: float) -> Section:
    """The table of some records, those of a problem in a row."""
    by = {(record["problem"], record["tool"]): record for record in records}
    made = Section(
        "Problems without their sequence",
        f"At most {seconds:.0f} s for each tool and problem, one process. Contacts: surfaces and "
        "rails; events: hits and changes of contact and friction. Twenty problems have two of "
        "either or more, three (DISCM, transport, landing) one. The best known motion has a "
        "closed form, or comes from its words when they are named, or from proposals, which then "
        "meet it by construction; beside it is a solve of its words in this run. The tree goes as "
        "deep as the best known word, at least "
        f"{DEPTH}, which is a hint; proposals have none. Costs are recomputed by the referee "
        "(docs/referee.md); in brackets where it refuses the motion. A star: within 1 % of the "
        "best known. How often: relaxed starts that led to the word, of those that led to any; 0 "
        "where a neighbour of a proposal is best. nosnoc is stated from the same model "
        "(benchmarks/nosnoc_problems.py), with two settings one after the other, of which the "
        "better counts; its seconds have its building.",
        [
            "problem", "known: contacts", "events", "cost", "source", "named",
            "propose: cost", "often", "s", "CPU s", "tree: cost", "s", "CPU s",
            "nosnoc: cost", "claimed", "s", "CPU s", "published: cost", "remark",
        ],
        after=_after(by),
    )  # fmt: skip
    for case in CASES:
        of = {tool: by[case.name, tool] for tool in TOOLS if (case.name, tool) in by}
        if of:
            made.row(*_row(case, of))
    return made


def _row(case: Case, of: Mapping[str, Mapping[str, Any]]) -> list[str]:
    named, propose, tree, nosnoc = (of.get(tool, {}) for tool in TOOLS)
    often = propose.get("often")
    published = "-" if case.published is None else f"{case.published:.6g}"
    system, events = case.system(), sum(len(word.split()) for word in case.word)
    contacts = len({*system.surfaces, *system.tangents})
    return [
        case.title, str(contacts), str(events), f"{case.cost:.5g}", case.source, _cost(case, named),
        _cost(case, propose), f"{often[0]} of {often[1]}" if often else "-", *_times(propose),
        _cost(case, tree), *_times(tree), _cost(case, nosnoc),
        _number(nosnoc.get("claimed")), *_times(nosnoc), published, case.remark or "-",
    ]  # fmt: skip


def _cost(case: Case, record: Mapping[str, Any]) -> str:
    """The recomputed cost, or why there is none."""
    if record.get("cost") is None:
        status = record.get("status", "not run")
        if "word" not in record and status in ("complete", "stopped"):
            return "none"
        return str(record.get("refused") or status)[:40]
    text = _number(record["cost"])
    best = "*" if record["cost"] <= case.cost + SAME * abs(case.cost) else ""
    return f"{text}{best}" if record["agrees"] else f"({text})"


def _times(record: Mapping[str, Any]) -> tuple[str, str]:
    return tuple(f"{record[k]:.1f}" if k in record else "-" for k in ("seconds", "cpu"))


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.5g}"


def _words_of(case: Case, by: Mapping[tuple[str, str], Mapping[str, Any]]) -> str:
    """The words of the best known motion, and those of searches that found others."""
    best = _words(case.named.contacts, case.word)
    others = [(tool, by.get((case.name, tool), {})) for tool in ("propose", "tree")]
    searched = [(tool, _words(r["contacts"], r["word"])) for tool, r in others if "word" in r]
    return "; ".join([best, *(f"{tool} {words}" for tool, words in searched if words != best)])


def _words(contacts: Sequence[str], words: Sequence[str]) -> str:
    """A sequence, with what is closed at the start in brackets."""
    closed = f"({', '.join(contacts)}) " if contacts else ""
    return closed + (", ".join(words) or "none")


def _after(by: Mapping[tuple[str, str], Mapping[str, Any]]) -> str:
    """What the referee has against motions, who is missing, and what is not stated."""
    against = [
        f"- {name}, {tool}: {record['refused']}."
        for (name, tool), record in by.items() if record.get("refused")
    ]  # fmt: skip
    texts = []
    if any(record.get("status") == MISSING for record in by.values()):
        texts.append("nosnoc is not installed: `pip install nosnoc==0.2.0`.")
    if against:
        texts.append("Refused:\n" + "\n".join(against))
    texts.append("Words, with what is closed at the start in brackets:\n" + "\n".join(
        f"- {case.title}: {_words_of(case, by)}."
        for case in CASES if any(name == case.name for name, _ in by)
    ))  # fmt: skip
    left_out = "\n".join(f"- {what}: {why}." for what, why in NOT_STATED)
    return "\n\n".join([*texts, f"Not stated:\n{left_out}"])


# The command --------------------------------------------------------------------------------------


def every(
    names: Sequence[str], tools: Sequence[str], seconds: float, folder: Path, again: bool = False
) -> list[Record]:
    """Solve what the file has not; it is written after each solve."""
    path = folder / "twenty.json"
    folder.mkdir(parents=True, exist_ok=True)
    MOTIONS.mkdir(parents=True, exist_ok=True)
    records = json.loads(path.read_text()) if path.exists() else []
    for name in names:
        for tool in tools:
            here = [r for r in records if (r["problem"], r["tool"]) == (name, tool)]
            if here and not again and here[0]["budget"] == seconds:
                continue
            record = run(name, tool, seconds)
            records = [r for r in records if r not in here] + [record]
            write_whole(path, json.dumps(records, indent=1).encode())
            sys.stderr.write(f"{name} {tool}: {record['status']}, {record.get('cost')}\n")
    return [r for r in records if r["problem"] in names]


def compare(quick: bool, folder: Path) -> Section:
    """For `run.py`: all of them, or the first with a small budget, which are not kept."""
    if quick:
        names, seconds = [case.name for case in CASES[:3]], 5.0
        return section(every(names, list(TOOLS), seconds, MOTIONS, again=True), seconds)
    made = section(every([case.name for case in CASES], list(TOOLS), SECONDS, folder), SECONDS)
    _write(made, folder)
    return made


def _write(made: Section, folder: Path) -> None:
    text = f"# Twenty-three problems\n\n{filled(f'Machine: {machine()}.')}\n\n{made.markdown()}"
    (folder / "twenty.md").write_text(text, encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    names = [case.name for case in CASES]
    parser.add_argument("--only", default=",".join(names), help="problems: " + ", ".join(names))
    parser.add_argument("--tools", default=",".join(TOOLS), help="tools: " + ", ".join(TOOLS))
    parser.add_argument("--seconds", type=float, default=SECONDS, help="budget of each solve")
    parser.add_argument("--again", action="store_true", help="solve what the file has, too")
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder of the records")
    parser.add_argument("--unit", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.unit:
        for record in unit(*options.unit, options.seconds, MOTIONS):
            print(json.dumps(record), flush=True)
        return
    chosen, tools = options.only.split(","), options.tools.split(",")
    for kind, values, possible in (("only", chosen, names), ("tools", tools, list(TOOLS))):
        if unknown := [value for value in values if value not in possible]:
            parser.error(f"--{kind} {unknown[0]}: expected some of {', '.join(possible)}")
    records = every(chosen, tools, options.seconds, options.out, options.again)
    report = section(records, options.seconds)
    if chosen == names and tools == list(TOOLS):
        _write(report, options.out)
    print(report.markdown())


if __name__ == "__main__":
    main()
