"""Large systems and those with definitions are shown by their structure, whose equations say the
same as those written out."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import chain_system, double_pendulum, rod_system

import dmoc
from dmoc.base.errors import ModelError
from dmoc.symbolic.derivation.document import Derivation, Section

H = 0.1
m, l, g = sp.symbols("m l g")
Values = dict[str, float]


def evaluated(sections: list[Section], values: Values) -> Values:
    """Values of the names of equations, one after the other."""
    values = dict(values)
    for section in sections:
        for e in section.equations:
            if not isinstance(e.right, sp.MatrixBase):
                at = {s: values[s.name] for s in e.right.free_symbols}
                values[e.name] = float(e.right.subs(at))
    return values


def of_step(system: dmoc.MechanicalSystem) -> tuple[Values, list[Any]]:
    """Values of what is shown of the middle of a random step and of the step itself, and the
    inputs of the kernel ``step``."""
    sections = list(dmoc.derive(system).sections)
    first = next(i for i, s in enumerate(sections) if s.title == "Midpoint of a step")
    rng = np.random.default_rng(0)
    q_k, q_kp1 = rng.uniform(0.2, 0.9, (2, len(system.coordinates)))
    u_k, u_kp1 = rng.uniform(0.2, 0.9, (2, len(system.inputs)))
    names = [str(q.func) for q in system.coordinates]
    inputs = [str(u.func) for u in system.inputs]
    par = {s.name: float(x) for s, x in system.parameters.items() if x is not None}
    at = dict(zip(names, (q_k + q_kp1) / 2, strict=True)) | par | {"t": H / 2}
    at |= {f"{n}_dot": v for n, v in zip(names, (q_kp1 - q_k) / H, strict=True)}
    at |= dict(zip(inputs, u_k, strict=True)) | {f"delta_{n}": 0.0 for n in names}
    middle = evaluated(sections[:first], at)
    step = par | {f"{name}_m": x for name, x in middle.items()} | {"h": H, "t_k": 0.0}
    for tag, q, u in (("k", q_k, u_k), ("kp1", q_kp1, u_kp1)):
        step |= {f"{n}_{tag}": x for n, x in zip((*names, *inputs), (*q, *u), strict=True)}
    discrete = [s for s in sections[first:] if s.title.startswith(("Discrete", "Midpoint"))]
    parts = (q_k, q_kp1, u_k, u_kp1, [H], [0.0], [], [*par.values()])
    return middle | evaluated(discrete, step), [np.array([p]) for p in parts]


def smooth_pendulum(named: bool) -> dmoc.MechanicalSystem:
    return double_pendulum(named, relative=True, cost=dynamicsymbols("u") ** 2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "plain"),
    [
        (smooth_pendulum(True), smooth_pendulum(False)),
        (chain_system(3, True), chain_system(3, True)),
    ],
)
def test_the_structure_has_the_values_of_what_is_written_out(
    system: dmoc.MechanicalSystem, plain: dmoc.MechanicalSystem
) -> None:
    """The other side is differentiated by SymPy; of a step it is the kernel."""
    values, inputs = of_step(system)
    at = dict(plain.parameters) | {dynamicsymbols._t: H / 2}
    at |= {s: values[str(s.func)] for s in (*plain.coordinates, *plain.inputs)}
    rates = [(q.diff(), values[f"{q.func}_dot"]) for q in plain.coordinates]

    def number(e: Any) -> Any:
        return pytest.approx(float(e.subs(rates).subs(at)), rel=1e-12, abs=1e-14)

    L, names = plain.lagrangian, [str(q.func) for q in plain.coordinates]
    states = zip(plain.coordinates, plain.velocities, plain.force_vector, names, strict=True)
    for q, v, Q, n in states:
        assert values[f"p_{n}"] == number(L.diff(v))
        assert values[f"f_{n}"] == number(L.diff(q))
        assert values[f"Q_{n}"] == number(Q)
        for w, m in zip(plain.velocities, names, strict=True):
            assert values.get(f"M_{n}_{m}", values.get(f"M_{m}_{n}", 0)) == number(
                L.diff(v).diff(w)
            )
        for surface, g in plain.gaps.items():
            assert values.get(f"n_{surface}_{n}", 0.0) == number(g.diff(q))
    r_minus, r_plus, cost, _ = dmoc.build(plain, backend="numpy").call("step", *inputs)
    for i, n in enumerate(names):
        assert values[f"r_minus_{n}"] == pytest.approx(r_minus[0, i], rel=1e-11)
        assert values[f"r_plus_{n}"] == pytest.approx(r_plus[0, i], rel=1e-11)
    assert values["C_d"] == pytest.approx(cost[0, 0], rel=1e-12)


@cache
def derived(named: bool, order: int = 2, expanded: bool = True) -> Derivation:
    """A double pendulum; of order 4 one that nothing damps, whose formulas are shorter."""
    fields = {} if order == 2 else {"dissipation": 0, "parameters": {m: 0.5, l: 0.4, g: 9.81}}
    system = double_pendulum(named, cost=0, path_constraints={}, **fields)
    return dmoc.derive(system, order, expanded=expanded)


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
def test_what_is_written_out_on_demand_is_what_was_stated_without_names(order: int) -> None:
    ours, expected = derived(True, order), derived(False, order)
    assert [s.title for s in ours.sections] == [s.title for s in expected.sections]
    assert [s.pattern for s in ours.sections] == [s.pattern for s in expected.sections]
    for a, b in zip(ours.sections[:-3], expected.sections[:-3], strict=True):
        for one, other in zip(a.equations, b.equations, strict=True):
            assert one.name == other.name
            difference = sp.Matrix([sp.sympify(one.right) - sp.sympify(other.right)])
            symbols = sorted(difference.free_symbols, key=str)
            at = {s: 0.3 + 0.1 * i for i, s in enumerate(symbols)}
            np.testing.assert_allclose(np.array(difference.subs(at), float), 0, atol=1e-12)


def test_small_systems_are_written_out() -> None:
    system = rod_system()
    assert dmoc.derive(system) == dmoc.derive(system, expanded=True)


@pytest.mark.slow
@pytest.mark.parametrize(("links", "order"), [(12, 2), (6, 6)])
def test_a_long_chain_is_shown_in_pages_not_books(links: int, order: int) -> None:
    derivation = dmoc.derive(chain_system(links), order)
    text, latex = str(derivation), derivation.latex()
    assert len(text) < 1e5 and len(latex) < 1e5
    assert "Named" not in text + latex and "Derivative" not in text + latex
    assert derivation.sections[-3].pattern and not derivation.sections[-3].equations


@pytest.mark.slow
def test_patterns_are_those_of_what_is_written_out() -> None:
    structure, written = (derived(True, expanded=e).sections for e in (False, True))
    assert structure[-3].pattern == written[-3].pattern
    assert structure[-2].pattern == written[-2].pattern


def test_names_of_the_derivation_may_be_those_of_definitions() -> None:
    a, u, *names = dynamicsymbols("a u L z_1 f_a M_a_a h E t_k L_m a_m R_a x_k")
    definitions, last = {}, sp.sin(a)
    for name in names:
        definitions[name] = last = last * sp.cos(a) + a
    system = dmoc.MechanicalSystem(
        "odd", [a], sum(n.diff() ** 2 for n in names), inputs=[u], forces={a: u},
        dissipation=names[3].diff() ** 2, cost=names[0] ** 2, surfaces={"L": names[2] <= 1},
        definitions=definitions,
    )  # fmt: skip
    derivation = dmoc.derive(system)
    stated = [e.name for section in derivation.sections for e in section.equations]
    assert len(set(stated)) == len(stated)
    assert "L~, " in derivation.sections[0].text and "z_1~" in derivation.sections[0].text


def test_every_name_of_the_structure_is_stated_before_it_is_used() -> None:
    system = double_pendulum(True, relative=True)
    stated = {str(q.func) for q in (*system.coordinates, *system.inputs)}
    stated |= {f"{q}_dot" for q in stated} | {s.name for s in system.parameters} | {"t"}
    for section in dmoc.derive(system).sections:
        if section.title == "Midpoint of a step":
            break
        for e in section.equations:
            used = {s.name for s in e.right.free_symbols if not s.name.startswith("delta_")}
            assert used <= stated, (e.name, used - stated)
            stated.add(e.name)


def test_expanded_is_true_or_false() -> None:
    with pytest.raises(ModelError, match="expanded = 'yes': expected True or False"):
        dmoc.derive(rod_system(), expanded="yes")  # type: ignore[arg-type]
