"""Recovery curves as a picture: a panel for each kind of fault, the error against samples since the fault's end."""
import math

WIDTH, HEIGHT, COLUMNS = 210, 118, 5     # of a panel, and how many stand side by side
LEFT, RIGHT, TOP, BOTTOM = 34, 6, 18, 20  # of a panel, around its axes
LEAST, MOST = 1e-2, 1e2                  # errors that are drawn [m]
SAMPLES = 60
COLOURS = ["#c1432e", "#2f6f9f", "#3d8a4f", "#8a5aa8"]


def place(after, error):
    x = LEFT + (WIDTH - LEFT - RIGHT) * after / SAMPLES
    share = math.log(min(max(error, LEAST), MOST) / LEAST) / math.log(MOST / LEAST)
    return f"{x:.1f},{TOP + (HEIGHT - TOP - BOTTOM) * (1 - share):.1f}"


def text(x, y, words, anchor="start", size=8):
    escaped = words.replace("&", "&amp;").replace("<", "&lt;")
    return f'<text x="{x}" y="{y}" text-anchor="{anchor}" font-size="{size}">{escaped}</text>'


def axes():
    parts = []
    for power in (-2, -1, 0, 1, 2):
        y = place(0, 10.0 ** power).split(",")[1]
        parts.append(f'<path d="M{LEFT} {y}H{WIDTH - RIGHT}" stroke="#ddd"/>')
        if power % 2 == 0:
            parts.append(text(LEFT - 3, float(y) + 3, f"{10.0 ** power:g}", "end"))
    for after in (0, 15, 30, 45, 60):
        x = place(after, MOST).split(",")[0]
        parts.append(f'<path d="M{x} {TOP}V{HEIGHT - BOTTOM}" stroke="{"#999" if after == 15 else "#ddd"}"/>')
        parts.append(text(x, HEIGHT - BOTTOM + 10, str(after), "middle"))
    return "".join(parts)


def panel(kind, curves):
    parts = [axes(), text(LEFT, TOP - 6, kind, size=9)]
    for colour, points in zip(COLOURS, curves.values()):
        for column, dashes in ((1, ""), (2, ' stroke-dasharray="3 2"')):
            line = " ".join(place(point[0], point[column]) for point in points if point[0] <= SAMPLES)
            parts.append(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="1.2"{dashes}/>')
    return "".join(parts)


def picture(document):
    kinds = document["kinds"]
    rows = math.ceil(len(kinds) / COLUMNS)
    width, height = COLUMNS * WIDTH, rows * HEIGHT + 40
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif">',
             f'<rect width="{width}" height="{height}" fill="#fff"/>',
             text(LEFT, 16, "Error of the position [m] against samples since the end of the fault (of one for good: since its beginning); "
                  "lines: median, dashes: 99 %", size=11)]
    x = LEFT
    for colour, name in zip(COLOURS, next(iter(kinds.values()))):
        parts.append(f'<path d="M{x} 27H{x + 16}" stroke="{colour}" stroke-width="2"/>' + text(x + 20, 30, name, size=10))
        x += 70
    for i, (kind, curves) in enumerate(kinds.items()):
        parts.append(f'<g transform="translate({i % COLUMNS * WIDTH} {40 + i // COLUMNS * HEIGHT})">{panel(kind, curves)}</g>')
    return "".join(parts) + "</svg>\n"
