"""A bar that shows how far a long call is: in a notebook, or on a terminal; nothing elsewhere."""
from __future__ import annotations

import math
import sys
import time

_WIDTH = 40


def _in_notebook():
    """Whether a notebook's front end shows what is displayed."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    return shell is not None and type(shell).__name__ == "ZMQInteractiveShell"


class _Nothing:
    def __call__(self, share, text):
        pass

    def close(self):
        pass


class _Terminal:
    def __init__(self, title):
        self._title, self._shown = title, ""

    def __call__(self, share, text):
        told = text or self._title
        if math.isnan(share):
            line = told
        else:
            filled = int(share * _WIDTH)
            line = f"{told} [{'#' * filled}{'.' * (_WIDTH - filled)}] {int(100 * share):3d} %"
        if line != self._shown:
            print(f"\r{line}\033[K", end="", file=sys.stderr, flush=True)
            self._shown = line

    def close(self):
        if self._shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)


class _Notebook:
    def __init__(self, title):
        from IPython.display import HTML, display

        self._html, self._title, self._next = HTML, title, 0.0
        self._handle = display(HTML(self._text(0.0, "")), display_id=True)

    def _text(self, share, text):
        value = "" if math.isnan(share) else f"value='{share:.3f}'"
        return f"<progress style='width: 20em' {value}></progress> {text or self._title}"

    def __call__(self, share, text):
        if time.monotonic() >= self._next:
            self._next = time.monotonic() + 0.2
            self._handle.update(self._html(self._text(share, text)))

    def close(self):
        self._handle.update(self._html(""))


class _Caller:
    def __init__(self, function):
        self._function = function

    def __call__(self, share, text):
        self._function(share, text)

    def close(self):
        pass


class Bar:
    """While it is entered, a function of (share, text) that shows both. `wanted`: None for a bar where one can be seen,
    True, False, or a function of one's own."""

    def __init__(self, wanted, title):
        if callable(wanted):
            self._bar = _Caller(wanted)
        elif wanted is False or (wanted is None and not _in_notebook() and not sys.stderr.isatty()):
            self._bar = _Nothing()
        else:
            self._bar = _Notebook(title) if _in_notebook() else _Terminal(title)

    def __enter__(self):
        return self._bar

    def __exit__(self, *failure):
        self._bar.close()
