"""What a reader does with the page that plays motions, and sees of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from io import BytesIO
from typing import Any

import numpy as np
from films import ROD
from PIL import Image
from selenium.webdriver.chrome.webdriver import WebDriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By

PATIENCE = 20.0  # seconds until what is awaited counts as lost


def awaited(condition: Callable[[], object], otherwise: Callable[[], object] = str) -> None:
    """Wait until a condition holds; what is said ``otherwise`` where it never does."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, otherwise()
        time.sleep(0.01)


def now(driver: WebDriver) -> float:
    """The time that the slider shows."""
    return float(driver.find_element(By.ID, "slider").get_property("value"))


def playing(driver: WebDriver) -> bool:
    return driver.find_element(By.ID, "play").get_attribute("aria-label") == "pause"


def seek(driver: WebDriver, t: float) -> None:
    script = """const slider = document.getElementById("slider");
        slider.value = arguments[0];
        slider.dispatchEvent(new Event("input", {bubbles: true}));"""
    driver.execute_script(script, t)


def press(driver: WebDriver, *keys: str) -> None:
    ActionChains(driver).send_keys(*keys).perform()


def circle(driver: WebDriver, number: int = 0) -> np.ndarray[Any, Any]:
    """Middle of the drawn mass on the screen in pixels, as the browser has laid it out."""
    script = """const mass = document.querySelectorAll("circle.point")[arguments[0]];
        const box = mass.getBoundingClientRect();
        return [box.x + box.width / 2, box.y + box.height / 2];"""
    return np.array(driver.execute_script(script, number))


def scale(driver: WebDriver, number: int = 0) -> float:
    """Pixels of a metre, from the length of the drawn rod."""
    script = """const rod = document.querySelectorAll("path.link")[arguments[0]];
        return rod.getTotalLength();"""
    return float(driver.execute_script(script, number)) / ROD


def shot(driver: WebDriver) -> Image.Image:
    return Image.open(BytesIO(driver.get_screenshot_as_png())).convert("RGB")


def texts(driver: WebDriver, selector: str) -> list[str]:
    return [element.text for element in driver.find_elements(By.CSS_SELECTOR, selector)]
