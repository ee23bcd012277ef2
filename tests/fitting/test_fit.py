"""Parameters from measured motions: what closed forms, simulations and the truth behind noise
say."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import FitError

NOISE = 0.002
THREE = ["wall"] * 3


@pytest.fixture(scope="module")
def hanging() -> dmoc.Problem:
    """A pendulum that is let go and hits the wall at its rest position."""
    return dmoc.Problem(
        dmoc.load("bouncing_pendulum"), start={"theta": None, "theta_dot": None}, sequence=THREE
    )


@pytest.fixture(scope="module")
def swing(hanging: dmoc.Problem) -> dict[str, np.ndarray]:
    """Its angle through three hits with e = 0.8 and g = 9.81, measured with noise."""
    motion = dmoc.simulate(
        hanging.kernels, {"theta": 0.9}, restitution=0.8, step_size=0.001, steps=3200, every=10
    )
    assert [c.surface for c in motion.collisions] == THREE
    rng = np.random.default_rng(3)
    return {"t": motion.t, "theta": motion.q[:, 0] + NOISE * rng.normal(size=len(motion.t))}


@pytest.fixture(scope="module")
def fitted(hanging: dmoc.Problem, swing: dict[str, np.ndarray]) -> dmoc.Fit:
    return dmoc.fit(hanging, swing, {"g": (5, 20), "e": (0, 1)})


def test_values_lie_within_their_errors_of_the_truth(fitted: dmoc.Fit) -> None:
    truth = {"g": 9.81, "e": 0.8, "start of theta": 0.9, "start of theta_dot": 0.0}
    for u in fitted.unknowns:
        assert abs(u.value - truth[u.name]) < 4 * u.error < 0.05
        assert u.low < u.value < u.high
    (sensor,) = fitted.sensors
    assert sensor.sigma == pytest.approx(NOISE, rel=0.1)
    assert fitted.status == "converged" and not fitted.message
    assert min(sensor.runs_test, sensor.normality) > 1e-3


def test_motions_are_checked_and_the_problem_has_the_values(fitted: dmoc.Fit) -> None:
    (motion,) = fitted.motions
    assert motion.solved and [c.word for c in motion.collisions] == THREE
    assert [c.time for c in motion.collisions] == pytest.approx(fitted.event_times["run 1"])
    assert fitted.problem.model.par[0].tolist()[2] == fitted["g"]
    assert fitted.problem.restitution_values.tolist() == [fitted["e"]]


def test_far_first_values_and_missing_hits_are_overcome(
    hanging: dmoc.Problem, swing: dict[str, np.ndarray], fitted: dmoc.Fit
) -> None:
    """Windows begin where whole runs miss, and the word that nobody gives is found."""
    far = hanging.but(sequence=(), parameters={"g": 19.0}, restitution=0.1)
    fit = dmoc.fit(far, swing, {"g": (1, 20), "e": (0, 1)})
    assert fit.words == {"run 1": tuple(THREE)}
    assert fit.message == "no sequence is given: wall, wall, wall fits run 1 best"
    assert fit["e"] == pytest.approx(fitted["e"], abs=1e-6)


def test_a_free_motion_is_the_straight_line_of_least_squares() -> None:
    """x = x_0 + v t: estimates and covariance in closed form."""
    rng = np.random.default_rng(1)
    t = np.sort(rng.random(40)) * 0.5
    t[0] = 0.0
    x = 0.2 + 0.7 * t + 0.01 * rng.normal(size=len(t))
    start = {"x": None, "y": 0.5, "x_dot": None}
    problem = dmoc.Problem(dmoc.load("puck_table"), start=start)
    fit = dmoc.fit(problem, {"t": t, "x": x}, {"m": (0.1, 10)}, sigma={"x": 0.01})
    line, covariance = np.polyfit(t, x, 1, cov="unscaled")
    assert [fit["start of x_dot"], fit["start of x"]] == pytest.approx(line, rel=1e-6)
    assert fit.covariance[1:, 1:][::-1, ::-1] == pytest.approx(1e-4 * covariance, rel=1e-5)
    assert fit.undetermined == ("nothing that is measured depends on m",)
    assert fit["m"] == pytest.approx(1.0, rel=1e-6)
    profile = fit.profile("start of x_dot", 5)
    error = fit.errors["start of x_dot"]
    assert profile.chi2 == pytest.approx([9, 2.25, 0, 2.25, 9], rel=1e-3, abs=1e-6)
    assert profile.high - profile.low == pytest.approx(2 * 1.96 * error, rel=1e-3)


def test_times_between_hits_alone_tell_the_restitution() -> None:
    """Between two walls each flight takes 1/e times as long as the one before."""
    puck = dmoc.Problem(
        dmoc.load("puck_table"), start={"x": 0.0, "y": 0.5, "x_dot": (0.1, None)},
        sequence=["east", "west", "east"],
    )  # fmt: skip
    seen = {"t": [0.0, 0.5, 1.2, 2.18], "event": ["", "east", "west", "east"]}
    fit = dmoc.fit(puck, seen, {"e": (0, 1)}, sigma={"event": 1e-3})
    assert fit["e"] == pytest.approx(1 / 1.4, rel=1e-5)
    assert fit["start of x_dot"] == pytest.approx(2.0, rel=1e-5)


def test_only_ratios_of_masses_are_known_without_a_force(pendulum: Any) -> None:
    start = {"alpha": 0.6, "x": 0.0}
    free = dmoc.simulate(pendulum, start, step_size=0.001, steps=120, every=4)
    pushed = dmoc.simulate(pendulum, start, inputs=[5.0], step_size=0.001, steps=120, every=4)
    problem = dmoc.Problem(pendulum, start=start)
    masses = {"m_p": (0.1, 10), "m_c": (0.1, 10)}
    sigma = {"alpha": 1e-4, "x": 1e-4}
    known = dmoc.identifiable(problem, free, masses, sigma=sigma)
    assert known.undetermined == ("only m_p/m_c is determined: no force is measured",)
    assert np.isinf(known.errors).all()
    assert not dmoc.identifiable(problem, pushed, masses, sigma=sigma).undetermined


def test_sensors_may_be_late_and_wrong(hanging: dmoc.Problem) -> None:
    """The reading gain y(t - delay) + bias of an angle and of its rate."""
    motion = dmoc.simulate(
        hanging.kernels, {"theta": 0.9}, restitution=0.8, step_size=0.001, steps=1500, every=10
    )
    t = motion.t[5:]
    late = dmoc.simulate(
        hanging.kernels, {"theta": 0.9}, restitution=0.8, step_size=0.001, steps=1500
    )
    rate = 1.1 * np.interp(t - 0.02, late.t, late.v[:, 0]) + 0.3
    seen = {"t": t, "theta": motion.q[5:, 0] - 0.05, "theta_dot": rate}
    fit = dmoc.fit(
        hanging.but(sequence=["wall"]), seen,
        {"e": (0, 1), "delay:theta_dot": (0, 0.1), "gain:theta_dot": (0.5, 2),
         "bias:theta_dot": None, "bias:theta": None},
    )  # fmt: skip
    assert fit["delay:theta_dot"] == pytest.approx(0.02, abs=2e-4)
    assert fit["gain:theta_dot"] == pytest.approx(1.1, rel=1e-3)
    assert [fit["bias:theta_dot"], fit["bias:theta"]] == pytest.approx([0.3, -0.05], abs=2e-3)


def test_outliers_count_little_by_hubers_loss(
    hanging: dmoc.Problem, swing: dict[str, np.ndarray], fitted: dmoc.Fit
) -> None:
    spoilt = {**swing, "theta": swing["theta"].copy()}
    spoilt["theta"][::40] += 0.3
    fit = dmoc.fit(hanging, spoilt, {"g": (5, 20), "e": (0, 1)}, loss="huber")
    assert fit.status == "converged"
    assert abs(fit["g"] - fitted["g"]) < 3 * fitted.errors["g"]


def test_runs_share_what_is_not_their_own(hanging: dmoc.Problem) -> None:
    """Two runs with one gravity and a restitution each."""
    runs = [
        dmoc.simulate(
            hanging.kernels, {"theta": angle}, restitution=e, step_size=0.001, steps=900, every=10
        )
        for angle, e in ((0.9, 0.8), (0.5, 0.6))
    ]
    start = [{"theta": 0.9, "theta_dot": 0.0}, {"theta": 0.5, "theta_dot": 0.0}]
    fit = dmoc.fit(
        hanging.but(sequence=["wall"]), runs, {"g": (5, 20), "e": (0, 1)}, start=start, own=["e"]
    )
    assert fit.values == pytest.approx({"g": 9.81, "e of run 1": 0.8, "e of run 2": 0.6}, rel=1e-4)
    assert set(fit.influence) == {"run 1", "run 2"}


def test_a_run_that_was_kept_out_is_predicted(hanging: dmoc.Problem, fitted: dmoc.Fit) -> None:
    other = dmoc.simulate(
        hanging.kernels, {"theta": 0.4}, restitution=0.8, step_size=0.001, steps=2500, every=10
    )
    predicted = fitted.predict(other, {"theta": 0.4, "theta_dot": 0.0})
    assert predicted.relative["theta"] < 0.01
    assert predicted.words == tuple(THREE[: len(other.collisions)]) and not predicted.start


def test_a_fit_is_kept_in_files(fitted: dmoc.Fit, hanging: dmoc.Problem, tmp_path: Path) -> None:
    again = dmoc.Fit.load(fitted.save(tmp_path / "fit.npz"))
    assert again.to_dict() == fitted.to_dict() and str(again) == str(fitted)
    with pytest.raises(FitError, match="a fit from a file has no runs"):
        again.profile("g")
    rows = again.to_csv(tmp_path / "fit.csv").read_text().splitlines()
    assert rows[0] == "run,sensor,t,measured,predicted,residual" and len(rows) == 322
    read = dmoc.fit(hanging, table(tmp_path / "swing.csv", fitted), {"g": (5, 20), "e": (0, 1)})
    assert read["g"] == pytest.approx(fitted["g"], rel=1e-6)
    text = fitted.report(tmp_path / "fit.html").read_text()
    assert "Correlations" in text and '"value": 9.8' in fitted.to_json(tmp_path / "j").read_text()


def table(path: Path, fit: dmoc.Fit) -> Path:
    """What a fit was made of as a user's file, with gaps."""
    rows = [f"{t!r},{x!r}" for t, x in zip(fit.t.tolist(), fit.measured.tolist(), strict=True)]
    path.write_text("\n".join(["t [s],theta [rad]", *rows, "3.3,"]) + "\n")
    return path


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"runs": {"phi": [1.0, 2.0]}}, "unknown column 'phi' of run 1: expected one of t, theta"),
        ({"runs": {"t": [0.0, 0.2, 0.1]}}, "the times of run 1 go back from 0.2 to 0.1 s in row 3"),
        ({"sigma": {"theta": 0}}, "sigma of theta = 0: expected a positive standard deviation"),
        ({"parameters": {"mu": (0, 1)}}, "unknown parameter 'mu' in parameters"),
        ({"parameters": {}}, "expected what is to be fitted"),
        ({"parameters": {"g": 3.0}}, "g = 3 is no range"),
        (
            {"start": {"theta": 0.5}},
            "the start of theta is given as 0.5, and run 1 begins at 0.9005",
        ),
        ({"sequences": [THREE * 2]}, "run 1 ends at 3.2 s, before event 4 of its sequence (wall)"),
        ({"runs": "nothing.csv"}, "nothing.csv cannot be read"),
        ({"runs": []}, "expected a measured run"),
        ({"loss": "l1"}, "loss = 'l1': expected one of linear, huber"),
        ({"own": ["m"]}, "unknown parameter 'm' in own"),
        ({"few": True}, "3 values are measured and 4 unknowns are fitted"),
    ],
)
def test_bad_input_is_refused_in_a_sentence(
    changes: dict[str, Any], words: str, hanging: dmoc.Problem, swing: dict[str, np.ndarray]
) -> None:
    runs: Any = swing
    if changes.pop("few", False):
        runs = {name: values[:3] for name, values in swing.items()}
    given = changes.pop("runs", None)
    if isinstance(given, dict):
        count = len(next(iter(given.values())))
        runs = {name: values[:count] for name, values in swing.items()} | given
    elif given is not None:
        runs = given
    parameters = changes.pop("parameters", {"g": (5, 20), "e": (0, 1)})
    with pytest.raises(FitError, match=re.escape(words)):
        dmoc.fit(hanging, runs, parameters, **changes)


def test_a_track_that_the_word_does_not_fit_is_said_with_one_that_does(
    hanging: dmoc.Problem, swing: dict[str, np.ndarray]
) -> None:
    fit = dmoc.fit(hanging.but(sequence=THREE[:2]), swing, {"g": (5, 20), "e": (0, 1)})
    assert fit.status == "misfit"
    assert "run 1 does not fit: residuals of theta [rad] are" in fit.message
    assert "as wall, wall, wall would" in fit.message and "is behind wall at" in fit.message


def test_a_table_of_hits_tells_the_laws_of_a_racket() -> None:
    """A table-tennis ball on the racket 01 of G. Gossard et al. (arXiv 2604.11349), by the law that
    they found for it, with noise: e = c0 + c1 v_z, and e_t = 0.704 of a hollow sphere."""
    x, z, a = dynamicsymbols("x z a")
    r, k, c0, c1, e_t = sp.symbols("r k c0 c1 e_t")
    ball = dmoc.MechanicalSystem(
        "table_tennis", [x, z, a],
        (x.diff() ** 2 + z.diff() ** 2 + k * r**2 * a.diff() ** 2) / 2,
        {r: 0.02, k: 2 / 3, c0: 1.0, c1: 0.0, e_t: 0.0}, surfaces={"racket": z >= r},
        tangents={"racket": x - r * a}, tangential_restitution={"racket": e_t},
        restitution={"racket": c0 - c1 * dmoc.approach_speed},
    )  # fmt: skip
    rng = np.random.default_rng(0)
    v = np.stack([rng.uniform(-1, 1, 60), rng.uniform(-10, -4, 60), rng.uniform(-300, 300, 60)])
    lost = -(1 + 0.704) * (v[0] - 0.02 * v[2]) / (1 + 1.5)
    after = v[0] + lost, -(0.917 + 0.0217 * v[1]) * v[1], v[2] - lost * 1.5 / 0.02
    noise = 0.05, 0.05, 1.0
    names = "x_dot", "z_dot", "a_dot"
    hits = {f"{name} before": row for name, row in zip(names, v, strict=True)}
    for name, row, size in zip(names, after, noise, strict=True):
        hits[f"{name} after"] = row + size * rng.normal(size=60)
    kernels = dmoc.build(ball, backend="numpy")
    problem = dmoc.Problem(kernels, start={"x": 0, "z": 1, "a": 0}, sequence=["racket"])
    fit = dmoc.fit(problem, hits, {"c0": (0, 1), "c1": (0, 0.1), "e_t": (-1, 1)})
    for name, truth in {"c0": 0.917, "c1": 0.0217, "e_t": 0.704}.items():
        assert abs(fit[name] - truth) < 4 * fit.errors[name] < 0.1
    assert [s.sigma for s in fit.sensors] == pytest.approx(noise, rel=0.3)
    assert not fit.motions and fit.predict(hits).motion is None
    with pytest.raises(FitError, match="is a table of hits, and its sequence has 0 events"):
        dmoc.fit(problem.but(sequence=()), hits, {"e_t": (-1, 1)})


def test_hits_nearly_at_once_are_put_in_their_order() -> None:
    """A puck that meets two walls within 0.05 s, in the other order than its word has them; the
    wall that it meets first lies elsewhere than the model has it."""
    puck = dmoc.load("puck_table")
    motion = dmoc.simulate(
        puck, {"x": 0.3, "y": 0.4}, {"x": 1.5, "y": 1.1}, parameters={"b": 0.95},
        restitution={"east": 0.7, "north": 0.8}, step_size=0.001, steps=800, every=10,
    )  # fmt: skip
    assert [c.surface for c in motion.collisions] == ["east", "north"]
    states = dict.fromkeys(["x", "y", "x_dot", "y_dot"])
    problem = dmoc.Problem(puck, start=states, sequence=["north", "east"])
    unknown = {"b": (0.5, 2), "e:east": (0, 1), "e:north": (0, 1)}
    seen = {"t": motion.t, "x": motion.q[:, 0], "y": motion.q[:, 1]}
    fit = dmoc.fit(problem, seen, unknown, sigma={"x": 0.001, "y": 0.001})
    assert fit.words == {"run 1": ("east", "north")} and "run 1 shows its hits as" in fit.message
    assert [fit[name] for name in unknown] == pytest.approx([0.95, 0.7, 0.8], rel=1e-4)


def test_friction_that_gives_way_and_holds_again(floor: Any) -> None:
    """A block on a rough floor is pushed harder and harder, slides, and sticks again."""
    force = np.where(np.arange(300) < 125, 0.11 * np.arange(300), 0.0)
    start = {"x": 0, "y": 0}
    motion = dmoc.simulate(
        floor, start, inputs=force[:, None], parameters={"m": 1.2, "mu": 0.35}, step_size=0.004,
        steps=300,
    )  # fmt: skip
    seen = {"t": motion.t, "x": motion.q[:, 0], "u": np.append(force, 0.0)}
    block = dmoc.Problem(
        floor, start=start, contacts=["floor"], sequence=["floor:slip+", "floor:stick"]
    )
    fit = dmoc.fit(block, seen, {"m": (0.5, 3), "mu": (0.05, 1)}, sigma={"x": 0.001})
    assert fit.values == pytest.approx({"m": 1.2, "mu": 0.35}, rel=1e-3)
    slips, sticks = (c.time for c in motion.trajectory.collisions)
    assert fit.event_times["run 1"] == pytest.approx([slips, sticks], abs=1e-3)
    assert fit.motions[0].solved


def test_ratios_that_are_known_keep_values_near_those_of_the_problem(
    hanging: dmoc.Problem, swing: dict[str, np.ndarray]
) -> None:
    """Of a pendulum only l/g matters; both are then as near to what was stated as it allows."""
    unknown = {"l": (0.5, 2), "g": (5, 20), "e": (0, 1)}
    fit = dmoc.fit(hanging.but(parameters={"g": 9.0}), swing, unknown)
    assert fit.undetermined == ("only l/g is determined",)
    assert fit["g"] / fit["l"] == pytest.approx(9.81, rel=2e-3)
    assert fit["g"] / 9 == pytest.approx(1 / fit["l"], rel=1e-3)
    assert np.isinf(fit.errors["g"]) and fit.errors["e"] < 1e-3


def test_an_event_at_the_begin_leaves_no_motion(
    hanging: dmoc.Problem, swing: dict[str, np.ndarray]
) -> None:
    """A sensor whose sign is wrong."""
    seen = {"t": swing["t"][:100], "theta": -swing["theta"][:100]}
    fit = dmoc.fit(hanging.but(sequence=["wall"]), seen, {"g": (5, 20)})
    assert fit.status == "misfit" and "run 1 does not fit" in fit.message


def test_what_can_be_known_of_a_hit_that_the_laws_say(
    hanging: dmoc.Problem, swing: dict[str, np.ndarray], fitted: dmoc.Fit
) -> None:
    """The errors to expect are those that the fit has then."""
    start = {"theta": (0.5, 1.3), "theta_dot": (-1, 1)}
    problem = hanging.but(sequence=(), start=start, parameters={"g": 9.81}, restitution=0.8)
    known = dmoc.identifiable(problem, swing, {"g": (5, 20), "e": (0, 1)}, sigma={"theta": NOISE})
    assert not known.undetermined
    expected = dict(zip(known.names, known.errors, strict=True))
    assert expected == pytest.approx(fitted.errors, rel=0.1)


def test_the_interval_of_a_value_at_its_bound_ends_there(hanging: dmoc.Problem) -> None:
    motion = dmoc.simulate(hanging.kernels, {"theta": 0.9}, step_size=0.001, steps=900, every=10)
    noise = NOISE * np.random.default_rng(5).normal(size=len(motion.t))
    seen = {"t": motion.t, "theta": motion.q[:, 0] + noise}
    bouncing = hanging.but(start={"theta": 0.9}, sequence=["wall"])
    fit = dmoc.fit(bouncing, seen, {"e": (0, 1)}, sigma={"theta": NOISE})
    profile = fit.profile("e", 7)
    assert fit["e"] > 0.998 and profile.high == 1 > profile.low > 0.99
