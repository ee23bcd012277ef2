"""How the gallery takes the examples: the pictures that they write, and their order."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx_gallery.scrapers import figure_rst

# Where examples write that are told nothing else.
FOLDER = Path(__file__).resolve().parents[2] / "examples" / "figures"
# What an example may write, the picture of its thumbnail first.
KINDS = (".gif", ".png")
# From what is easily understood to what is not.
ORDER = (
    "block_and_wall",
    "two_bounces",
    "seed",
    "two_discs",
    "cart_pole",
    "hanging",
    "cart_links",
    "puck",
    "pushed_block",
    "stance_hopper",
    "hopper",
    "finger_puck",
    "push_or_flick",
    "compass_gait",
    "walker",
)


def written(_: Any, script: dict[str, Any], conf: dict[str, Any]) -> str:
    """Show the pictures that an example has written."""
    name, paths = Path(script["src_file"]).stem, []
    for kind in KINDS:
        picture = FOLDER / f"{name}{kind}"
        if picture.exists():
            target = Path(next(script["image_path_iterator"])).with_suffix(kind)
            shutil.copy(picture, target)
            paths.append(str(target))
    return str(figure_rst(paths, conf["src_dir"]))


class Order:
    """Sorts examples as they are listed, others after them by name."""

    def __init__(self, folder: str) -> None:
        self.folder = folder

    def __call__(self, file: str) -> tuple[int, str]:
        name = Path(file).stem
        return (ORDER.index(name) if name in ORDER else len(ORDER), name)

    def __repr__(self) -> str:
        return f"Order({', '.join(ORDER)})"


def setup(_: Sphinx) -> dict[str, Any]:
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
