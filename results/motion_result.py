"""What has a motion: its states at any time, tables, figures and animations."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from dmoc.base.errors import MotionError
from dmoc.base.files import write_whole
from dmoc.base.signatures import public
from dmoc.motion import motion_tables
from dmoc.motion.states import State, state_at
from dmoc.motion.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from xarray import Dataset


@public(MotionError)
class MotionResult:
    """A result that has a motion: a solution or a simulation."""

    trajectory: Trajectory

    @property
    def final_time(self) -> float:
        return self.trajectory.final_time

    def at(self, t: ArrayLike, side: str = "right") -> State:
        """The state of the motion at a time in seconds, or at an array of times.

        Inputs are what they are within a step: constant, linear, or linear between values of its
        own.  Positions are the polynomial through all nodes of the step with the motion's
        velocities at both ends, see :mod:`dmoc.motion.states`.  The steps of a simulation are those
        between recorded nodes, with the inputs of the first one that begins there.

        Parameters
        ----------
        t : float or array of shape (n,)
        side : {"right", "left"}
            What holds at a collision: the phase that begins there, or the one that ends.

        Returns
        -------
        State
            q, v, p, u, contact forces; by name too, as ``solution.at(0.3)["x_dot"]``.

        Raises
        ------
        MotionError
            If a time lies outside [0, final_time].
        """
        return state_at(self.trajectory, t, side)

    def to_frame(self) -> DataFrame:
        """The motion as a pandas DataFrame: a row for each node of each phase, two at a collision;
        see :mod:`dmoc.motion.motion_tables`.  ``frame.attrs["units"]`` has the units that are
        known.

        Raises
        ------
        MissingExtraError
            If pandas is not installed.
        """
        return motion_tables.to_frame(self.trajectory)

    def to_xarray(self) -> Dataset:
        """The same table as an xarray Dataset over ``time``, with the coordinate ``phase``.

        Raises
        ------
        MissingExtraError
            If xarray is not installed.
        """
        return motion_tables.to_xarray(self.trajectory)

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the same table as comma-separated values, with all digits, and with units in the
        header where they are known.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        return write_whole(path, motion_tables.to_csv(self.trajectory).encode())

    def to_json(self, path: str | os.PathLike[str]) -> Path:
        """Write the same table, by columns, with units, parameters and collisions as JSON.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        return write_whole(path, motion_tables.to_json(self.trajectory).encode())

    def plot(
        self,
        path: str | os.PathLike[str] | None = None,
        *,
        velocities: bool = False,
        style: str = "light",
    ) -> Figure:
        """Draw snapshots, positions, momenta and inputs, with velocities if wanted; write the
        figure if a path is given.  ``style`` is "light" or "dark"."""
        from dmoc.report.figure import plot

        return plot(self.trajectory, path, velocities=velocities, style=style)

    def animate(
        self,
        path: str | os.PathLike[str],
        *,
        speed: float | None = None,
        fps: int = 25,
        style: str = "light",
    ) -> Path:
        """Write the motion as a page that plays it, as a GIF or as an mp4; see
        :func:`dmoc.animate`."""
        from dmoc.report.animation import animate

        return animate(self, path, speed=speed, fps=fps, style=style)
