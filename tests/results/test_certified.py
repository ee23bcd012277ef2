"""A solution shows the certificate that it was given."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dmoc
from dmoc.base.errors import ProblemError, SolutionFileError
from dmoc.base.table import plain
from dmoc.results.certificate import Certificate
from dmoc.results.solution_report import tables


@pytest.fixture
def certificate(solution: dmoc.Solution) -> Certificate:
    low, high = solution.cost - 1e-9, solution.cost + 1e-9
    return Certificate((), (low, high), 1e-8, 86, 1, 0.25, ("a force",), ("a row",), 0.5)


FAILED = Certificate(("the cost falls along a direction.",), seconds=0.1)


def test_print_report_and_json_show_it(solution: dmoc.Solution, certificate: Certificate) -> None:
    assert solution.certificate is None and solution.to_dict()["certificate"] is None
    certified = solution.with_certificate(certificate)
    assert solution.certificate is None and certified.certificate is certificate
    row = {plain(r[0]): plain(r[1]) for r in certified.summary().rows}["certificate"]
    low, high = certificate.cost or (0.0, 0.0)
    assert row.startswith("passed: a strict local minimum of the discrete program")
    assert row.endswith(f"its cost lies in [{low:.15g}, {high:.15g}]")
    (shown,) = [table for table in tables(certified) if table.title == "Certificate"]
    assert shown.rows == certificate.summary().rows
    data = certified.to_dict()["certificate"]
    assert data["proved"] and data["cost"] == (low, high) and data["radius"] == 1e-8


def test_why_there_is_none_is_shown_too(solution: dmoc.Solution) -> None:
    rows = solution.with_certificate(FAILED).summary().rows
    row = {plain(r[0]): plain(r[1]) for r in rows}["certificate"]
    assert row == "failed: the cost falls along a direction."


def test_a_file_keeps_it(solution: dmoc.Solution, certificate: Certificate, tmp_path: Path) -> None:
    for written in (certificate, FAILED):
        path = solution.with_certificate(written).save(tmp_path / "certified.npz")
        assert dmoc.Solution.load(path).certificate == written


def test_the_certificate_of_another_motion_is_refused(
    solution: dmoc.Solution, certificate: Certificate
) -> None:
    low, high = certificate.cost or (0.0, 0.0)
    other = replace(certificate, cost=(1.01 * low, 1.01 * high))
    with pytest.raises(ProblemError, match="the certificate is of a motion whose cost lies in"):
        solution.with_certificate(other)
    with pytest.raises(ProblemError, match=r"expected what dmoc\.certify returns"):
        solution.with_certificate("proved")  # type: ignore[arg-type]
    for wrong, sentence in (
        (other, "of a motion whose cost lies in"),
        (replace(certificate, cost=None), "has no condition that fails, and no cost"),
        (replace(certificate, radius=np.inf), "has no condition that fails, and no cost"),
    ):
        content = replace(solution, certificate=wrong).to_bytes()
        with pytest.raises(SolutionFileError, match=sentence):
            dmoc.Solution.from_bytes(content)
