"""The map from packages to folders, and the extensions."""

import os
from copy import copy
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

LAYERS = (
    "base",
    "motion",
    "symbolic",
    "robots",
    "codegen",
    "generated",
    "mechanics",
    "problem",
    "program",
    "guess",
    "solvers",
    "simulation",
    "check",
    "control",
    "models",
    "report",
    "results",
    "inspection",
    "solving",
    "proving",
    "sequences",
    "fitting",
    "export",
    "planning",
    "cli",
)
INNER = (
    "symbolic.derivation",
    "program.laws",
    "simulation.impact_laws",
    "report.animation",
    "solving.mesh",
    "solving.multistart",
)
LONGEST = [f"dmoc.{name}" for name in ("simulation.integrator", "check.free_motion")]
LONGEST += ["dmoc.simulation.stepper"]
LONGEST += ["dmoc.solvers.compiled", "dmoc.guess.tracker"]
# What Cython has of memoryviews, once for all: in each of them it would take a third of the time of
# the compiler.
SHARED = "dmoc.codegen.memoryviews"
KERNEL = "codegen/dmoc_kernel.h"
PARTS = [f"simulation/{name}.pxi" for name in ("rows", "conditions", "dynamics", "dop853", "gaps")]
FREE = [f"check/free_{name}.pxi" for name in ("sizes", "steps", "costs", "paths", "limits")]
FREE += [f"check/free_{name}.pxi" for name in ("parts", "run")]
LEGS = [f"simulation/{name}.pxi" for name in ("leg", "leg_surfaces")]
# Sizes of the arrays of proofs of what positions and velocities cost.
WIDE = [("MOST_INPUTS", "16"), ("MOST_PRICED", "160"), ("MOST_MULTIPLIERS", "208")]
# What Cython makes takes the compiler half the time with less optimisation: for tests, once.
QUICK = bool(os.environ.get("DMOC_QUICK_BUILD"))
# Without symbols for debuggers, which take a third of the time of the compiler.
FLAGS = ["-std=c11", "-O1" if QUICK else "-O2", "-ffp-contract=off", "-g0"]
# Unrolls the loops of the factorisation: an eighth less time in all.
SOLVER_FLAGS = ["-std=c11", "-O3", "-ffp-contract=off", "-g0"]

models = sorted(p.parent.name for p in Path("generated").glob("*/manifest.json"))
package_dir = {"dmoc": "src/dmoc"}
package_dir |= {f"dmoc.{name}": name.replace(".", "/") for name in (*LAYERS, *INNER)}
package_dir |= {f"dmoc.generated.{model}": f"generated/{model}" for model in models}

extensions = [
    Extension(
        f"dmoc.generated.{model}.kernels",  # no module: a library that dmoc.codegen.border loads
        [f"generated/{model}/kernels.c"],
        depends=[f"generated/{model}/kernels.h", KERNEL],
        include_dirs=["codegen"],
        libraries=["m"],
        extra_compile_args=FLAGS,
    )
    for model in models
]
extensions += [
    Extension(SHARED, ["codegen/memoryviews.c"], extra_compile_args=FLAGS),  # Cython writes it
    Extension(
        "dmoc.codegen.border",
        ["codegen/border.pyx"],
        depends=[KERNEL],
        include_dirs=["codegen"],
        extra_compile_args=FLAGS,
    ),
    Extension(
        "dmoc.mechanics.small_systems",
        ["mechanics/small_systems.pyx"],
        depends=["mechanics/elimination.pxd"],
        extra_compile_args=FLAGS,
    ),
    Extension(
        "dmoc.simulation.stepper",
        ["simulation/stepper.pyx"],
        depends=["mechanics/elimination.pxd", *LEGS, "codegen/call.pxi", KERNEL],
        include_dirs=["codegen"],
        extra_compile_args=FLAGS,
    ),
    Extension(
        "dmoc.simulation.integrator",
        ["simulation/integrator.pyx"],
        depends=["mechanics/elimination.pxd", "simulation/sums.h", *PARTS, KERNEL],
        include_dirs=["codegen", "simulation"],
        extra_compile_args=FLAGS if QUICK else SOLVER_FLAGS,
    ),
    Extension(
        "dmoc.check.free_motion",
        ["check/free_motion.pyx"],
        depends=["mechanics/elimination.pxd", "simulation/sums.h", *PARTS, *FREE, KERNEL],
        include_dirs=["codegen", "simulation"],
        extra_compile_args=FLAGS,
    ),
    Extension(
        "dmoc.program.assembly",
        ["program/assembly.pyx", "program/passes.c"],
        depends=["program/passes.h", KERNEL],
        include_dirs=["codegen", "program"],
        extra_compile_args=FLAGS,
    ),
    Extension(
        "dmoc.guess.tracker",
        ["guess/tracker.pyx", "guess/least_squares.c"],
        depends=["guess/least_squares.h", "guess/equations.pxi", "codegen/call.pxi", KERNEL],
        include_dirs=["codegen", "guess"],
        extra_compile_args=FLAGS,
    ),
    *(
        Extension(
            f"dmoc.proving.{name}",
            [f"proving/{name}.pyx", *sorted(map(str, Path("proving").glob("*.c")))],
            depends=["proving/branch.pyx", *sorted(map(str, Path("proving").glob("*.h")))],
            define_macros=sizes,
            include_dirs=["proving"],
            libraries=["pthread"],
            extra_compile_args=SOLVER_FLAGS,
        )
        for name, sizes in (("branch", []), ("branch_wide", WIDE))
    ),
    Extension(
        "dmoc.solvers.compiled",
        [
            "solvers/compiled.pyx",
            *sorted(map(str, Path("solvers").glob("*.c"))),
            "program/passes.c",
        ],
        depends=[
            "solvers/factorisation.pxi",
            "solvers/residuals.pxi",
            "solvers/rows.pxi",
            "solvers/second_order.pxi",
            *sorted(map(str, Path("solvers").glob("*.h"))),
            "program/passes.h",
            KERNEL,
        ],
        include_dirs=["codegen", "program", "solvers"],
        extra_compile_args=SOLVER_FLAGS,
    ),
]


def cythonized() -> list[Extension]:
    from Cython.Build import cythonize

    return cythonize(
        extensions,
        include_path=["check", "codegen", "guess", "mechanics", "program", "proving", "simulation"],
        build_dir="build/cython",
        language_level=3,
        nthreads=os.cpu_count() or 1,
        shared_utility_qualified_name=SHARED,
        quiet=True,
    )


class Parallel(build_ext):
    """As many compilers at once as there are processors, each with a folder of its own: two
    extensions have a source in common.  What takes longest begins first."""

    def build_extensions(self) -> None:
        self.parallel = True
        self.extensions = sorted(self.extensions, key=lambda e: e.name not in LONGEST)
        super().build_extensions()

    def build_extension(self, ext: Extension) -> None:
        own = copy(self)
        own.build_temp = str(Path(self.build_temp) / ext.name)
        build_ext.build_extension(own, ext)


setup(
    cmdclass={"build_ext": Parallel},
    packages=sorted(package_dir),
    package_dir=package_dir,
    package_data={
        "dmoc": ["py.typed"],
        "dmoc.cli": ["templates/*.py", "*.md"],
        "dmoc.codegen": ["templates/*.jinja", "*.pyx", "*.pxd", "*.pxi", "*.pyi", "*.h"],
        "dmoc.export": ["templates/*.jinja", "*.c", "*.h"],
        "dmoc.report.animation": ["player/*"],
        **{
            f"dmoc.{layer}": ["*.pyx", "*.pxd", "*.pxi", "*.pyi", "*.c", "*.h"]
            for layer in (
                "check",
                "guess",
                "mechanics",
                "program",
                "proving",
                "solvers",
                "simulation",
            )
        },
        **{f"dmoc.generated.{model}": ["*.c", "*.h", "manifest.json"] for model in models},
    },
    ext_modules=cythonized(),
)
