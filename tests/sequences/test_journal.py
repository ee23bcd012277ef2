"""The journal of a search: killed searches go on, other problems and damaged files are refused."""

from __future__ import annotations

import signal
import sqlite3
import subprocess
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from searches import seconds_of, suicidal

import dmoc
from dmoc.base.errors import SearchError
from dmoc.sequences.nodes import Node, Verdict
from dmoc.sequences.search import SearchResult

pytestmark = pytest.mark.slow


def test_a_killed_search_goes_on(tmp_path: Path, table: dmoc.Problem, pair: SearchResult) -> None:
    journal = tmp_path / "journal.sqlite"
    ended = subprocess.run(suicidal(journal, nodes=4), check=False)
    assert ended.returncode == -signal.SIGKILL
    before = seconds_of(journal)
    assert len(before) == 4
    result = dmoc.search(table, 2, journal=journal, resume=True)
    assert len(result.nodes) == 21 and result.complete
    after = {n.sequence: n.seconds for n in result.nodes}
    assert {s: after[s] for s in before} == before  # not solved again
    assert [n.cost for n in result.nodes] == pytest.approx([n.cost for n in pair.nodes], rel=1e-12)


def test_a_journal_of_another_problem_is_refused(table: dmoc.Problem, tmp_path: Path) -> None:
    path = tmp_path / "journal.sqlite"
    dmoc.search(table, 0, journal=path)
    with pytest.raises(SearchError, match="exists: resume it"):
        dmoc.search(table, 0, journal=path)
    with pytest.raises(SearchError, match="another problem"):
        dmoc.search(table.but(parameters={"m": 2.0}), 0, journal=path, resume=True)
    with pytest.raises(SearchError, match="another problem"):
        dmoc.search(table, 0, starts=1, journal=path, resume=True)
    with pytest.raises(SearchError, match="does not exist"):
        dmoc.search(table, 0, journal=tmp_path / "none", resume=True)
    with closing(sqlite3.connect(tmp_path / "foreign")) as foreign:
        foreign.execute("CREATE TABLE foreign_data (a)")
    with pytest.raises(SearchError, match="something else"):
        dmoc.search(table, 0, journal=tmp_path / "foreign", resume=True)
    (tmp_path / "empty").touch()  # left by a search that was killed at once
    assert len(dmoc.search(table, 0, journal=tmp_path / "empty", resume=True).nodes) == 1
    broken = tmp_path / "broken"
    broken.write_text("no database at all")
    with pytest.raises(SearchError, match="cannot be used as a journal"):
        dmoc.search(table, 0, journal=broken, resume=True)
    deeper = dmoc.search(table, 1, journal=path, resume=True)
    assert len(deeper.nodes) == 5


def test_what_failed_gets_another_chance(table: dmoc.Problem, tmp_path: Path) -> None:
    path = tmp_path / "journal.sqlite"
    assert dmoc.search(table, 0, journal=path, node_seconds=1e-6).nodes[0].verdict is Verdict.FAILED
    assert dmoc.search(table, 0, journal=path, resume=True).nodes[0].verdict is Verdict.OPTIMAL


def test_nodes_survive_the_journal(pair: SearchResult, weak: dmoc.Problem) -> None:
    for node in pair.nodes[:6]:
        again = Node.from_row(*node.to_row())
        assert again.to_dict() == node.to_dict()
        assert again.solution is not None and node.solution is not None
        np.testing.assert_array_equal(again.solution.unknowns, node.solution.unknowns)
    unreachable = dmoc.search(weak, 1).nodes[1]
    again = Node.from_row(*unreachable.to_row())
    assert (
        again.to_dict() == unreachable.to_dict() and again.solution is None is unreachable.solution
    )


def test_a_damaged_page_of_the_index_is_told(table: dmoc.Problem, tmp_path: Path) -> None:
    """All rows can be read from the table alone, and none could be written any more."""
    journal = tmp_path / "journal.sqlite"
    dmoc.search(table, 1, journal=journal)
    with closing(sqlite3.connect(journal)) as database:
        ((size,),) = database.execute("PRAGMA page_size")
        ((page,),) = database.execute(
            "SELECT rootpage FROM sqlite_master WHERE name = 'sqlite_autoindex_nodes_1'"
        )
    content = bytearray(journal.read_bytes())
    content[(page - 1) * size : page * size] = bytes(size)
    journal.write_bytes(content)
    with closing(sqlite3.connect(journal)) as database:
        assert len(list(database.execute("SELECT summary FROM nodes NOT INDEXED"))) == 5
    with pytest.raises(SearchError, match="is damaged: start anew with another file"):
        dmoc.search(table, 1, journal=journal, resume=True)
    assert journal.read_bytes() == content
