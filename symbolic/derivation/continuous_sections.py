"""Sections of what is continuous: Lagrangian, momenta, forces, motion, surfaces, friction, and the
shortest time to a surface."""

from __future__ import annotations

from collections.abc import Iterable

import sympy as sp

from dmoc.motion.impact_laws import IMPACT_LAWS, law_of
from dmoc.symbolic.contact_references import has_forces
from dmoc.symbolic.continuous import (
    Continuous,
    dot,
    energy,
    input_matrix,
    keeps_rate,
    mass_matrix,
    momenta,
    right_hand_side,
)
from dmoc.symbolic.derivation.document import (
    Equation,
    Section,
    definition,
    definitions,
    latex_of,
    upright,
)
from dmoc.symbolic.derivation.symbols import DisplayNames, latex_symbol
from dmoc.symbolic.event_sums import event_terms, hit_quantities
from dmoc.symbolic.expressions import sliding_speed
from dmoc.symbolic.graph import gradient
from dmoc.symbolic.shortest_times import approach, first_root
from dmoc.symbolic.system import MechanicalSystem

QUANTITIES = "z, which have names as states do."
FORCES = (
    " Normal forces N, friction T and forces R of constraints obey M q'' = dL/dq - (d2L/dq'dq) q' +"
    " Q - sum N grad g + sum T grad tau + sum R grad phi, with g'' = 0, phi'' = 0, and tau'' = 0 of"
    " what sticks or T = -s mu N of what slides."
)

KINDS_OF_CONSTRAINTS = (
    (False, "phi", r"\phi", "Constraints", "phi = 0 in every phase, by forces R grad phi."),
    (
        True, "c", "c", "Constraints of velocities",
        "c = 0 in every phase, by forces R dc/dq'. They stand beside R grad phi, as"
        " c' = 0 beside phi'' = 0.",
    ),
)  # fmt: skip


def continuous_sections(
    system: MechanicalSystem, f: Continuous, own: DisplayNames
) -> Iterable[Section]:
    names = [str(q) for q in f.q]
    tex = [latex_symbol(str(q)) for q in f.q]
    accelerations = [own.symbol(f"{n}_ddot", "acceleration") for n in names]
    time = ", t" if f.L.has(f.t) else ""
    yield Section(
        "Lagrangian",
        f"L(q, q'{time}) with the coordinates q = (" + ", ".join(names) + ").",
        (definition(own, "L", "L", f.L),),
    )
    yield Section("Momenta", "p = dL/dq'.", tuple(definitions(own, "p", names, tex, momenta(f))))
    yield Section(
        "Mass matrix", "M = d2L/dq'2.", (definition(own, "M", "M", sp.Matrix(mass_matrix(f))),)
    )
    yield Section("Energy", "E = p . q' - L.", (definition(own, "E", "E", sp.expand(energy(f))),))
    work = dot(f.Q, [own.symbol(f"delta_{n}", "variation") for n in names])
    forces = [Equation("delta W", r"\delta W", work), *definitions(own, "Q", names, tex, f.Q)]
    if f.u:
        forces.append(Equation("dQ/du", r"\partial Q / \partial u", sp.Matrix(input_matrix(f))))
    yield Section("Virtual work and generalised forces", "delta W = Q . delta q.", tuple(forces))
    left = sp.Matrix(mass_matrix(f)) * sp.Matrix(accelerations)
    motion = [
        Equation(sp.sstr(a), latex_of(a), b, a)
        for a, b in zip(left, right_hand_side(f), strict=True)
    ]
    partial = " - d2L/dq'dt" if time else ""
    yield Section(
        "Equations of motion", f"M q'' = dL/dq - (d2L/dq'dq) q'{partial} + Q.", tuple(motion)
    )
    yield from gap_sections(system, f, own)
    yield from held_sections(system, f, own)


def gap_sections(system: MechanicalSystem, f: Continuous, own: DisplayNames) -> Iterable[Section]:
    """Gaps of surfaces, and of the places of grips behind them."""
    surfaces = len(system.surfaces)
    gaps = list(zip(system.gaps, f.g, strict=True))
    for title, text, of in (
        (
            "Unilateral constraints", "g <= 0; the gradient points out of the admissible set.",
            gaps[:surfaces],
        ),
        (
            "Grips", "g = -phi; g = 0 while it is closed, with forces of both signs, and anything "
            "while it is open.", gaps[surfaces:],
        ),
    ):  # fmt: skip
        equations = list[Equation]()
        for name, g in of:
            tag = f"g_{upright(name)}"
            equations.append(definition(own, f"g_{name}", tag, g))
            slope = sp.Matrix([gradient(g, f.q)])
            equations.append(Equation(f"grad g_{name}", rf"\nabla {tag}", slope))
            if g.has(f.t):
                equations.append(Equation(f"dg_{name}/dt", rf"\partial_t {tag}", g.diff(f.t)))
        if equations:
            yield Section(title, text, tuple(equations))


def held_sections(system: MechanicalSystem, f: Continuous, own: DisplayNames) -> Iterable[Section]:
    """Ends of surfaces, quantities, constraints, and friction."""
    if f.within:
        names = [list(system.surfaces)[j] for j in f.ends]
        numbered = [(n, names[:i].count(n) + 1) for i, n in enumerate(names)]
        values = tuple(
            definition(own, f"W_{n}_{k}", rf"W_{{{upright(n)},{k}}}", w)
            for (n, k), w in zip(numbered, f.within, strict=True)
        )
        text = "W >= 0 where a surface is: elsewhere nothing is touched or passed."
        yield Section("Ends of surfaces", text, values)
    if f.z:
        named = zip(system.quantities_along, f.z, strict=True)
        values = tuple(definition(own, f"z_{n}", f"z_{upright(n)}", z) for n, z in named)
        yield Section("Quantities", QUANTITIES + FORCES * has_forces(system), values)
    if of_hits := hit_quantities(system):
        told = (
            f"{t.name} is {t.value} at {f'hit {t.hit}' if t.hit else 'each hit'} of {t.surface}."
            for t in of_hits
        )
        yield Section("Quantities of hits", " ".join(told), ())
    if f.c:
        named = zip(system.integrals, f.c, strict=True)
        values = tuple(definition(own, f"I_{n}", f"I_{upright(n)}", c) for n, c in named)
        text = "Integrands over the motion."
        for term in event_terms(system):
            every = f"Hit {term.hit}" if term.hit else "Each hit"
            text += f" {every} of {term.surface} adds {term.value} to {term.name}."
        yield Section("Integrals", text, values)
    if f.w:
        named = zip(system.switches, f.w, strict=True)
        values = tuple(definition(own, f"w_{n}", f"w_{upright(n)}", w) for n, w in named)
        yield Section("Switches", "Events where w = 0 and dw/dt >= 0.", values)
    if system.objective != 0:
        places = (*system.coordinates, *system.velocities), (*f.q, *f.v)
        shown = system.objective.xreplace(dict(zip(*places, strict=True)))
        value = Equation("J", "J", shown)
        yield Section("Objective", "What is minimised beside the cost.", (value,))
    of_rates = [keeps_rate(f, phi) for phi in f.phi]
    for by_rate, letter, tag, title, text in KINDS_OF_CONSTRAINTS:
        of_kind = zip(system.constraints, f.phi, of_rates, strict=True)
        values = tuple(
            definition(own, f"{letter}_{n}", f"{tag}_{upright(n)}", value)
            for n, value, rate in of_kind
            if rate == by_rate
        )
        if values:
            yield Section(title, text, values)
    if f.tau:
        equations = []
        for k, (name, tau, mu) in enumerate(zip(system.tangents, f.tau, f.mu, strict=True)):
            tag, of = upright(name), "sigma" if keeps_rate(f, tau) else "tau"
            equations.append(definition(own, f"{of}_{name}", rf"\{of}_{tag}", tau))
            letter, symbol = ("mu", r"\mu") if name in system.surfaces else ("F", "F")
            if name in system.friction:
                equations.append(definition(own, f"{letter}_{name}", f"{symbol}_{tag}", mu))
                if mu != f.mu_s[k]:
                    static = f"{letter}_s_{name}", f"{symbol}_{{s,{tag}}}", f.mu_s[k]
                    equations.append(definition(own, *static))
            if name in system.tangential_restitution:
                equations.append(definition(own, f"e_t_{name}", f"e_{{t,{tag}}}", f.e_t[k]))
        text = (
            "Tangential positions tau. A contact that sticks keeps tau, with a tangential impulse "
            "|T| <= mu P and P the normal one; one that slides with the sign s has T = -s mu P. A "
            "rail has the largest force F instead of mu P/h."
        )
        if any(keeps_rate(f, tau) for tau in f.tau):
            text += " Of others the sliding velocities sigma are given."
        if any(isinstance(mu, sp.Tuple) for mu in system.friction.values()):
            text += (
                " What sticks in a phase has mu_s, or F_s, which it has reached where it slides."
            )
        if sliding_speed in set().union(*(mu.free_symbols for mu in f.mu)):
            text += (
                " sliding_speed is |sigma|, sigma the rate of tau; a single coefficient has its "
                "value at rest, mu_s or F_s, where it sticks."
            )
        yield Section("Friction", text + "".join(_impact_laws(system)), tuple(equations))


def _impact_laws(system: MechanicalSystem) -> Iterable[str]:
    """Sentences on the laws of hits with a tangential impulse."""
    facts = system.impact_laws, system.tangential_restitution
    laws = {name: law_of(name, *facts) for name in system.surfaces if name in system.tangents}
    for law in dict.fromkeys(laws.values()):
        names = " and ".join(name for name, other in laws.items() if other == law)
        yield f" Hits of {names} obey {IMPACT_LAWS[law].name}: {IMPACT_LAWS[law].says}."


def minimal_time_section(
    system: MechanicalSystem, f: Continuous, own: DisplayNames
) -> Iterable[Section]:
    if not f.g or any(g.has(f.t) for g in f.g):
        return
    a = [own.symbol(f"{q}_ddot_bar", "averaged") for q in f.q]
    half_way = {q: own.symbol(f"{q}_bar", "half-way") for q in f.q}
    equations = []
    for name, g in zip(system.gaps, f.g, strict=True):
        time = first_root(*approach(g, f, a, half_way))
        tag = rf"T_{{\min,{upright(name)}}}"
        equations.append(definition(own, f"T_min_{name}", tag, time))
    yield Section(
        "Minimal collision time",
        "First root of g + g' t + g'' t^2/2. The accelerations (_ddot_bar) are constant: M q'' = "
        "F at averaged coefficients, half-way (_bar) between the phase's start and its collision, "
        "with the inputs at the bounds that drive towards the surface. It is an estimate and no "
        "lower bound.",
        tuple(equations),
    )
