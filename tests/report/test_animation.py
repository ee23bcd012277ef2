"""Films of motions: the document, the page that plays it, GIF and mp4."""

from __future__ import annotations

import io
import json
import os
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from films import END, EVIL, HIGH, ROD, TURN, motion, place
from PIL import Image

import dmoc
from dmoc.base.errors import MissingExtraError, OutputError, ProblemError
from dmoc.motion.trajectory import Trajectory
from dmoc.report.animation import animate_tree
from dmoc.report.animation.page import MOST, document, page_of, rounded
from dmoc.report.film import Branch, Film, Take
from dmoc.report.labels import label_of
from dmoc.sequences.nodes import Verdict

DATA = re.compile(r'<script type="application/json" id="film">(.*?)</script>', re.S)


def film(*motions: Trajectory) -> Any:
    """The document of some motions, as a page has it."""
    takes = tuple(Take(f"take {i}", m) for i, m in enumerate(motions))
    return json.loads(json.dumps(document(Film("films", takes)), default=rounded, allow_nan=False))


def columns_at(entry: Any, t: float) -> np.ndarray:
    """The columns of the scene of a document at a time, linear between its samples."""
    part = entry["parts"][max(i for i, start in enumerate(entry["starts"]) if start <= t or i == 0)]
    return np.array([np.interp(t, *np.broadcast_arrays(part["times"], c)) for c in part["columns"]])


def read(page: str) -> Any:
    """The document in a page, as a browser would cut it out."""
    (document,) = DATA.findall(page)
    return json.loads(document)


def test_the_document_has_the_motion() -> None:
    (entry,) = film(motion())["motions"]
    assert entry["starts"] == [0.0, TURN] and entry["duration"] == END
    assert entry["modes"] == ["floor:slip+", "free"] and entry["unit"] == "m"
    assert [shape["kind"] for shape in entry["shapes"]] == [
        "wall", "link", "point", "contact", "contact",
    ]  # fmt: skip
    for t in (0.0, 0.13, TURN - 1e-9, TURN, 0.77, END):
        columns = columns_at(entry, t)
        rod, mass = (columns[entry["shapes"][i]["columns"]] for i in (1, 2))
        np.testing.assert_allclose(mass, [place(t), HIGH], atol=1e-5)
        np.testing.assert_allclose(rod, [place(t), HIGH, place(t) - ROD, HIGH], atol=1e-5)


def test_columns_that_are_the_same_are_there_once_and_still_ones_are_numbers() -> None:
    (entry,) = film(motion())["motions"]
    for part in entry["parts"]:
        moving = [column for column in part["columns"] if isinstance(column, list)]
        assert len(moving) == 2  # x of the mass, and of the other end of its rod
        assert {len(column) for column in moving} == {len(part["times"])}


def test_panels_have_the_curves_of_the_motion_by_unit() -> None:
    trajectory = motion()
    (entry,) = film(trajectory)["motions"]
    panels = {panel["title"]: panel for panel in entry["panels"]}
    assert {title: panel["unit"] for title, panel in panels.items()} == {
        "coordinates": "m", "velocities": "m/s", "momenta": "N s", "inputs": "N",
        "normal forces": "N", "friction": "N",
    }  # fmt: skip
    for title, part in (("coordinates", "q"), ("velocities", "v"), ("momenta", "p")):
        for i, curve in enumerate(panels[title]["curves"]):
            for phase, values, t in zip(
                trajectory.phases, curve["values"], panels[title]["times"], strict=True
            ):
                at_nodes = [int(np.argmin(np.abs(np.array(t) - node))) for node in phase.t]
                wanted = getattr(phase, part)[:, i]
                np.testing.assert_allclose(np.array(values)[at_nodes], wanted, atol=1e-5)
                np.testing.assert_allclose(np.array(t)[at_nodes], phase.t, atol=1e-6)
    (force,) = panels["inputs"]["curves"]
    assert (force["low"], force["high"]) == (-6.0, 6.0)
    # A step of a constant input has both of its ends.
    assert panels["inputs"]["times"][0] == [0.0, 0.1, 0.1, 0.2, 0.2, 0.3, 0.3, 0.4, 0.4, 0.5]
    assert force["values"][0] == [5.0] * 10
    (normal,), (friction,) = (panels[t]["curves"] for t in ("normal forces", "friction"))
    assert normal["values"] == [[10.0, 12.0, 14.0, 16.0, 18.0, 20.0], None]
    assert friction["values"] == [[-4.0] * 6, None]
    assert friction["limits"] == [[5.0, 6.0, 7.0, 8.0, 9.0, 10.0], None]  # mu N
    assert {(a["kind"], a["shape"]) for a in entry["arrows"]} == {("N", 4), ("T", 4)}
    assert entry["largest"] == 20.0


def test_events_are_told_at_their_places() -> None:
    ((event,),) = (m["events"] for m in film(motion())["motions"])
    assert event == {
        "time": TURN,
        "word": "wall",
        "told": "impulse 9",
        "marks": [
            {
                "contact": "wall",
                "at": [1.0, HIGH, -1.0, 0.0],
                "impulse": [-1.0, 0.0],
                "told": "wall impulse 9",
            }
        ],
    }


def test_several_contacts_of_an_event_are_told_apart() -> None:
    trajectory = motion()
    (hit,) = trajectory.collisions
    landing = replace(
        hit, surface="floor", lands=("floor",), leaves=("wall",), impulses={"floor": 2.5},
        tractions={"floor": -0.75},
    )  # fmt: skip
    ((event,),) = (m["events"] for m in film(replace(trajectory, collisions=(landing,)))["motions"])
    assert event["word"] == "+floor -wall"
    assert event["told"] == "impulse 2.5 of floor, friction \N{MINUS SIGN}0.75 of floor"
    assert {mark["contact"]: mark["told"] for mark in event["marks"]} == {
        "floor": "+floor impulse 2.5, friction \N{MINUS SIGN}0.75",
        "wall": "-wall",
    }
    # Shares of the largest: upwards by the floor, and friction against its tangent to the right.
    floor, wall = (mark["impulse"] for mark in event["marks"])
    assert floor == [-0.3, 1.0] and wall == [0.0, 0.0]
    grazing = replace(hit, grazes=True, impulse=1e-9)
    ((event,),) = (m["events"] for m in film(replace(trajectory, collisions=(grazing,)))["motions"])
    assert event["told"] == "grazes"


def test_the_longest_arrow_is_that_of_the_largest_force_friction_of_a_rail_too() -> None:
    phases = motion().phases
    (pushed,) = film(motion())["motions"]
    assert pushed["largest"] == 20.0
    slides = {"closed": (), "rubbing": {"rail": 1}, "normal": np.zeros((len(phases[0].t), 0))}
    railed = replace(motion(), phases=(replace(phases[0], **slides), *phases[1:]))
    (rubbed,) = film(railed)["motions"]
    assert rubbed["largest"] == 4.0


def test_the_room_holds_what_moves_and_near_walls_not_far_ones() -> None:
    trajectory = motion()
    assert trajectory.scene is not None
    far = trajectory.scene.values[0].copy()
    far[:, 0] = -1000.0
    scene = replace(trajectory.scene, values=(far, trajectory.scene.values[1]))
    for entry in film(trajectory, replace(trajectory, scene=scene))["motions"]:
        left, right, bottom, top = entry["bounds"]
        assert -2.0 < left < -ROD and 1.0 < right < 2.5
        assert bottom < 0.0 and HIGH < top < 1.0


@pytest.mark.parametrize(
    ("name", "head", "tail"),
    [
        ("alpha", "\N{GREEK SMALL LETTER ALPHA}", ""),
        ("x_1", "x", "1"),
        ("x1", "x", "1"),
        ("p_theta_l", "p", "θ,l"),
        ("torso", "torso", ""),
        ("omega_", "ω", ""),
    ],
)
def test_names_are_written_as_mathematics(name: str, head: str, tail: str) -> None:
    assert label_of(name)[1:] == (head, tail)


def test_numbers_are_short_and_fine_enough() -> None:
    values = np.array([0.0, -0.0, 1 / 3, -2 / 3, 123.4567891])
    assert rounded(values) == [0.0, 0.0, 0.333, -0.667, 123.457]
    assert str(rounded(values)[1]) == "0.0"
    assert rounded(1e-9 * values)[2] == pytest.approx(1e-9 / 3, abs=1e-12)


def test_long_phases_are_thinned_and_keep_their_ends() -> None:
    trajectory = motion()
    t = np.linspace(0.0, TURN, 5001)
    first = replace(
        trajectory.phases[0], t=t, q=np.stack([t / TURN, HIGH + 0 * t], axis=1),
        p=np.zeros((5001, 2)), v=np.zeros((5001, 2)), u=np.zeros((5000, 1)),
        normal=np.ones((5001, 1)), tangential=np.zeros((5001, 1)),
    )  # fmt: skip
    (entry,) = film(replace(trajectory, phases=(first, trajectory.phases[1])))["motions"]
    positions = entry["panels"][0]
    x = positions["curves"][0]["values"][0]
    assert x is not None and len(x) == len(positions["times"][0]) == MOST
    assert (x[0], x[-1]) == (0.0, 1.0)
    np.testing.assert_allclose(x, np.array(positions["times"][0]) / TURN, atol=1e-5)


def test_a_page_holds_all_it_needs(solution: dmoc.Solution, tmp_path: Path) -> None:
    path = solution.animate(tmp_path / "swing_up.html")
    page = path.read_text(encoding="utf-8")
    assert len(page.encode()) < 500_000
    outside = page.replace("http://www.w3.org/2000/svg", "")  # the name of a language
    assert not re.search(r"https?:|//[a-z]+\.|\ssrc\s*=|@import|url\(|<link|<iframe", outside)
    assert re.search(r"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-", page)
    content = read(page)
    assert content["title"] == "cart_pendulum"
    (entry,) = content["motions"]
    assert entry["status"] == "solved" and entry["cost"] == solution.cost
    assert [event["word"] for event in entry["events"]] == ["lower"]
    tip = next(s for s in entry["shapes"] if s["kind"] == "point")["columns"]
    alpha, x = solution.phases[1].q[-1]
    at = columns_at(entry, entry["duration"])[tip]
    np.testing.assert_allclose(at, [x + 0.5 * np.cos(alpha), 0.5 * np.sin(alpha)], atol=1e-5)


def test_a_simulation_is_shown_without_a_cost(tmp_path: Path) -> None:
    simulation = dmoc.simulate(
        dmoc.load("bouncing_pendulum"), [0.5], step_size=0.01, steps=200, restitution=0.8
    )
    path = simulation.animate(tmp_path / "bounces.html")
    (entry,) = read(path.read_text("utf-8"))["motions"]
    assert entry["cost"] is None and entry["status"] == ""
    times = [event["time"] for event in entry["events"]]
    assert times == [collision.time for collision in simulation.collisions] and times
    for event in entry["events"]:
        (mark,) = event["marks"]
        np.testing.assert_allclose(mark["at"], [0.0, -1.0, 1.0, 0.0], atol=1e-5)


def test_names_of_a_model_are_texts_in_the_page() -> None:
    takes = Film(EVIL, (Take(EVIL, motion(EVIL, EVIL), EVIL, EVIL),))
    page = page_of(takes)
    assert read(page) == json.loads(json.dumps(document(takes), default=rounded))
    assert page.count("</script>") == 2 and "<b>" not in page
    assert "{{style}}" in page  # as the name said it, and nothing in its place


@pytest.mark.slow
def test_a_search_has_its_tree_and_its_motions(solution: dmoc.Solution, tmp_path: Path) -> None:
    moved = replace(solution, trajectory=motion())
    branches = [
        ((), "no event", "feasible", 3.0, ("confirmed",), moved),
        (("wall",), "wall", "infeasible", None, ("the goal is missed",), None),
        (("floor",), "floor", "optimal", 1.0, (), moved),
    ]
    content = read(animate_tree("shuttle", branches, tmp_path / "tree.html").read_text("utf-8"))
    assert [(n["sequence"], n["verdict"], n["motion"]) for n in content["tree"]] == [
        ([], "feasible", 0),
        (["wall"], "infeasible", None),
        (["floor"], "optimal", 1),
    ]
    assert content["tree"][1]["evidence"] == ["the goal is missed"]
    assert [m["name"] for m in content["motions"]] == ["no event", "floor"]
    with Image.open(animate_tree("s", branches, tmp_path / "best.gif", fps=5)) as best:
        left, right, bottom, top = content["motions"][0]["bounds"]
        assert best.width == 2 * 640  # both confirmed motions
        assert best.height == pytest.approx(640 * (top - bottom) / (right - left) + 72, abs=2)
    with pytest.raises(ProblemError, match="has no confirmed motion"):
        animate_tree("shuttle", branches[1:2], tmp_path / "best.gif")


def mass(image: Image.Image) -> np.ndarray:
    """The middle (x, y) of the mass in an image, by its colour."""
    pixels = np.asarray(image.convert("RGB")).astype(int)
    red = np.argwhere(np.abs(pixels - (0xC1, 0x44, 0x0E)).sum(axis=2) < 60)[:, ::-1]
    near = np.abs(red - np.median(red, axis=0)).max(axis=1) < 9  # no dots of its way
    return (red[near].min(axis=0) + red[near].max(axis=0)) / 2


@pytest.mark.slow
def test_a_gif_shows_the_mass_where_it_is(tmp_path: Path) -> None:
    path = dmoc.animate(motion(), tmp_path / "shuttle.gif", speed=0.5, fps=10)
    with Image.open(path) as gif:
        assert gif.info["duration"] == 100
        assert gif.n_frames == 31  # 1.5 s at half the speed, the end among them
        middles = []
        for k in (0, 5, 10, 20, 30):  # at 0, 0.25, 0.5, 1.0, 1.5 s
            gif.seek(k)
            middles.append(mass(gif))
        assert gif.info["duration"] == 700  # the end stands for 0.6 s more
    x, y = np.array(middles).T
    scale = x[2] - x[0]  # pixels from x = 0 to x = 1
    assert scale > 100
    np.testing.assert_allclose((x - x[0]) / scale, [0.0, 0.5, 1.0, 0.5, 0.0], atol=0.02)
    flying = [0, 1, 3, 4]  # without the ring of the hit around it
    np.testing.assert_allclose(y[flying], y[0], atol=1.5)


@pytest.mark.slow
def test_a_dark_gif_is_dark(tmp_path: Path) -> None:
    path = dmoc.animate([motion()], tmp_path / "dark.gif", speed=1.0, fps=4, style="dark")
    with Image.open(path) as gif:
        assert np.median(np.asarray(gif.convert("L"))) < 40


@pytest.mark.slow
def test_an_mp4_has_the_frames_and_the_colours(tmp_path: Path) -> None:
    from imageio_ffmpeg import get_ffmpeg_exe

    path = dmoc.animate({"there and back": motion()}, tmp_path / "s.mp4", speed=1.0, fps=20)
    decode = [get_ffmpeg_exe(), "-loglevel", "error", "-i", str(path), "-f", "image2pipe"]
    done = subprocess.run([*decode, "-c:v", "ppm", "-"], capture_output=True, check=True)
    frames = done.stdout.split(b"P6\n")[1:]
    assert len(frames) == 31 + 12
    first, turned = (Image.open(io.BytesIO(b"P6\n" + frames[k])) for k in (0, 10))
    ways = [mass(f)[0] for f in (first, turned)]
    assert ways[1] - ways[0] > 100


def test_a_missing_ffmpeg_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda _: None)
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingExtraError, match=r"ffmpeg is needed .* imageio-ffmpeg"):
        dmoc.animate(motion(), tmp_path / "s.mp4")
    assert not list(tmp_path.iterdir())


def test_motions_are_named_by_model_and_events_and_numbered_where_these_are_the_same(
    tmp_path: Path,
) -> None:
    def names(motions: Any) -> list[str]:
        page = dmoc.animate(motions, tmp_path / "s.html").read_text("utf-8")
        return [entry["name"] for entry in read(page)["motions"]]

    assert names(motion()) == ["shuttle: wall"]
    assert names([motion(), motion()]) == ["1. shuttle: wall", "2. shuttle: wall"]
    assert names({"first": motion(), "other": motion()}) == ["first", "other"]


def test_the_page_knows_every_verdict() -> None:
    page = page_of(Film("films", (Take("take", motion()),)))
    verdicts = [verdict.value for verdict in Verdict]
    assert list(read(page)["verdicts"]) == verdicts
    assert all(f"--{verdict}: #" in page for verdict in verdicts)


def test_a_model_without_a_drawing_is_shown_by_its_coordinates() -> None:
    (entry,) = film(replace(motion(), scene=None))["motions"]
    assert entry["unit"] == ""
    (mass,) = (shape for shape in entry["shapes"] if shape["kind"] == "point")
    np.testing.assert_allclose(
        columns_at(entry, 0.9)[mass["columns"]], [place(0.9), HIGH], atol=1e-5
    )


def test_branches_and_takes_are_numbered_together() -> None:
    branch = Branch(("wall",), "wall", "optimal", 1.0, (), 0)
    content = document(Film("t", (Take("wall", motion()),), (branch,)))
    assert content["tree"][0]["motion"] == 0 and len(content["motions"]) == 1


def fake_ffmpeg(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An ffmpeg that reads its frames and fails."""
    program = folder / "ffmpeg"
    program.write_text("#!/bin/sh\ncat > /dev/null\nexit 255\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder), prepend=os.pathsep)


def test_an_ffmpeg_that_fails_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake_ffmpeg(tmp_path, monkeypatch)
    with pytest.raises(OutputError, match="ffmpeg has failed"):
        dmoc.animate(motion(), tmp_path / "s.mp4", fps=2)


def test_ctrl_c_stays_what_it_is_where_it_ends_ffmpeg_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    fake_ffmpeg(tmp_path, monkeypatch)
    monkeypatch.setattr("matplotlib.animation.FFMpegWriter.grab_frame", interrupted)
    with pytest.raises(KeyboardInterrupt):
        dmoc.animate(motion(), tmp_path / "s.mp4", fps=2)
    assert not (tmp_path / "s.mp4").exists()
