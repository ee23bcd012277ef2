"""Chromium without a window, and pages opened in it."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.chrome.webdriver import WebDriver

ARGUMENTS = (
    "--headless=new", "--no-sandbox", "--disable-quic", "--no-first-run",
    "--disable-gpu", "--enable-unsafe-swiftshader",  # WebGL without a GPU
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--hide-scrollbars",
)  # fmt: skip
Open = Callable[..., WebDriver]


@pytest.fixture(scope="session")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[WebDriver]:
    options = webdriver.ChromeOptions()
    paths = (shutil.which(name) for name in ("chromium", "chromium-browser", "google-chrome"))
    options.binary_location = next(filter(None, paths), "chromium")
    for argument in (*ARGUMENTS, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = Service(shutil.which("chromedriver") or "chromedriver")
    driver = webdriver.Chrome(options=options, service=service)
    yield driver
    driver.quit()


@pytest.fixture
def opened(chromium: WebDriver) -> Iterator[Open]:
    """Opens a page in a window of a width, after a script if one is given; it must write nothing
    to the console."""

    def open_(
        path: Path, width: int = 1280, *, dark: bool = False, still: bool = True, before: str = ""
    ) -> WebDriver:
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        chromium.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        features = [
            {"name": "prefers-color-scheme", "value": "dark" if dark else "light"},
            {"name": "prefers-reduced-motion", "value": "reduce" if still else "no-preference"},
        ]
        chromium.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        command = "Page.addScriptToEvaluateOnNewDocument"
        added = chromium.execute_cdp_cmd(command, {"source": before})
        chromium.get(path.as_uri())
        chromium.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", added)
        return chromium

    yield open_
    # Without a GPU chromium says that reading what WebGL has drawn takes long.
    assert [e for e in chromium.get_log("browser") if e["source"] != "rendering"] == []
