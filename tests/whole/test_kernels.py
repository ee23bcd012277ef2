"""Answers under other kernels of BLAS: sets are asked in processes of their own and compared."""

from __future__ import annotations

import signal
import subprocess
from typing import Any

import hopper_spring
import kernels
import pytest
from kernels import Answer, differences

import dmoc


@pytest.mark.parametrize(
    "other",
    [
        Answer("infeasible", 3.0),
        Answer("solved", 3.0 + 4e-6),
        Answer("solved", float("nan")),
        Answer("solved"),
    ],
    ids=str,
)
def test_another_status_or_cost_is_a_difference(other: Answer) -> None:
    runs = {"Zen": {"a": Answer("solved", 3.0)}, "Prescott": {"a": other}}
    assert list(differences(runs)) == [f"! a: Zen: solved 3; Prescott: {other}"]


def test_rounding_is_none() -> None:
    runs = {"Zen": {"a": Answer("solved", -3.0)}, "Prescott": {"a": Answer("solved", -3.0 - 2e-6)}}
    assert not list(differences(runs))


@pytest.mark.slow
def test_a_run_has_the_kernel_of_its_name_and_says_what_is_solved(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[Any] = []
    run = subprocess.run

    def noted(command: Any, **options: Any) -> Any:
        asked.append(options["env"].get("OPENBLAS_CORETYPE"))
        return run(command, **options)

    monkeypatch.setattr(subprocess, "run", noted)
    monkeypatch.delenv("OPENBLAS_CORETYPE", raising=False)
    for name in ("Prescott", kernels.CHANGED):
        found = kernels.answers("known", name, "double integrator, rest to rest, order 4")
        assert found is not None
        (answer,) = found.values()
        assert answer.status == "solved" and answer.cost == pytest.approx(12.0, rel=1e-9)
    assert asked == ["Prescott", None]


def test_instructions_that_a_processor_lacks_are_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lacking = subprocess.CompletedProcess((), -signal.SIGILL, "", "")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: lacking)
    assert kernels.main(["ladder", "--runs", "SkylakeX"]) == 0
    told = capsys.readouterr().out
    assert "no instructions of SkylakeX" in told and "0 problems" in told


def test_all_parameters_are_changed_but_those_of_a_design(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dmoc, "solve", lambda problem, **options: (problem, options))
    monkeypatch.setattr(dmoc, "search", dmoc.search)
    kernels.change_parameters()
    stated = hopper_spring.problem()
    problem, options = dmoc.solve(stated, starts=3)
    changes = dict(zip(stated.kernels.parameters, problem.parameter_values[0], strict=True))
    for name, value in zip(stated.kernels.parameters, stated.parameter_values[0], strict=True):
        change = 0.0 if name in stated.design else -1e-12
        assert changes.pop(name) / value - 1 == pytest.approx(change, abs=1e-15), name
    assert stated.design and options == {"starts": 3}
