"""Regressors and dynamics: consistent with each other, of any shape, as fast as the library."""

import statistics
import time
import unittest

import numpy as np
import proprio
from proprio._proprio import regressor_seconds


class Dynamics(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.model = proprio.Model.go2()
        random = np.random.default_rng(1)
        cls.q, cls.dq, cls.ddq = random.normal(size=(3, 4, 5, 12))

    def test_all_are_one_dynamics(self):
        q, dq, ddq = self.q, self.dq, self.ddq
        torque = proprio.inverse_dynamics(self.model, q, dq, ddq)
        self.assertEqual(torque.shape, (4, 5, 12))
        inertia = proprio.mass_matrix(self.model, q)
        self.assertEqual(inertia.shape, (4, 5, 12, 12))
        np.testing.assert_allclose(inertia, np.swapaxes(inertia, -1, -2), atol=1e-14)
        rest = proprio.inverse_dynamics(self.model, q, dq, 0 * ddq)
        np.testing.assert_allclose(rest + np.einsum("...ij,...j", inertia, ddq), torque, atol=1e-10)
        np.testing.assert_allclose(proprio.forward_dynamics(self.model, q, dq, torque), ddq, atol=1e-8)
        rotors = np.full(12, 0.01)
        moved = proprio.forward_dynamics(self.model, q, dq, torque + rotors * ddq, armature=rotors)
        np.testing.assert_allclose(moved, ddq, atol=1e-8)
        regressor = proprio.torque_regressor(self.model, q, dq, ddq)
        self.assertEqual(regressor.shape, (4, 5, 12, 120))
        names = proprio.regressor_parameters(self.model)
        self.assertEqual((len(names), names[0], names[10]), (120, "m:FR_hip", "m:FR_thigh"))
        # Unit masses at the joints' origins alone: columns are forces per kilogram.
        theta = np.linalg.lstsq(regressor.reshape(-1, 120), torque.reshape(-1), rcond=None)[0]
        np.testing.assert_allclose(regressor @ theta, torque, atol=1e-9)

    def test_a_limb_is_its_part_of_the_whole(self):
        part = slice(3, 6)
        q, dq, ddq = (x[0, 0] for x in (self.q, self.dq, self.ddq))
        leg = proprio.torque_regressor(self.model, q[part], dq[part], ddq[part], limb="FL")
        whole = proprio.torque_regressor(self.model, q, dq, ddq)
        self.assertEqual(leg.shape, (3, 30))
        np.testing.assert_array_equal(leg, whole[part, 30:60])
        self.assertEqual(np.count_nonzero(whole[part, :30]), 0)

    def test_shapes_that_do_not_fit_are_refused(self):
        x = np.zeros((7, 12))
        for wrong in (np.zeros((7, 11)), np.zeros((6, 12)), np.zeros(84), 1.0):
            self.assertRaises(ValueError, proprio.inverse_dynamics, self.model, x, x, wrong)
        self.assertRaises(proprio.UnknownNameError, proprio.mass_matrix, self.model, x, limb="XX")
        self.assertRaises(proprio.Error, proprio.forward_dynamics, self.model, x, x, x, armature=[0.0])
        self.assertEqual(proprio.inverse_dynamics(self.model, x[:0], x[:0], x[:0]).shape, (0, 12))

    def test_lists_and_other_layouts_are_arrays(self):
        expected = proprio.inverse_dynamics(self.model, self.q, self.dq, self.ddq)
        turned = (np.asfortranarray(x) for x in (self.q, self.dq, self.ddq))
        np.testing.assert_array_equal(proprio.inverse_dynamics(self.model, *turned), expected)
        lists = (x.tolist() for x in (self.q, self.dq, self.ddq))
        np.testing.assert_array_equal(proprio.inverse_dynamics(self.model, *lists), expected)

    def test_a_million_rows_take_at_most_twice_the_librarys_time(self):
        samples = np.random.default_rng(2).normal(size=(3, 333_334, 3))
        ratios = []
        for _ in range(5):
            begun = time.perf_counter()
            rows = proprio.torque_regressor(self.model, *samples, limb="FR")
            own = time.perf_counter() - begun
            ratios.append(own / regressor_seconds(self.model, *samples, limb="FR"))
        self.assertEqual(rows.shape[0] * rows.shape[1], 1_000_002)
        print(f"10^6 rows of a regressor: {statistics.median(ratios):.2f} times the library's time")
        self.assertLess(statistics.median(ratios), 2.0)
