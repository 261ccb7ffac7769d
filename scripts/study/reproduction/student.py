"""Student's t distribution, and what follows from it for a mean of independent values.

Nothing is looked up in a table: the distribution is the regularised incomplete beta function, summed as a continued fraction
(Abramowitz & Stegun 26.5.8), and a quantile is found by bisection.
"""
import math
import statistics


def incomplete_beta(a, b, x):
    """I_x(a, b), regularised, for 0 <= x <= 1."""
    if not 0.0 <= x <= 1.0:
        raise ValueError(f"incomplete_beta: x is {x}, expected 0 to 1")
    if x in (0.0, 1.0):
        return x
    if x > (a + 1.0) / (a + b + 2.0):  # where the fraction converges slowly; it is the same from the other side
        return 1.0 - incomplete_beta(b, a, 1.0 - x)
    front = math.exp(a * math.log(x) + b * math.log1p(-x) + math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b)) / a
    tiny = 1e-300
    # Lentz's evaluation of 1 / (1 + d1 / (1 + d2 / (1 + ...))).
    c, d, value = 1.0, 0.0, 1.0
    for step in range(1000):
        m = step // 2
        if step == 0:
            term = 1.0
        elif step % 2 == 0:
            term = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        else:
            term = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        d = 1.0 + term * d
        d = 1.0 / (d if abs(d) > tiny else tiny)
        c = 1.0 + term / c
        c = c if abs(c) > tiny else tiny
        value *= c * d
        if abs(1.0 - c * d) < 1e-15:
            return front * (value - 1.0)
    raise ArithmeticError(f"incomplete_beta({a}, {b}, {x}) did not converge")


def upper_tail(t, freedom):
    """P(T > t)."""
    if math.isinf(t):
        return 0.0 if t > 0 else 1.0
    half = 0.5 * incomplete_beta(0.5 * freedom, 0.5, freedom / (freedom + t * t))
    return half if t >= 0 else 1.0 - half


def quantile(probability, freedom):
    """The t that T is below with this probability."""
    if not 0.0 < probability < 1.0:
        raise ValueError(f"quantile: the probability is {probability}, expected between 0 and 1")
    if probability < 0.5:
        return -quantile(1.0 - probability, freedom)
    low, high = 0.0, 1.0
    while upper_tail(high, freedom) > 1.0 - probability:
        low, high = high, 2.0 * high
    while high - low > 1e-13 * high:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (middle, high) if upper_tail(middle, freedom) > 1.0 - probability else (low, middle)
    return 0.5 * (low + high)


def interval(values, level=0.95):
    """Mean, and the lower and upper end of its confidence interval, of independent values."""
    if len(values) < 2:
        raise ValueError(f"interval: {len(values)} values; expected two or more")
    mean = statistics.fmean(values)
    half = quantile(0.5 + 0.5 * level, len(values) - 1) * statistics.stdev(values) / math.sqrt(len(values))
    return mean, mean - half, mean + half


def p_above(values, bound):
    """One-sided p-value against 'the mean is at most `bound`'."""
    if len(values) < 2:
        raise ValueError(f"p_above: {len(values)} values; expected two or more")
    difference, spread = statistics.fmean(values) - bound, statistics.stdev(values)
    if spread == 0.0:  # all the same: as sure as one can be, but of equality with the bound
        return 0.0 if difference > 0.0 else 1.0
    return upper_tail(difference / (spread / math.sqrt(len(values))), len(values) - 1)


def holm(p_values, level):
    """Which of several hypotheses are rejected so that the chance of any false rejection is at most `level` (Holm 1979)."""
    rejected = [False] * len(p_values)
    for rank, index in enumerate(sorted(range(len(p_values)), key=lambda place: p_values[place])):
        if p_values[index] > level / (len(p_values) - rank):
            break
        rejected[index] = True
    return rejected
