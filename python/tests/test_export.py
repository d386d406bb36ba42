"""What `export --mjcf` writes, in MuJoCo: its torque is the model's."""

import re
from xml.etree import ElementTree

import mujoco
import numpy as np
import proprio
from helpers import JOINTS, InFolder, command

POSES = [(0.1, 0.4, -1.2), (-0.3, 1.1, -2.0), (0.4, -0.5, -1.5)]  # rad
CREEP = 1e-6  # rad/s: no two samples are the same, and nothing but position matters
EFFECT = """
[[effect]]
name = "{name}"
joint = "{joint}"
{values}
"""


def with_effects(folder, file, effects):
    """A Go2 whose model file states these effects: (name, joint, lines of values)."""
    proprio.Model.go2().save(folder / file)
    text = (folder / file).read_text()
    text += "".join(EFFECT.format(name=n, joint=j, values=v) for n, j, v in effects)
    (folder / file).write_text(text)
    return proprio.Model.load(folder / file)


def exported(folder, model, file, *more):
    command(folder, "export", "-m", model, "--mjcf", *more, "-o", file, "--force")
    return mujoco.MjModel.from_xml_path(str(folder / file))


class Export(InFolder):
    def test_a_springs_torque_in_mujoco_is_what_predict_says(self):
        springs = [("spring", "FR_thigh", "value = 2.5\nparameters = { c = { value = -1.1 } }"), ("spring", "FR_calf", "value = 0.7\nparameters = { c = { value = 1.3 } }")]
        model = with_effects(self.folder, "spring.toml", springs)
        robot = exported(self.folder, "spring.toml", "spring.xml")
        # The same into a file of the user's whose angles are in degrees.
        user = (self.folder / "spring.xml").read_text()
        user = re.sub(r' (stiffness|springref)="[^"]*"', "", user).replace('angle="radian"', 'angle="degree"')
        user = re.sub(r' range="[^"]*"', "", user)
        (self.folder / "user.xml").write_text(user)
        degrees = exported(self.folder, "spring.toml", "written.xml", "user.xml")
        self.assertIn("stiffness", (self.folder / "written.xml").read_text())
        t = np.arange(2000) * 0.002
        for pose in POSES:
            q = np.array(pose) + CREEP * t[:, None]
            dq = np.full_like(q, CREEP)
            series = proprio.predict(proprio.Log(t=t, q=q, dq=dq, tau=np.ones_like(q), joints=JOINTS), model)
            self.assertEqual(len(series[1].t), 1998)
            for simulated in (robot, degrees):
                data = mujoco.MjData(simulated)
                dofs = [simulated.joint(f"{joint}_joint").dofadr[0] for joint in JOINTS]
                for k in (0, 700, 1997):
                    data.qpos[dofs] = [s.q[k] for s in series]
                    data.qvel[dofs] = CREEP
                    mujoco.mj_inverse(simulated, data)
                    torque = data.qfrc_inverse[dofs]
                    np.testing.assert_allclose(torque, [s.predicted[k] for s in series], rtol=0, atol=1e-9)
                    self.assertGreater(abs(data.qfrc_spring[dofs[1]]), 0.05)

    def test_couplings_are_tendons_with_the_same_torques(self):
        effects = [
            ("viscous", "FR_thigh", "value = 0.4"),
            ("viscous", "FR_calf", "value = 0.1"),
            ("coupled_viscous", "FR_calf", "value = -0.15"),
            ("armature", "FR_thigh", "value = 0.02"),
            ("armature", "FR_calf", "value = 0.03"),
            ("coupled_armature", "FR_calf", "value = 0.01"),
            ("saturation", "FR_hip", "value = 9.0"),
        ]
        with_effects(self.folder, "coupled.toml", effects)
        robot = exported(self.folder, "coupled.toml", "coupled.xml")
        proprio.Model.go2().save(self.folder / "cad.toml")
        bare = exported(self.folder, "cad.toml", "cad.xml")
        thigh, calf = (robot.joint(f"FR_{part}_joint").dofadr[0] for part in ("thigh", "calf"))
        random = np.random.default_rng(3)
        for _ in range(5):
            v, a = random.normal(size=(2, robot.nv))
            torques = []
            for simulated in (robot, bare):
                data = mujoco.MjData(simulated)
                data.qpos[:] = np.tile([0.1, 0.8, -1.5], 4)  # within the joints' ranges
                data.qvel[:], data.qacc[:] = v, a
                mujoco.mj_inverse(simulated, data)
                torques.append(data.qfrc_inverse.copy())
            more = torques[0] - torques[1]
            self.assertLess(abs(more[thigh] - (0.4 * v[thigh] - 0.15 * v[calf] + 0.02 * a[thigh] + 0.01 * a[calf])), 1e-9)
            self.assertLess(abs(more[calf] - (0.1 * v[calf] - 0.15 * v[thigh] + 0.03 * a[calf] + 0.01 * a[thigh])), 1e-9)
        np.testing.assert_array_equal(robot.jnt_actfrcrange[robot.joint("FR_hip_joint").id], [-9.0, 9.0])
        # A coupling that no passive tendon has is left out, and said to be.
        with_effects(self.folder, "strong.toml", [e for e in effects if e[0] != "coupled_viscous"] + [("coupled_viscous", "FR_calf", "value = 0.3")])
        told = self.json("export", "-m", "strong.toml", "--mjcf", "-o", "strong.xml")
        self.assertTrue(any("coupled_viscous:FR_calf is left out" in note for note in told["notes"]), told["notes"])
        # URDF has a word for the limit alone.
        told = self.json("export", "-m", "coupled.toml", "--urdf", "-o", "coupled.urdf")
        left = " ".join(told["notes"])
        for name in ("coupled_viscous:FR_calf", "coupled_armature:FR_calf"):
            self.assertIn(f"{name} is left out", left)
        self.assertNotIn("saturation", left)
        hip = next(j for j in ElementTree.parse(self.folder / "coupled.urdf").iter("joint") if j.get("name") == "FR_hip_joint")
        self.assertEqual(float(hip.find("limit").get("effort")), 9.0)
