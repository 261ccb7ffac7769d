"""The cells of measurements over speeds, paths and fields of slip."""

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
