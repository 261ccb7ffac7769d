#!/usr/bin/env python3
"""The tests have the shape of the sources: mirror.py <source root> | --self-test

The test of <floor>/<room>/<name>.cpp is tests/<floor>/<room>/<name>_test.cpp; a plugin's folder is a room. What outgrows one
file goes on in <name>_<subject>_test.cpp beside it. Headers without a source may have tests too. What is in apps/ may be
tested from outside, by tests/cli/<name>.py or tests/report/<name>.py. A folder whose CMakeLists.txt has a project() is a
project of its own and is left out. A test that no CMakeLists.txt names is never built, and a violation. What is tested in another place is listed here with the test that does it, and nothing
else is: an entry that is no longer needed, or names a test that is not there, is a violation, too.
"""
import argparse
import pathlib
import re
import sys
import tempfile

import house

# The floors whose sources and tests must mirror each other.
FLOORS = ("core", "plugins", "solvers", "models", "blocking", "priors", "terms", "logs", "sim", "apps")
# Folders of tests that are about more than one source: whole suites, and programs in other languages.
SUITES = {
    "cli": "the commands of apps/, from outside: apps/check.cpp is tested by tests/cli/check.py",
    "docs": "the pages of the manual, and what is made of them",
    "closed_loop": "estimator and controller together",
    "house": "the house itself",
    "machines": "the same numbers on other processors",
    "performance": "counts of instructions",
    "python": "the package of python/, from Python",
    "reference": "recorded solutions",
    "report": "the page of reports, in a browser",
    "reproduction": "scripts/reproduce",
    "ros2": "the package for colcon",
    "solvers/conformance": "every solver on every problem",
    "support": "what tests share",
    "threads": "what is promised to programs with several threads",
}
# Sources without a test of their own -> the file that tests them, and what it does with them.
UNTESTED = {
    "apps/command.cpp": "tests/cli/bad_input.py: wrong commands and arguments; tests/cli/runs.py: the help",
    "apps/completion_words.cpp": "tests/cli/completion.py: the words that a shell shows",
    "apps/estimate.cpp": "tests/cli/report_log.py: the files of an estimation are those that its report is held against",
    "apps/examine_plugin/main.cpp": "tests/plugins/host/examiner_test.cpp: plugins that do harm, each in another way",
    "apps/examine_plugin/walls.cpp": "tests/plugins/host/examiner_test.cpp: memory, time, other processes",
    "apps/integration_note.cpp": "tests/cli/runs.py: a vehicle with a fast lag",
    "apps/log_arguments.cpp": "tests/cli/smooth.py: `rhec smooth` has the arguments that `rhec estimate` has",
    "apps/main.cpp": "tests/cli/bad_input.py: commands, usage and exit codes",
    "apps/plugins.cpp": "tests/cli/runs.py: the list, and one plugin's options; tests/cli/doctor.py has --doctor",
    "apps/report/embedded.cpp": "tests/report/report.py: the page, which it holds, is looked at in a browser",
    "apps/report/report_page.cpp": "tests/cli/report_run.py: the document is read from the page",
    "apps/report/svg_engine.cpp": "tests/report/figures.py: each figure of each kind of report",
    "apps/ros/library.cpp": "tests/cli/ros.py: every drive",
    "apps/ros/live.cpp": "tests/cli/ros.py: a program without the node says what to install; another build's is refused",
    "apps/ros/node/lever_arms.cpp": "tests/apps/ros/wire/participant_strangers_test.cpp: transforms come from another process",
    "apps/ros/node/loop_topics.cpp": "tests/apps/ros/node/loop_test.cpp: paths, stops and what is told of estimates",
    "apps/ros/node/node.cpp": "tests/cli/ros.py: the command, its mistakes and its end",
    "apps/ros/simulation/robot.cpp": "tests/cli/ros.py: the other end of every drive",
    "apps/ros/wire/raw_type.cpp": "tests/apps/ros/wire/participant_strangers_test.cpp: bytes arrive as they were sent",
    "apps/run.cpp": "tests/cli/runs.py: every choice of a scenario, and what a run leaves behind",
    "apps/solve.cpp": "tests/cli/dump.py: problems that were saved are solved again; tests/cli/bad_input.py has mistakes",
    "apps/stop_request.cpp": "tests/cli/tune.py: a command that is stopped",
    "apps/sweep_ranks.cpp": "tests/cli/sweep_mpi.py: sweeps under mpirun, and of a build without MPI",
    "apps/drive.cpp": "tests/cli/log.py: logs of all vehicles are estimated and smoothed",
    "apps/drive_arguments.cpp": "tests/cli/log.py: arguments, and files for others' tools",
    "logs/cdr/message_log.cpp": "tests/logs/rosbag2/db3_log_test.cpp: topics with and without definitions",
    "sim/replay/drive_replay_files.cpp": "tests/sim/replay/replay_summary_test.cpp: a row for each",
    "sim/telemetry/robot_messages.cpp": "tests/sim/telemetry/track_writer_test.cpp: every message is read back",
    "sim/telemetry/track_csv.cpp": "tests/sim/telemetry/track_writer_test.cpp: tables and trajectories",
    "sim/telemetry/track_messages.cpp": "tests/sim/telemetry/track_writer_test.cpp: messages have what the run had",
    "sim/telemetry/track_mcap.cpp": "tests/sim/telemetry/track_writer_test.cpp: messages have what the run had",
    "plugins/host/examiner_process.cpp": "tests/plugins/host/examine_test.cpp: runs it; examiner_test.cpp has how it may end",
    "core/estimation/kalman_filter_between.cpp": "tests/core/estimation/between_nodes_test.cpp: against dense conditioning",
    "core/estimation/prior_bank_between.cpp": "tests/core/estimation/between_nodes_test.cpp: against a window's problem",
    "core/estimation/stamped_rows.cpp": "tests/core/estimation/estimator_test.cpp: order, equal stamps, and what is full",
    "core/horizon/measured_interval.cpp": "tests/core/horizon/rhe_between_test.cpp: whatever a problem has between nodes",
    "sim/comparison/bench.cpp": "tests/sim/comparison/comparison_test.cpp: every answer is of a bench; refusals, too",
    "sim/problems/problem_dump.cpp": "tests/cli/dump.py: what a loop saves, attempts and failures, and its replay",
    "sim/report/report_comparison.cpp": "tests/cli/report_study.py: needs a comparison's files, which that test makes",
    "sim/report/report_horizons.cpp": "tests/cli/report_run.py: needs a run's horizons.jsonl, which that test makes",
    "sim/report/log_page.cpp": "tests/cli/report_log.py: needs an estimation's files, which that test makes",
    "sim/report/report_drive.cpp": "tests/cli/report_log.py: needs an estimation's files, which that test makes",
    "sim/report/report_log.cpp": "tests/cli/report_log.py: needs an estimation's files, which that test makes",
    "sim/report/report_map.cpp": "tests/cli/map.py: needs the map of a drive, which that test makes",
    "sim/report/report_run.cpp": "tests/cli/report_run.py: needs a run's files, which that test makes",
    "sim/report/report_sweep.cpp": "tests/cli/report_study.py: needs a sweep's database, which that test makes",
    "sim/tuning/controller_tuning_files.cpp": "tests/sim/tuning/controller_tuning_test.cpp: needs a tuning, which takes a while",
    "sim/tuning/log_tuning_files.cpp": "tests/sim/tuning/log_tuning_test.cpp: needs a tuning, which takes a while",
    "sim/tuning/log_worth.cpp": "tests/sim/tuning/log_tuning_test.cpp: the second half of the same class",
}
# Tests that mirror no source -> what they are about.
ALONE = {
    "tests/blocking/geometric_test.cpp": "plugins/template/geometric.cpp, a blocking from outside",
    "tests/core/estimation/allocation_test.cpp": "all methods of estimation, which must not allocate",
    "tests/core/estimation/between_nodes_test.cpp": "all methods: measurements between nodes, and what comes late",
    "tests/core/ocp/minimum_time_test.cpp": "a kind of problem that derives from Ocp itself, examples/minimum_time",
    "tests/core/horizon/own_problem_test.cpp": "a kind of problem from outside, examples/problem",
    "tests/models/derivatives_test.cpp": "every model that is found",
    "tests/priors/conformance_test.cpp": "every prior that is found",
    "tests/terms/conformance_test.cpp": "every term that is found, on every model that is found",
    "tests/sim/world/allocation_test.cpp": "paths, ground and the true vehicle, which must not allocate",
}


def of_suite(test, root):
    path = test.relative_to(root / "tests")
    return any(path.is_relative_to(suite) for suite in SUITES)


def of_another_project(path, root):
    """Whether a folder above it, but for the root, is a project of its own."""
    lists = [folder / "CMakeLists.txt" for folder in path.parents if folder != root and folder.is_relative_to(root)]
    return any(file.is_file() and re.search(r"^project\(", file.read_text(), re.MULTILINE) for file in lists)


def tests_of(source, root):
    """Where the test of a source may be; the first one is the usual place."""
    name = source.relative_to(root)
    places = [root / "tests" / name.parent / f"{name.stem}_test.cpp"]
    if name.parts[0] == "apps":
        places += [root / "tests" / suite / f"{name.stem}.py" for suite in ("cli", "report")]
    return places


def mirrored(test, root):
    """Whether a test names a source, or a header, of the folder that it mirrors."""
    folder = root / test.relative_to(root / "tests").parent
    words = test.name.removesuffix("_test.cpp").split("_")
    names = ["_".join(words[:count]) for count in range(len(words), 0, -1)]
    for name in names:
        if (folder / f"{name}.cpp").is_file() or any(folder.rglob(f"{name}.hpp")):
            return True
    return False


def is_built(test, root):
    """Whether a list of its folder, or of one above it in tests/, names a test: as a file, or without its ending."""
    name = test.name.removesuffix("_test.cpp")
    word = re.compile(rf"(?<![\w/]){re.escape(name)}(_test(\.cpp)?)?(?![\w.])|\b{re.escape(name)}_test\.cpp\b")
    lists = [folder / "CMakeLists.txt" for folder in test.parents if folder.is_relative_to(root / "tests")]
    return any(word.search(re.sub(r"#.*", "", file.read_text())) for file in lists if file.is_file())


def violations_of(root, floors=FLOORS, untested=None, alone=None):
    untested, alone = UNTESTED if untested is None else untested, ALONE if alone is None else alone
    found, looked_at = [], 0
    for source in house.files(root, floors, {".cpp"}):
        if of_another_project(source, root):
            continue
        looked_at += 1
        name = source.relative_to(root)
        places = [place.relative_to(root) for place in tests_of(source, root)]
        there = [place for place in places if (root / place).is_file()]
        if there and name.as_posix() in untested:
            found.append(f"{name}: has a test, {there[0]}; take it off the list in mirror.py")
        elif not there and name.as_posix() not in untested:
            found.append(f"{name}: has no test; expected {' or '.join(map(str, places))}")
    for test in house.files(root, [f"tests/{floor}" for floor in floors], {".cpp"}):
        if not test.name.endswith("_test.cpp") or of_suite(test, root):
            continue
        looked_at += 1
        name = test.relative_to(root).as_posix()
        if not is_built(test, root):
            found.append(f"{name}: no CMakeLists.txt of its folder or above names it; add it, or it never runs")
        if mirrored(test, root):
            if name in alone:
                found.append(f"{name}: mirrors a source; take it off the list in mirror.py")
        elif name not in alone:
            found.append(f"{name}: mirrors no source of {test.relative_to(root / 'tests').parent}/; move it, or say in mirror.py what "
                         "it is about")
    for name in sorted([*untested, *alone]):
        if not (root / name).is_file():
            found.append(f"tests/house/mirror.py: lists {name}, which is not there")
    for name, reason in sorted(untested.items()):
        test = reason.split(":")[0]
        if not test.startswith("tests/") or not (root / test).is_file():
            found.append(f"tests/house/mirror.py: says that {name} is tested by '{test}', which is no file of tests/")
    return found, looked_at


def self_test():
    """Plants sources and tests in a small tree; what is wrong must be told, and nothing else."""
    right = [
        "core/low/angle.cpp", "tests/core/low/angle_test.cpp",
        "core/low/include/rhec/core/low/dual.hpp", "tests/core/low/dual_test.cpp",
        "tests/core/low/angle_large_numbers_test.cpp",
        "core/low/long_name.cpp", "tests/core/low/long_name_test.cpp",
        "core/low/special.cpp", "core/low/unbuilt.cpp",
        "models/cart/cart.cpp", "tests/models/cart/cart_test.cpp",
        "tests/models/every_test.cpp", "tests/models/helper.cpp",
        "apps/check.cpp", "tests/cli/check.py",
        "apps/report/page.cpp", "tests/report/page.py",
        "apps/run.cpp", "tests/cli/runs.py",
        "plugins/host/host.cpp", "tests/plugins/host/host_test.cpp",
        "tests/CMakeLists.txt", "tests/models/CMakeLists.txt", "tests/plugins/CMakeLists.txt", "tests/solvers/CMakeLists.txt",
        "plugins/template/CMakeLists.txt", "plugins/template/own.cpp", "plugins/template/deep/own.cpp",
        "sim/CMakeLists.txt", "sim/loop/loop.cpp", "tests/sim/loop/loop_test.cpp",
        "solvers/fast/fast.cpp", "tests/solvers/fast/fast_test.cpp", "tests/solvers/conformance/all_test.cpp",
    ]
    wrong = [
        "core/low/untested.cpp",
        "core/low/moved.cpp", "tests/core/moved_test.cpp",
        "tests/core/low/gone_test.cpp",
        "models/cart/other.cpp",
        "apps/untested.cpp",
        "sim/loop/untested.cpp",
        "plugins/untested.cpp",
        "core/low/tested_after_all.cpp",
        "tests/solvers/listed_test.cpp",
        "tests/core/low/unbuilt_test.cpp",
    ]
    texts = {"plugins/template/CMakeLists.txt": "cmake_minimum_required(VERSION 3.22)\nproject(mine)\n",
             "tests/CMakeLists.txt": "angle dual long_name_test angle_large_numbers tested_after_all\nloop_test.cpp\n"
                                     "low/moved_test.cpp gone listed # unbuilt\n",
             "tests/models/CMakeLists.txt": "cart every\n", "tests/plugins/CMakeLists.txt": "host\n",
             "tests/solvers/CMakeLists.txt": "fast\n",
             "sim/CMakeLists.txt": "# No project(): a part of ours.\nadd_subdirectory(loop)\n"}
    more = ["tests/core/low/tested_after_all_test.cpp", "sim/loop/by_nobody.cpp", "sim/loop/by_words.cpp"]
    by_another = "tests/models/every_test.cpp: planted"
    untested = {"core/low/special.cpp": by_another, "core/low/tested_after_all.cpp": by_another,
                "apps/run.cpp": "tests/cli/runs.py", "sim/loop/by_nobody.cpp": "tests/cli/gone.py: planted",
                "sim/loop/by_words.cpp": "looked at by eye"}
    alone = {"tests/models/every_test.cpp": "planted", "tests/core/low/never_written_test.cpp": "planted"}
    failures = []
    with tempfile.TemporaryDirectory() as directory:
        root = pathlib.Path(directory)
        for name in right + wrong + more:
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(texts.get(name, "\n"))
        found, _ = violations_of(root, FLOORS, untested, alone)
        told = {violation.split(":")[0] for violation in found}
        failures += [f"not noticed: {name}" for name in wrong if name not in told]
        failures += [f"wrongly blamed: {name}" for name in right + more if name in told]
        if not any("never_written_test.cpp" in violation for violation in found):
            failures.append("not noticed: an entry of the list that names no file")
        for name in ("by_nobody.cpp is tested by 'tests/cli/gone.py'", "by_words.cpp is tested by 'looked at by eye'"):
            if not any(name in violation for violation in found):
                failures.append(f"not noticed: {name}")
    house.tell("mirror self-test", failures, len(right) + len(wrong) + len(more) + 3)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", nargs="?", type=pathlib.Path)
    parser.add_argument("--self-test", action="store_true")
    arguments = parser.parse_args()
    if arguments.self_test:
        self_test()
    if not arguments.root:
        parser.error("the source root is missing")
    house.tell("mirror", *violations_of(arguments.root.resolve()))


if __name__ == "__main__":
    sys.exit(main())
