"""The page that plays motions, in a browser: what is drawn, what moves it, and how it looks."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from films import END, EVIL, TURN, mirrored, motion, place
from players import awaited, circle, now, playing, press, scale, seek, shot, texts
from selenium.webdriver.chrome.webdriver import WebDriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

import dmoc
from dmoc.report.animation import animate_tree
from dmoc.report.film import Proofs

Open = Callable[..., WebDriver]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return dmoc.animate(motion(), tmp_path_factory.mktemp("page") / "shuttle.html")


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory, solution: dmoc.Solution) -> Path:
    nodes = [
        (
            (), "no collision", "feasible", 3.0, ("confirmed by simulation",),
            replace(solution, trajectory=motion()),
        ),
        (("wall",), "wall", "optimal", 1.25, (), replace(solution, trajectory=mirrored(motion()))),
        (("wall", "wall"), "wall, wall", "infeasible", None, ("the goal of x is missed",), None),
        (("floor",), "floor", "unreachable", None, (), None),
    ]  # fmt: skip
    proofs = Proofs({("wall",): "optimal (proved): it costs at least 1.24"}, "proved: no sequence")
    target = tmp_path_factory.mktemp("tree") / "tree.html"
    return animate_tree("shuttle", nodes, target, proofs=proofs)


@pytest.mark.parametrize("t", [0.0, 0.2, 0.45, 0.9, END])
def test_the_mass_is_drawn_where_it_is(opened: Open, page: Path, t: float) -> None:
    driver = opened(page)
    seek(driver, 0.0)
    begin = circle(driver)
    seek(driver, t)
    moved = (circle(driver) - begin) / scale(driver)
    np.testing.assert_allclose(moved, [place(t) - place(0.0), 0.0], atol=2e-3)
    x, y = circle(driver).round().astype(int) - (4, 0)  # beside a cross
    red, green, blue = shot(driver).getpixel((int(x), int(y)))
    assert abs(red - 0xC1) + abs(green - 0x44) + abs(blue - 0x0E) < 12


def test_pictures_of_two_times_differ_where_the_mass_is(opened: Open, page: Path) -> None:
    driver = opened(page)
    seek(driver, 0.7)
    one, first = np.asarray(shot(driver)).astype(int), circle(driver).round().astype(int)
    seek(driver, 1.4)
    two, second = np.asarray(shot(driver)).astype(int), circle(driver).round().astype(int)
    changed = np.abs(one - two).sum(axis=2) > 60
    for x, y in (first, second):
        assert changed[y, x]
    above = slice(int(first[1]) - 120, int(first[1]) - 40)  # nothing moves over the mass
    assert not changed[above, : driver.get_window_size()["width"] // 3].any()


def test_a_page_plays_by_itself_and_pauses(opened: Open, page: Path) -> None:
    driver = opened(page, still=False)
    assert playing(driver)
    first = now(driver)
    awaited(lambda: now(driver) != first)
    driver.find_element(By.ID, "play").click()
    stopped = now(driver)
    time.sleep(0.3)
    assert not playing(driver) and now(driver) == stopped


def test_a_page_stands_where_motion_is_not_wanted(opened: Open, page: Path) -> None:
    driver = opened(page)
    time.sleep(0.3)
    assert not playing(driver) and now(driver) == 0.0


def test_the_speed_is_that_of_the_choice(opened: Open, page: Path) -> None:
    driver = opened(page)
    choice = Select(driver.find_element(By.ID, "speed"))
    speeds = [option.text.removesuffix("\N{MULTIPLICATION SIGN}") for option in choice.options]
    assert speeds == ["0.1", "0.2", "0.5", "1", "2"]
    ways = {}
    for speed in ("0.1", "0.5"):
        choice.select_by_value(speed)
        script = """const [slider, done] = [document.getElementById("slider"), arguments[0]];
            document.getElementById("play").click();
            const [t, begin] = [Number(slider.value), performance.now()];
            setTimeout(() => {
              const rate = (slider.value - t) / (performance.now() - begin) * 1000;
              document.getElementById("play").click();
              done(rate);
            }, 1000);"""
        seek(driver, 0.0)
        ways[speed] = driver.execute_async_script(script)
    assert ways["0.1"] == pytest.approx(0.1, rel=0.3)
    assert ways["0.5"] == pytest.approx(0.5, rel=0.3)


def test_it_begins_again_only_in_a_loop(opened: Open, page: Path) -> None:
    driver = opened(page)
    Select(driver.find_element(By.ID, "speed")).select_by_value("2")
    driver.find_element(By.ID, "loop").click()
    seek(driver, 1.3)
    driver.find_element(By.ID, "play").click()
    awaited(lambda: not playing(driver))
    assert now(driver) == END
    driver.find_element(By.ID, "loop").click()
    seek(driver, 1.3)
    driver.find_element(By.ID, "play").click()
    awaited(lambda: now(driver) < 1.3)
    assert playing(driver)


def test_keys_play_step_and_go_to_the_ends(opened: Open, page: Path) -> None:
    driver = opened(page)
    press(driver, Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_LEFT)
    assert now(driver) == pytest.approx(2 * END / 100)
    press(driver, Keys.END)
    assert now(driver) == END
    press(driver, Keys.HOME)
    assert now(driver) == 0.0
    press(driver, Keys.SPACE)
    assert playing(driver)
    press(driver, Keys.SPACE)
    assert not playing(driver)
    # On the slider the arrows do the same, and a button is pressed once by the key.
    seek(driver, 0.0)
    driver.find_element(By.ID, "slider").send_keys(Keys.ARROW_RIGHT)
    assert now(driver) == pytest.approx(END / 100)
    driver.find_element(By.ID, "play").send_keys(Keys.SPACE)
    assert playing(driver)


def test_buttons_step(opened: Open, page: Path) -> None:
    driver = opened(page)
    driver.find_element(By.ID, "forth").click()
    driver.find_element(By.ID, "forth").click()
    driver.find_element(By.ID, "back").click()
    assert now(driver) == pytest.approx(END / 100)


def test_the_slider_can_be_dragged_and_has_the_events(opened: Open, page: Path) -> None:
    driver = opened(page)
    slider = driver.find_element(By.ID, "slider")
    width = slider.rect["width"]
    start = round(-width / 2 + 8)
    chain = ActionChains(driver).move_to_element_with_offset(slider, start, 0).click_and_hold()
    chain.move_by_offset(round((width - 16) / 2), 0).release().perform()
    assert now(driver) == pytest.approx(END / 2, abs=0.02)
    (tick,) = driver.find_elements(By.CSS_SELECTOR, "#ticks i")
    middle = tick.rect["x"] + tick.rect["width"] / 2
    share = (middle - slider.rect["x"] - 8) / (width - 16)
    assert share == pytest.approx(TURN / END, abs=2e-3)


def test_a_curve_can_be_dragged_and_is_read_at_its_cursor(opened: Open, page: Path) -> None:
    driver = opened(page)
    panel = driver.find_element(By.CSS_SELECTOR, "svg.panel")
    frame = panel.find_element(By.CSS_SELECTOR, "rect.frame").rect
    x0, y0 = frame["x"], frame["y"] + frame["height"] / 2

    def to(t: float) -> tuple[int, int]:
        return round(x0 + frame["width"] * t / END), round(y0)

    chain = ActionChains(driver, duration=0)
    chain.w3c_actions.pointer_action.move_to_location(*to(0.2)).pointer_down()
    chain.w3c_actions.pointer_action.move_to_location(*to(1.0)).pointer_up()
    chain.perform()
    assert now(driver) == pytest.approx(1.0, abs=END / frame["width"])
    assert not playing(driver)
    cursor = driver.find_element(By.CSS_SELECTOR, "svg.panel line.cursor").rect
    assert cursor["x"] == pytest.approx(x0 + frame["width"] * now(driver) / END, abs=1.0)
    seek(driver, 1.0)
    assert texts(driver, "details:first-child .legend li") == ["x = 0.500 m", "y = 0.700 m"]
    seek(driver, 0.25)
    assert "Nfloor = 15.00 N" in [t.replace("\n", "") for t in texts(driver, ".legend li")]
    assert "Tfloor = \N{MINUS SIGN}4.00 N" in [
        t.replace("\n", "") for t in texts(driver, ".legend li")
    ]
    seek(driver, 1.0)  # nothing touches there
    assert "Nfloor = \N{EN DASH}" in [t.replace("\n", "") for t in texts(driver, ".legend li")]


def test_contact_forces_are_arrows_to_scale(opened: Open, page: Path) -> None:
    driver = opened(page)
    script = """return ["N", "T"].map((kind) => {
          const path = document.querySelector(`path.force.${kind}`);
          if (path.parentElement.style.display === "none") return null;
          const [a, b] = path.getAttribute("d").slice(1).split("L").map((p) => p.split("M")[0]);
          return [...a.split(" "), ...b.split(" ")].map(Number);
        });"""
    lengths = {}
    for t in (0.0, 0.25):
        seek(driver, t)
        (ax, ay, bx, by), (cx, _, dx, dy) = driver.execute_script(script)
        assert (ax, ay) == pytest.approx((bx, ay), abs=0.02) and by < ay  # upwards
        assert dx < cx and dy == pytest.approx(ay, abs=0.02)  # against the sliding
        lengths[t] = (ay - by, cx - dx)
    assert lengths[0.25][0] / lengths[0.0][0] == pytest.approx(1.5, abs=0.01)  # 15 N, 10 N
    assert lengths[0.0][1] / lengths[0.0][0] == pytest.approx(0.4, abs=0.01)  # 4 N, 10 N
    seek(driver, 1.0)
    assert driver.execute_script(script) == [None, None]


def test_a_hit_is_told_at_its_place_and_its_button_goes_there(opened: Open, page: Path) -> None:
    driver = opened(page)
    labels = driver.find_elements(By.CSS_SELECTOR, "svg.picture g > text.told")
    (button,) = driver.find_elements(By.CSS_SELECTOR, ".events button")
    assert button.text == "1 wall at 0.5 s, impulse 9"
    assert not labels[0].is_displayed()
    button.click()
    assert now(driver) == TURN
    assert labels[0].text == "1 wall impulse 9"
    cross = driver.find_element(By.CSS_SELECTOR, "path.mark").rect
    middle = cross["x"] + cross["width"] / 2, cross["y"] + cross["height"] / 2
    np.testing.assert_allclose(middle, circle(driver), atol=1.0)
    seek(driver, END)
    assert labels[0].text == "1"


def test_motions_side_by_side_share_the_clock_and_the_scale(opened: Open, tmp_path: Path) -> None:
    both = {"one": motion(), "other": mirrored(motion())}
    driver = opened(dmoc.animate(both, tmp_path / "both.html"))
    assert texts(driver, ".motion h2") == ["one", "other"]
    one, other = (m.rect for m in driver.find_elements(By.CSS_SELECTOR, ".motion"))
    assert one["y"] == other["y"] and other["x"] >= one["x"] + one["width"]
    seek(driver, 0.0)
    begins = circle(driver, 0), circle(driver, 1)
    seek(driver, 0.4)
    for number in (0, 1):
        moved = (circle(driver, number) - begins[number]) / scale(driver, number)
        np.testing.assert_allclose(moved, [0.8, 0.0], atol=2e-3)
    assert scale(driver, 0) == pytest.approx(scale(driver, 1))
    left = [begins[n][0] - (one, other)[n]["x"] for n in (0, 1)]
    assert (left[0] - left[1]) / scale(driver) == pytest.approx(1.0, abs=5e-3)
    narrow = opened(tmp_path / "both.html", 400)
    one, other = (m.rect for m in narrow.find_elements(By.CSS_SELECTOR, ".motion"))
    assert other["y"] >= one["y"] + one["height"]


def test_a_node_of_a_tree_shows_its_motion_and_its_verdict(opened: Open, tree: Path) -> None:
    driver = opened(tree)
    nodes = driver.find_elements(By.CSS_SELECTOR, "#tree [role=treeitem]")
    assert [n.text[1:] for n in nodes] == ["no collision 3", "wall 1.25 \u220e", "wall", "floor"]
    assert len({n.text[0] for n in nodes}) == 4  # each verdict has a sign of its own
    assert nodes[1].get_attribute("aria-current") == "true"
    assert nodes[1].get_attribute("aria-label") == (
        "wall, optimal, cost 1.25, optimal (proved): it costs at least 1.24"
    )
    assert texts(driver, "#statement") == ["proved: no sequence"]
    assert texts(driver, ".key li")[-1] == "\u220e proved (1)"
    assert "optimal (proved): it costs" in driver.find_element(By.ID, "verdict").text
    begin = circle(driver)
    nodes[0].click()
    assert "confirmed by simulation" in driver.find_element(By.ID, "verdict").text
    assert (circle(driver) - begin)[0] != 0.0
    nodes[2].click()
    verdict = driver.find_element(By.ID, "verdict").text
    assert "wall, wall" in verdict and "the goal of x is missed" in verdict
    assert not driver.find_elements(By.CSS_SELECTOR, "svg.picture")
    nodes[0].click()
    driver.find_element(By.ID, "compare").click()
    assert texts(driver, ".motion h2")[1:] == ["wall", "no collision"]
    assert len(driver.find_elements(By.CSS_SELECTOR, "svg.picture")) == 2


def test_a_tree_is_walked_by_keys(opened: Open, tree: Path) -> None:
    driver = opened(tree)
    nodes = driver.find_elements(By.CSS_SELECTOR, "#tree [role=treeitem]")
    nodes[1].click()
    for key, number in (
        (Keys.ARROW_RIGHT, 2), (Keys.ARROW_LEFT, 1), (Keys.ARROW_UP, 0), (Keys.ARROW_DOWN, 1),
        (Keys.END, 3), (Keys.HOME, 0),
    ):  # fmt: skip
        driver.switch_to.active_element.send_keys(key)
        assert driver.switch_to.active_element == nodes[number]
    assert now(driver) == 0.0  # the arrows were those of the tree
    driver.switch_to.active_element.send_keys(Keys.ENTER)
    assert "no collision" in driver.find_element(By.ID, "verdict").text


def test_dark_is_the_readers_choice_or_the_buttons(opened: Open, page: Path) -> None:
    def ground(driver: WebDriver) -> int:
        return sum(shot(driver).getpixel((4, 200)))  # type: ignore[arg-type]

    driver = opened(page, dark=True)
    assert ground(driver) < 120
    driver.find_element(By.ID, "theme").click()
    assert ground(driver) == 3 * 255
    assert driver.find_element(By.ID, "theme").text == "dark"
    driver = opened(page)
    assert ground(driver) == 3 * 255
    driver.find_element(By.ID, "theme").click()
    assert ground(driver) < 120


@pytest.mark.parametrize("width", [400, 1280])
def test_nothing_is_wider_than_the_window(opened: Open, page: Path, tree: Path, width: int) -> None:
    for path in (page, tree):
        driver = opened(path, width)
        script = "return document.documentElement.scrollWidth"
        assert driver.execute_script(script) <= width


def test_everything_that_acts_has_a_name(opened: Open, tree: Path) -> None:
    driver = opened(tree)
    for element in driver.find_elements(By.CSS_SELECTOR, "button, select, input, [role=img]"):
        assert element.accessible_name, element.get_attribute("outerHTML")


def test_the_contrast_of_texts_is_enough(opened: Open, page: Path) -> None:
    script = """const style = getComputedStyle(document.documentElement);
        const rgb = (name) => {
          const hex = style.getPropertyValue(name).trim();
          return [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255);
        };
        const luminance = (name) => rgb(name)
          .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
          .reduce((sum, c, k) => sum + c * [0.2126, 0.7152, 0.0722][k], 0);
        const names = ["--ink", "--muted", "--hit", "--normal", "--friction"];
        return names.map((name) => {
          const pair = [luminance(name), luminance("--card")].sort((a, b) => b - a);
          return (pair[0] + 0.05) / (pair[1] + 0.05);
        });"""
    for dark in (False, True):
        assert min(opened(page, dark=dark).execute_script(script)) >= 4.5


def test_names_of_a_model_are_texts(opened: Open, tmp_path: Path) -> None:
    path = dmoc.animate({EVIL: motion(EVIL, EVIL)}, tmp_path / "evil.html")
    driver = opened(path)
    assert driver.find_element(By.TAG_NAME, "h1").text == EVIL
    assert texts(driver, ".motion h2") == [EVIL]
    assert not driver.find_elements(By.TAG_NAME, "b")
    seek(driver, TURN)
    label = driver.find_element(By.CSS_SELECTOR, "svg.picture g > text.told").text
    assert label == f"1 {EVIL} impulse 9"


@pytest.mark.parametrize("size", [1.0, 2.3, 3.4, 4.8, 7.0])
def test_every_axis_has_two_numbers_at_least(opened: Open, tmp_path: Path, size: float) -> None:
    """Whatever its range: from -3.4 to 3.4 zero alone is a multiple of 5."""
    trajectory = motion()
    swings = [
        replace(phase, v=size * np.cos(np.linspace(0, 3 * np.pi, len(phase.t)))[:, None])
        for phase in trajectory.phases
    ]
    path = dmoc.animate(replace(trajectory, phases=tuple(swings)), tmp_path / "swings.html")
    script = (
        "return [...document.querySelectorAll('svg.panel')].map((panel) => "
        "panel.querySelectorAll('text[text-anchor=end]').length);"
    )
    counts = opened(path).execute_script(script)
    assert counts and min(counts) >= 2
