"""What a reader sees and does on a page that plans, and on one in space."""

from __future__ import annotations

from players import awaited
from selenium.webdriver.chrome.webdriver import WebDriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By


def text(driver: WebDriver) -> str:
    return driver.find_element(By.ID, "planned").text


def count(driver: WebDriver) -> int:
    return int(driver.find_element(By.ID, "planned").get_attribute("data-count") or 0)


def planned(driver: WebDriver, least: int = 1) -> WebDriver:
    """The page, after so many motions were planned."""
    awaited(lambda: count(driver) >= least, lambda: text(driver))
    return driver


def number(driver: WebDriver, name: str) -> float:
    slider = driver.find_element(By.CSS_SELECTOR, f'input[name="{name}"]')
    return float(slider.get_property("value"))


def cost(driver: WebDriver) -> float:
    words = driver.find_element(By.CSS_SELECTOR, ".motion > .quiet").text
    return float(words.split("cost ")[1].split(",")[0])


def drag(driver: WebDriver, ring: int, way: tuple[int, int]) -> None:
    """Drag a ring by some pixels, in ten moves."""
    box = driver.find_elements(By.CSS_SELECTOR, "circle.handle")[ring].rect
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    chain = ActionChains(driver, duration=0)
    chain.w3c_actions.pointer_action.move_to_location(round(x), round(y)).pointer_down()
    for k in range(1, 11):
        to = round(x + way[0] * k / 10), round(y + way[1] * k / 10)
        chain.w3c_actions.pointer_action.move_to_location(*to)
    chain.perform()


def release(driver: WebDriver) -> None:
    chain = ActionChains(driver, duration=0)
    chain.w3c_actions.pointer_action.pointer_up()
    chain.perform()


def view(driver: WebDriver) -> tuple[float, float, float]:
    """Yaw, pitch and zoom of a picture in space."""
    canvas = driver.find_element(By.TAG_NAME, "canvas")
    numbers = (canvas.get_attribute(f"data-{name}") for name in ("yaw", "pitch", "zoom"))
    yaw, pitch, zoom = (float(number or 0) for number in numbers)
    return yaw, pitch, zoom
