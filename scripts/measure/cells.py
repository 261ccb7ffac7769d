"""The cells of measurements over speeds, paths and fields of slip."""
import math

PATHS = {"figure8": "ekf", "zigzag": "ekf_zigzag"}
SPEEDS = (1, 2, 5, 8)
WIDTHS = {"w": 0.5, "n": 0.85}  # least slip factor; the largest is 1


def fields():
    """Name -> assignments, given the seed."""
    found = {}
    for width, lower in WIDTHS.items():
        for length in (2, 5, 10, 20, 40):
            found[f"g{length}{width}"] = [f"terrain={{name: gaussian, correlation_length: {length}, lower: {lower}, upper: 1}}"]
        for size in (8, 25):
            found[f"p{size}{width}"] = [f"terrain={{name: patches, patch_size: {size}, lower: {lower}, upper: 1}}"]
    found["const"] = None
    return found


def assignments_of(field, seed):
    if field is not None:
        return field
    # Somewhere within the bounds, another place for every seed.
    kappa, mu = 0.5 + 0.5 * ((seed * 0.6180339887) % 1), 0.5 + 0.5 * ((seed * 0.7548776662) % 1)
    return [f"terrain={{name: constant, values: {{kappa: {kappa:.4f}, mu: {mu:.4f}}}}}"]


def mean(values):
    values = list(values)
    return sum(values) / len(values)


def interval(statistic, seeds):
    """Half the width of the 95 % interval of `statistic`, a function of the numbers of the seeds that count, by leaving
    out one seed after the other (jackknife); NaN for a single seed."""
    if seeds < 2:
        return math.nan
    values = [statistic([s for s in range(seeds) if s != left_out]) for left_out in range(seeds)]
    error = math.sqrt((seeds - 1) / seeds * sum((value - mean(values)) ** 2 for value in values))
    quantiles = [12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23, 2.20, 2.18, 2.16, 2.14, 2.13, 2.12, 2.11, 2.10, 2.09]
    return error * (quantiles[seeds - 2] if seeds - 2 < len(quantiles) else 2.0)


def ratio_over_cells(cells, of, to):
    """Text for the mean over the cells of a ratio, with the 95 % interval over the seeds if there are several, and for the worst
    cell. `of` and `to` give a cell's list of numbers by seed; the ratio of a cell is that of their means."""
    seeds = len(of(next(iter(cells.values()))))

    def ratios(kept):
        return [mean(of(cell)[s] for s in kept) / mean(to(cell)[s] for s in kept) for cell in cells.values()]

    half = interval(lambda kept: mean(ratios(kept)), seeds)
    found = ratios(range(seeds))
    return f"{mean(found):.3f}" + (f" ± {half:.3f}" if seeds > 1 else "") + f" / {max(found):.3f}"
