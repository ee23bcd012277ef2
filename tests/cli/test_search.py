"""`dmoc search`: what it writes and tells, also where something fails or Ctrl-C is pressed."""

from __future__ import annotations

import json
import signal
import sqlite3
import subprocess
import time
from functools import partial
from pathlib import Path

import pytest
from commands import Run, printed
from searches import command, seconds_of

import dmoc
from dmoc.sequences.journal import Journal
from dmoc.sequences.nodes import Node

pytestmark = pytest.mark.slow


def test_ctrl_c_ends_the_command_with_the_best_so_far(tmp_path: Path) -> None:
    for workers in ("1", "2"):
        journal = tmp_path / f"journal{workers}.sqlite"
        arguments = command(
            "--max-collisions", "5", "--workers", workers, "--journal", str(journal), "--json", "-"
        )
        # A shell that starts the tests in the background has its children ignore the signal.
        listening = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
        pipe = subprocess.PIPE
        running = subprocess.Popen(
            arguments, stdout=pipe, stderr=pipe, text=True, preexec_fn=listening
        )
        while running.poll() is None and len(seconds_of(journal)) < 4:
            time.sleep(0.02)
        running.send_signal(signal.SIGINT)
        out, err = running.communicate(timeout=60)
        result = json.loads(out)
        assert running.returncode == 0, err
        assert not result["complete"] and "interrupted" in result["notes"][0]
        assert 4 <= len(result["nodes"]) < 200


def test_the_command_writes_and_tells(tmp_path: Path) -> None:
    words = ("--surfaces", "east,west", "--out", str(tmp_path / "out"), "--workers", "2")
    text = printed(*command(*words))
    assert "best: east, west" in text and "optimal" in text
    written = {p.name for p in (tmp_path / "out").iterdir()}
    assert written == {"solution.npz", "tree.png", "best.png", "tree.html"}
    assert dmoc.Solution.load(tmp_path / "out" / "solution.npz").verify().passed


SEARCH = "search puck_table --steps 20 --max-collisions 1"


def test_a_search_keeps_its_result_where_a_figure_fails(
    run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise ValueError("no [room]")

    monkeypatch.setattr("dmoc.report.search_tree.plot_motions", fail)
    code, out, err = run(f"{SEARCH} --out o")
    assert code == 0 and "best: " in out and "written: " in out
    assert err.endswith("best.png was not drawn: ValueError: no [room]\n") and err.count("\n") == 1
    assert {p.name for p in (tmp_path / "o").iterdir()} == {"solution.npz", "tree.png", "tree.html"}


def test_a_search_that_a_full_disk_breaks_off_is_no_success(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was found is told and written, the node whose row had no room included."""
    add, added = Journal.add, []

    def full(journal: Journal, node: Node) -> None:
        if added:
            raise sqlite3.OperationalError("database or disk is full")
        added.append(node)
        add(journal, node)

    with monkeypatch.context() as patch:
        patch.setattr(Journal, "add", full)
        code, out, err = run(f"{SEARCH} --journal journal --out o --json j.json")
    assert code == 2 and "best: " in out and "2 sequences" in out and "note: journal" in out
    reason = (
        "could not be written (database or disk is full): the result is that of a search that was"
    )
    assert err == f"error: journal journal {reason} broken off. (dmoc explain SearchError)\n"
    assert len(json.loads(Path("j.json").read_text())["nodes"]) == 2
    assert Path("o/solution.npz").exists()
    assert run(f"{SEARCH} --journal journal --resume")[0] == 0
