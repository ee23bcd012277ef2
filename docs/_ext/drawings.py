"""The figures of docs/theory.md, by name: each is drawn in one style, and from what dmoc computes
where it shows numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from strokes import WIDTH, arrow, empty_axes, frame, write

import dmoc
from dmoc.mechanics.model import Model
from dmoc.models.registry import find
from dmoc.program.layout import Layout
from dmoc.program.transcription import Transcription
from dmoc.report.style import Style
from dmoc.simulation.impact_laws.course import Coefficients
from dmoc.simulation.impact_laws.poisson import impulses
from dmoc.solvers.kkt_layout import kkt_layout

# A rod that hits a floor at this angle slides, stops and sticks (rates n and t, response A, mu, e).
ROD = (np.array([-1.0, 0.2]), np.array([[1.75, 0.55], [0.55, 3.25]]), 0.35, 0.6)
Draw = Callable[[Style], Figure]


def gap(style: Style) -> Figure:
    """A curved wall, the gradient of its gap, and the velocities of a hit."""
    figure, (axes,) = empty_axes(style, 3.0)
    y = np.linspace(-1.35, 1.35, 80)
    wall = 0.16 * y**2
    axes.fill_betweenx(y, wall, 3.2, color=style.body)
    axes.plot(wall, y, color=style.edge, lw=2)
    write(axes, 1.9, 0.9, r"$g(q, t) > 0$", style.ink)
    write(axes, -2.9, 0.9, r"$g(q, t) < 0$: admissible", style.ink)
    write(axes, 0.45, 1.18, r"$g = 0$", style.ink)
    for start, end, label, at in (
        ((-1.9, -1.1), (-0.95, -0.55), r"$v^-$", (-1.62, -0.68)),
        ((-0.5, 0.38), (-1.45, 1.1), r"$v^+$", (-0.82, 0.86)),
    ):
        arrow(axes, start, end, style.colours[0])
        write(axes, *at, label, style.colours[0])
    axes.plot([-1.9, 0, -1.45], [-1.1, 0, 1.1], color=style.colours[0], lw=1, ls=":")
    arrow(axes, (0, 0), (1.15, 0), style.colours[1])
    write(axes, 1.4, -0.03, r"$\nabla g$", style.colours[1], ha="left")
    arrow(axes, (0, 0), (-1.35, 0), style.hit)
    write(axes, -1.75, -0.03, r"$-\lambda\,\nabla g$", style.hit, ha="right")
    axes.plot(0, 0, "o", color=style.mass, ms=8)
    write(
        axes,
        -2.9,
        -1.25,
        r"$\gamma^- = \nabla g \cdot v^- + \partial g/\partial t \geq 0$",
        style.ink,
    )
    write(axes, -2.9, 0.45, r"$\gamma^+ = -e\,\gamma^- \leq 0$", style.ink)
    axes.set(xlim=(-4.6, 3.2), ylim=(-1.45, 1.4))
    return figure


def variation(style: Style) -> Figure:
    """A path to a moving wall, and one that hits later."""
    figure, (axes,) = empty_axes(style, 3.0)
    t = np.linspace(0, 10, 100)
    wall = 0.55 + 0.05 * t
    axes.fill_between(t, wall, 1.6, color=style.body)
    axes.plot(t, wall, color=style.edge, lw=2)
    write(axes, 8.6, 1.25, r"$g(q, t) > 0$", style.ink)
    for hit, line, colour in ((4.0, "-", style.colours[0]), (5.6, "--", style.colours[1])):
        place = 0.55 + 0.05 * hit
        before, after = np.linspace(0.4, hit, 40), np.linspace(hit, 9.6, 40)
        rise = -0.85 + (place + 0.85) * (1 - ((hit - before) / (hit - 0.4)) ** 1.3)
        fall = place - (place + 0.6) * ((after - hit) / (9.6 - hit)) ** 1.2
        axes.plot(before, rise, color=colour, lw=1.8, ls=line)
        axes.plot(after, fall, color=colour, lw=1.8, ls=line)
        axes.plot(hit, place, "o", color=colour, ms=6)
    q, later = 0.55 + 0.05 * 4.0, 0.55 + 0.05 * 5.6
    axes.plot([4, 4, 5.6, 5.6], [q, -1.0, -1.0, later], color=style.muted, lw=0.8, ls=":")
    arrow(axes, (4, -0.95), (5.6, -0.95), style.muted)
    write(axes, 4.8, -0.88, r"$\delta t_c$", style.ink)
    arrow(axes, (5.75, q), (5.75, later + 0.003), style.hit)
    axes.plot([4, 5.85], [q, q], color=style.muted, lw=0.8, ls=":")
    write(
        axes,
        5.9,
        1.05,
        r"$\delta q_c$: $\nabla g \cdot \delta q_c + (\partial g/\partial t)\,\delta t_c = 0$",
        style.ink,
        ha="left",
        va="center",
    )
    write(axes, 1.9, 0.33, r"$q(t)$", style.colours[0])
    write(axes, 3.3, -0.45, r"$q + \delta q$", style.colours[1])
    write(axes, 9.9, -1.13, r"$t$", style.ink)
    axes.set(xlim=(0, 10.2), ylim=(-1.2, 1.6))
    return figure


def poisson(style: Style) -> Figure:
    """The path of an impact that slides and then sticks, in the plane of its impulses."""
    figure, (axes,) = empty_axes(style, 3.4)
    (n, t), A, mu, e = ROD
    whole = impulses(ROD[0], A, Coefficients(mu, e))
    stop = t / -(A[0, 1] - mu * A[1, 1])
    stuck = -A[0, 1] / A[1, 1]

    def tangential(P: Any) -> Any:
        return np.where(stop > P, -mu * P, -mu * stop + stuck * (P - stop))

    P_1 = whole.normal / (1 + e)
    top = 1.15 * whole.normal
    low = -0.8 * mu * top
    P = np.array([0.0, stop, P_1, whole.normal])
    axes.fill_between([0, top], [0, -mu * top], [0, mu * top], color=style.free)
    axes.plot([0, top, 0, top], [0, -mu * top, 0, mu * top], color=style.grid, lw=1)
    line = np.array([0, top])
    axes.plot(line, (-t - A[0, 1] * line) / A[1, 1], color=style.colours[2], lw=1.3, ls="--")
    ends = np.array([low, 0.7 * mu * top])
    axes.plot((-n - A[0, 1] * ends) / A[0, 0], ends, color=style.colours[4], lw=1.3, ls="-.")
    axes.plot(P[:3], tangential(P[:3]), color=style.colours[0], lw=2.6)
    axes.plot(P[2:], tangential(P[2:]), color=style.colours[1], lw=2.6)
    axes.plot(P, tangential(P), "o", color=style.mass, ms=6)
    deep = float(tangential(top))
    write(axes, 0.35 * stop, deep * 0.62, "slides:\n$dT = -s\\mu\\,dP$", style.colours[0])
    write(axes, 0.75 * top, deep * 0.55, r"sticks: $\sigma = 0$", style.colours[2])
    write(axes, P_1 + 0.02, 0.5 * mu * P_1, r"$\gamma = 0$", style.colours[4], ha="left")
    for place, label in zip(P[1:], ("stops", "$P_1$", "$(1 + e)\\,P_1$"), strict=True):
        axes.plot(
            [place, place], [float(tangential(place)), low], color=style.muted, lw=0.8, ls=":"
        )
        write(axes, place, 1.12 * low, label, style.ink)
    write(axes, 0.8 * top, 0.5 * mu * top, r"cone $|T| \leq \mu P$", style.muted)
    frame(axes, style, "normal impulse $P$", "tangential impulse $T$")
    axes.set(xlim=(0, top), ylim=(1.25 * low, 0.75 * mu * top), xticks=[], yticks=[])
    return figure


MODES = {
    "open": (0.0, 0.0, "open\n(flight)"),
    "stick": (3.6, 0.0, "closed,\nsticks"),
    "slip+": (7.2, 1.2, "closed, slides\n$s = +1$"),
    "slip-": (7.2, -1.2, "closed, slides\n$s = -1$"),
}
# From mode, to mode, word, bend of the arrow, where the word stands.
WORDS = (
    ("open", "stick", "+floor", -0.2, (1.8, 0.46)),
    ("stick", "open", "-floor", -0.2, (1.8, -0.58)),
    ("stick", "slip+", "floor:slip+", -0.22, (4.7, 1.02)),
    ("slip+", "stick", "floor:stick", -0.22, (6.55, 0.33)),
    ("stick", "slip-", "floor:slip-", 0.22, (4.7, -1.14)),
    ("slip-", "stick", "floor:stick", 0.22, (6.55, -0.44)),
    ("open", "slip+", "+floor:slip+", -0.25, (2.6, 1.55)),
    ("slip-", "open", "-floor", -0.25, (2.6, -1.67)),
    ("slip+", "slip-", "floor:slip-", -0.3, (8.6, 0.08)),
    ("slip-", "slip+", "floor:slip+", -0.3, (8.6, -0.2)),
)


def modes(style: Style) -> Figure:
    """The automaton of one contact with friction."""
    figure, (axes,) = empty_axes(style, 3.5)
    box = {"boxstyle": "round,pad=0.45", "fc": style.body, "ec": style.edge, "lw": 1.4}
    for x, y, label in MODES.values():
        axes.text(x, y, label, color=style.ink, fontsize=9.5, ha="center", va="center", bbox=box)
    for start, end, word, bend, at in WORDS:
        look = {
            "arrowstyle": "-|>", "color": style.muted, "lw": 1.2, "shrinkA": 30, "shrinkB": 38,
            "connectionstyle": f"arc3,rad={bend}",
        }  # fmt: skip
        axes.annotate("", xy=MODES[end][:2], xytext=MODES[start][:2], arrowprops=look)
        axes.text(*at, word, color=style.colours[0], fontsize=8.5, ha="center", family="monospace")
    loop = {"arrowstyle": "-|>", "color": style.hit, "lw": 1.4, "connectionstyle": "arc3,rad=1.5"}
    axes.annotate("", xy=(-0.62, -0.22), xytext=(-0.62, 0.22), arrowprops=loop)
    axes.text(-1.5, 0.4, "floor", color=style.hit, fontsize=8.5, ha="center", family="monospace")
    axes.text(-1.5, -0.52, "a hit", color=style.hit, fontsize=8.5, ha="center")
    axes.set(xlim=(-2.1, 9.6), ylim=(-1.95, 1.9))
    return figure


def _reference(order: int, steps: Sequence[int]) -> dmoc.Problem:
    """The reference problem on a mesh."""
    reference = find("cart_pendulum")
    fields = reference.defaults | {"steps": list(steps)}
    return dmoc.Problem(reference.kernels(order), **fields)


def _swing_up(problem: dmoc.Problem) -> dmoc.Solution:
    return dmoc.solve(problem, "ipm", starts=1, verify=False)


def timeline(style: Style) -> Figure:
    """Nodes and inputs of the reference problem on a mesh of order 4."""
    figure = Figure(figsize=(WIDTH, 3.6), facecolor=style.paper, layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    problem = _reference(4, (4, 9))
    solution, lay = _swing_up(problem), Layout.of(problem)
    within = solution.unknowns[lay.index_q_i][:, 0]
    for number, phase in enumerate(solution.phases):
        colour = style.colours[number]
        t, q = phase.t, phase.q[:, 0]
        inside = within[lay.ends[number] : lay.ends[number + 1]]
        middle = (t[1:] + t[:-1]) / 2
        for k in range(len(t) - 1):  # the parabola through the three nodes of a step
            c = np.linspace(0, 1, 12)
            shapes = ((1 - c) * (1 - 2 * c), 4 * c * (1 - c), c * (2 * c - 1))
            curve = sum(s * v for s, v in zip(shapes, (q[k], inside[k], q[k + 1]), strict=True))
            above.plot(t[k] + c * (t[k + 1] - t[k]), curve, color=colour, lw=1.6)
        above.plot(t, q, "o", color=colour, ms=5.5)
        above.plot(middle, inside, "o", mfc=style.paper, mec=colour, ms=4.5)
        u = phase.u[:, 0]
        for k in range(len(t) - 1):
            below.plot(t[k : k + 2], u[2 * k : 2 * k + 2], color=colour, lw=1.8)
        width = t[1] - t[0]
        above.annotate(
            "", xy=(t[1], 0.17), xytext=(t[0], 0.17),
            arrowprops={"arrowstyle": "<->", "color": colour, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
        write(
            above,
            t[0] + width / 2 if number else t[1] + 0.012,
            0.02 if number else 0.13,
            f"$h_{number}$",
            colour,
        )
    hit = solution.collisions[0].time
    for axes in (above, below):
        axes.set_facecolor(style.paper)
        axes.axvline(hit, color=style.hit, lw=1.2, ls=":")
    frame(above, style, "", r"$\alpha$ [rad]")
    frame(below, style, "time [s]", "F [N]")
    write(
        above,
        hit + 0.012,
        1.5,
        "collision: one node,\n$v^-$ and $v^+$",
        style.hit,
        ha="left",
        va="top",
        fontsize=9,
    )
    write(above, 0.93, 0.75, "nodes of steps, and inside", style.muted, ha="right", fontsize=9)
    write(below, 0.93, -20, "two values a step", style.muted, ha="right", fontsize=9)
    above.set_ylim(-0.05, 1.75)
    return figure


def pattern(style: Style) -> Figure:
    """Entries of the matrix of a Newton step, as stated and in the order in time."""
    nlp = Transcription(_reference(2, (4, 5)))
    K = kkt_layout(nlp)
    column = np.repeat(np.arange(K.size), np.diff(K.start))
    of_place = np.empty(K.size, dtype=int)  # index of the unknown or of the row at a place of K
    of_place[K.place[K.place >= 0]] = np.flatnonzero(K.place >= 0)
    upper = np.stack([K.row, column], axis=1)
    place = np.vstack([upper, upper[:, ::-1]])
    at = np.unique(of_place, return_inverse=True)[1][place]
    lay = nlp.layout
    special = {
        *np.ravel(lay.index_h),
        *np.ravel(lay.impact.lam),
        *np.ravel(lay.impact.v_a),
        *np.ravel(lay.impact.v_c),
    }
    of_hit = np.isin(of_place[place], [*special]).any(axis=1)
    figure, axes = empty_axes(style, 3.7, 2)
    for a, ij, title in (
        (axes[0], at, "unknowns, then equations"),
        (axes[1], place, "in the order of the time"),
    ):
        a.plot(ij[~of_hit, 1], ij[~of_hit, 0], "s", color=style.colours[0], ms=1.9, mew=0)
        a.plot(ij[of_hit, 1], ij[of_hit, 0], "s", color=style.hit, ms=2.9, mew=0)
        a.set(xlim=(-1, K.size), ylim=(K.size, -1), aspect="equal")
        frame(a, style, title, "")
        a.spines[["top", "right"]].set_visible(True)
        a.spines[["top", "right"]].set_color(style.muted)
        a.set(xticks=[], yticks=[])
    return figure


def tree(style: Style) -> Figure:
    """The tree of the reference problem up to two hits, as a search finds it."""
    problem = _reference(2, (100, 100)).but(steps=100)
    nodes = {n.sequence: n for n in dmoc.search(problem, max_collisions=2).nodes}
    figure, (axes,) = empty_axes(style, 3.1)
    spread = {0: 0.0, 1: 2.0, 2: 1.0}

    def place(sequence: tuple[str, ...]) -> tuple[float, float]:
        x = sum((1 if s == "upper" else -1) * spread[k] for k, s in enumerate(sequence, 1))
        return x, -1.1 * len(sequence)

    for sequence in sorted(nodes, key=len, reverse=True):
        if sequence:
            (x, y), (x_0, y_0) = place(sequence), place(sequence[:-1])
            axes.plot([x_0, x], [y_0, y], color=style.muted, lw=1.2, zorder=1)
            write(
                axes,
                (x_0 + x) / 2 + (0.2 if x > x_0 else -0.2),
                (y_0 + y) / 2 + 0.12,
                sequence[-1],
                style.muted,
                fontsize=9,
            )
    for sequence, node in nodes.items():
        x, y = place(sequence)
        cost = "" if node.cost is None else f"{node.cost:.1f}"
        box = {
            "boxstyle": "round,pad=0.4",
            "fc": style.verdicts[str(node.verdict)],
            "ec": style.edge,
        }
        label = f"{cost}\n{node.verdict}".strip()
        axes.text(
            x, y, label, color=style.on_verdict, fontsize=9, ha="center", va="center", bbox=box
        )
    write(axes, 1.0, 0.0, "no collision", style.muted, fontsize=9, va="center", ha="left")
    axes.set(xlim=(-3.9, 3.9), ylim=(-2.65, 0.45))
    return figure


def check(style: Style) -> Figure:
    """A coarse motion of the reference problem, the flow from its segments, and the open loop."""
    from scipy.integrate import solve_ivp

    problem = _reference(2, (8, 16))
    solution = _swing_up(problem)
    model: Model = problem.model

    def flow(y: np.ndarray, span: tuple[float, float], phase: Any) -> Any:
        def slope(t: float, y: np.ndarray) -> np.ndarray:
            k = int(np.clip(np.searchsorted(phase.t, t, side="right") - 1, 0, len(phase.u) - 1))
            return np.concatenate([y[2:], model.acceleration(y[:2], y[2:], phase.u[k])])

        most = float(phase.t[1] - phase.t[0]) / 2
        return solve_ivp(slope, span, y, max_step=most, dense_output=True, rtol=1e-8, atol=1e-9)

    def velocity(phase: Any, k: int) -> np.ndarray:
        return np.asarray(model.velocity(phase.q[k], phase.p[k]))

    figure, (axes,) = empty_axes(style, 3.4)
    state = None
    for phase in solution.phases:
        axes.plot(phase.t, phase.q[:, 0], "o", color=style.colours[0], ms=5, zorder=3)
        size = max(len(phase.u) // 4, 1)
        for k in range(0, len(phase.t) - 1, size):
            end = min(k + size, len(phase.t) - 1)
            start = np.concatenate([phase.q[k], velocity(phase, k)])
            run = flow(start, (phase.t[k], phase.t[end]), phase)
            t = np.linspace(phase.t[k], phase.t[end], 30)
            axes.plot(t, run.sol(t)[0], color=style.colours[2], lw=2.2)
        begin = np.concatenate([phase.q[0], velocity(phase, 0)]) if state is None else state
        run = flow(begin, (phase.t[0], phase.t[-1]), phase)
        t = np.linspace(phase.t[0], phase.t[-1], 80)
        axes.plot(t, run.sol(t)[0], color=style.colours[1], lw=1.5, ls="--")
        end_state = run.y[:, -1]
        after = end_state.copy()
        n = np.array([-1.0, 0.0])  # the limiter `lower`
        response, inertia = model.impulse_response(end_state[:2], n)
        after[2:] -= 2 * float(n @ end_state[2:]) / inertia * response
        state = after
    hit = solution.collisions[0].time
    axes.axvline(hit, color=style.hit, lw=1, ls=":")
    write(
        axes,
        hit + 0.01,
        0.08,
        "impact: rates, impulse,\nwhole momentum, position",
        style.hit,
        ha="left",
        fontsize=9,
    )
    write(
        axes,
        0.99,
        0.98,
        "flow from the first node of each segment",
        style.colours[2],
        ha="right",
        fontsize=9,
    )
    write(axes, 0.99, 0.82, "open loop: the inputs alone", style.colours[1], ha="right", fontsize=9)
    write(axes, 0.99, 1.14, "planned nodes", style.colours[0], ha="right", fontsize=9)
    frame(axes, style, "time [s]", r"$\alpha$ [rad]")
    axes.set_ylim(bottom=0)
    return figure


DRAWINGS: dict[str, Draw] = {
    f.__name__: f for f in (gap, variation, poisson, modes, timeline, pattern, tree, check)
}
