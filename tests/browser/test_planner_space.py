"""The page that plans, of a motion in space: what is dragged goes with the pointer, in the plane
that is parallel to the screen, and what is seen turns and comes nearer as before."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from planned_pages import cost, count, drag, number, planned, release, view
from selenium.webdriver.chrome.webdriver import WebDriver
from selenium.webdriver.common.by import By
from sympy.physics.mechanics import dynamicsymbols

import dmoc

Open = Callable[..., WebDriver]


@pytest.fixture(scope="module")
def problem() -> dmoc.Problem:
    """A body that turns freely, and is pushed from place to place beside a mast that turns."""
    a, *place = dynamicsymbols("a x y z")
    u, *push = dynamicsymbols("u F_x F_y F_z")
    world = dmoc.spatial.World()
    world.hinge(a, "z", tip=(0.5, 0, 0), mass=1, torque=u)
    body = world.free(place, attitude="q", mass=1, inertia=(0.1, 0.1, 0.1))
    body.draw(dmoc.spatial.Sphere(0.1), dmoc.spatial.Sphere(0.05, at=(0.2, 0, 0)))
    system = world.system(
        "craft", inputs=[u, *push], forces=dict(zip(place, push, strict=True)),
        cost=sum(f**2 for f in (u, *push)),
    )  # fmt: skip
    rest = dict.fromkeys(("a_dot", "x_dot", "y_dot", "z_dot"), 0)
    spin = {"q_omega_x": 0, "q_omega_y": 0, "q_omega_z": 0}
    start = {"x": 0, "y": 0, "z": 0.5, "a": 0, "q": dmoc.attitude((1, 0, 0, 0)), **rest, **spin}
    goal = {"x": 1, "y": 0.5, "z": 1, "a": 1, **rest}
    return dmoc.Problem(dmoc.build(system), start, goal, final_time=1.0, steps=10)


@pytest.fixture(scope="module")
def page(problem: dmoc.Problem, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return dmoc.generate_page(problem, tmp_path_factory.mktemp("planner") / "craft.html")


def rings(driver: WebDriver) -> np.ndarray:
    boxes = [r.rect for r in driver.find_elements(By.CSS_SELECTOR, "circle.handle")]
    return np.array([[b["x"] + b["width"] / 2, b["y"] + b["height"] / 2] for b in boxes])


def goal(driver: WebDriver) -> np.ndarray:
    return np.array([number(driver, f"goal.{name}") for name in "xyz"])


def highest(driver: WebDriver) -> int:
    """The ring at the body where the motion ends, which is above the others."""
    return int(np.argmin(rings(driver)[:, 1]))


def test_a_body_is_dragged_parallel_to_the_screen(
    opened: Open, page: Path, problem: dmoc.Problem
) -> None:
    driver = planned(opened(page))
    ring, before, answers = highest(driver), goal(driver), count(driver)
    assert len(rings(driver)) == 4  # start and goal of the body and of the mast
    at = rings(driver)
    drag(driver, ring, (-40, 30))
    planned(driver, answers + 1)
    np.testing.assert_allclose(rings(driver)[ring] - at[ring], (-40, 30), atol=1.5)
    release(driver)
    moved, (yaw, pitch, _) = goal(driver) - before, view(driver)
    back = np.array([np.cos(pitch) * np.sin(yaw), -np.cos(pitch) * np.cos(yaw), np.sin(pitch)])
    assert np.linalg.norm(moved) > 0.1 and abs(moved @ back) < 1e-6
    assert number(driver, "goal.a") == 1.0
    change = dict(zip("xyz", goal(driver).tolist(), strict=True))
    other = dmoc.solve(problem.but(goal={**problem.goal, **change}), "ipm", starts=1, verify=False)
    assert cost(driver) == pytest.approx(other.cost, rel=1e-3)


def test_rings_turn_with_what_is_seen(opened: Open, page: Path) -> None:
    driver = planned(opened(page))
    before, ring = rings(driver), highest(driver)
    driver.find_element(By.TAG_NAME, "canvas").send_keys("dd")
    assert np.abs(rings(driver) - before).max() > 5
    wheel = "arguments[0].dispatchEvent(new WheelEvent('wheel', {deltaY: -400, bubbles: true}));"
    driver.execute_script(wheel, driver.find_elements(By.CSS_SELECTOR, "circle.handle")[ring])
    assert view(driver)[2] == pytest.approx(np.exp(-0.5))
