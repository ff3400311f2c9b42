"""What people rely on around the code: a core that works alone, installs that repeat, a map."""

import ast
import re
import subprocess
import sys
import tomllib
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import gelpolight_core

ROOT = Path(__file__).resolve().parents[1]
RUNTIME_LOCK = ROOT / "packaging" / "requirements.lock"
DEV_LOCK = ROOT / "packaging" / "requirements-dev.lock"
OLDEST_LOCK = ROOT / "packaging" / "requirements-oldest.lock"
TESTS = ROOT / "packaging" / "test.sh"
DOCS_LOCK = ROOT / "packaging" / "requirements-docs.lock"
FREEZE_LOCK = ROOT / "packaging" / "requirements-freeze.lock"
LOCKS = [RUNTIME_LOCK, DEV_LOCK, OLDEST_LOCK, DOCS_LOCK, FREEZE_LOCK]

# Imports every module of a package in a Python in which the given modules cannot be imported.
IMPORT_ALL_WITHOUT = """
import importlib, pkgutil, sys

package, *blocked = sys.argv[1:]
for name in blocked:
    sys.modules[name] = None
root = importlib.import_module(package)
names = [module.name for module in pkgutil.walk_packages(root.__path__, package + ".")]
for name in names:
    importlib.import_module(name)
print(len(names))
"""
NOT_THERE = ["app", "PySide6", "pyqtgraph", "pyvista", "pyvistaqt", "vtk", "vtkmodules"]


def pins(lock: Path) -> dict[str, str]:
    """Return the version of every library in a lock file."""
    return dict(re.findall(r"^([\w.-]+)==([^ \\]+)", lock.read_text("utf-8"), flags=re.MULTILINE))


@pytest.mark.function("Import the library without Qt and VTK")
def test_the_core_works_in_a_notebook_without_the_desktop_program():
    """Scripts and clusters have no Qt and no VTK."""
    command = [sys.executable, "-W", "error", "-c", IMPORT_ALL_WITHOUT, "gelpolight_core"]
    done = subprocess.run(
        [*command, *NOT_THERE], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 0


def test_the_release_note_and_the_citation_are_of_this_version():
    """Provenance and the citation name the program that people have installed."""
    version = gelpolight_core.__version__
    notes = (ROOT / "CHANGELOG.md").read_text("utf-8")
    assert re.findall(r"^## ([\d.]+)", notes, flags=re.MULTILINE)[0] == version
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    assert re.findall(r"^version: (.+)$", citation, flags=re.MULTILINE) == [version]


@pytest.mark.parametrize("lock", LOCKS, ids=lambda path: path.name)
def test_every_locked_library_is_pinned_and_has_a_hash(lock):
    """Everybody gets the very files that were tested."""
    text = "\n".join(x for x in lock.read_text("utf-8").splitlines() if not x.startswith("#"))
    entries = text.replace("\\\n", " ").splitlines()
    assert entries
    for entry in entries:
        assert re.match(r"[\w.-]+==\S+ .*--hash=sha256:[0-9a-f]{64}( |$)", entry), entry
        # A mirror or an offline folder of wheels serves as well as the public registry.
        assert not re.search(r"://|/|@|--(?!hash)", entry), entry


def requirements(*extras: str, core: bool = True) -> list[str]:
    """Return what pyproject.toml asks for, with the extras and those that they name."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    found = list(project["dependencies"]) if core else []
    for extra in extras:
        for requirement in project["optional-dependencies"][extra]:
            named = re.fullmatch(r"gelpolight-studio\[(\w+)\]", requirement)
            found += requirements(named[1], core=False) if named else [requirement]
    return found


def test_only_the_extra_of_reports_brings_what_draws_them():
    """The library and its commands are half as large without."""
    names = {re.split(r"[<>=!~\[ ]", requirement)[0] for requirement in requirements()}
    assert not names & {"matplotlib", "typst"}
    assert {"matplotlib", "typst"} <= {x.split(">=")[0] for x in requirements("gui")}


def test_the_tests_run_with_the_versions_that_users_get():
    """The test environment holds the program's environment."""
    runtime, dev = pins(RUNTIME_LOCK), pins(DEV_LOCK)
    assert runtime
    assert {name: dev.get(name) for name in runtime} == runtime


def test_every_dependency_is_locked():
    """A library added to the project is added to the locks."""
    for lock, wanted in (
        (RUNTIME_LOCK, requirements("gui")),
        (DEV_LOCK, requirements("gui", "dev")),
        (DOCS_LOCK, requirements("docs", core=False)),
    ):
        names = {re.split(r"[<>=!~\[ ]", requirement)[0].lower() for requirement in wanted}
        assert names <= pins(lock).keys()


def test_the_lowest_versions_that_are_allowed_are_those_that_were_tested():
    """A lower bound that nobody tried is a guess."""
    table = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    oldest = pins(OLDEST_LOCK)
    for requirement in requirements("gui", "dask") + table["build-system"]["requires"]:
        name, bound = re.match(r"([\w.-]+)>=([\d.]+)", requirement).groups()
        tested = oldest[name.lower()]
        assert re.fullmatch(re.escape(bound) + r"(\.0)*", tested), (requirement, tested)


def test_only_the_headless_opencv_is_installed():
    """Its sibling brings a Qt of its own, which crashes beside PySide6."""
    opencv = {name for name in pins(DEV_LOCK) if name.startswith("opencv")}
    assert opencv == {"opencv-contrib-python-headless"}


def test_python_calls_no_part_of_a_compiled_loop():
    """A part has no wrapper for Python: such a call would end the program."""
    parts, called = set[str](), set[str]()
    for path in (ROOT / "gelpolight_core").rglob("*.py"):
        for made in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(made, ast.FunctionDef):
                how = " ".join(map(ast.unparse, made.decorator_list)).lower()
                if "part" in how:
                    parts.add(f"{path}{made.name}" if made.name[0] == "_" else made.name)
                elif not re.search("whole|njit|compiled", how):
                    names = re.findall(r"\b(\w+)\(", ast.unparse(made))
                    called |= {f"{path}{name}" if name[0] == "_" else name for name in names}
    assert parts and not parts & called


def test_no_file_imports_itself_through_others():
    """Imports for the type checker alone count, too."""
    grimp = pytest.importorskip("grimp")  # of import-linter
    graph = grimp.build_graph("gelpolight_core", "app", cache_dir=None)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    TopologicalSorter(imports).prepare()  # raises CycleError with the circle


CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text("utf-8")


def test_each_folder_has_one_row_in_the_map_for_contributors():
    rows = re.findall(r"^\| `((?:gelpolight_core|app)/\w+)` \|", CONTRIBUTING, flags=re.MULTILINE)
    modules = [*(ROOT / "gelpolight_core").glob("*/*.py"), *(ROOT / "app").glob("*/*.py")]
    assert sorted(rows) == sorted({str(path.parent.relative_to(ROOT)) for path in modules})


def test_files_and_names_in_the_answers_for_contributors_exist():
    paths = set(
        re.findall(r"`((?:gelpolight_core|app|docs|tests|packaging)/[\w/.-]+)`", CONTRIBUTING)
    )
    assert paths
    assert not [path for path in paths if not (ROOT / path).exists()]
    named = re.findall(r"`(\w+)` (?:in|of)\s+`([\w/]+\.py)`", CONTRIBUTING)
    assert named
    texts = {path: (ROOT / path).read_text("utf-8") for _, path in named}
    assert not [(name, path) for name, path in named if not re.search(rf"\b{name}\b", texts[path])]
