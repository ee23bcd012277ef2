"""What of an event its law does not allow, just inside and just outside each limit: at the first
and at the last surface, before the event and after it."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dmoc.check import events
from dmoc.check.contact_forces import BEARABLE, TURNED
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.contacts import Contacts

Row = tuple[float, ...]
ON = (0, 1)
SIZES: Any = SimpleNamespace(rate=np.array([2.0, 2.0, 2.0]), slide=np.array([2.0, 2.0]))
SLACK = 0.1


def passage(
    law: Mapping[str, Any] | None = None,
    planned: tuple[Row, Row] = ((0.0, 0.0, 0.0), (0.0, 0.0)),
    rates: tuple[Row, Row] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    sliding: tuple[Row, Row] = ((0.0, 0.0), (0.0, 0.0)),
    event: Mapping[str, Any] | None = None,
    **fields: Any,
) -> Any:
    """An event of a mass between three surfaces, of which the first and the last have a tangent; at
    places (1) and (2) the surfaces answer to impulses with 1/q.  Velocities are numbers of sliding
    velocities, before the event and after it."""
    outcome = {
        "normal": np.zeros((1, 3)), "tangential": np.zeros((1, 2)), "course": "", "unheld": (),
        "velocity": np.array([[1.0]]),
    } | dict(law or {})  # fmt: skip
    of_velocity = {0.0: sliding[0], 1.0: sliding[1]}
    there = SimpleNamespace(
        bearing=lambda normal: 0.5 * normal[[0, 2]], friction=np.array([0.5, 0.5]),
        hit_friction=np.array([0.5, np.inf]),
    )  # fmt: skip
    model = SimpleNamespace(
        kernels=SimpleNamespace(surfaces=("floor", "wall", "roof"), tangents=("along", "above")),
        contacts=Contacts(("floor", "wall", "roof"), ("floor", "roof")), nj=0, gripped=(),
        supports=(0, 2), surface_numbers={"floor": 0, "wall": 1, "roof": 2},
        responses=lambda q, n, t: n / q[0], in_impact_at=lambda q, t: there,
        with_friction_at=lambda q, t: there,
        slide_rates=lambda q, v, t: np.array(of_velocity[float(np.ravel(v)[0])]),
    )  # fmt: skip
    c = {"surface": "", "impulse": 0.0, "time": 1.0, "grazes": False, "lands": (), "leaves": ()}
    q, v = np.array([[1.0], [2.0]]), np.array([[5.0], [0.0]])
    stated = {
        "model": model, "c": SimpleNamespace(**c | {"course": "", "off": ()} | dict(event or {})),
        "law": SimpleNamespace(**outcome), "planned": tuple(map(np.array, planned)),
        "before": SimpleNamespace(q=q, v=v, rubbing={}), "after": SimpleNamespace(q=q[::-1], v=v),
        "normals": np.eye(3)[:, :1], "mode": Mode(ON), "rates": np.array(rates),
        "rubs": None, "hit": None, "lands": False, "restitution": np.zeros(3),
        "impact": SimpleNamespace(by="poisson"),
    }  # fmt: skip
    return SimpleNamespace(**stated | fields)


def one(j: int, value: float, n: int = 3) -> np.ndarray:
    """A row with one value."""
    return value * np.eye(1, n, j)


def test_slack_is_that_of_the_end_of_the_phase_before() -> None:
    """The first surface answers with 1/2 at the place 2, where the phase ends: 1e-3 of 2 m/s there
    takes 0.004 N s; a larger impulse of the law counts by itself."""
    assert events._slack(passage(), SIZES) == pytest.approx(BEARABLE * TURNED * 2 * 2)
    law = {"normal": np.array([[0.1, -3.0, 2.0]])}
    assert events._slack(passage(law), SIZES) == pytest.approx(BEARABLE * 3)


@pytest.mark.parametrize("j", [0, 1, 2])
@pytest.mark.parametrize("who", ["law", "plan"])
def test_an_impulse_may_not_pull(j: int, who: str) -> None:
    for pull, pulls in ((0.99 * SLACK, False), (1.01 * SLACK, True)):
        row = one(j, -pull)
        p = (
            passage({"normal": row})
            if who == "law"
            else passage(planned=(tuple(row[0]), (0.0, 0.0)))
        )
        texts = list(events._unbearable(p, SIZES, SLACK))
        assert bool(texts) is pulls
        assert all(
            t.startswith(("floor", "wall", "roof")[j] + " would have to pull") for t in texts
        )


@pytest.mark.parametrize(("push", "told"), [(0.99 * SLACK, False), (1.01 * SLACK, True)])
def test_a_surface_without_a_part_takes_no_impulse(push: float, told: bool) -> None:
    p = passage(planned=((9.0, 9.0, push), (0.0, 0.0)))
    expected = ["roof takes an impulse at 1 s without being hit or closed"] * told
    assert list(events._unbearable(p, SIZES, SLACK)) == expected


@pytest.mark.parametrize("k", [0, 1])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("who", ["law", "plan"])
def test_friction_holds_what_its_cone_bears(k: int, sign: float, who: str) -> None:
    """Half of 4 N s, and a slack."""
    normal = one((0, 2)[k], 4.0)
    for beyond, told in ((0.99 * SLACK, False), (1.01 * SLACK, True)):
        row = one(k, sign * (2 + beyond), 2)
        law = {"normal": normal} | ({"tangential": row} if who == "law" else {})
        plan = tuple(normal[0]), tuple(row[0]) if who == "plan" else (0.0, 0.0)
        texts = list(events._unbearable(passage(law, plan, mode=Mode((0, 1, 2))), SIZES, SLACK))
        assert len(texts) == told
        assert all(t.startswith(("along", "above")[k] + " would need an impulse") for t in texts)
    if k == 1:  # where it is hit, its friction has no limit
        free = passage({"normal": normal, "tangential": row}, mode=Mode((0, 1, 2)), rubs=1)
        assert not list(events._unbearable(free, SIZES, SLACK))


@pytest.mark.parametrize("k", [0, 1])
@pytest.mark.parametrize("sign", [1, -1])
def test_what_slides_after_an_event_has_its_sign(k: int, sign: int) -> None:
    """To a thousandth of 2 m/s."""
    for share, told in ((0.99, False), (1.01, True)):
        after = tuple(one(k, -sign * share * TURNED * 2, 2)[0])
        p = passage(sliding=((0.0, 0.0), after), mode=Mode.of([0, 2], {k: sign}))
        texts = list(events._unbearable(p, SIZES, SLACK))
        assert len(texts) == told
        assert all(f"does not slide with the sign {sign:+d}" in t for t in texts)


@pytest.mark.parametrize(
    ("was", "sign", "pressed", "fields", "text"),
    [
        (1, -1, 9.0, {}, "turns round"),
        (-1, 1, 9.0, {}, "turns round"),
        (1, 1, 9.0, {}, ""),
        (1, -1, 0.99 * SLACK / 0.5, {}, ""),
        (1, -1, 1.01 * SLACK / 0.5, {}, "turns round"),
        (1, 0, 9.0, {}, ""),  # a plastic impact may stop it
        (1, 0, 9.0, {"rubs": 0}, "stops sliding"),
        (1, 0, 9.0, {"hit": 1, "restitution": np.array([0.0, 0.5, 0.0])}, "stops sliding"),
        (1, 0, 9.0, {"hit": 1, "restitution": np.array([0.5, 0.0, 0.5])}, ""),
        (1, 0, 9.0, {"hit": 1, "lands": True, "restitution": np.ones(3)}, ""),
        (0, 0, 9.0, {"rubs": 0}, ""),
    ],
)
def test_what_is_pressed_neither_turns_nor_stops_within_an_impact(
    was: int, sign: int, pressed: float, fields: dict[str, Any], text: str
) -> None:
    """The last tangent, of which the phase before knows, or the sliding velocity at its end."""
    p = passage({"normal": one(2, pressed)}, mode=Mode.of([0, 2], {1: sign}), **fields)
    p.before.rubbing = {"above": was}
    q = passage(
        {"normal": one(2, pressed)}, sliding=((0.0, was * 1.01 * TURNED * 2), (0.0, 0.0)),
        mode=Mode.of([0, 2], {1: sign}), **fields,
    )  # fmt: skip
    for each in (p, q):
        texts = list(events._turned(each, SIZES, SLACK))
        assert len(texts) == bool(text) and all(f"above {text}" in t for t in texts)


@pytest.mark.parametrize(
    ("planned", "course", "told"),
    [
        (((3.2, 0.0, 0.0), (0.0, 0.0)), "slip+", True),
        (((3.05, 0.0, 0.0), (0.0, 0.0)), "slip+", False),  # both ways have the same impulses
        (((3.0, 0.0, 0.0), (0.2, 0.0)), "slip+", True),
        (((3.2, 0.0, 0.0), (0.0, 0.0)), "stick", False),  # goes as planned
        (((3.2, 0.0, 0.0), (0.0, 0.0)), "", False),  # nothing is planned
        (((3.0, 9.0, 9.0), (0.0, 9.0)), "slip+", False),  # others are looked at elsewhere
    ],
)
def test_a_hit_goes_the_way_of_its_law(planned: tuple[Row, Row], course: str, told: bool) -> None:
    law = {"normal": np.array([[3.0, 0.0, 0.0]]), "course": "stick"}
    p = passage(law, planned, event={"course": course, "surface": "floor"}, rubs=0, hit=0)
    assert bool(list(events._otherwise(p, SLACK))) is told
    for fields in ({"rubs": None}, {"hit": None}):
        other = SimpleNamespace(**vars(p) | fields)
        assert not list(events._otherwise(other, SLACK))


@pytest.mark.parametrize("j", [0, 1, 2])
def test_what_is_hit_is_approached_and_what_leaves_opens(j: int) -> None:
    """To a thousandth of 2 m/s, before the event and after it."""
    name, still = ("floor", "wall", "roof")[j], (0.0, 0.0, 0.0)
    for share, told in ((0.99, False), (1.01, True)):
        rate = share * TURNED * 2
        for event in ({"surface": name}, {"surface": "wall", "lands": (name,)}):
            p = passage(rates=(tuple(one(j, -rate)[0]), still), event=event)
            texts = [f"{name} is not approached where it is hit at 1 s"] * told
            assert list(events._approached(p, SIZES)) == texts
        for fields in ({"event": {"leaves": (name,)}}, {"hit": j}):
            p = passage(rates=(still, tuple(one(j, rate)[0])), **fields)
            texts = [f"{name} is entered where it should open at 1 s"] * told
            assert list(events._approached(p, SIZES)) == texts
    assert not list(events._approached(passage(rates=((-9.0,) * 3, (9.0,) * 3)), SIZES))
