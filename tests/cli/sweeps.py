"""What the tests of `rhec sweep` share: short runs, and the rows that came of them."""
import sqlite3

from cli import FIGURE8

TIMES = {"solve_time_us", "seconds", "finished"}
SHORT = f"scenario: {FIGURE8}\nset: {{path.laps: 1, path.radius: 8, speed: 10}}\n"


def rows(file):
    """By identity, without times."""
    with sqlite3.connect(file) as database:  # with the right to write, to undo what was under way when it was killed
        if not database.execute("SELECT count(*) FROM sqlite_schema").fetchone()[0]:
            return {}  # killed before it had its tables
        answer = database.execute("SELECT * FROM runs")
        names = [column[0] for column in answer.description]
        found = [dict(zip(names, row)) for row in answer]
    database.close()
    return {row["identity"]: {key: value for key, value in row.items() if key not in TIMES} for row in found}
