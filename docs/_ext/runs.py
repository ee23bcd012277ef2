"""How the gallery takes the examples: their pictures, their motions, and their order."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx_gallery.scrapers import figure_rst

import dmoc
from dmoc.models.registry import find

# Where examples write that are told nothing else.
FOLDER = Path(__file__).resolve().parents[2] / "examples" / "figures"
# Pictures of an example, that of its thumbnail first.
KINDS = (".gif", ".png")
# Of a moving picture, in a second.
FRAMES = 12
# The page that plays a motion, beside the pictures.
PLAYER = """
.. raw:: html

   <p><a href="../_static/motions/{0}.html">Play this motion</a>, with all its curves.</p>

"""
# The best collisions of the swing-up on the first page.
BEST = ("left", "left")
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
    """Show the pictures that an example has written, its motion first."""
    name, paths = Path(script["src_file"]).stem, []
    motion = FOLDER / f"{name}.npz"
    if not motion.exists():
        return ""
    solution = dmoc.Solution.load(motion)
    solution.animate(FOLDER / f"{name}.gif", fps=FRAMES)
    solution.animate(FOLDER / f"{name}.html")
    for kind in KINDS:
        picture = FOLDER / f"{name}{kind}"
        if picture.exists():
            target = Path(next(script["image_path_iterator"])).with_suffix(kind)
            shutil.copy(picture, target)
            paths.append(str(target))
    return str(figure_rst(paths, conf["src_dir"])) + PLAYER.format(name)


class Order:
    """Sorts examples as they are listed, others after them by name."""

    def __init__(self, folder: str) -> None:
        self.folder = folder

    def __call__(self, file: str) -> tuple[int, str]:
        name = Path(file).stem
        return (ORDER.index(name) if name in ORDER else len(ORDER), name)

    def __repr__(self) -> str:
        return f"Order({', '.join(ORDER)})"


def write_players(app: Sphinx, failed: Exception | None) -> None:
    """Put the pages that play motions beside the style sheets, and that of the first page."""
    if failed or app.builder.format != "html":
        return
    target = Path(app.outdir) / "_static" / "motions"
    target.mkdir(parents=True, exist_ok=True)
    for page in FOLDER.glob("*.html"):
        shutil.copy(page, target)
    reference = find("cart_pendulum")
    problem = dmoc.Problem(reference.kernels(), **reference.defaults | {"sequence": BEST})
    dmoc.solve(problem, "ipm").animate(target / "swing_up.html")


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("build-finished", write_players)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
