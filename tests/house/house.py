"""What the checks of the house share: which files are ours, and how findings are told."""
import pathlib
import sys

FOLDERS = ("core", "plugins", "solvers", "models", "blocking", "priors", "terms", "logs", "sim", "apps", "python", "benchmarks")
CODE_FOLDERS = FOLDERS + ("tests", "examples")
ALL_FOLDERS = CODE_FOLDERS + ("cmake", "docs", "packaging", "scenarios", "scripts", ".ci")
CODE = {".hpp", ".cpp", ".h", ".cc", ".in"}
TEXT = CODE | {".py", ".sh", ".cmake", ".txt", ".md", ".yaml", ".yml", ".json", ".toml", ".js", ".mjs", ".css", ".html", ""}


def files(root, folders, suffixes):
    """Our files below `folders` of `root` whose name ends in one of `suffixes`, in order."""
    found = []
    for folder in folders:
        for path in sorted((pathlib.Path(root) / folder).rglob("*")):
            parts = path.relative_to(root).parts[1:]
            hidden = any(part.startswith((".", "__pycache__")) for part in parts)
            if path.is_file() and path.suffix in suffixes and not hidden:
                found.append(path)
    return found


def cpp_files(root, folders=CODE_FOLDERS):
    return files(root, folders, {".hpp", ".cpp", ".h", ".cc"})


def tell(check, violations, looked_at):
    """Prints the violations and ends the process: 0 without any, 1 with some or with nothing to look at."""
    for violation in violations:
        print(violation)
    if not looked_at:
        print(f"{check}: found nothing to look at, so nothing is known")
        sys.exit(1)
    print(f"{check}: {looked_at} looked at, {len(violations)} violations")
    sys.exit(1 if violations else 0)
