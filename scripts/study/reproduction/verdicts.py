"""From figures by seed to a verdict. Pure functions: nothing here reads a file or knows a claim.

A part of a claim says that a mean over seeds lies on one side of a bound that was fixed beforehand. A condition (setting and
speed) confirms the claim if all of its parts are significant. The first condition is the claim's main one and tested by itself; over
the others Holm's procedure keeps the chance of a single false confirmation at the level that it is given.
"""
import dataclasses
import math

import student
from slices import MOST_LEFT_OUT

HELD, PARTLY, FAILED = "held", "holds when", "did not hold"
PAGE_LEVEL = 0.01  # chance of any false confirmation on the page, of main conditions and of others; shared evenly by its claims


@dataclasses.dataclass
class Part:
    """`values` by seed, None where a seed has none; the claim is that their mean is above (direction 1) or below (-1) `bound`.
    Without a bound they are only shown."""
    name: str
    values: list
    direction: int = 1
    bound: float | None = None
    scale: str = "ratio"  # how values are shown: ratio (they are logarithms), share, us (logarithms)

    def known(self):
        return [value for value in self.values if value is not None]

    def p(self):
        """Never below the chance that all seeds lie on one side by luck alone, so that equal values do not prove too much."""
        signed = [self.direction * value for value in self.known()]
        return max(student.p_above(signed, self.direction * self.bound), 0.5 ** len(signed))

    def claimed_side(self):
        """Whether the 95 % interval lies wholly on the claimed side of the bound."""
        if len(self.known()) < 2:
            return False
        _, low, high = student.interval(self.known())
        return low > self.bound if self.direction > 0 else high < self.bound

    def estimate(self):
        """Mean and 95 % interval, as they are shown."""
        show = (lambda value: value) if self.scale == "share" else math.exp
        known = self.known()
        if len(known) < 2:
            return (show(known[0]) if known else math.nan), math.nan, math.nan
        return tuple(show(value) for value in student.interval(known))


@dataclasses.dataclass
class Condition:
    setting: tuple
    speed: float | None  # None: all speeds of the base together
    parts: list
    runs: int  # that were compared
    lost: int = 0  # of these without an end
    points: int = 0  # (S, o)
    is_map: bool = False  # the whole map rather than the (S, o) that all conditions have
    confirmed: bool = False

    def p(self):
        """All parts must be so: the largest of their p-values."""
        if self.lost > MOST_LEFT_OUT * self.runs or any(len(part.known()) < 2 for part in self.parts):
            return 1.0
        return max(part.p() for part in self.parts if part.bound is not None)

    def claimed_side(self):
        """By the intervals alone, whatever else is compared."""
        return all(part.claimed_side() for part in self.parts if part.bound is not None)


def assess(conditions, level):
    """Marks the conditions that confirm the claim, and returns held, holds when or did not hold."""
    p_values = [condition.p() for condition in conditions]
    for condition, confirmed in zip(conditions, student.holm(p_values[:1], level) + student.holm(p_values[1:], level)):
        condition.confirmed = confirmed
    count = sum(condition.confirmed for condition in conditions)
    return HELD if conditions and count == len(conditions) else PARTLY if count else FAILED


def numbers(values):
    """1, 2, 3, 5 -> '1 to 3, 5'."""
    values, runs = sorted(values), []
    for value in values:
        if runs and value == runs[-1][-1] + 1:
            runs[-1].append(value)
        else:
            runs.append([value])
    return ", ".join(f"{run[0]:g}" if len(run) == 1 else f"{run[0]:g}, {run[1]:g}" if len(run) == 2 else
                     f"{run[0]:g} to {run[-1]:g}" for run in runs)


def threshold(points):
    """Of (rate, confirmed): where the confirmed lie, in words, if a border separates them; else None."""
    yes, no = [rate for rate, confirmed in points if confirmed], [rate for rate, confirmed in points if not confirmed]
    if not yes or not no:
        return None
    if min(yes) > max(no):
        return f"{min(yes):.2g} or more (not at {max(no):.2g} or less)"
    if max(yes) < min(no):
        return f"{max(yes):.2g} or less (not at {min(no):.2g} or more)"
    return None


def best_border(points):
    """The border that most of (rate, confirmed) agree with: '(most at 0.6 or more: 9 of 10; below: 1 of 4)'."""
    rates = sorted({rate for rate, _ in points})
    if len(rates) < 2:
        return None

    def right(border, above):
        return sum(confirmed == ((rate >= border) == above) for rate, confirmed in points)
    border, above = max(((border, above) for border in rates[1:] for above in (True, False)), key=lambda pair: right(*pair))
    upper = [confirmed for rate, confirmed in points if rate >= border]
    lower = [confirmed for rate, confirmed in points if rate < border]
    return f"{sum(upper)} of {len(upper)} conditions at {border:.2g} or more, {sum(lower)} of {len(lower)} below"


def describe(conditions, base, name_of, rate_of):
    """Where a claim that holds in part does, in words: by speed, by v N_e dt / L, and by what else was changed."""
    single = [condition for condition in conditions if condition.speed is not None and not condition.is_map]
    words = ["all speeds together"] if any(condition.confirmed and condition.speed is None for condition in conditions) else []
    at_base = [condition for condition in single if condition.setting == base]
    if at_base:
        yes = [condition.speed for condition in at_base if condition.confirmed]
        looked = numbers([condition.speed for condition in at_base])
        which = "at no single speed" if not yes else "at all speeds" if len(yes) == len(at_base) else f"at {numbers(yes)} m/s"
        words.append(f"base: {which}" + (f" of {looked}" if len(at_base) > 1 and len(yes) < len(at_base) else ""))
    maps = [condition for condition in conditions if condition.is_map]
    if maps:
        yes = [condition.speed for condition in maps if condition.confirmed]
        words.append(f"whole map: {f'at {numbers(yes)} m/s' if yes else 'at no speed'} of {numbers([each.speed for each in maps])}")
    lengths = [condition for condition in single if condition.setting[1:] == base[1:]]
    if len({condition.setting[0] for condition in lengths}) > 1:
        points = [(rate_of(condition.setting, condition.speed), condition.confirmed) for condition in lengths]
        border = threshold(points)
        if border:
            words.append(f"v N_e dt / L is {border}")
        elif any(confirmed for _, confirmed in points) and not all(confirmed for _, confirmed in points):
            words.append(f"v N_e dt / L does not decide it ({best_border(points)})")
    others = {}
    for condition in single:
        if condition.setting[1:] != base[1:]:
            others.setdefault(condition.setting, []).append(condition)
    for setting, group in others.items():
        yes = [condition.speed for condition in group if condition.confirmed]
        if len(yes) < len(group):
            words.append(f"{name_of(setting)}: {f'at {numbers(yes)} m/s' if yes else 'at no speed'} of "
                         f"{numbers([condition.speed for condition in group])}")
    if others and all(condition.confirmed for group in others.values() for condition in group):
        words.append("all other settings")
    return "; ".join(words)
