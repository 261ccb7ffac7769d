"""Every block of Python in README.md and docs/python.md runs, in its order, as it is written."""
import re
import traceback

import pytest
from shared import ROOT

BLOCK = re.compile(r"```python\n(.*?)```\n", re.DOTALL)
# Packages that a page may use and not everybody has.
WELCOME = ("sympy", "casadi", "pandas")


@pytest.mark.parametrize("page, least", [("README.md", 1), ("docs/python.md", 10)])
def test_blocks_run(page, least, tmp_path, monkeypatch, capfd):
    for name in ("scenarios", "examples"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    text = (ROOT / page).read_text(encoding="utf-8")
    names, left_out, ran = {}, [], 0
    for block in BLOCK.finditer(text):
        line = text[:block.start()].count("\n") + 2
        code = compile("\n" * (line - 1) + block.group(1), str(ROOT / page), "exec")
        try:
            exec(code, names)  # noqa: S102  (what this test is for)
            ran += 1
        except ModuleNotFoundError as missing:
            if missing.name not in WELCOME:
                raise
            left_out.append(f"line {line} without {missing.name}")
        except NameError as missing:  # of a block that was left out
            if not left_out:
                raise
            left_out.append(f"line {line}: {missing}")
        except Exception:
            pytest.fail(f"{page}:{line}: {traceback.format_exc()}")
    assert ran + len(left_out) >= least
    if left_out:
        pytest.skip(f"{page}: {ran} blocks ran; left out: {'; '.join(left_out)}")
