"""Recorded drives of a vehicle that slips, made up: what a log says of it is known."""
import math
import random

SCENARIO = """\
name: drive
step: 0.2
model: {name: bicycle_slip, wheelbase: 2.0, gps_offset: 0}
log: {fix_delay: 0, steering_bias: 0}
noise:
  outputs: {x_gps: %(noise)g, y_gps: %(noise)g, delta: 0.01}
  inputs: {u1: 0.1, u2: 0.1}
bounds: {kappa: [0.3, 1.3], mu: [0.3, 1.3], u2: [null, null]}
estimator:
  name: %(estimator)s
  heading_starts: 12
  process_noise: {kappa: 0.01, mu: 0.003}
  initial:
    parameters: {kappa: 1, mu: 1}
    sigma: {x_pos: 100, y_pos: 100, beta: 3.14, delta: 0.1, kappa: 0.3, mu: 0.3}
"""

# What the scenario does not know.
TRUTH = {"noise.outputs.x_gps, y_gps": 0.1, "model.gps_offset": 0.7, "log.fix_delay": 0.15, "log.steering_bias": 0.02}


def drive(folder, seed, seconds, outliers=0.0, noise=0.3, estimator="ekf"):
    """Writes drs.txt, gps.txt and drive.yaml: a weaving drive at 1 to 4 m/s. `noise` is what the scenario takes for the
    GPS's, `outliers` the share of fixes that are off by metres."""
    draw = random.Random(seed)
    rows, fixes, dt = [], [], 0.01
    x, y, heading, kappa = 0.0, 0.0, 0.7, 0.8
    delay = round(TRUTH["log.fix_delay"] / dt)
    sigma, offset, bias = TRUTH["noise.outputs.x_gps, y_gps"], TRUTH["model.gps_offset"], TRUTH["log.steering_bias"]
    past = []
    phases = [draw.uniform(0, 6.28) for _ in range(4)]
    for i in range(round(seconds / dt)):
        time = dt * i
        speed = 2.5 + 1.5 * math.sin(0.31 * time + phases[0])
        steering = 0.25 * math.sin(0.5 * time + phases[1]) + 0.15 * math.sin(0.13 * time + phases[2])
        kappa = 0.8 + 0.1 * math.sin(0.02 * time + phases[3])
        past.append((x - offset * math.cos(heading), y - offset * math.sin(heading)))
        if i % 5 == 0:
            rows.append(f"{time:.3f},{speed + 0.05 * draw.gauss(0, 1):.6f},{steering + bias + 0.002 * draw.gauss(0, 1):.6f}")
        if i % 20 == 0 and i >= delay:
            far = 5.0 if draw.random() < outliers else 0.0
            measured = [at + (sigma + far) * draw.gauss(0, 1) for at in past[i - delay]]
            fixes.append(f"{time:.3f},{measured[0]:.6f},{measured[1]:.6f}")
        rate = kappa * speed / 2.0 * math.tan(0.9 * steering)
        x += dt * kappa * speed * math.cos(heading + 0.5 * dt * rate)
        y += dt * kappa * speed * math.sin(heading + 0.5 * dt * rate)
        heading += dt * rate
    for name, lines in (("drs.txt", rows), ("gps.txt", fixes)):
        (folder / name).write_text("\n".join(lines) + "\n")
    (folder / "drive.yaml").write_text(SCENARIO % {"noise": noise, "estimator": estimator})
