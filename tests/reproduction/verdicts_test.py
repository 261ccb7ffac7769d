#!/usr/bin/env python3
"""Verdicts on databases whose truth is known: claims that are so, that are not, and methods that were shuffled."""
import math
import pathlib
import random
import sqlite3
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "scripts" / "study" / "reproduction"))

import claims    # noqa: E402
import database  # noqa: E402
import page      # noqa: E402
import synthetic  # noqa: E402
import verdicts  # noqa: E402
from verdicts import FAILED, HELD, PARTLY, Condition, Part  # noqa: E402

CONDITIONS = (({}, 2), ({}, 8), ({"terrain.correlation_length": 40}, 8), ({"estimator.arrival.name": "off"}, 8))


class Databases(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="rhec-reproduction-")
        self.addCleanup(folder.cleanup)
        self.file = pathlib.Path(folder.name) / "runs.sqlite"

    def assessed(self, figures, shuffle=(), **options):
        synthetic.write(self.file, figures, **options)
        study = database.Study.read(self.file)
        if shuffle:
            return [{each.claim.key: each.verdict for each in page.assess_all(study.shuffled(seed))} for seed in shuffle]
        return {each.claim.key: each for each in page.assess_all(study)}

    def test_claims_that_are_so(self):
        assessed = self.assessed(synthetic.as_claimed, conditions=CONDITIONS, spread=0.01)
        for key, each in assessed.items():
            self.assertEqual(each.verdict, HELD, f"{key}: {[(c.speed, c.p()) for c in each.conditions]}")
            self.assertEqual(len(each.conditions), 5, key)

    def test_claims_that_are_the_other_way_round(self):
        for key, each in self.assessed(synthetic.contrary, conditions=CONDITIONS).items():
            self.assertEqual(each.verdict, FAILED, f"{key}: {[(c.speed, c.p()) for c in each.conditions]}")

    def test_methods_that_are_alike(self):
        for key, each in self.assessed(synthetic.alike, conditions=CONDITIONS).items():
            self.assertEqual(each.verdict, FAILED, f"{key}: {[(c.speed, c.p()) for c in each.conditions]}")

    def test_shuffled_methods(self):
        """Of effects that all claims hold for without."""
        for seed, found in enumerate(self.assessed(synthetic.as_claimed, conditions=CONDITIONS, shuffle=range(1, 21)), 1):
            self.assertEqual({key: verdict for key, verdict in found.items() if verdict != FAILED}, {}, f"shuffled by {seed}")

    def test_shuffling_permutes(self):
        """Nothing but the methods changes hands, within each path, speed, seed and setting."""
        synthetic.write(self.file, synthetic.as_claimed, seeds=3, conditions=CONDITIONS[:2])
        study = database.Study.read(self.file)
        for shuffled in (study.shuffled(1), study.shuffled(2)):
            moved = 0
            for place, paths in study.runs.items():
                for path, methods in paths.items():
                    other = shuffled.runs[place][path]
                    self.assertEqual(methods.keys(), other.keys())
                    for seed in (1, 2, 3):
                        self.assertEqual(sorted(map(id, (runs[seed] for runs in methods.values()))),
                                         sorted(map(id, (runs[seed] for runs in other.values()))))
                        moved += sum(methods[method][seed] is not other[method][seed] for method in methods)
            self.assertGreater(moved, 500)

    def test_effects_are_those_that_were_put_in(self):
        assessed = self.assessed(synthetic.as_claimed, spread=0.02)
        for key, part, expected in (("5b", 0, 1 / 1.3), ("6", 0, 0.8), ("7", 0, 1.04), ("6b", 0, 0.4), ("9", 0, 0.03 / 0.08),
                                    ("1", 0, 1500.0), ("4", 0, 1 / 1.5), ("5a", 0, 1.3)):
            effect, low, high = assessed[key].conditions[0].parts[part].estimate()
            self.assertLess(abs(math.log(effect / expected)), 0.03, key)
            self.assertTrue(low < effect < high and math.log(high / low) < 0.1, f"{key}: {low} to {high}")
        self.assertEqual(assessed["2"].conditions[0].parts[0].estimate(), (1.0, 1.0, 1.0))
        self.assertEqual(assessed["2"].conditions[0].runs, 2 * 20 * 25)

    def test_holds_when(self):
        """kappa is better only where v N_e dt / L is 2 or more; the words say so."""
        def figures(quantity, method, path, changes, speed):
            length = changes.get("terrain.correlation_length", 10)
            known = synthetic.as_claimed if speed * 3.0 / length > 1.0 else synthetic.contrary
            return known(quantity, method, path, changes, speed)
        lengths = [({}, speed) for speed in (1, 2, 5, 8)]
        lengths += [({"terrain.correlation_length": length}, speed) for length in (5, 40) for speed in (2, 8)]
        each = self.assessed(figures, conditions=lengths)["2"]
        self.assertEqual(each.verdict, PARTLY)
        words = verdicts.describe(each.conditions, database.BASE, database.setting_name, database.rate)
        self.assertIn("base: at 5, 8 m/s of 1, 2, 5, 8", words)
        self.assertIn("v N_e dt / L is 1.2 or more (not at 0.6 or less)", words)

    def test_the_map_is_a_condition_of_its_own(self):
        """At one speed there are more (S, o), where FHB is better; elsewhere nothing changes."""
        more = [("kappa", 4, overlap) for overlap in range(16)] + [("kappa", 7, overlap) for overlap in range(16)]

        def figures(quantity, method, path, changes, speed):
            return synthetic.as_claimed(quantity, method, path, changes, speed) * (4.0 if method in more and quantity == "kappa" else 1.0)
        lattice = self.assessed(synthetic.as_claimed, conditions=CONDITIONS[:2])
        self.file.unlink()
        synthetic.write(self.file, figures, conditions=CONDITIONS[:2])
        synthetic.add(self.file, figures, conditions=CONDITIONS[1:2], methods=more)
        found = {each.claim.key: each for each in page.assess_all(database.Study.read(self.file))}
        self.assertEqual([(each.speed, each.points, each.is_map, each.confirmed) for each in found["2"].conditions],
                         [(None, 24, False, True), (2, 24, False, True), (8, 24, False, True), (8, 56, True, False)])
        self.assertEqual(found["2"].conditions[3].parts[0].estimate()[0], 24 / 56)
        self.assertEqual(found["2"].verdict, PARTLY)
        self.assertEqual(len(found["6"].conditions), 3)
        self.assertEqual(len(lattice["2"].conditions), 3)

    def test_few_seeds_confirm_nothing(self):
        for key, each in self.assessed(synthetic.as_claimed, seeds=4).items():
            self.assertEqual(each.verdict, FAILED, key)

    def test_methods_without_blocks_take_part_in_settings_of_blocks(self):
        def write(more, methods):
            synthetic.write(self.file, synthetic.as_claimed, seeds=2, conditions=more, methods=methods)
        write((({}, 8),), synthetic.METHODS)
        study = database.Study.read(self.file)
        ramp = tuple("ramp" if axis.name == "transition" else value for axis, value in zip(database.AXES, database.BASE))
        study.runs[ramp, 8] = {path: {method: runs for method, runs in methods.items() if method[0] == "kappa"}
                               for path, methods in study.runs[database.BASE, 8].items()}
        study.borrow()
        self.assertIs(study.runs[ramp, 8]["zigzag"][database.FHB], study.runs[database.BASE, 8]["zigzag"][database.FHB])

    def test_runs_without_an_end(self):
        """Up to a tenth are left out of ratios and count as not better; with more nothing is confirmed."""
        synthetic.write(self.file, synthetic.as_claimed)
        with sqlite3.connect(self.file) as open_file:
            open_file.execute("UPDATE runs SET status = 'not completed' WHERE configuration ->> '$.blocking.kappa.size' = 1 AND "
                              "configuration ->> '$.blocking.kappa.overlap' = 0")
        open_file.close()
        found = {each.claim.key: each for each in page.assess_all(database.Study.read(self.file))}
        self.assertEqual(found["2"].verdict, HELD)
        self.assertEqual(found["2"].conditions[0].parts[0].estimate()[0], 23 / 24)
        self.assertEqual(found["2"].conditions[0].lost, 40)
        with sqlite3.connect(self.file) as open_file:
            open_file.execute("UPDATE runs SET status = 'not completed' WHERE configuration ->> '$.blocking.kappa.size' = 2")
        open_file.close()
        found = {each.claim.key: each for each in page.assess_all(database.Study.read(self.file))}
        self.assertEqual(found["2"].verdict, FAILED)


class Rules(unittest.TestCase):
    def test_one_part_that_fails_is_enough(self):
        chance = random.Random(5)
        good, bad = [chance.gauss(1.0, 0.1) for _ in range(20)], [chance.gauss(0.0, 0.1) for _ in range(20)]
        condition = Condition(database.BASE, 8, [Part("a", good, 1, 0.0), Part("b", bad, 1, 0.0)], 40)
        self.assertEqual(verdicts.assess([condition], 0.01), FAILED)
        condition = Condition(database.BASE, 8, [Part("a", good, 1, 0.0), Part("b", bad, -1, 0.5)], 40)
        self.assertEqual(verdicts.assess([condition], 0.01), HELD)

    def test_levels(self):
        """The first by itself, the others by Holm's procedure: a p-value of 1/128 passes a level of 0.01, but not half of it."""
        values = [0.9, 1.1, 1.0, 1.0, 1.1, 0.9, 1.2]
        condition = lambda: Condition(database.BASE, 8, [Part("a", values, 1, 0.0)], 14)
        self.assertEqual(condition().p(), 0.5 ** 7)  # 0.0078
        three = [condition(), condition(), condition()]
        self.assertEqual(verdicts.assess(three, 0.01), PARTLY)
        self.assertEqual([each.confirmed for each in three], [True, False, False])
        self.assertEqual(verdicts.assess(three, 0.016), HELD)
        self.assertEqual(verdicts.assess(three, 0.007), FAILED)

    def test_no_conditions(self):
        self.assertEqual(verdicts.assess([], 0.01), FAILED)

    def test_equal_values_prove_no_more_than_their_number(self):
        self.assertEqual(Part("a", [1.0] * 5, 1, 0.0).p(), 0.5 ** 5)
        self.assertEqual(Part("a", [1.0] * 5, -1, 0.0).p(), 1.0)

    def test_words(self):
        self.assertEqual(verdicts.numbers([8, 1, 2, 3, 5]), "1 to 3, 5, 8")
        self.assertEqual(verdicts.threshold([(1.0, False), (2.0, True), (4.0, True)]), "2 or more (not at 1 or less)")
        self.assertEqual(verdicts.threshold([(1.0, True), (2.0, False)]), "1 or less (not at 2 or more)")
        self.assertIsNone(verdicts.threshold([(1.0, True), (2.0, False), (3.0, True)]))
        self.assertIsNone(verdicts.threshold([(1.0, True), (2.0, True)]))
        self.assertEqual(verdicts.best_border([(1.0, True), (2.0, False), (3.0, True), (4.0, True)]),
                         "2 of 2 conditions at 3 or more, 1 of 2 below")

    def test_claims_have_names_of_their_own(self):
        keys = [claim.key for claim in claims.CLAIMS]
        self.assertEqual(len(keys), len(set(keys)))
        self.assertEqual({key[0] for key in keys}, set("123456789"))


if __name__ == "__main__":
    unittest.main()
