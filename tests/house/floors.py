#!/usr/bin/env python3
"""The order of the floors and of their rooms, in what files include and in what libraries link to.

    floors.py <source root> [--lib <directory of the libraries> --plugins <directory of the plugins>]
    floors.py --self-test

A folder includes folders on lower floors, and itself; a plugin includes its own folder, core and plugins. Benchmarks look
into plugins too, as "solvers/gn_rti/gn_rti.hpp". A room includes its own files and the public headers of the rooms that it
comes after: `rhec_add_room(<floor> <room> AFTER <room> ...)` in its CMakeLists.txt says which. A SHARED room has a library
of its own, which links to those rooms' libraries at most. A folder of a floor that is a project of its own (the template of
plugins) is no room: it includes what the floor has for others.
"""
import argparse
import pathlib
import re
import subprocess
import sys
import tempfile

import house

# folder -> the folders whose public headers ("rhec/<folder>/x.hpp") it may include, and whose libraries it may link to
MAY_USE = {
    "core": ("core",),
    "plugins": ("core", "plugins"),
    "solvers": ("core", "plugins"),
    "models": ("core", "plugins"),
    "blocking": ("core", "plugins"),
    "priors": ("core", "plugins"),
    "terms": ("core", "plugins"),
    "logs": ("core", "plugins", "logs"),
    "sim": ("core", "plugins", "logs", "sim"),
    "apps": ("core", "plugins", "logs", "sim", "apps"),
    "python": ("core", "plugins", "logs", "sim"),
    "benchmarks": ("core", "plugins", "logs", "sim"),
}
PLUGIN_FOLDERS = ("solvers", "models", "blocking", "priors", "terms")
CORE_THIRD_PARTY = ("Eigen", "unsupported/Eigen", "fmt", "xsimd")
CORE_LIBRARIES = ("libfmt", "libstdc++", "libm.", "libgcc_s", "libc.", "ld-linux", "libasan", "libubsan", "libtsan")
STANDARD = set("""
algorithm any array atomic barrier bit bitset charconv chrono codecvt compare complex concepts condition_variable
coroutine deque exception execution filesystem format forward_list fstream functional future initializer_list iomanip
ios iosfwd iostream istream iterator latch limits list locale map memory memory_resource mutex new numbers numeric
optional ostream queue random ranges ratio regex scoped_allocator semaphore set shared_mutex source_location span
sstream stack stdexcept stop_token streambuf string string_view strstream syncstream system_error thread tuple
type_traits typeindex typeinfo unordered_map unordered_set utility valarray variant vector version
cassert cctype cerrno cfenv cfloat cinttypes climits clocale cmath csetjmp csignal cstdarg cstddef cstdint cstdio
cstdlib cstring ctime cuchar cwchar cwctype
""".split())
ROOM = re.compile(r"^rhec_add_room\((\w+)\s+(\w+)([^)]*)\)", re.MULTILINE)
PROJECT = re.compile(r"^project\(", re.MULTILINE)
ROOM_KEYWORDS = ("INTERNAL", "SHARED", "AFTER", "SOURCES", "PUBLIC", "PRIVATE")
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')


class Rooms:
    """The rooms of all floors: which rooms of its floor each may include, and which are not to be seen from other floors."""

    def __init__(self, root):
        self.after, self.internal, self.shared, self.projects, self.violations = {}, set(), set(), set(), []
        for file in sorted(root.glob("*/*/CMakeLists.txt")):
            text = file.read_text(encoding="utf-8")
            if PROJECT.search(text):
                self.projects.add(file.parent.parts[-2:])
            for floor, room, words in ROOM.findall(text):
                self._add(file, floor, room, words.split())
        for floor, room in self.after:
            for other in sorted(self.reach(floor, room) - {room}):
                if (floor, other) not in self.after:
                    self.violations.append(f"{floor}/{room}: comes after {other}, which is no room of {floor}/")
                elif room in self.reach(floor, other):
                    self.violations.append(f"{floor}/{room}: comes after {other}, which comes after {room}")

    def _add(self, file, floor, room, words):
        self.after[floor, room] = set()
        taker = None
        for word in words:
            if word in ROOM_KEYWORDS:
                taker = word
                if word == "INTERNAL":
                    self.internal.add((floor, room))
                if word == "SHARED":
                    self.shared.add((floor, room))
            elif taker == "AFTER":
                self.after[floor, room].add(word)
        if file.parent.parts[-2:] != (floor, room):
            self.violations.append(f"{file}: declares the room {floor}/{room}, which is another folder")

    def of_floor(self, floor):
        return {room for of, room in self.after if of == floor}

    def reach(self, floor, room):
        """The room itself and all that come before it."""
        reached, waiting = set(), [room]
        while waiting:
            at = waiting.pop()
            if at not in reached:
                reached.add(at)
                waiting += self.after.get((floor, at), ())
        return reached

    def of_file(self, root, file):
        """The room that a file lies in, or None."""
        parts = file.relative_to(root).parts
        return parts[1] if len(parts) > 2 and (parts[0], parts[1]) in self.after else None

    def is_own_project(self, root, file):
        return file.relative_to(root).parts[:2] in self.projects

    def why_not(self, root, file, name):
        """`name` is "rhec/<floor>/..." of a floor that may be included."""
        floor, rest = name.split("/")[1], name.split("/")[2:]
        if not self.of_floor(floor):
            return None
        if len(rest) != 2 or rest[0] not in self.of_floor(floor):
            return f'public headers of {floor}/ are named "rhec/{floor}/<room>/<header>.hpp"'
        own_floor, own_room = file.relative_to(root).parts[0], self.of_file(root, file)
        if own_floor != floor or self.is_own_project(root, file):
            return f"{floor}/{rest[0]} is not to be seen from other floors" if (floor, rest[0]) in self.internal else None
        reach = self.reach(floor, own_room)
        if rest[0] not in reach:
            return f"{floor}/{own_room} does not come after {rest[0]}, only after {', '.join(sorted(reach - {own_room})) or 'none'}"
        return None


def allowed_text(folder):
    names = ", ".join(f'"rhec/{name}/..."' for name in MAY_USE[folder])
    if folder == "core":
        return f"{names}, own files, the standard library, Eigen, fmt, xsimd"
    if folder == "benchmarks":
        return f"{names}, own files, those of plugins, third parties in <>"
    if folder in PLUGIN_FOLDERS:
        return f"{names}, files of the plugin's own folder, third parties in <>"
    return f"{names}, own files, third parties in <>"


def own_folder(root, rooms, file):
    """The folder within which a file may include by relative name: its plugin's or its room's, else that of the floor."""
    parts = file.relative_to(root).parts
    is_inner = len(parts) > 2 and (
        parts[0] in PLUGIN_FOLDERS or rooms.of_file(root, file) or rooms.is_own_project(root, file))
    return root.joinpath(*parts[: 2 if is_inner else 1])


def why_not_include(root, rooms, file, quote, name):
    folder = file.relative_to(root).parts[0]
    if name.startswith("rhec/"):
        if quote == "<":
            return f'ours is included with quotes, as "{name}"'
        parts = name.split("/")
        if len(parts) < 3:
            return 'public headers are named "rhec/<folder>/<header>.hpp"'
        if parts[1] not in MAY_USE[folder]:
            return f"{folder}/ does not reach {parts[1]}/"
        return rooms.why_not(root, file, name)
    if quote == '"':
        if folder == "benchmarks" and name.startswith(tuple(f"{other}/" for other in PLUGIN_FOLDERS)) and ".." not in name:
            return None if (root / name).is_file() else f'"{name}" is not a file of {root}'
        own = own_folder(root, rooms, file).resolve()
        places = [file.parent, own, own / "src"]
        targets = [(place / name).resolve() for place in places]
        if any(target.is_file() and target.is_relative_to(own) for target in targets):
            return None
        lists = own / "CMakeLists.txt"
        if "/" not in name and lists.is_file() and re.search(rf"[ /]{re.escape(name)}\b", lists.read_text(encoding="utf-8")):
            return None  # the build writes it
        return f'"{name}" is not a file of {own.relative_to(root.resolve())}/'
    if folder == "core" and name not in STANDARD and not name.startswith(tuple(p + "/" for p in CORE_THIRD_PARTY)):
        return f"core does not depend on <{name}>"
    return None


def include_violations(root):
    rooms, looked_at = Rooms(root), 0
    violations = list(rooms.violations)
    for file in house.cpp_files(root, house.FOLDERS):
        looked_at += 1
        folder = file.relative_to(root).parts[0]
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
            match = INCLUDE.match(line)
            reason = match and why_not_include(root, rooms, file, *match.groups())
            if reason:
                violations.append(f"{file}:{number}: {reason}; allowed: {allowed_text(folder)}")
        if rooms.of_floor(folder) and not rooms.of_file(root, file) and not rooms.is_own_project(root, file):
            violations.append(f"{file}:1: lies in no room of {folder}/; its rooms are {', '.join(sorted(rooms.of_floor(folder)))}")
    return violations, looked_at


def needed(library):
    """The libraries that a shared library asks the loader for (DT_NEEDED)."""
    text = subprocess.run(["readelf", "--dynamic", "--wide", str(library)], check=True, capture_output=True, text=True).stdout
    return re.findall(r"\(NEEDED\).*\[(.*)\]", text)


def link_violations(label, folder, needs, plugin_names, rooms_before=()):
    """`needs` are the names that the library `label` of `folder` asks for, or of a room of it that comes after others."""
    violations = []
    allowed = [name for name in MAY_USE[folder] if name != folder] + [f"{folder}_{room}" for room in sorted(rooms_before)]
    for name in needs:
        ours = re.match(r"librhec_(\w+)\.so", name)
        # A floor whose rooms are libraries, before it.
        is_of_floor = ours and folder != "logs" and "logs" in MAY_USE[folder] and ours.group(1).startswith("logs_")
        bad = (
            (ours and ours.group(1) not in allowed and not is_of_floor)
            or name in plugin_names
            or (folder == "core" and not ours and not name.startswith(CORE_LIBRARIES))
        )
        if bad:
            libraries = ", ".join(f"librhec_{other}" for other in allowed) or "no other library of rhec"
            extra = "; of others only " + ", ".join(CORE_LIBRARIES) if folder == "core" else " and third parties"
            violations.append(f"{label}: links to {name}; allowed: {libraries}{extra}")
    return violations


def library_violations(root, lib, plugins):
    violations, looked_at, rooms = [], 0, Rooms(root)
    modules = sorted(plugins.glob("*.so"))
    plugin_names = {module.name for module in modules}
    libraries = {"core": ("core", ()), "plugins": ("plugins", ())}
    for floor, room in sorted(rooms.shared):
        libraries[f"{floor}_{room}"] = floor, rooms.reach(floor, room) - {room}
    for name, (folder, rooms_before) in libraries.items():
        library = lib / f"librhec_{name}.so"
        if library.exists():
            looked_at += 1
            violations += link_violations(library, folder, needed(library), plugin_names, rooms_before)
        else:
            violations.append(f"{library}: is not there; build first")
    if not modules:
        violations.append(f"{plugins}: no plugin is there; build first")
    for module in modules:
        looked_at += 1
        violations += link_violations(module, "models", needed(module), plugin_names)
    return violations, looked_at


def self_test():
    """Plants violations, and things that are none, in a small tree; each must be told apart."""
    wrong = {
        "core/low/up.cpp": '#include "rhec/plugins/host/host.hpp"',
        "core/low/angle.cpp": "#include <rhec/core/low/model.hpp>",
        "core/low/boost.cpp": "#include <boost/dll.hpp>",
        "core/low/include/rhec/core/low/escapes.hpp": '#include "../../../../../../sim/world/own.hpp"',
        "core/low/higher.cpp": '#include "rhec/core/high/model.hpp"',
        "core/side/beside.cpp": '#include "rhec/core/high/model.hpp"',
        "core/high/no_room.cpp": '#include "rhec/core/model.hpp"',
        "core/high/private.cpp": '#include "../low/own.hpp"',
        "core/astray.cpp": "#include <vector>",
        "core/round/CMakeLists.txt": "rhec_add_room(core round AFTER trip)",
        "core/trip/CMakeLists.txt": "rhec_add_room(core trip AFTER round)",
        "core/lost/CMakeLists.txt": "rhec_add_room(core lost AFTER nowhere)",
        "plugins/host/up.cpp": '  #  include "rhec/sim/world/truth.hpp"',
        "plugins/host/internal.cpp": '#include "rhec/core/inner/lanes.hpp"',
        "plugins/template/peeks.cpp": '#include "../host/own.hpp"',
        "models/a/other.cpp": '#include "../b/b.hpp"',
        "solvers/s/sim.cpp": '#include "rhec/sim/world/truth.hpp"',
        "sim/world/model.cpp": '#include "rhec/models/a.hpp"',
        "logs/table/up.cpp": '#include "rhec/sim/world/truth.hpp"',
        "logs/table/later.cpp": '#include "rhec/logs/bag/bag.hpp"',
        "sim/world/loop.cpp": '#include "rhec/sim/loop/run.hpp"',
        "sim/loop/no_room.cpp": '#include "rhec/sim/world.hpp"',
        "python/binding/app.cpp": '#include "rhec/apps/commands.hpp"',
        "benchmarks/app.cpp": '#include "rhec/apps/commands.hpp"',
        "benchmarks/up.cpp": '#include "../apps/main.cpp"',
        "benchmarks/gone.cpp": '#include "models/b/gone.hpp"',
        "core/high/unwritten.cpp": '#include "written.hpp"',
    }
    right = {
        "core/low/CMakeLists.txt": "rhec_add_room(core low)",
        "core/inner/CMakeLists.txt": "rhec_add_room(core inner INTERNAL AFTER low SOURCES a.cpp)\nwrite(a.cpp written.hpp)",
        "core/inner/a.cpp": '#include "written.hpp"',
        "core/high/CMakeLists.txt": "# A comment.\nrhec_add_room(core high\n  AFTER inner\n  SOURCES good.cpp\n  PRIVATE fmt::fmt)",
        "core/side/CMakeLists.txt": "rhec_add_room(core side AFTER low)",
        "core/high/good.cpp": '#include <vector>\n#include <Eigen/Core>\n#include <fmt/format.h>\n#include "rhec/core/low/model.hpp"',
        "core/high/inner.cpp": '#include "rhec/core/inner/lanes.hpp"\n#include "rhec/core/high/model.hpp"',
        "core/low/own_user.cpp": '#include "own.hpp"',
        "core/low/own.hpp": "#pragma once\n// #include \"rhec/sim/world/truth.hpp\"",
        "plugins/kit/CMakeLists.txt": "rhec_add_room(plugins kit)",
        "plugins/host/CMakeLists.txt": "rhec_add_room(plugins host AFTER kit)",
        "plugins/host/own.hpp": "#pragma once",
        "plugins/template/CMakeLists.txt": "project(template)",
        "plugins/template/user.cpp": '#include "rhec/plugins/host/host.hpp"\n#include "rhec/core/high/model.hpp"',
        "plugins/host/good.cpp": '#include <boost/dll.hpp>\n#include "rhec/core/high/model.hpp"',
        "models/b/b.hpp": '#include "rhec/plugins/kit/sdk.hpp"',
        "models/b/b.cpp": '#include "b.hpp"',
        "sim/world/CMakeLists.txt": "rhec_add_room(sim world SHARED SOURCES own.cpp)",
        "sim/world/own.cpp": '#include "rhec/plugins/host/host.hpp"\n#include "rhec/sim/world/truth.hpp"',
        "logs/table/CMakeLists.txt": "rhec_add_room(logs table SHARED SOURCES up.cpp)",
        "logs/bag/CMakeLists.txt": "rhec_add_room(logs bag SHARED AFTER table SOURCES bag.cpp)",
        "logs/bag/bag.cpp": '#include "rhec/logs/table/table.hpp"\n#include "rhec/core/low/model.hpp"',
        "sim/loop/reads.cpp": '#include "rhec/logs/bag/bag.hpp"',
        "sim/loop/CMakeLists.txt": "rhec_add_room(sim loop SHARED AFTER world SOURCES run.cpp)",
        "sim/loop/run.cpp": '#include "rhec/plugins/host/host.hpp"\n#include "rhec/sim/world/truth.hpp"',
        "benchmarks/all.cpp": '#include <benchmark/benchmark.h>\n#include "models/b/b.hpp"\n#include "rhec/sim/world/truth.hpp"',
        "python/binding/own.hpp": "#pragma once",
        "python/binding/runs.cpp": '#include <pybind11/pybind11.h>\n#include "own.hpp"\n#include "rhec/sim/world/truth.hpp"',
        "apps/main.cpp": '#include <CLI/CLI.hpp>\n#include "rhec/sim/world/truth.hpp"',
    }
    failures = []
    with tempfile.TemporaryDirectory() as directory:
        root = pathlib.Path(directory)
        for name, text in {**wrong, **right}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text + "\n")
        if Rooms(root).shared != {("logs", "table"), ("logs", "bag"), ("sim", "world"), ("sim", "loop")}:
            failures.append(f"the rooms with libraries are {Rooms(root).shared}")
        told = {violation.split(":")[0].removeprefix(f"{root}/") for violation in include_violations(root)[0]}
        # A room that is declared wrongly is told by its name.
        failures += [f"not noticed: {name}" for name in wrong if name.removesuffix("/CMakeLists.txt") not in told]
        failures += [f"wrongly blamed: {name}" for name in right if name.removesuffix("/CMakeLists.txt") in told]
    links = [
        ("core", "librhec_plugins.so.0.1", True),
        ("core", "libboost_filesystem.so.1.74.0", True),
        ("core", "libfmt.so.9", False),
        ("plugins", "librhec_sim_files.so.0.1", True),
        ("plugins", "librhec_core.so.0.1", False),
        ("models", "other.so", True),
        ("models", "librhec_sim_files.so.0.1", True),
        ("models", "librhec_plugins.so.0.1", False),
        ("sim", "librhec_plugins.so.0.1", False),
        ("sim", "librhec_sim_files.so.0.1", False),
        ("sim", "librhec_sim_loop.so.0.1", True),
        ("sim", "librhec_logs_bag.so.0.1", False),
        ("logs", "librhec_sim_files.so.0.1", True),
        ("logs", "librhec_logs_bag.so.0.1", True),
        ("models", "librhec_logs_bag.so.0.1", True),
        ("sim", "libsqlite3.so.0", False),
        ("sim", "other.so", True),
    ]
    for folder, name, bad in links:
        before = ("files", "world") if folder == "sim" else ()
        if bool(link_violations("planted", folder, [name], {"other.so"}, before)) != bad:
            failures.append(f"{folder} linking to {name}: should be {'refused' if bad else 'accepted'}")
    house.tell("floors self-test", failures, len(wrong) + len(right) + len(links))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", nargs="?", type=pathlib.Path)
    parser.add_argument("--lib", type=pathlib.Path)
    parser.add_argument("--plugins", type=pathlib.Path)
    parser.add_argument("--self-test", action="store_true")
    arguments = parser.parse_args()
    if arguments.self_test:
        self_test()
    if not arguments.root:
        parser.error("the source root is missing")
    violations, looked_at = include_violations(arguments.root.resolve())
    if arguments.lib and arguments.plugins:
        more, libraries = library_violations(arguments.root.resolve(), arguments.lib, arguments.plugins)
        violations, looked_at = violations + more, looked_at + libraries
    house.tell("floors", violations, looked_at)


if __name__ == "__main__":
    sys.exit(main())
