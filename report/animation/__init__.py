"""Motions that move: a page, a GIF, a film."""

from __future__ import annotations

from dmoc.report.animation.output import animate, animate_tree

__all__ = ["animate", "animate_tree"]
