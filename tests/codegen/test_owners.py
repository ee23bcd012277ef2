"""Who may own the folders of a kernel cache, and write to them: the folder itself, one above it,
and the one at the top."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from dmoc.codegen.private_files import objection

ME, ROOT_USER, OTHER = 1000, 0, 1001
PLAIN, SHARED, STICKY = 0o755, 0o777, 0o1777
FOLDER = Path("/first/middle/last")


@pytest.mark.parametrize(
    ("place", "owner", "mode", "why"),
    [
        (FOLDER, ME, PLAIN, None),
        (FOLDER, OTHER, PLAIN, "belongs to another user"),
        (FOLDER, ROOT_USER, PLAIN, "belongs to another user"),
        (FOLDER, ME, SHARED, "other users may write to"),
        (FOLDER, ME, STICKY, "other users may write to"),
        *(
            (above, *case)
            for above in (FOLDER.parent, FOLDER.parents[1])
            for case in (
                (ME, PLAIN, None), (ROOT_USER, PLAIN, None), (ROOT_USER, STICKY, None),
                (OTHER, PLAIN, "belongs to another user"),
                (OTHER, STICKY, "belongs to another user"),
                (ROOT_USER, SHARED, "other users may write to"),
                (ME, SHARED, "other users may write to"),
            )
        ),
    ],
)  # fmt: skip
def test_nobody_else_can_change_what_lies_in_a_folder(
    place: Path, owner: int, mode: int, why: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stat(path: Path) -> Any:
        mine = SimpleNamespace(st_uid=ME, st_mode=PLAIN)
        return SimpleNamespace(st_uid=owner, st_mode=mode) if path == place else mine

    monkeypatch.setattr(os, "geteuid", lambda: ME)
    monkeypatch.setattr(Path, "stat", stat)
    told = objection(FOLDER)
    monkeypatch.undo()
    assert told is None if why is None else told is not None and why in told and str(place) in told
