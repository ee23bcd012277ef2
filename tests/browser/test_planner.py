"""The page that plans while one drags, in a browser: its answers are those of a solve in Python,
what is dragged goes with the pointer, and where there is no motion it says so."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np
import pushed_block
import pytest
from planned_pages import cost, count, drag, number, planned, release, text
from players import circle, now, playing, seek
from selenium.webdriver.chrome.webdriver import WebDriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

import dmoc
from dmoc.models.registry import find

Open = Callable[..., WebDriver]
LENGTH, STEPS = 0.5, 50  # of the pendulum, and of each phase
ENOUGH = 0.03  # seconds for a motion while dragging


@pytest.fixture(scope="module")
def problem() -> dmoc.Problem:
    reference = find("cart_pendulum")
    return dmoc.Problem(reference.kernels(2), **reference.defaults).but(steps=STEPS)


@pytest.fixture(scope="module")
def page(problem: dmoc.Problem, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return dmoc.generate_page(problem, tmp_path_factory.mktemp("planner") / "swing_up.html")


def move(driver: WebDriver, name: str, value: float) -> None:
    """Move a slider, and wait for the motion."""
    before = count(driver)
    script = """const slider = document.querySelector(`input[name="${arguments[0]}"]`);
        slider.value = arguments[1];
        slider.dispatchEvent(new Event("input", {bubbles: true}));"""
    driver.execute_script(script, name, value)
    planned(driver, before + 1)


def read(driver: WebDriver, name: str) -> float:
    """What the legend says of a curve at the cursor."""
    curve = driver.find_element(By.CSS_SELECTOR, f'.legend li:has([aria-label="{name}"]) output')
    return float(curve.text.split()[0].replace("\N{MINUS SIGN}", "-"))


def view(driver: WebDriver) -> tuple[float, float, float]:
    """Pixels of a metre, and where the origin of the drawing is in its picture."""
    picture = driver.find_element(By.CSS_SELECTOR, "svg.picture")
    numbers = [picture.get_attribute(f"data-{name}") for name in ("scale", "x", "y")]
    scale, x, y = (float(value or 0) for value in numbers)
    return scale, x, y


def mass(driver: WebDriver) -> np.ndarray:
    """Where the mass is drawn, in metres."""
    picture = driver.find_element(By.CSS_SELECTOR, "svg.picture").rect
    scale, x, y = view(driver)
    px, py = circle(driver) - (picture["x"], picture["y"])
    return np.array([(px - x) / scale, (y - py) / scale])


def drawn(solution: dmoc.Solution, t: float) -> np.ndarray:
    alpha, x = solution.at(t).q
    return np.array([x + LENGTH * np.cos(alpha), LENGTH * np.sin(alpha)])


@pytest.mark.parametrize(
    ("name", "value", "change"),
    [
        ("", 0.0, {}),
        ("parameters.m_c", 1.3, {"parameters": {"m_c": 1.3}}),
        ("bounds.F.high", 40.0, {"bounds": {"F": (-200.0, 40.0), "x": (-10.0, 10.0)}}),
        ("parameters.alpha_min", 0.4, {"parameters": {"alpha_min": 0.4}}),
        ("restitution.lower", 0.95, {"restitution": 0.95}),
    ],
)
def test_a_number_that_is_moved_gives_the_motion_of_a_solve(
    opened: Open, page: Path, problem: dmoc.Problem, name: str, value: float, change: dict
) -> None:
    driver = planned(opened(page))
    if name:
        move(driver, name, value)
    other = dmoc.solve(problem.but(**change), "ipm", starts=1, verify=False)
    assert text(driver).startswith("planned in")
    assert cost(driver) == pytest.approx(other.cost, rel=1e-3)  # four digits are shown
    (hit,), event = other.collisions, driver.find_element(By.CSS_SELECTOR, ".events button").text
    words = re.fullmatch(r"1 lower at (.*) s, impulse (.*)", event)
    assert words and float(words[1]) == pytest.approx(hit.time, rel=1e-3)
    assert float(words[2]) == pytest.approx(hit.impulse, rel=1e-3)
    for t in (0.0, 0.05, 0.5, 0.99):
        seek(driver, t)
        np.testing.assert_allclose(mass(driver), drawn(other, t), atol=4e-3)
    seek(driver, 0.5)
    for name, digits in (("alpha_dot", 0.01), ("x_dot", 0.01), ("F", 0.06)):
        assert read(driver, name) == pytest.approx(other.at(0.5)[name], abs=digits)


def test_the_start_is_dragged_in_the_picture(
    opened: Open, page: Path, problem: dmoc.Problem
) -> None:
    """The mass stands under the pointer, the cart stays, and the motion is that from there."""
    driver = planned(opened(page))
    seek(driver, 0.0)
    rings = driver.find_elements(By.CSS_SELECTOR, "circle.handle.start")
    places = [r.rect["x"] + r.rect["width"] / 2 for r in rings]
    middle = circle(driver)
    (ring,) = [k for k, x in enumerate(places) if abs(x - middle[0]) < 1.0]
    before = count(driver)
    drag(driver, ring, (-30, -40))
    planned(driver, before + 1)
    time.sleep(0.3)
    assert now(driver) == 0.0 and not playing(driver)
    to = middle + np.array([-30, -40])
    scale, x, y = view(driver)
    picture = driver.find_element(By.CSS_SELECTOR, "svg.picture").rect
    alpha = np.arctan2(picture["y"] + y - to[1], to[0] - picture["x"] - x)
    assert number(driver, "start.alpha") == pytest.approx(alpha, abs=2.0 / scale / LENGTH)
    assert number(driver, "start.x") == 0.0
    tip = LENGTH * np.array([np.cos(alpha), np.sin(alpha)])
    np.testing.assert_allclose(mass(driver), tip, atol=0.01)
    release(driver)
    start = {**problem.start, "alpha": number(driver, "start.alpha")}
    other = dmoc.solve(problem.but(start=start), "ipm", starts=1, verify=False)
    assert cost(driver) == pytest.approx(other.cost, rel=1e-3)


def test_a_limiter_is_dragged_in_the_picture(opened: Open, page: Path) -> None:
    driver = planned(opened(page))
    walls = driver.find_elements(By.CSS_SELECTOR, "path.wall")
    rings = driver.find_elements(By.CSS_SELECTOR, "circle.handle.start")
    box = walls[0].rect
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    seek(driver, 0.0)
    (ring,) = [
        k for k, r in enumerate(rings)
        if abs(r.rect["x"] + r.rect["width"] / 2 - middle[0]) < 3
        and abs(r.rect["y"] + r.rect["height"] / 2 - middle[1]) < 3
    ]  # fmt: skip
    before = number(driver, "parameters.alpha_min"), number(driver, "parameters.l")
    drag(driver, ring, (0, -12))
    planned(driver, 2)
    release(driver)
    assert number(driver, "parameters.alpha_min") > before[0] + 0.02
    assert number(driver, "parameters.l") == before[1]


def test_where_there_is_no_motion_it_says_so_and_finds_the_next(opened: Open, page: Path) -> None:
    driver = planned(opened(page))
    first = cost(driver)
    move(driver, "start.alpha", 0.2)  # behind the limiter at 0.314
    assert text(driver).startswith("no motion: ")
    assert driver.find_element(By.ID, "stage").get_attribute("class") == "none"
    driver.find_element(By.ID, "again").click()
    planned(driver, 3)
    assert text(driver).startswith("planned in") and cost(driver) == pytest.approx(first, rel=1e-3)


def test_a_number_that_does_not_fit_is_named(opened: Open, page: Path) -> None:
    driver = planned(opened(page))
    move(driver, "bounds.x.low", -1.0)
    move(driver, "start.x", -1.0)
    driver.execute_script("""document.querySelector('input[name="start.x"]').min = -2;""")
    move(driver, "start.x", -1.5)
    assert text(driver) == "no motion: start.x: expected no less than its lower bound"


def test_sliders_have_the_keys_and_the_clock_does_not(opened: Open, page: Path) -> None:
    driver = planned(opened(page))
    slider = driver.find_element(By.CSS_SELECTOR, 'input[name="parameters.m_c"]')
    slider.send_keys(Keys.ARROW_RIGHT)
    planned(driver, 2)
    assert number(driver, "parameters.m_c") > 1.0 and now(driver) == 0.0


def test_contacts_that_last_and_rub(opened: Open, tmp_path: Path) -> None:
    """A block that is pushed along a rail and slides on."""
    problem = pushed_block.problem(20)
    driver = planned(opened(dmoc.generate_page(problem, tmp_path / "block.html")))
    move(driver, "goal.x", 1.1)
    other = dmoc.solve(problem.but(goal={"x": 1.1, "x_dot": 0.0}), "ipm", starts=1, verify=False)
    assert text(driver).startswith("planned in") and other.status == "solved"
    assert cost(driver) == pytest.approx(other.cost, rel=1e-3)


@pytest.mark.parametrize("width", [400, 760, 1280])
def test_nothing_is_wider_than_the_window_and_all_has_names(
    opened: Open, page: Path, width: int
) -> None:
    driver = planned(opened(page, width))
    assert driver.execute_script("return document.documentElement.scrollWidth") <= width
    for element in driver.find_elements(By.CSS_SELECTOR, "button, select, input, [role=img]"):
        assert element.accessible_name, element.get_attribute("outerHTML")


def test_it_plans_while_one_drags(opened: Open, page: Path) -> None:
    """From the event to the picture, the median of 50."""
    driver = planned(opened(page))
    latencies = []
    for value in np.linspace(1.0, 1.4, 50):
        move(driver, "parameters.m_c", float(value))
        latency = driver.find_element(By.ID, "planned").get_attribute("data-latency")
        latencies.append(float(latency or "nan") / 1000)
    print(f"{1000 * median(latencies):.1f} ms")
    assert median(latencies) < ENOUGH
