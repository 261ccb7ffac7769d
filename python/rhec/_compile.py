"""Plugins in C++ that are written, compiled against the rhec that this package belongs to, and kept."""
from __future__ import annotations

import hashlib
import os
import pathlib
import shutil
import subprocess

from . import _files, _rhec
from ._errors import Error
from ._types import File


# Targets that CMake has in every project.
_TARGETS = ("all", "clean", "depend", "edit_cache", "help", "install", "list_install_components", "package", "package_source",
            "preinstall", "rebuild_cache", "test")


def check_name(name: str) -> None:
    """Throws Error where CMake keeps a plugin's name for itself."""
    if name in _TARGETS:
        raise Error(f"build: the name is '{name}', which CMake keeps for itself; choose another name")


def folder_of(given: File | None, name: str, text: str) -> pathlib.Path:
    """Where a plugin's sources are: as given, or in the user's cache, by what they are and by which rhec."""
    folder = pathlib.Path(given) if given is not None else _cached(name, text)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise Error(f"build: {folder}: {problem.strerror}; expected a folder for the sources, or a place for it") from None
    return folder


def _cached(name: str, text: str) -> pathlib.Path:
    library = pathlib.Path(_rhec.library_folder(), "librhec_plugins.so")
    told = hashlib.sha256(f"{text}|{library}|{library.stat().st_mtime_ns}".encode()).hexdigest()
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return pathlib.Path(cache, "rhec", "built", f"{name}-{told[:16]}")


def write(file: pathlib.Path, content: str) -> None:
    """Writes a file, where it is not there already: else nothing is compiled anew."""
    if not file.exists() or _files.read_text(file) != content:
        _files.write_text(file, content)


def compile_in(folder: pathlib.Path, settings: list[str]) -> None:
    """Configures and builds the project in a folder, in its folder `build`."""
    cmake = shutil.which("cmake")
    if cmake is None:
        raise Error("build: cmake is not there; install it with a C++ compiler (apt-get install cmake g++), or use load()")
    package = pathlib.Path(_rhec.library_folder(), "cmake", "rhec")
    if not (package / "rhecConfig.cmake").exists():
        raise Error(f"build: {package} has no rhecConfig.cmake; install rhec with its headers, or use load()")
    build = folder / "build"
    _call(folder, [cmake, "-S", str(folder), "-B", str(build), f"-Drhec_DIR={package}", "-DCMAKE_BUILD_TYPE=Release", *settings])
    _call(folder, [cmake, "--build", str(build), "--parallel"])


def _call(folder: pathlib.Path, words: list[str]) -> None:
    result = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    if result.returncode != 0:
        log = folder / "build.log"
        log.write_text(result.stdout, encoding="utf-8")
        end = "\n".join(result.stdout.splitlines()[-15:])
        raise Error(f"build: {' '.join(words[:2])} failed; the whole of it is in {log}; it ends:\n{end}")
