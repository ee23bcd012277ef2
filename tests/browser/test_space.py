"""The page that plays motions in space, in a browser: WebGL draws bodies where they are, dragging
turns what is seen, the wheel goes nearer, and without WebGL the picture is much the same."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from films import END, TURN, flight
from planned_pages import view
from players import seek, shot, texts
from selenium.webdriver.chrome.webdriver import WebDriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

import dmoc

Open = Callable[..., WebDriver]
WITHOUT = """const known = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
      return kind === "webgl2" ? null : known.call(this, kind, ...rest);
    };"""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return dmoc.animate(flight(), tmp_path_factory.mktemp("page") / "flight.html")


def pixels(driver: WebDriver) -> np.ndarray[Any, Any]:
    """What is drawn on the canvas, as colours of shape (height, width, 3)."""
    box = driver.find_element(By.TAG_NAME, "canvas").rect
    x, y = round(box["x"]), round(box["y"])
    image = shot(driver).crop((x, y, x + round(box["width"]), y + round(box["height"])))
    return np.asarray(image).astype(int)


def orange(driver: WebDriver) -> np.ndarray[Any, Any]:
    """The middle of the moving ball on the canvas, and how many pixels it takes."""
    red, green, blue = np.moveaxis(pixels(driver), -1, 0)
    rows, columns = np.nonzero((red - blue > 60) & (red - green > 50))
    return np.array([np.median(columns), np.median(rows), len(rows)])


@pytest.mark.parametrize("script", ["", WITHOUT], ids=["webgl", "canvas"])
def test_bodies_are_drawn_where_they_are(opened: Open, page: Path, script: str) -> None:
    """The ball goes to the right and comes back, in its colour."""
    driver = opened(page, before=script)
    seek(driver, 0.0)
    begin = orange(driver)
    assert begin[2] > 100
    blue = pixels(driver)[..., 2] - pixels(driver)[..., 0] > 20
    assert blue.sum() > 400
    seek(driver, 0.45)
    there = orange(driver)
    seek(driver, END)
    assert there[0] > begin[0] + 80
    np.testing.assert_allclose(orange(driver)[:2], begin[:2], atol=3)


def test_dragging_and_keys_turn_and_the_wheel_goes_nearer(opened: Open, page: Path) -> None:
    driver = opened(page)
    seek(driver, 0.0)
    begin, (yaw, pitch, zoom) = orange(driver), view(driver)
    canvas = driver.find_element(By.TAG_NAME, "canvas")
    drag = ActionChains(driver).move_to_element(canvas).click_and_hold()
    drag.move_by_offset(100, 30).release().perform()
    turned, after = orange(driver), view(driver)
    assert after == pytest.approx((yaw - 0.8, pitch + 0.24, zoom))
    assert np.hypot(*(turned - begin)[:2]) > 20
    wheel = "arguments[0].dispatchEvent(new WheelEvent('wheel', {deltaY: -400, bubbles: true}));"
    driver.execute_script(wheel, canvas)
    assert view(driver)[2] == pytest.approx(np.exp(-0.5))
    assert orange(driver)[2] > 1.5 * turned[2]
    canvas.send_keys("d+")
    assert view(driver) == pytest.approx((yaw - 0.9, pitch + 0.24, 0.9 * np.exp(-0.5)))
    (again,) = (e for e in driver.find_elements(By.CSS_SELECTOR, ".views button"))
    again.click()
    assert view(driver) == (yaw, pitch, zoom)
    np.testing.assert_allclose(orange(driver), begin)


def test_what_moves_is_followed(opened: Open, page: Path) -> None:
    driver = opened(page)
    driver.find_element(By.CSS_SELECTOR, ".views input").send_keys(Keys.SPACE)
    places = []
    for t in (0.0, 0.25, 1.0):
        seek(driver, t)
        places.append(orange(driver)[:2])
    np.testing.assert_allclose(places, [places[0]] * 3, atol=3)


def test_a_hit_is_told_where_it_is(opened: Open, page: Path) -> None:
    driver = opened(page)
    seek(driver, TURN - 0.01)
    assert not any(text.startswith("1") for text in texts(driver, ".space .told") if text)
    seek(driver, TURN + 0.01)
    assert "1 wall impulse 9" in texts(driver, ".space .told")


@pytest.mark.parametrize(("width", "dark"), [(1280, True), (360, False)])
def test_a_picture_in_space_fits_its_window(
    opened: Open, page: Path, width: int, dark: bool
) -> None:
    driver = opened(page, width, dark=dark)
    seek(driver, 0.0)
    assert driver.execute_script("return document.documentElement.scrollWidth") <= width
    corner = pixels(driver)[2, 2]
    assert corner.max() < 60 if dark else corner.min() > 240
    assert orange(driver)[2] > 20
