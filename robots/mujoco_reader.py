"""A description as data, read by MuJoCo: it knows defaults, units and the orders of angles."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from dmoc.base.errors import MissingExtraError, ModelError
from dmoc.robots.description import Text, worded
from dmoc.robots.records import Array, Description, Joint, Limits, Link, Shape

VERSION = "4"
KINDS = ("free", "ball", "slide", "hinge")  # of joints, as MuJoCo counts them
TOUCHING = {2: "sphere", 3: "capsule", 5: "cylinder", 6: "box"}  # of shapes


def read_description(text: Text, label: str) -> Description:
    """Let MuJoCo read a text that names no file."""
    mujoco = _reader()
    with _warnings(mujoco, text.notes):
        try:
            spec = mujoco.MjSpec.from_string(text.xml)
            spec.compiler.fusestatic = False
            _leave_out_meshes(spec, text, label, mujoco)
            loads = _own_loads(spec) if text.kind == "URDF" else {}
            model = spec.compile()
        except (ValueError, RuntimeError, mujoco.FatalError) as error:
            words = worded(error).replace(", line 1", "")  # which is all that the text has
            raise ModelError(f"{label} is not read, {words}: correct the file.") from None
    return _described(model, spec, loads, text)


def _reader() -> Any:
    """The module of MuJoCo, of a version whose fields are those that are read here."""
    try:
        import mujoco
    except ImportError:
        raise MissingExtraError(
            'robots from files need MuJoCo as a reader: install it by `pip install "dmoc[robots]"`.'
        ) from None
    if mujoco.__version__.partition(".")[0] != VERSION:
        raise MissingExtraError(
            f"robots from files need MuJoCo {VERSION}, and {mujoco.__version__} is installed: take "
            'it by `pip install "dmoc[robots]"`.'
        )
    return mujoco


@contextmanager
def _warnings(mujoco: Any, notes: list[str]) -> Iterator[None]:
    """Take warnings as notes; by default MuJoCo writes them into a file."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda message: notes.append(worded(message)))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of what is deprecated in files
            yield
    finally:
        mujoco.set_mju_user_warning(before)


def _leave_out_meshes(spec: Any, text: Text, label: str, mujoco: Any) -> None:
    """Shapes that other files hold; refuse bodies whose inertia they would make."""
    kinds, always = mujoco.mjtGeom, mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    files = (kinds.mjGEOM_MESH, kinds.mjGEOM_HFIELD, kinds.mjGEOM_SDF)
    low, high = spec.compiler.inertiagrouprange
    for geom in [*spec.geoms]:
        if geom.type not in files and not geom.meshname:
            continue
        body, name = geom.parent, geom.name or geom.meshname
        heavy = geom.mass > 0 if geom.mass == geom.mass else geom.density > 0
        computed = not body.explicitinertial or spec.compiler.inertiafromgeom == always
        if computed and heavy and low <= geom.group <= high and body.name != "world":
            raise ModelError(
                f"body {body.name} of {label} has its mass from the mesh {name}, which is not "
                "read: give it <inertial>."
            )
        if geom.contype or geom.conaffinity:
            text.notes.append(f"shape {name} of link {body.name}: a mesh is not read")
        spec.delete(geom)


def _own_loads(spec: Any) -> dict[str, tuple[float, Array, Array]]:
    """Mass, centre and inertia of each link of a URDF, in the place of which MuJoCo gets those of
    a sphere: it refuses light links that are fixed to heavy ones."""
    loads = {}
    for body in spec.bodies[1:]:
        if body.mass != 0 or body.explicitinertial:
            full = np.asarray(body.fullinertia)
            moments = np.diag(body.inertia) if np.isnan(full[0]) else _symmetric(full)
            axes = rotation(body.iquat)
            centre = np.nan_to_num(np.asarray(body.ipos))
            loads[body.name] = (float(body.mass), centre, axes @ moments @ axes.T)
        body.mass, body.inertia, body.explicitinertial = 1.0, (1, 1, 1), True
        body.ipos, body.iquat = (0, 0, 0), (1, 0, 0, 0)
        body.fullinertia = [np.nan, 0, 0, 0, 0, 0]
    return loads


def _symmetric(full: Array) -> Array:
    xx, yy, zz, xy, xz, yz = full
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def rotation(quaternion: Any) -> Array:
    """The matrix of a quaternion of any length."""
    w, x, y, z = np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def _described(
    model: Any, spec: Any, loads: dict[str, tuple[float, Array, Array]], text: Text
) -> Description:
    links = []
    for i in range(1, model.nbody):
        body, parent = model.body(i), int(model.body_parentid[i])
        if text.kind == "URDF":
            mass, centre, inertia = loads.get(body.name, (0.0, np.zeros(3), np.zeros((3, 3))))
        else:
            axes = rotation(model.body_iquat[i])
            mass, centre = float(model.body_mass[i]), model.body_ipos[i].copy()
            inertia = axes @ np.diag(model.body_inertia[i]) @ axes.T
        first, count = int(model.body_jntadr[i]), int(model.body_jntnum[i])
        links.append(
            Link(
                body.name or f"body_{i}", None if parent == 0 else parent - 1,
                model.body_pos[i].copy(), rotation(model.body_quat[i]), mass, centre, inertia,
                tuple(_joint(model, j, text) for j in range(first, first + count)),
                tuple(_shapes(model, i, text)),
            )
        )  # fmt: skip
        if model.body_gravcomp[i] != 0:
            text.notes.append(f"body {body.name}: what balances its weight")
    grounds = [
        model.geom(k).name or "without a name" for k in np.flatnonzero(model.geom_bodyid == 0)
    ]
    text.notes += [f"shape {name} of the world: state it as a surface" for name in grounds]
    return Description(str(spec.modelname), tuple(links), np.array(spec.option.gravity), text.notes)


def _joint(model: Any, j: int, text: Text) -> Joint:
    kind = KINDS[int(model.jnt_type[j])]
    body = model.body(int(model.jnt_bodyid[j])).name
    name = model.joint(j).name or f"{body}_{kind}"
    dof, place = int(model.jnt_dofadr[j]), int(model.jnt_qposadr[j])
    single = kind in ("hinge", "slide")
    effort, driven = _drive(model, j, name, text)
    follows = _leader(model, j) if single else None
    text.notes += _unread(
        model, j, name, not single, follows is not None, driven and text.kind == "MJCF"
    )
    return Joint(
        name, kind, model.jnt_pos[j].copy(), model.jnt_axis[j].copy(),
        zero=float(model.qpos0[place]) if single else 0.0,
        limits=_pair(model.jnt_range[j]) if single and model.jnt_limited[j] else None,
        speed=text.speeds.get(name) or None,
        effort=effort,
        driven=driven,
        damping=float(model.dof_damping[dof]),
        armature=float(model.dof_armature[dof]),
        friction=float(model.dof_frictionloss[dof]),
        stiffness=float(model.jnt_stiffness[j]),
        rest=float(model.qpos_spring[place]) if single else 0.0,
        follows=follows,
    )  # fmt: skip


def _unread(
    model: Any, j: int, name: str, turning: bool, following: bool, driven: bool
) -> Iterator[str]:
    """What of a joint is not taken: of one that turns in any way, or follows another one, what a
    coordinate of its own would have."""
    dof = int(model.jnt_dofadr[j])
    known = {
        "its limits": turning and model.jnt_limited[j],
        "its spring": turning and model.jnt_stiffness[j] != 0,
        "its dry friction": (turning or following) and model.dof_frictionloss[dof] != 0,
        "what drives it": (turning or following) and driven,
        "its spring beyond the linear term": np.any(model.jnt_stiffnesspoly[j] != 0),
        "its damping beyond the linear term": np.any(model.dof_dampingpoly[dof] != 0),
    }
    yield from (f"joint {name}: {what}" for what, is_there in known.items() if is_there)


def _pair(values: Any) -> Limits:
    low, high = map(float, values)
    return (low, high) if low < high else None


def _drive(model: Any, j: int, name: str, text: Text) -> tuple[Limits, bool]:
    """Largest forces of a joint, and whether something drives it."""
    ranges = [_pair(model.jnt_actfrcrange[j])] if model.jnt_actfrclimited[j] else []
    if text.kind == "URDF":
        return (ranges or [None])[0], True
    motors = [k for k in range(model.nu) if model.actuator_trntype[k] in (0, 1)]
    motors = [k for k in motors if int(model.actuator_trnid[k][0]) == j]
    own: list[Limits] = []
    for k in motors:
        label = model.actuator(k).name or f"of joint {name}"
        gear = float(model.actuator_gear[k][0])
        plain = model.actuator_gaintype[k] == 0 and model.actuator_biastype[k] == 0
        if not plain or model.actuator_dyntype[k] != 0:
            text.notes.append(f"actuator {label}: its law; its force is the input")
        if model.actuator_armature[k] != 0 or np.any(model.actuator_damping[k] != 0):
            text.notes.append(f"actuator {label}: its armature and damping")
        limits = _pair(model.actuator_forcerange[k]) if model.actuator_forcelimited[k] else None
        if limits is None and plain and model.actuator_ctrllimited[k]:
            gain = float(model.actuator_gainprm[k][0])
            limits = _pair(sorted(gain * c for c in model.actuator_ctrlrange[k]))
        own.append(None if limits is None else _pair(sorted(gear * f for f in limits)))
    if own and None not in own:
        sums = np.sum([pair for pair in own if pair is not None], axis=0)
        ranges.append((float(sums[0]), float(sums[1])))
    known = [pair for pair in ranges if pair is not None]
    if not known:
        return None, bool(motors)
    return (max(low for low, _ in known), min(high for _, high in known)), bool(motors)


def _leader(model: Any, j: int) -> tuple[str, tuple[float, ...]] | None:
    """The joint that another one follows, with the coefficients of the powers of its way."""
    for k in range(model.neq):
        if int(model.eq_obj1id[k]) == j and model.eq_active0[k]:
            other = int(model.eq_obj2id[k])
            leader = "" if other < 0 else model.joint(other).name
            return leader, tuple(float(c) for c in model.eq_data[k][:5])
    return None


def _shapes(model: Any, i: int, text: Text) -> Iterator[Shape]:
    """Shapes of a body that touch, and its named points."""
    body = model.body(i).name
    for k in np.flatnonzero(model.geom_bodyid == i):
        if not (model.geom_contype[k] or model.geom_conaffinity[k]):
            continue
        kind, name = TOUCHING.get(int(model.geom_type[k])), model.geom(k).name or body
        if kind is None:
            text.notes.append(f"shape {name} of link {body}: it is no sphere, capsule or box")
            continue
        turn = rotation(model.geom_quat[k])
        yield Shape(name, kind, model.geom_size[k].copy(), model.geom_pos[k].copy(), turn)
    for k in np.flatnonzero(model.site_bodyid == i):
        if model.site(k).name:
            turn, place = rotation(model.site_quat[k]), model.site_pos[k].copy()
            yield Shape(model.site(k).name, "site", np.zeros(3), place, turn)
