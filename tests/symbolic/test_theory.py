"""The identities of docs/theory.md, derived with SymPy from the principle that it begins with."""

from __future__ import annotations

import re
import sys
from typing import Any

import pytest
import sympy as sp
from pages import DOCS
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.models import catalogue
from dmoc.motion.attitude import rates, rotation
from dmoc.symbolic.continuous import mass_matrix, readable, right_hand_side
from dmoc.symbolic.discrete import StepElement, step_element
from dmoc.symbolic.shortest_times import first_root

T = dynamicsymbols._t


def zero(expression: sp.Expr) -> bool:
    return bool(sp.cancel(sp.together(expression)) == 0)


# The step -----------------------------------------------------------------------------------------


def thrown(order: int) -> tuple[StepElement, dict[sp.Symbol, sp.Expr], sp.Symbol]:
    """The element of a mass with a weight w and a constant force u, on its exact motion
    q = a + b t + (u - w) t^2 / 2 m."""
    q, u = dynamicsymbols("q u")
    m, w, a, b = sp.symbols("m w a b", positive=True)
    system = dmoc.MechanicalSystem(
        "thrown", [q], m * q.diff() ** 2 / 2 - w * q, {m: 1, w: 1}, inputs=[u], forces={q: u}
    )
    e = step_element(readable(system), order, sp.Symbol, sp.sympify)
    h, t = e.h, sp.Symbol("t")
    motion = a + b * t + (e.u_k[0] - w) * t**2 / (2 * m)
    values = dict(e.definitions) | {e.u_kp1[0]: e.u_k[0]}
    nodes = [sp.S.Zero, h, *((h * c) for c in (sp.Rational(1, 2),)[: e.inside])]
    places = {
        s: motion.subs(t, c) for s, c in zip((x for n in e.nodes for x in n), nodes, strict=True)
    }
    exact = {s: sp.sympify(v).subs(places) for s, v in values.items()}
    return e, exact | places | {sp.Symbol("motion"): motion}, t


def test_discrete_momenta_and_energies_are_those_of_the_motion() -> None:
    """{legendre}, {energies}: with a constant force the parabola of order 4 is exact, and what the
    step says at its ends is p and -E of the motion."""
    e, exact, t = thrown(4)
    m, w = sp.symbols("m w", positive=True)
    motion, h = exact.pop(sp.Symbol("motion")), e.h

    def of(expression: sp.Expr) -> sp.Expr:
        return expression.subs(exact).subs(e.u_kp1[0], e.u_k[0])

    rate = motion.diff(t)
    energy = m * rate**2 / 2 + w * motion
    assert zero(of(e.r_minus[0]) + m * rate.subs(t, 0))
    assert zero(of(e.r_plus[0]) - m * rate.subs(t, h))
    assert zero(of(e.r_i[0]))
    assert zero(of(e.e_plus) + energy.subs(t, h))
    assert zero(of(e.e_minus) + energy.subs(t, 0))


def test_a_brake_acts_at_a_node_as_a_force_of_its_inputs() -> None:
    """{varying-friction}: -s mu h with the mean of the inputs of both steps, of a rail with the
    largest force 2 u, is what the steps make of the force -2 s u."""
    q, u = dynamicsymbols("q u")
    system = dmoc.MechanicalSystem("braked", [q], q.diff() ** 2 / 2, inputs=[u], forces={q: -2 * u})
    e = step_element(readable(system), 2, sp.Symbol, sp.sympify)
    before, after = sp.symbols("u_before u_after")
    at_end = e.fd_plus[0].subs(e.u_kp1[0], before)
    at_start = e.fd_minus[0].subs(e.u_k[0], after)
    assert zero(at_end + at_start + 2 * e.h * (before + after) / 2)


@pytest.mark.parametrize("m", [1, 2, 3])
def test_errors_of_rates_at_the_nodes_of_a_step_cancel(m: int) -> None:
    """{sliding-rates}: with Lobatto's weights, times polynomials below the degree of the step."""
    x = sp.Symbol("x")
    roots = sp.Poly(sp.legendre(m, 2 * x - 1).diff(x), x).nroots(n=30) if m > 1 else []
    nodes = [sp.S.Zero, *sorted(roots), sp.S.One]
    shapes = [sp.interpolate([(c, sp.Integer(c == b)) for c in nodes], x) for b in nodes]
    weights = [sp.integrate(shape, (x, 0, 1)) for shape in shapes]
    for power in range(m):
        errors = [
            sum(l.diff(x).subs(x, a) * b ** (m + 1) for l, b in zip(shapes, nodes, strict=True))
            - (m + 1) * a**m
            for a in nodes
        ]
        assert max(map(abs, errors)) > 0.1
        moment = sum(w * a**power * e for w, a, e in zip(weights, nodes, errors, strict=True))
        assert abs(moment) < 1e-20


def test_the_action_of_two_steps_is_stationary_where_their_momenta_agree() -> None:
    """{del}: the derivative of the sum of two actions in the node between, with its virtual
    work."""
    x, y, z, h, m, c, u = sp.symbols("x y z h m c u")

    def action(a: sp.Expr, b: sp.Expr) -> sp.Expr:
        return h * (m * ((b - a) / h) ** 2 / 2 - c * sp.sin((a + b) / 2))

    first, second = action(x, y), action(y, z)
    r_plus, r_minus = first.diff(y) + h / 2 * u, second.diff(y) + h / 2 * u
    assert zero((first + second).diff(y) + h * u - r_plus - r_minus)


# Collisions ---------------------------------------------------------------------------------------

M = sp.Matrix(2, 2, lambda i, j: sp.Symbol(f"M{min(i, j)}{max(i, j)}"))
BEFORE, AFTER, LINEAR, NORMAL = (sp.Matrix(sp.symbols(f"{n}_1:3")) for n in ("v", "w", "l", "g"))
LAM, G_T, E = sp.symbols("lam g_t e")


def momentum(v: sp.Matrix) -> sp.Matrix:
    """Of L = v.M v/2 + l.v - V."""
    return M * v + LINEAR


def energy(v: sp.Matrix) -> sp.Expr:
    return (v.T * M * v)[0] / 2 + sp.Symbol("V")


def rate(v: sp.Matrix) -> sp.Expr:
    return NORMAL.dot(v) + G_T


def after_an_impulse() -> dict[sp.Symbol, sp.Expr]:
    """The velocity after, from p- - p+ = lam grad g."""
    equations = list(momentum(BEFORE) - momentum(AFTER) - LAM * NORMAL)
    return sp.solve(equations, list(AFTER), dict=True)[0]


def test_the_variation_at_a_moving_wall_gives_impulse_and_energy() -> None:
    """{variation}, {impact}: p . dq - E dt jumps by nothing for all displacements in space and time
    that stay on g(q, t) = 0."""
    p, E_jump = sp.Matrix(sp.symbols("j_1:3")), sp.Symbol("E_jump")
    free, dt = sp.symbols("free dt")
    # dq_1 follows from grad g . dq + g_t dt = 0.
    dq = sp.Matrix([-(NORMAL[1] * free + G_T * dt) / NORMAL[0], free])
    boundary = p.dot(dq) - E_jump * dt  # jumps before - after of p, and of E
    conditions = [boundary.diff(free), boundary.diff(dt)]
    answer = sp.solve(conditions, [p[1], E_jump], dict=True)[0]
    impulse = p[0] / NORMAL[0]
    assert zero(answer[p[1]] - impulse * NORMAL[1])
    assert zero(-answer[E_jump] - impulse * G_T)  # E+ - E- = lam dg/dt


def test_energy_after_an_impulse() -> None:
    """{impact-energy}: with terms linear in the velocity too."""
    gained = (energy(AFTER) - energy(BEFORE)).subs(after_an_impulse())
    mean = (rate(BEFORE) + rate(AFTER)).subs(after_an_impulse()) / 2
    assert zero(gained - LAM * (G_T - mean))


def test_the_law_of_restitution_is_newtons() -> None:
    """{law} = -lam (gamma+ + e gamma-)/2."""
    gained = (energy(AFTER) - energy(BEFORE)).subs(after_an_impulse())
    after = rate(AFTER).subs(after_an_impulse())
    law = E * (gained - LAM * G_T) - (1 - E) / 2 * LAM * after
    assert zero(law + LAM * (after + E * rate(BEFORE)) / 2)


def test_the_impulse_of_newtons_law() -> None:
    """{impulse}: lam = (1 + e) gamma- / (n . M^-1 n), and the energy that it takes from a wall at
    rest."""
    share = (NORMAL.T * M.inv() * NORMAL)[0]
    newton = (rate(AFTER) + E * rate(BEFORE)).subs(after_an_impulse())
    lam = (1 + E) * rate(BEFORE) / share
    assert zero(newton.subs(LAM, lam)) and newton.diff(LAM) != 0 == newton.diff(LAM, 2)
    lost = (energy(AFTER) - energy(BEFORE)).subs(after_an_impulse()).subs(LAM, lam).subs(G_T, 0)
    assert zero(lost + (1 - E**2) * rate(BEFORE).subs(G_T, 0) ** 2 / (2 * share))


# Friction -----------------------------------------------------------------------------------------


def test_rates_change_linearly_with_the_impulses_of_a_hit() -> None:
    """{poisson}: from the momentum M dv = -grad g dP + grad tau dT."""
    tangent = sp.Matrix(sp.symbols("tau_1:3"))
    dP, dT = sp.symbols("dP dT")
    D = sp.Matrix.hstack(-NORMAL, tangent).T
    A = D * M.inv() * D.T
    dv = M.inv() * (-NORMAL * dP + tangent * dT)
    assert zero(-NORMAL.dot(dv) - (A[0, 0] * dP + A[0, 1] * dT))
    assert zero(tangent.dot(dv) - (A[1, 0] * dP + A[1, 1] * dT))
    # What sticks keeps its rate.
    assert zero(tangent.dot(dv).subs(dT, -A[0, 1] / A[1, 1] * dP))


def test_what_holds_in_a_hit_takes_its_share() -> None:
    """{held}: an impulse along a direction, and that along what holds, which keeps its rate."""
    held, tangent = (sp.Matrix(sp.symbols(f"{n}_1:3")).T for n in ("c", "tau"))
    push, P_b = tangent.T, sp.Symbol("P_b")
    inverse = M.inv()
    dv = inverse * (push + held.T * P_b)
    (impulse,) = sp.solve((held * dv)[0], P_b)
    share = (held * inverse * held.T)[0]
    reduced = inverse - inverse * held.T * held * inverse / share
    assert all(zero(a) for a in dv.subs(P_b, impulse) - reduced * push)


def test_friction_that_obeys_coulombs_law_takes_energy() -> None:
    """{friction-work}: T sigma <= 0 in what slides, and the work of an impulse over a stage is the
    impulse times the mean rate."""
    tangent = sp.Matrix(sp.symbols("tau_1:3"))
    dP, dT = sp.symbols("dP dT")
    dv = M.inv() * (-NORMAL * dP + tangent * dT)
    work = energy(BEFORE + dv) - energy(BEFORE)
    mean = BEFORE + dv / 2
    assert zero(work + dP * NORMAL.dot(mean) - dT * tangent.dot(mean))


def test_coefficients_of_restitution_agree_where_friction_does_not_change() -> None:
    """{coefficients}: the rate falls by the slope k in compression and grows by k' in restitution;
    works of the normal impulse are areas under the rate."""
    gamma, k, later, e = sp.symbols("gamma k later e", positive=True)
    P = sp.Symbol("P")
    compressed = gamma / k
    compression = -sp.integrate(gamma - k * P, (P, 0, compressed))
    restitution = sp.integrate(later * P, (P, 0, e * compressed))
    assert zero(later * e * compressed / gamma - e * later / k)
    assert zero(-restitution / compression - e**2 * later / k)


def test_tangential_restitution_turns_the_rate_and_takes_energy() -> None:
    """{tangential}, {turned}, {tangential-energy}: with the impulses that stop the normal alone and
    all at once."""
    e, back, kappa = sp.symbols("e e_t kappa")
    A = sp.Matrix(2, 2, sp.symbols("A_nn A_nt A_nt A_tt"))
    before = sp.Matrix(sp.symbols("n sigma"))
    first = sp.Matrix([-before[0] / A[0, 0], 0])
    second = -A.inv() * before - first
    smooth = before[1] + A[0, 1] * first[0]
    assert zero(second[1] + smooth / (A[1, 1] - A[0, 1] ** 2 / A[0, 0]))

    def impulses(share: sp.Expr) -> sp.Matrix:
        return (1 + e) * first + (1 + share) * second

    after = before + A * impulses(back)
    assert zero(after[0] + e * before[0])
    assert zero(after[1] + back * smooth - e * (smooth - before[1]))
    P = impulses(kappa)
    work = (P.T * (before + A * P / 2))[0]
    lost = (1 - e**2) * first.dot(A * first) + (1 - kappa**2) * second.dot(A * second)
    assert zero(first.dot(A * second)) and zero(work + lost / 2)


def test_a_ball_slides_in_one_direction_and_takes_energy() -> None:
    """{ball}: where A is diagonal, friction opposite to sigma keeps its direction; in the plane of
    both, the impulse is that of {tangential}."""
    e, back, mu, A_nn, A_tt, n = sp.symbols("e e_t mu A_nn A_tt n")
    sigma = sp.Matrix(sp.symbols("sigma_1 sigma_2", real=True))
    speed = sp.sqrt(sigma.dot(sigma))
    P = (1 + e) * n / A_nn  # n is the rate of the gap, which falls
    sticks, slides = -(1 + back) / A_tt * sigma, -mu * P * sigma / speed
    for T in (sticks, slides):
        after = sigma + A_tt * T
        assert zero(after[0] * sigma[1] - after[1] * sigma[0])
        work = n * -P + P**2 * A_nn / 2 + T.dot(sigma) + A_tt * T.dot(T) / 2
        kappa = -T.dot(sigma) * A_tt / speed**2 - 1
        lost = (1 - e**2) * n**2 / A_nn + (1 - kappa**2) * speed**2 / A_tt
        assert zero(sp.simplify(work + lost / 2))
    assert all(map(zero, sigma + A_tt * sticks + back * sigma))
    m, k, r = sp.symbols("m k r")
    share = 1 / (1 / m + r**2 / (k * m * r**2))
    assert zero(share.subs(k, sp.Rational(2, 5)) - sp.Rational(2, 7) * m)


# The program --------------------------------------------------------------------------------------


def test_sensitivities_need_the_bounds_in_the_lagrangian() -> None:
    """{sensitivity}: least (x - 3)^2 + (y - theta)^2 with y = theta x and x <= beta(theta), where
    the bound holds: dJ/dtheta is the partial derivative of L with -z (x - beta) in it."""
    x, y, Y, z, theta = sp.symbols("x y Y z theta")
    beta = theta / 2
    J = (x - 3) ** 2 + (y - theta) ** 2
    lagrangian = J + Y * (y - theta * x) - z * (x - beta)
    point = {x: beta, y: theta * beta}
    multipliers = sp.solve(
        [lagrangian.diff(x).subs(point), lagrangian.diff(y).subs(point)], [Y, z], dict=True
    )[0]
    least = J.subs(point)
    full = lagrangian.diff(theta).subs(point).subs(multipliers)
    assert zero(least.diff(theta) - full)
    without = (lagrangian + z * (x - beta) - z * x).diff(theta).subs(point).subs(multipliers)
    assert not zero(least.diff(theta) - without)


def test_a_newton_step_is_the_same_without_its_slack() -> None:
    """{newton-step}: the primal-dual step of J with d - eta = 0 and w eta = zeta, and the step that
    is left of it without eta, with y = -w and c_zeta = d - zeta / w."""
    x, eta, w, zeta = sp.symbols("x eta w zeta", positive=True)
    J, d = sp.Function("J")(x), sp.Function("d")(x)
    unknowns, rows = (x, eta, w), sp.Matrix([(J - w * d).diff(x), d - eta, w * eta - zeta])
    whole = rows.jacobian(unknowns).solve(-rows)
    H, G = (J - w * d).diff(x, 2), d.diff(x)
    matrix = sp.Matrix([[H, G], [G, -eta / w]])
    step = matrix.solve(-sp.Matrix([(J - w * d).diff(x), d - zeta / w]))
    assert zero(whole[0] - step[0]) and zero(whole[2] + step[1])


@pytest.mark.parametrize("moved", [False, True])
def test_a_touch_that_becomes_a_collision_changes_the_cost(moved: bool) -> None:
    """{graze}: a cost J_1 of the velocity before, J_2 of that after; the graze has gamma+ = 0 with
    the multiplier y and lam = 0 with the multiplier z, the collision gamma+ = -e s and
    lam = (1 + e) s m / n^2 on a wall with the normal n."""
    v, w, lam, y, Y, z, s, m, n, e = sp.symbols("v w lam y Y z s m n e")
    J_1, J_2 = (sp.Function(f"J_{i}") for i in (1, 2))
    wall = sp.Symbol("u") if moved else sp.S.Zero  # rate of the gap of what rests
    lagrangian = J_1(v) + J_2(w) + Y * (m * (v - w) - lam * n) + y * (n * w + wall) - z * lam
    rest = {v: -wall / n, w: -wall / n}
    slopes = [lagrangian.diff(a).doit() for a in (v, w, lam)]
    multipliers = sp.solve(slopes, [y, Y, z], dict=True)[0]
    formula = e * multipliers[y] + (1 + e) * m / n**2 * multipliers[z]
    collision = {v: (s - wall) / n, w: (-e * s - wall) / n}
    # The collision obeys the momentum equation.
    assert zero(m * (collision[v] - collision[w]) - (1 + e) * s * m / n**2 * n)
    direct = J_1(v).diff(v) * collision[v].diff(s) + J_2(w).diff(w) * collision[w].diff(s)
    assert zero(formula - direct)
    assert zero((formula - direct).subs(rest))
    # The derivative of L with respect to lam itself, printed in the place of z, is none.
    assert zero(lagrangian.diff(lam).subs(multipliers))


def test_the_multiplier_of_a_rough_touch() -> None:
    """{rough-graze}: the impulse of a hit with friction that comes with the rate s."""
    s, A_nn, A_nt, slope, e, P = sp.symbols("s A_nn A_nt slope e P")
    (compressed,) = sp.solve(s - (A_nn + A_nt * slope) * P, P)
    assert zero(((1 + e) * compressed).diff(s) - (1 + e) / (A_nn + A_nt * slope))


def test_the_estimate_of_the_error_from_two_meshes() -> None:
    """{richardson}: errors C h^p of meshes whose steps have the ratio r."""
    C, h, p, r = sp.symbols("C h p r", positive=True)
    change = C * (r * h) ** p - C * h**p
    assert zero(sp.expand_power_base(change / (r**p - 1) - C * h**p))


def test_a_hit_carries_errors_by_its_saltation_matrix() -> None:
    """{saltation}: a ball under gravity on a floor that rises faster and faster, whose flow and hit
    have closed forms."""
    v, q_0, v_0, t, G, w_0, b, e = sp.symbols("v q_0 v_0 t G w_0 b e")
    w = w_0 + b * t
    # The gap is w_0 t + b t^2/2 - q, and R(q, v, t) = (q, w - e (v - w)).
    start = sp.Matrix([q_0, v_0])
    before = sp.Matrix([q_0 + v_0 * t - G * t**2 / 2, v_0 - G * t])
    gap = w_0 * t + b * t**2 / 2 - before[0]
    hit = sp.Function("hit")(q_0, v_0)
    after_hit = sp.Matrix([before[0], w - e * (before[1] - w)]).subs(t, hit)
    s = t - hit
    after = sp.Matrix([after_hit[0] + after_hit[1] * s - G * s**2 / 2, after_hit[1] - G * s])
    slopes = {hit.diff(x): -gap.diff(x).subs(t, hit) / gap.diff(t).subs(t, hit) for x in start}
    exact = after.jacobian(start).subs(slopes).subs(t, hit).doit()
    R = sp.Matrix([[1, 0], [0, -e]])
    rates = sp.Matrix([v, -G]), sp.Matrix([w - e * (v - w), -G])
    gamma = w - v
    later = -sp.Matrix([[-1, 0]]) / gamma
    R_t = sp.Matrix([0, (1 + e) * b])
    saltation = R - (rates[1] - R * rates[0] - R_t) * later
    carried = saltation * before.jacobian(start)
    carried = carried.subs(v, before[1]).subs(t, hit)
    assert all(zero(a - b) for a, b in zip(exact, carried, strict=True))


def test_the_first_estimate_of_the_time_of_a_hit() -> None:
    """{minimal-time}: the root of the quadratic that the kernel takes."""
    g, (rate_, a) = sp.Symbol("g", negative=True), sp.symbols("rate a", positive=True)
    t = first_root(g, rate_, a)
    assert zero(g + rate_ * t + a * t**2 / 2)


def test_the_first_guess_of_the_source_is_that_of_the_equations_of_motion() -> None:
    """{guess}: of the cart-pendulum, x'' sin(alpha) = l alpha'' + g cos(alpha), and where
    sin(alpha) = 0 nothing follows for x''."""
    f = readable(catalogue.system("cart_pendulum"))
    mass, force = sp.Matrix(mass_matrix(f)), sp.Matrix(right_hand_side(f))
    alpha, (m_p, _, l, g, *_) = f.q[0], f.par
    a, b = sp.symbols("a b")
    (rest,) = sp.solve((mass * sp.Matrix([a, b]) - force)[0], b)
    assert zero(rest * sp.sin(alpha) - l * a - g * sp.cos(alpha))
    assert mass[0, 1].subs(alpha, 0) == 0 == mass[0, 1].subs(alpha, sp.pi)
    assert f.Q[0] == 0 and m_p in mass[0, 1].free_symbols


def test_the_angular_velocity_of_a_quaternion_is_that_of_its_rotation() -> None:
    """{quaternion}: R^T R' is the cross product with omega, and Q . p' = tau . omega."""
    tau, rates_of_u = sp.symbols("tau_x tau_y tau_z"), sp.symbols("v_x v_y v_z")
    u = sp.symbols("u_x u_y u_z")  # all unit quaternions but -1, as fractions
    square = sum(ui**2 for ui in u)
    p = tuple(sp.sympify(pi) / (1 + square) for pi in (1 - square, *(2 * ui for ui in u)))

    def rate(value: Any) -> Any:
        return sum((value.diff(ui) * vi for ui, vi in zip(u, rates_of_u, strict=True)), 0 * value)

    R, G = sp.Matrix(rotation(p)), sp.Matrix(rates(p))
    speeds = rate(sp.Matrix(p))
    omega = 2 * G * speeds
    skew = R.T * rate(R)
    for row, column, component in ((2, 1, 0), (0, 2, 1), (1, 0, 2)):
        assert sp.cancel(skew[row, column] - omega[component]) == 0
    assert (R.T * R - sp.eye(3)).applyfunc(sp.cancel) == sp.zeros(3)
    work = (2 * G.T * sp.Matrix(tau)).dot(speeds) - sp.Matrix(tau).dot(omega)
    assert sp.expand(work) == 0


def test_what_is_derived_here_is_on_the_page() -> None:
    tests = [f for name, f in vars(sys.modules[__name__]).items() if name.startswith("test_")]
    labels = {label for f in tests for label in re.findall(r"\{([a-z-]+)\}", f.__doc__ or "")}
    page = (DOCS / "theory.md").read_text()
    assert len(labels) > 15
    assert {label for label in labels if f"$$ ({label})" not in page} == set()
