"""Kernels of systems with joints phi(q, t) = 0, which hold in every phase."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import dmoc
from dmoc.codegen.build import build_cached, numpy_kernels
from dmoc.codegen.kernels import Kernels
from dmoc.codegen.text import c_files, manifest, numpy_text
from dmoc.symbolic.families import model_spec
from dmoc.symbolic.spec import KernelSpec

KERNELS = {"surface": "joint", "gap_rate": "joint_rate"}
OUTPUTS = {"g": "phi", "gamma": "phi_dot"}


def joined(
    system: dmoc.MechanicalSystem, joints: Mapping[str, Any], backend: str = "compiled"
) -> Kernels:
    """The kernels of a system whose joints are its own; those of a joint are those of a surface
    under other names."""
    as_surfaces = {name: phi <= 0 for name, phi in joints.items()}
    other = model_spec(replace(system, surfaces=as_surfaces, tangents={}, friction={}))
    of_joints = [
        _renamed(kernel, KERNELS[stem] + end)
        for kernel in other.kernels
        for stem in KERNELS
        for end in ("", "_jac")
        if kernel.name == stem + end
    ]
    spec = model_spec(system)
    spec = replace(
        spec,
        facts=spec.facts | {"joints": list(joints)},
        kernels=(*spec.kernels, *of_joints),
    )
    if backend == "numpy":
        return numpy_kernels(manifest(spec), numpy_text(spec))
    files = c_files(spec)
    key = hashlib.sha256("".join(files.values()).encode()).hexdigest()
    return build_cached(spec.name, f"joined {key}", lambda: files)


def _renamed(kernel: KernelSpec, name: str) -> KernelSpec:
    def named(output: str) -> str:
        stem, _, end = output.partition("_")
        return "_".join([OUTPUTS[stem], end] if end else [OUTPUTS[stem]])

    outputs = tuple(replace(o, name=named(o.name)) for o in kernel.outputs)
    return replace(kernel, name=name, outputs=outputs)
