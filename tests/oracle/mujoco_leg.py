"""One leg of a Go2, held by its base, as MuJoCo moves it: what the drives would report without noise. See README.md.

The leg is FR of `go2_urdf.py`. A PD controller follows a reference; effects are MuJoCo's own mechanics wherever it has them
(damping, friction loss, armature, springs, welded bodies, a second inertia behind a spring or a gap, tendons that turn with two
joints, torque limits, forces at the foot), and torques at the motor where it has none. Steps are of fourth order.
"""

from dataclasses import dataclass
from math import copysign, exp, sin

import mujoco
import numpy as np
from mujoco import rollout

from go2_urdf import CALF, FOOT, HIP, ROTOR_Y, THIGH, flip_y

JOINTS = ("FR_hip", "FR_thigh", "FR_calf")
ORIGINS = ((0.1934, -0.0465, 0), (0, -0.0955, 0), (0, 0, -0.213))
AXES = ((1, 0, 0), (0, 1, 0), (0, 1, 0))
FOOT_PLACE = (0, 0, -0.213)
GRAVITY = 9.81
GEAR = np.array([6.333, 6.333, 6.333 * 23 / 12])
STEP = 5e-4  # s
GAIN_P, GAIN_D = 60.0, 2.0  # N m/rad, N m s/rad
SPEED_OF_REST = 1e-3  # rad/s


@dataclass
class Run:
    """What happened, at every step: times, and \\[step, joint\\]."""

    t: np.ndarray
    q: np.ndarray  # the motors'
    dq: np.ndarray
    ddq: np.ndarray
    tau: np.ndarray  # what the controller asks for, and the drive reports
    temperature: np.ndarray


def moved(body, by):
    """A body seen from a frame that lies at `by` in it: its place is then farther."""
    m, com, inertia = body
    return m, np.array(com) + by, inertia


def lumped(parts):
    """(mass, com, inertia about the com, 3×3) of bodies in one frame."""
    mass = sum(m for m, _, _ in parts)
    com = sum(m * np.array(c) for m, c, _ in parts) / mass
    total = np.zeros((3, 3))
    for m, c, (xx, xy, xz, yy, yz, zz) in parts:
        d = np.array(c) - com
        total += np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) + m * (d @ d * np.eye(3) - np.outer(d, d))
    return mass, com, total


def nominal():
    """The CAD's bodies of the leg: link, rotor of the next joint, foot."""
    return [
        lumped([flip_y(HIP), moved(ROTOR_Y, (0, 0.00015, 0))]),
        lumped([flip_y(THIGH), moved(ROTOR_Y, (0, 0.03235, 0))]),
        lumped([flip_y(CALF), moved(FOOT, FOOT_PLACE)]),
    ]


def off_the_cad(bodies, share, random):
    """Bodies whose pseudo-inertia L Lᵀ is L (1 + E)(1 + E)ᵀ Lᵀ: possible ones, off by about `share`."""
    out = []
    for mass, com, inertia in bodies:
        about = inertia + mass * (com @ com * np.eye(3) - np.outer(com, com))
        p = np.zeros((4, 4))
        p[:3, :3] = np.trace(about) / 2 * np.eye(3) - about
        p[:3, 3] = p[3, :3] = mass * com
        p[3, 3] = mass
        size = np.linalg.cholesky(p) @ (np.eye(4) + share * random.normal(size=(4, 4)))
        p = size @ size.T
        mass, com = p[3, 3], p[:3, 3] / p[3, 3]
        about = np.trace(p[:3, :3]) * np.eye(3) - p[:3, :3]
        out.append((mass, com, about - mass * (com @ com * np.eye(3) - np.outer(com, com))))
    return out


def text(numbers):
    return " ".join(repr(float(x)) for x in numbers)


class Leg:
    """The mechanics for `effects`, {(effect, joint): {parameter: value}}; joint None where an effect has none."""

    def __init__(self, effects, bodies):
        self.effects = effects
        self.soft = [n for n, j in enumerate(JOINTS) if self.has("elasticity", j) or self.has("backlash", j)]
        tilt = effects.get(("base_tilt", None), {})
        self.gravity = turned(tilt.get("roll", 0.0), tilt.get("pitch", 0.0)).T @ np.array([0, 0, -GRAVITY])
        self.model = mujoco.MjModel.from_xml_string(self.mjcf(bodies))
        self.motors = [self.model.joint(j).qposadr[0] for j in JOINTS]
        self.foot = self.model.body("foot").id

    def has(self, effect, joint):
        return (effect, joint) in self.effects

    def value(self, effect, joint, parameter=None, otherwise=0.0):
        """A parameter, the first one if none is named."""
        parameters = self.effects.get((effect, joint))
        if not parameters:
            return otherwise
        return parameters.get(parameter, otherwise) if parameter else next(iter(parameters.values()))

    def dry(self, joint):
        """Coulomb friction and what direction adds to it as a constant torque, which is the same at rest too."""
        plus = self.value("asymmetric_coulomb", joint, "F_plus")
        minus = self.value("asymmetric_coulomb", joint, "F_minus")
        return self.value("coulomb", joint) + (plus + minus) / 2, (plus - minus) / 2

    def mjcf(self, bodies):
        out, closing = "", ""
        for n, (joint, origin, axis, (mass, com, inertia)) in enumerate(zip(JOINTS, ORIGINS, AXES, bodies)):
            limit = self.value("saturation", joint, otherwise=None)
            clamp = "" if limit is None else f'actuatorfrclimited="true" actuatorfrcrange="{-limit} {limit}"'
            hinge = f"""<joint name="{joint}" axis="{text(axis)}" damping="{self.value("viscous", joint)}"
                frictionloss="{self.dry(joint)[0]}" armature="{self.value("armature", joint)}"
                stiffness="{self.value("spring", joint)}" springref="{self.value("spring", joint, "q0")}" {clamp}/>"""
            tensor = [inertia[k] for k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
            inertial = f'<inertial pos="{text(com)}" mass="{float(mass)!r}" fullinertia="{text(tensor)}"/>'
            out += f'<body pos="{text(origin)}">{hinge}'
            closing = "</body>" + closing
            if n in self.soft:
                # The motor turns a body of no weight; the link hangs on it.
                stiff, gap = self.value("elasticity", joint), self.value("backlash", joint)
                damping = self.value("elasticity", joint, "d", self.value("backlash", joint, "d"))
                stop = "" if not gap else (
                    f'limited="true" range="{-gap / 2} {gap / 2}" solreflimit="{4 * STEP} 1" '
                    'solimplimit="0.99 0.999 0.0001"')
                out += f"""<inertial pos="0 0 0" mass="1e-6" diaginertia="1e-9 1e-9 1e-9"/><body>
                    <joint name="{joint}_link" axis="{text(axis)}" stiffness="{stiff}" damping="{damping}" {stop}/>"""
                closing = "</body>" + closing
            out += inertial
            load = self.value("payload", joint)
            if load:
                place, ball = [self.value("payload", joint, a) for a in "xyz"], 0.4 * load * 0.01**2
                out += f'<body pos="{text(place)}"><inertial pos="0 0 0" mass="{load}" diaginertia="{ball} {ball} {ball}"/></body>'
        out += f'<body name="foot" pos="{text(FOOT_PLACE)}"><inertial pos="0 0 0" mass="1e-7" diaginertia="1e-10 1e-10 1e-10"/></body>'
        tendons = "".join(self.tendon(before, joint) for before, joint in zip(JOINTS, JOINTS[1:]))
        motors = "".join(f'<position joint="{j}" kp="{GAIN_P}"/>' for j in JOINTS)
        motors += "".join(f'<velocity joint="{j}" kv="{GAIN_D}"/>' for j in JOINTS)
        # A torque in proportion to a signal and to the velocity.
        motors += "".join(f'<general joint="{j}" gaintype="affine" gainprm="0 0 1"/>' for j in JOINTS)
        # Friction as hard as MuJoCo makes it at this step.
        return f"""<mujoco><compiler angle="radian" boundmass="0" boundinertia="0" autolimits="false"/>
            <option timestep="{STEP}" gravity="{text(self.gravity)}" integrator="RK4" iterations="50" tolerance="1e-10"/>
            <default><joint limited="false" solreffriction="{2 * STEP} 1" solimpfriction="0.999 0.9999 0.001"/></default>
            <worldbody>{out}{closing}</worldbody><tendon>{tendons}</tendon><actuator>{motors}</actuator></mujoco>"""

    def tendon(self, before, joint):
        """What turns with the sum of a joint and the one before it."""
        inertia, viscous, dry = (self.value(f"coupled_{what}", joint) for what in ("armature", "viscous", "coulomb"))
        if not (inertia or viscous or dry):
            return ""
        return f"""<fixed armature="{inertia}" damping="{viscous}" frictionloss="{dry}"
            solreffriction="{2 * STEP} 1" solimpfriction="0.999 0.9999 0.001">
            <joint joint="{before}" coef="1"/><joint joint="{joint}" coef="1"/></fixed>"""

    def run(self, reference, disturbance=None):
        """Follows `reference` (t, q, dq); `disturbance` is added to the velocity that the controller sees."""
        t, q_ref, dq_ref = reference
        seen = np.zeros_like(q_ref) if disturbance is None else disturbance
        temperature = warm_up(t)
        heat = np.stack([
            -self.value("thermal_viscous", j) * (temperature[:, n] - self.value("thermal_viscous", j, "T0", 40.0))
            for n, j in enumerate(JOINTS)
        ], 1)
        # A step holds its control: that of its middle, so that on average it is the law's.
        control = np.hstack([middle(q_ref), middle(dq_ref) - seen, heat])
        moves, start = self.model.nq, mujoco.MjData(self.model)
        start.qpos[self.motors] = q_ref[0]
        by_state = any(effect in STATE_EFFECTS for effect, _ in self.effects)
        pushes = self.pushes(t)
        states = self.step_by_step(start, control) if by_state else self.roll_out(start, control, pushes)
        q, dq = states[:, self.motors], states[:, moves:][:, self.motors]
        ddq = np.gradient(dq, STEP, axis=0)
        tau = GAIN_P * (q_ref - q) + GAIN_D * (dq_ref - seen - dq)
        return Run(t, q, dq, ddq, tau, temperature)

    def pushes(self, t):
        """Constant torques by dof, and forces at the foot by time."""
        torque = np.zeros(self.model.nv)
        for motor, joint in zip(self.motors, JOINTS):
            torque[motor] = -self.value("bias", joint) - self.dry(joint)[1]
        force = np.zeros((len(t), 3))
        contact = self.effects.get(("contact", JOINTS[2]))
        if contact:
            # Half sines of 0.6 s every 2.5 s, from 2 s on.
            phase = np.mod(t - 2.0, 2.5) / 0.6
            shape = np.where((t >= 2.0) & (phase < 1), np.sin(np.pi * np.clip(phase, 0, 1)) ** 0.5, 0.0)
            force = shape[:, None] * np.array([contact.get("x", 0.0), contact.get("y", 0.0), contact["z"]])
        return torque, force

    def roll_out(self, start, control, pushes):
        torque, force = pushes
        spec = mujoco.mjtState
        parts, kinds = [control], spec.mjSTATE_CTRL
        if np.any(torque):
            parts.append(np.tile(torque, (len(control), 1)))
            kinds |= spec.mjSTATE_QFRC_APPLIED
        if np.any(force):
            wrench = np.zeros((len(control), self.model.nbody, 6))
            wrench[:, self.foot, :3] = force
            parts.append(wrench.reshape(len(control), -1))
            kinds |= spec.mjSTATE_XFRC_APPLIED
        full = spec.mjSTATE_FULLPHYSICS
        initial = np.zeros(mujoco.mj_stateSize(self.model, full))
        mujoco.mj_getState(self.model, start, initial, full)
        states, _ = rollout.rollout(
            self.model, [start], initial[None], np.hstack(parts)[None, :-1], control_spec=int(kinds))
        after = states[0, :, 1 : 1 + 2 * self.model.nq]
        return np.vstack([initial[1 : 1 + 2 * self.model.nq], after])

    def step_by_step(self, data, control):
        """For what depends on the state: torques and friction are those of the middle of the step, extrapolated."""
        model, motors = self.model, self.motors
        assert not self.soft and not self.has("contact", JOINTS[2])
        torque, _ = self.pushes(np.zeros(1))
        states = np.zeros((len(control), 2 * model.nq))
        laws = [(n, law) for n, joint in enumerate(JOINTS) if (law := self.law(joint))]
        q, dq, ddq, ctrl, applied = data.qpos, data.qvel, data.qacc, data.ctrl, data.qfrc_applied
        loss, half = model.dof_frictionloss, 0.5 * STEP
        for k in range(len(control)):
            states[k, : model.nq], states[k, model.nq :] = q, dq
            ctrl[:] = control[k]
            for n, law in laws:
                i = motors[n]
                v = float(dq[i] + half * ddq[i])
                at = float(q[i] + half * dq[i])
                # What the gear hands on: the drive's torque less rotor and friction, as of the last step.
                load = float(data.qfrc_actuator[i] - model.dof_armature[i] * ddq[i] + data.qfrc_passive[i] + data.qfrc_constraint[i])
                extra, friction = law(at, v, load)
                applied[i] = torque[i] - extra
                if friction is not None:
                    loss[i] = friction
            for i in motors:
                if all(motors[n] != i for n, _ in laws):
                    applied[i] = torque[i]
            mujoco.mj_step(model, data)
        return states

    def law(self, joint):
        """(q, v, transmitted torque) → a torque against the motor, and the dry friction if it varies; None if nothing does."""
        if not any(self.has(effect, joint) for effect in STATE_EFFECTS):
            return None
        dry = self.dry(joint)[0]
        drag = self.value("quadratic_drag", joint)
        size, turns, phase = (self.value("cogging", joint, p) for p in ("A", "N", "psi"))
        more, speed = self.value("stribeck", joint, "Fs"), self.value("stribeck", joint, "vs", 1.0)
        share = self.value("load_friction", joint)
        varies = more != 0 or share != 0
        uneven = self.value("asymmetric_viscous", joint)
        level, knee = self.value("saturating_viscous", joint, "F"), self.value("saturating_viscous", joint, "vs", 1.0)
        bristles, reach = self.value("presliding", joint, "F"), self.value("presliding", joint, "zs", 1.0)
        bent = [0.0]

        def of(q, v, load):
            extra = drag * v * abs(v) + (size * sin(turns * q + phase) if size else 0.0)
            extra += uneven * abs(v) + level * (1 - exp(-abs(v) / knee)) * copysign(1, v)
            if bristles:
                # Dahl's, exact at a steady speed; as it is in the middle of the step.
                way, half = copysign(1, v), abs(v) * STEP / 2 / reach
                middle = way + (bent[0] - way) * exp(-half)
                bent[0] = way + (bent[0] - way) * exp(-2 * half)
                extra += bristles * middle
            return extra, dry + more * exp(-((v / speed) ** 2)) + share * abs(load) if varies else None

        return of


STATE_EFFECTS = ("stribeck", "load_friction", "quadratic_drag", "cogging", "asymmetric_viscous", "saturating_viscous", "presliding")


def turned(roll, pitch):
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    return np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]]) @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])


def middle(x):
    """Means of neighbours in time; the last value once more."""
    return 0.5 * (x + np.vstack([x[1:], x[-1:]]))


def warm_up(t):
    """Motor temperatures, °C."""
    return np.stack([28.0 + rise * (1 - np.exp(-t / 9.0)) for rise in (22.0, 28.0, 34.0)], 1)
