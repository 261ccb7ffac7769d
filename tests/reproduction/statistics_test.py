#!/usr/bin/env python3
"""Student's t, intervals and Holm's procedure against values that are known from elsewhere."""
import pathlib
import random
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent.parent / "scripts" / "study" / "reproduction"))

import student  # noqa: E402


class Quantiles(unittest.TestCase):
    # Probability, degrees of freedom, and the quantile as printed tables have it (e.g. Abramowitz & Stegun, table 26.10).
    KNOWN = [(0.75, 1, 1.000), (0.9, 2, 1.886), (0.95, 3, 2.353), (0.975, 1, 12.706), (0.975, 4, 2.776), (0.975, 19, 2.093),
             (0.99, 9, 2.821), (0.995, 5, 4.032), (0.995, 30, 2.750), (0.9995, 20, 3.850), (0.975, 120, 1.980)]

    def test_printed_tables(self):
        for probability, freedom, expected in self.KNOWN:
            self.assertAlmostEqual(student.quantile(probability, freedom), expected, delta=5.01e-4, msg=f"{probability}, {freedom}")

    def test_closed_forms(self):
        """One and two degrees of freedom have an inverse in closed form: tan(pi (p - 1/2)), and (2p - 1) / sqrt(2 p (1 - p))."""
        import math
        for probability in (0.6, 0.9, 0.99, 0.999, 0.99999, 1 - 1e-9):
            one = 1.0 / math.tan(math.pi * (1.0 - probability))
            two = (2 * probability - 1) / math.sqrt(2 * probability * (1 - probability))
            self.assertAlmostEqual(student.quantile(probability, 1) / one, 1.0, delta=1e-6)
            self.assertAlmostEqual(student.quantile(probability, 2) / two, 1.0, delta=1e-6)

    def test_symmetry_and_inverse(self):
        for freedom in (1, 3, 19, 400):
            self.assertAlmostEqual(student.quantile(0.5, freedom), 0.0, delta=1e-12)
            for probability in (0.55, 0.8, 0.975, 0.9999):
                t = student.quantile(probability, freedom)
                self.assertAlmostEqual(student.upper_tail(t, freedom), 1.0 - probability, delta=1e-12)
                self.assertAlmostEqual(student.quantile(1.0 - probability, freedom), -t, delta=1e-9 * t)

    def test_far_tail(self):
        """Where 1 - F would have lost all digits: of 19 degrees of freedom P(T > 30) by quadrature of the density."""
        import math
        freedom, at = 19, 30.0
        front = math.exp(math.lgamma(10) - math.lgamma(9.5)) / math.sqrt(freedom * math.pi)
        steps, total = 200000, 0.0
        for k in range(steps):  # substitution x = at / s, s in (0, 1]; the midpoint rule
            s = (k + 0.5) / steps
            total += front * (1 + (at / s) ** 2 / freedom) ** (-0.5 * (freedom + 1)) * at / (s * s) / steps
        self.assertAlmostEqual(student.upper_tail(at, freedom) / total, 1.0, delta=1e-6)

    def test_mistakes(self):
        for wrong in (0.0, 1.0, -1.0):
            self.assertRaises(ValueError, student.quantile, wrong, 5)
        self.assertRaises(ValueError, student.incomplete_beta, 1, 1, 1.5)
        self.assertRaises(ValueError, student.interval, [1.0])
        self.assertRaises(ValueError, student.p_above, [1.0], 0.0)


class Means(unittest.TestCase):
    def test_interval(self):
        """Gosset's own data (sleep, ten patients): mean 1.58, standard deviation 1.230, so 1.58 +- 2.262 x 0.389."""
        mean, low, high = student.interval([1.2, 2.4, 1.3, 1.3, 0.0, 1.0, 1.8, 0.8, 4.6, 1.4])
        self.assertAlmostEqual(mean, 1.58)
        self.assertAlmostEqual(low, 0.70, delta=0.005)
        self.assertAlmostEqual(high, 2.46, delta=0.005)

    def test_p_value(self):
        """The same data: t = 4.0621 at 9 degrees of freedom, two-sided p = 0.00283."""
        data = [1.2, 2.4, 1.3, 1.3, 0.0, 1.0, 1.8, 0.8, 4.6, 1.4]
        self.assertAlmostEqual(2 * student.p_above(data, 0.0), 0.00283, delta=1e-5)
        self.assertAlmostEqual(student.p_above([-x for x in data], 0.0), 1 - 0.00283 / 2, delta=1e-5)
        self.assertAlmostEqual(student.p_above(data, 1.58), 0.5, delta=1e-9)

    def test_equal_values(self):
        self.assertEqual(student.p_above([1.0, 1.0, 1.0], 0.5), 0.0)
        self.assertEqual(student.p_above([1.0, 1.0, 1.0], 1.0), 1.0)

    def test_coverage(self):
        """Of 2000 intervals around a mean of 8 normal values, 95 % hold the truth: within 3 standard errors."""
        chance, hits = random.Random(3), 0
        for _ in range(2000):
            _, low, high = student.interval([chance.gauss(5.0, 2.0) for _ in range(8)])
            hits += low <= 5.0 <= high
        self.assertAlmostEqual(hits / 2000, 0.95, delta=3 * (0.95 * 0.05 / 2000) ** 0.5)


class Comparisons(unittest.TestCase):
    def test_holm(self):
        """Levels are 0.05 / 4, / 3, / 2, / 1 from the smallest on; the first that fails ends it."""
        self.assertEqual(student.holm([0.01, 0.04, 0.03, 0.005], 0.05), [True, False, False, True])
        self.assertEqual(student.holm([0.012, 0.016, 0.024, 0.049], 0.05), [True] * 4)
        self.assertEqual(student.holm([0.013, 0.001], 0.025), [True, True])
        self.assertEqual(student.holm([0.03, 0.9], 0.05), [False, False])
        self.assertEqual(student.holm([], 0.05), [])


if __name__ == "__main__":
    unittest.main()
