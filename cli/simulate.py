"""The command ``dmoc simulate``: a model from a state, or a solution once more."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from dmoc.base.errors import SimulationError
from dmoc.base.table import print_table
from dmoc.cli import completion
from dmoc.cli.console import draw, in_turn, out, prepare, written
from dmoc.cli.option_values import read_pairs
from dmoc.cli.problem_options import ModelOptions, problem_fields
from dmoc.cli.shared_options import DarkOption, out_option
from dmoc.cli.words import argument, option

if TYPE_CHECKING:
    from dmoc.results.simulation import Simulation

STEPS = 1000  # of a model, where nothing is said


def simulate(
    *,
    model: Annotated[
        str,
        argument(
            metavar="MODEL|FILE.npz",
            help="Name of a shipped model, file.py:name, or a solution file.",
            completed=completion.models,
        ),
    ],
    start: Annotated[
        list[str] | None,
        option(
            metavar="NAME=VALUE",
            help="Start state of a model: x or x_dot, zero unless given, an attitude as its "
            "quaternion q=1,0,0,0; several with commas, or repeat it.",
        ),
    ] = None,
    final_time: Annotated[float | None, option(help="Final time of a model in seconds.")] = None,
    steps: Annotated[
        int | None,
        option(help=f"Steps; {STEPS} of a model, a quarter of its smallest step of a solution."),
    ] = None,
    input_: Annotated[
        list[str] | None,
        option(
            "--input",
            metavar="NAME=VALUE",
            help="Constant input of a model; several with commas, or repeat it.",
        ),
    ] = None,
    values: ModelOptions,
    own_model: Annotated[
        str | None,
        option("--model", help="Model of a solution file, if it is not shipped: file.py:name."),
    ] = None,
    target: Annotated[
        Path | None,
        out_option("Write simulation.npz, .csv and .png into this folder.", "DIR"),
    ] = None,
    dark: DarkOption = False,
) -> None:
    """Simulate a model forward in time through its collisions; or a solution, open loop."""
    from dmoc.base.names import omega_names, velocity_name
    from dmoc.models import registry
    from dmoc.results.simulation import simulate as simulated
    from dmoc.results.solution import Solution

    prepare(target, None)
    laws = {name: value for name, value in problem_fields({}, values).items() if value != {}}
    if model.endswith(".npz"):
        stated = {
            "--start": start, "--final-time": final_time, "--input": input_,
            "--order": values.order,
        }  # fmt: skip
        for option in (name for name, value in stated.items() if value is not None):
            raise SimulationError(f"{option} goes with a model: a solution file has its own.")
        solution = Solution.load(model)
        if own_model is not None:
            laws["model"] = registry.load(own_model, order=solution.trajectory.order)
        _show(simulated(solution, steps=steps, **laws), target, dark)
        return
    if own_model is not None:
        raise SimulationError("--model goes with a solution file: a model is named alone.")
    kernels = registry.find(model).kernels(values.order)
    duration, count = _checked(final_time), STEPS if steps is None else steps
    rates = {velocity_name(name): name for name in kernels.coordinates}
    spins = [omega for name in kernels.manifest.attitudes for omega in omega_names(name)]
    turned = dict.fromkeys(kernels.manifest.attitudes, True)
    places = turned | dict.fromkeys(kernels.coordinates, False)
    state = _values(start, "--start", places | dict.fromkeys((*rates, *spins), False))
    q = {name: value for name, value in state.items() if name in places}
    v = {rates.get(name, name): value for name, value in state.items() if name not in places}
    inputs = _values(input_, "--input", dict.fromkeys(kernels.inputs, False))
    u = [inputs.get(name, 0.0) for name in kernels.inputs]
    size = duration / max(count, 1)
    _show(simulated(kernels, q, v, step_size=size, steps=count, inputs=u, **laws), target, dark)


def _checked(final_time: float | None) -> float:
    """The final time of a model."""
    if final_time is None:
        raise SimulationError("--final-time is missing: give it in seconds, such as 2.5.")
    if not 0 < final_time < inf:
        raise SimulationError(
            f"--final-time {final_time:g}: expected a positive, finite number of seconds."
        )
    return final_time


def _values(texts: list[str] | None, option: str, names: Mapping[str, bool]) -> dict[str, Any]:
    """Values given by name: numbers, of attitudes four of them."""
    values = read_pairs(texts, option, lists=4 if any(names.values()) else 0)
    for name, value in values.items():
        if name not in names:
            raise SimulationError(
                f"{option} {name}: expected one of {', '.join(names) or 'no inputs'}."
            )
        if not isinstance(value, list if names[name] else float):
            what = "four numbers with commas, such as 1,0,0,0" if names[name] else "a number"
            raise SimulationError(f"{option} {name}: expected {what}.")
    return values


def _show(motion: Simulation, target: Path | None, dark: bool) -> None:
    """Write and tell a simulation."""
    files: list[Path] = []

    def save() -> None:
        if target is not None:
            files.append(motion.save(target / "simulation.npz"))
            files.append(motion.to_csv(target / "simulation.csv"))

    def tell() -> None:
        print_table(motion.summary(), out)
        written(*files)

    in_turn(
        save,
        tell,
        lambda: draw(target and target / "simulation.png", motion.plot, False, dark),
    )
