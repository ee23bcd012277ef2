"""How the gallery takes the examples: their pictures on light and on dark pages, their motions, and
their order."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

import dmoc
from dmoc.models.registry import find

# Where examples write that are told nothing else.
FOLDER = Path(__file__).resolve().parents[2] / "examples" / "figures"
# Of a moving picture, in a second.
FRAMES = 10
STYLES = ("dark", "light")
PICTURE = """
.. image:: /{0}
   :alt: {1}
   :class: only-{2} sphx-glr-single-img
"""
# A thumbnail of the gallery's first page, which is the first picture of an example.
THUMBNAIL = re.compile(
    r"^( *)\.\. image:: /examples/images/thumb/(\w+)_thumb\.gif\n( *):alt:.*\n", re.M
)
# The page that plays a motion, beside the pictures.
PLAYER = """
.. raw:: html

   <p><a href="../_static/motions/{0}.html">Play this motion</a>, with all its curves.</p>

"""
# The best collisions of the swing-up on the first page, and the steps of its phases there.
BEST, STEPS = ("lower", "lower"), 30
# From what is easily understood to what is not.
ORDER = (
    "block_and_wall",
    "two_bounces",
    "superball",
    "coin",
    "seed",
    "two_discs",
    "cart_pole",
    "hanging",
    "cart_links",
    "puck",
    "ball_track",
    "wrong_masses",
    "sledge",
    "pushed_block",
    "block_friction",
    "stance_hopper",
    "four_bar",
    "satellite",
    "quadrotor",
    "hopper_spring",
    "soft_landing",
    "jumper",
    "hopper",
    "hops",
    "finger_puck",
    "push_or_flick",
    "compass_gait",
    "kneed_walker",
    "walker",
    "transport",
)


def written(block: Any, script: dict[str, Any], conf: dict[str, Any]) -> str:
    """Show what the last block of an example has written: its motion, then its figure."""
    if "__main__" not in block[1]:
        return ""
    name = Path(script["src_file"]).stem
    solution = dmoc.Solution.load(FOLDER / f"{name}.npz")
    solution.animate(FOLDER / f"{name}.html")
    shown = ""
    for kind in (".gif", ".png"):
        for style in STYLES:  # the first one of all is the thumbnail
            target = Path(next(script["image_path_iterator"])).with_suffix(kind)
            if kind == ".gif":
                solution.animate(target, fps=FRAMES, style=style)
            else:
                solution.plot(target, style=style)
            place = target.relative_to(conf["src_dir"]).as_posix()
            shown += PICTURE.format(place, name, style)
    return shown + PLAYER.format(name)


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
    """Put the pages that play motions beside the style sheets, and the one of the first page."""
    if failed or app.builder.format != "html":
        return
    target = Path(app.outdir) / "_static" / "motions"
    target.mkdir(parents=True, exist_ok=True)
    for page in FOLDER.glob("*.html"):
        shutil.copy(page, target)
    reference = find("cart_pendulum")
    stated = reference.defaults | {"sequence": BEST, "steps": STEPS}
    dmoc.generate_page(dmoc.Problem(reference.kernels(), **stated), target / "swing_up.html")


def show_both_styles(app: Sphinx, document: str, source: list[str]) -> None:
    """Thumbnails for light and for dark pages."""
    if document == "examples/index":
        both = (
            rf"\1.. image:: /examples/images/\2_00{i}.gif\n\3:alt:\n\3:class: only-{style}\n"
            rf"\3:loading: lazy\n\n"
            for i, style in enumerate(STYLES, 1)
        )
        source[0] = THUMBNAIL.sub("".join(both), source[0])


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("source-read", show_both_styles)
    app.connect("build-finished", write_players)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
