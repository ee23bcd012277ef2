"""Runs of the words with budgets of CPU time: dmoc and its peer, records, table and figure."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from math import inf, isfinite, nan
from pathlib import Path
from statistics import mean
from typing import Any

import best_of_word_known as known
import best_of_word_peer as peer
from best_of_word_known import Best
from best_of_word_problems import NAMED, WORDS, Word
from common import Section, filled, machine

import dmoc
from dmoc.base.files import write_whole

SHARE = 0.01  # of the best known cost, within which one counts as found
FOLDER = Path(__file__).parent / "results"
BUILT = Path(__file__).resolve().parent.parent / "build" / "best_of_word"
RECORDS = "best_of_word_runs.json"
PEER = "CasADi + IPOPT"
LINES = 20

Record = dict[str, Any]


@dataclass(frozen=True)
class Answer:
    """What one solve says, its starts and CPU seconds."""

    name: str
    status: str
    cost: float = nan
    starts: int = 0
    agreeing: int = 0
    cpu: float = nan

    def near(self, best: Mapping[str, Best]) -> bool:
        """Whether it is confirmed, and costs hardly more than the best known motion."""
        return self.status == "solved" and best[self.name].within(SHARE, self.cost)


def by_default(name: str, **options: Any) -> Answer:
    """The default call."""
    problem = NAMED[name].problem
    begin = time.process_time()
    try:
        solution = dmoc.solve(problem, **options)
    except dmoc.DmocError as error:
        return Answer(name, f"{type(error).__name__}: {error}")
    return Answer(
        name, str(solution.status), float(solution.cost), solution.starts or 1,
        solution.agreeing_starts or 0, time.process_time() - begin,
    )  # fmt: skip


def on_cpu_clock() -> None:
    """Start this command again, with limits of CPU seconds for those of the clock."""
    library = BUILT / "cpu_clock.so"
    if os.environ.get("LD_PRELOAD") == str(library):
        return
    BUILT.mkdir(parents=True, exist_ok=True)
    source = str(Path(__file__).with_name("cpu_clock.c"))
    subprocess.run(["cc", "-shared", "-fPIC", "-O2", "-o", str(library), source], check=True)
    environment = {**os.environ, "LD_PRELOAD": str(library)}
    os.execve(sys.executable, [sys.executable, *sys.argv], environment)


def run(budgets: Sequence[float], name: str) -> Record:
    """A word by the default call, by the same with budgets, and by the peer until the longest."""
    record: Record = {"name": name, "default": asdict(by_default(name))}
    record["budgets"] = [[b, asdict(by_default(name, seconds=b))] for b in budgets]
    try:
        record["peer"] = _confirmed(NAMED[name], max(budgets))
    except peer.NotStatedError as reason:
        record["not stated"] = str(reason)
    return record


def _confirmed(word: Word, seconds: float) -> list[tuple[float, float]]:
    """CPU seconds and costs of what the peer finds from its lines.

    What claims to be cheaper than all before is solved by dmoc from there.  It counts, if that is
    confirmed, with the larger one of both costs: a solve may lead to another minimum, and a
    collocation may be wrong between its nodes.
    """
    costs, least = list[tuple[float, float]](), sys.float_info.max
    for motion in peer.motions(word, seconds, LINES):
        if motion.cost >= least - known.CHEAPER * abs(least):
            continue
        solution = known.confirmed(word.problem, motion.guess)
        cost = inf if solution is None else max(motion.cost, float(solution.cost))
        if cost < least:
            costs.append((motion.cpu, cost))
            least = cost
    return costs


# Records ------------------------------------------------------------------------------------------


def read(folder: Path) -> dict[str, Record]:
    path = folder / RECORDS
    if not path.exists():
        return {}
    return {r["name"]: r for r in json.loads(path.read_text(encoding="utf-8"))}


def keep(new: Iterable[Record], folder: Path) -> None:
    """Write records as they come, beside those of other words."""
    folder.mkdir(parents=True, exist_ok=True)
    records = read(folder)
    for record in new:
        records[record["name"]] = record
        lines = ",\n".join(json.dumps(r) for _, r in sorted(records.items()))
        write_whole(folder / RECORDS, f"[\n{lines}\n]\n".encode())
        sys.stderr.write(f"{record['name']}\n")


# Report -------------------------------------------------------------------------------------------


def report(folder: Path) -> Section:
    """The table of shares, into best_of_word.md with that of the words, and the figure."""
    best, records = known.read(), read(folder)
    chosen = [records[word.name] for word in WORDS if word.name in records]
    shares, words = _shares(chosen, best), _every(chosen, best)
    head = f"# The best motion of a word\n\n{filled(f'Machine: {machine()}.')}\n"
    text = "\n".join([head, shares.markdown(), words.markdown()])
    (folder / "best_of_word.md").write_text(text, encoding="utf-8")
    _draw(chosen, best, folder / "best_of_word.png")
    return shares


def _shares(records: Sequence[Record], best: Mapping[str, Best]) -> Section:
    stated = [r for r in records if "peer" in r]
    section = Section(
        "Share within 1 % of the best known cost",
        f"{len(records)} problems with one sequence each, from no guess. Budgets are CPU seconds "
        "of one core, without kernels and programs, which are built before; `no limit` is the "
        f"default call. {PEER}: Hermite and Simpson's rule with the same phases and the law of "
        f"impact, from {LINES} broken straight lines with random durations and places of the "
        "events, one after the other; a motion counts where dmoc's check confirms what it leads "
        f"to. {len(records) - len(stated)} problems are not stated for it: a dash below.",
        [
            "CPU s", f"dmoc, of {len(records)}", f"dmoc, of {len(stated)}",
            f"{PEER}, of {len(stated)}",
        ],
    )  # fmt: skip
    for i, (budget, _) in enumerate(records[0]["budgets"] if records else []):
        own = {r["name"]: Answer(**r["budgets"][i][1]).near(best) for r in records}
        by_peer = [_near_at(r, best, budget) for r in stated]
        section.row(
            f"{budget:g}", _share(list(own.values())), _share([own[r["name"]] for r in stated]),
            _share(by_peer),
        )  # fmt: skip
    defaults = [Answer(**r["default"]) for r in records]
    named = {r["name"] for r in stated}
    if records:
        cpu = mean(a.cpu for a in defaults if isfinite(a.cpu))
        section.row(
            f"no limit: {cpu:.2f} on average", _share([a.near(best) for a in defaults]),
            _share([a.near(best) for a in defaults if a.name in named]), "-",
        )  # fmt: skip
    return section


def _every(records: Sequence[Record], best: Mapping[str, Best]) -> Section:
    section = Section(
        "Each problem",
        "Costs as shares of the best known one; CPU seconds of the default, and those after which "
        f"{PEER} has its best one of {LINES} lines. Not within 1 %: in bold.",
        [
            "problem", "best known", "from", "default", "CPU s", "starts", "agreeing", PEER,
            "after, s",
        ],
    )  # fmt: skip
    for record in records:
        answer, least = Answer(**record["default"]), best[record["name"]]
        ratio = f"{answer.cost / least.cost:.4f}" if answer.status == "solved" else answer.status
        section.row(
            record["name"], f"{least.cost:.7g}", least.source,
            ratio if answer.near(best) else f"**{ratio}**", f"{answer.cpu:.2f}", answer.starts,
            answer.agreeing, *_peer_cells(record, least),
        )  # fmt: skip
    return section


def _peer_cells(record: Record, least: Best) -> tuple[str, str]:
    if "peer" not in record:
        return "-", "-"
    if not record["peer"]:
        return "**none**", "-"
    cpu, cost = min(record["peer"], key=lambda pair: pair[1])
    ratio = f"{cost / least.cost:.4f}"
    return ratio if least.within(SHARE, cost) else f"**{ratio}**", f"{cpu:.2f}"


def _near_at(record: Record, best: Mapping[str, Best], seconds: float) -> bool:
    """Whether the peer has a motion near the best known one after some seconds."""
    near = best[record["name"]].within
    return any(cpu <= seconds and near(SHARE, cost) for cpu, cost in record["peer"])


def _share(near: Sequence[bool]) -> str:
    return f"{sum(near)}, {100 * sum(near) / len(near):.0f} %" if near else "-"


def _draw(records: Sequence[Record], best: Mapping[str, Best], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    stated = [r for r in records if "peer" in r]
    budgets = [budget for budget, _ in records[0]["budgets"]] if records else []

    def shares(of: Sequence[Record], near: Callable[[Record, int], bool]) -> list[float]:
        return [100 * mean(near(r, i) for r in of) for i in range(len(budgets))]

    figure, axes = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
    own = shares(records, lambda r, i: Answer(**r["budgets"][i][1]).near(best))
    axes.semilogx(budgets, own, "o-", label=f"dmoc, {len(records)} problems")
    if stated:
        by_peer = shares(stated, lambda r, i: _near_at(r, best, budgets[i]))
        axes.semilogx(budgets, by_peer, "s--", label=f"{PEER}, {len(stated)} of them")
    axes.set(xlabel="CPU time (s)", ylabel="within 1 % of the best known (%)", ylim=(0, 101))
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right", frameon=False)
    figure.savefig(path, dpi=150)
    plt.close(figure)
