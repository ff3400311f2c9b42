"""What goes into the frozen program, and what of the libraries it leaves out."""

from __future__ import annotations

import hashlib
import py_compile
import re
import subprocess
import sys
from collections.abc import Iterable
from fnmatch import fnmatch
from importlib.util import find_spec
from pathlib import Path, PurePath

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("app", "gelpolight_core")
# The image in resources/ itself is the README's.
RESOURCES = ("checkerboards", "designs", "icons")
# What setuptools puts beside the modules: see package-data in pyproject.toml.
PACKAGE_DATA = ("*.toml", "*.csv", "*.json", "*.typ", "py.typed")
# Of the documentation: for search engines.
NOT_READ = ("sitemap.xml", "sitemap.xml.gz")
# Whose version the program asks for.
NAMED_VERSIONS = (
    "matplotlib",
    "numba",
    "numpy",
    "opencv-contrib-python-headless",
    "pyqtgraph",
    "PySide6-Essentials",
    "pyvista",
    "pyvistaqt",
    "scipy",
    "tifffile",
    "trimesh",
    "typst",
    "vtk",
)

Entry = tuple[str, str, str]
"""Place in the build, file it is made from, kind: an entry of PyInstaller's tables."""

# Imported from C, where PyInstaller does not look. Not the whole of VTK's folders: others of their
# modules would bring three times as many of its libraries.
HIDDEN_MODULES = (
    "PySide6.support.deprecated",
    "isal.igzip_lib",
    "numba._devicearray",
    "vtkmodules.numpy_interface.array_overrides",
    "vtkmodules.numpy_interface.vtk_affine_array",
    "vtkmodules.numpy_interface.vtk_aos_array",
    "vtkmodules.numpy_interface.vtk_composite_array",
    "vtkmodules.numpy_interface.vtk_constant_array",
    "vtkmodules.numpy_interface.vtk_implicit_array",
    "vtkmodules.numpy_interface.vtk_indexed_array",
    "vtkmodules.numpy_interface.vtk_soa_array",
    "vtkmodules.numpy_interface.vtk_strided_array",
    "vtkmodules.numpy_interface.vtk_structured_point_array",
    "vtkmodules.util.data_array_selection",
)

LEFT_OUT_MODULES = (
    "IPython",
    "PIL._avif",  # formats and fonts that Matplotlib does not ask Pillow for
    "PIL._imagingcms",
    "PIL._imagingft",
    "PIL._imagingtk",
    "PIL._webp",
    "PySide6.QtNetwork",
    "PySide6.QtPrintSupport",
    "PySide6.QtQml",
    "PySide6.QtQuick",
    "_curses",
    "_gdbm",  # GPL
    "_tkinter",
    "curses",
    "cyclopts",  # pyvista's own command line
    "dask",
    "dbm.gnu",
    "distributed",
    "docutils",
    "imageio",
    "lib2to3",
    "meshio",
    "matplotlib.backends.backend_qtagg",
    "numba.cuda",
    "pyqtgraph.console",
    "pyqtgraph.examples",
    "pyqtgraph.opengl",
    "readline",  # GPL
    "rich",
    "setuptools",
    "tkinter",
)

# pyvista names nearly all of VTK and loads what is used. Of its readers that is images; what
# is for web pages, maps, molecules or accelerators is not used at all.
LEFT_OUT_VTK = (
    "vtkmodules.vtkAccelerators*",
    "vtkmodules.vtkDomains*",
    "vtkmodules.vtkGeovis*",
    "vtkmodules.vtkIO[!CI]*",
    "vtkmodules.vtkIOC[!o]*",
    "vtkmodules.vtkIOCON*",
    "vtkmodules.vtkIOI[!m]*",
    "vtkmodules.vtkIOImport",
    "vtkmodules.vtkRenderingGL2PS*",
    "vtkmodules.vtkRenderingVR*",
    "vtkmodules.vtkTesting*",
    "vtkmodules.vtkWeb*",
)


def left_out_modules() -> list[str]:
    """Return the modules that are left out, those of VTK by their names on this machine."""
    folder = Path(find_spec("vtkmodules").submodule_search_locations[0])
    vtk = {f"vtkmodules.{path.name.split('.')[0]}" for path in folder.glob("vtk*.so")}
    vtk |= {f"vtkmodules.{path.name.split('.')[0]}" for path in folder.glob("vtk*.pyd")}
    return [
        *LEFT_OUT_MODULES,
        *sorted(name for name in vtk if any(fnmatch(name, kind) for kind in LEFT_OUT_VTK)),
    ]


# Plugins of Qt that this program uses; Windows and macOS have others of their own.
QT_PLUGINS = (
    "iconengines/*qsvgicon*",
    "imageformats/*qsvg.*",
    "imageformats/*qjpeg*",
    "imageformats/*qwebp*",
    "platforminputcontexts/*compose*",
    "platforminputcontexts/*ibus*",
    "platforms/*qcocoa*",
    "platforms/*qwayland*",
    "platforms/*qwindows*",
    "platforms/*qxcb*",
    "platformthemes/*xdgdesktopportal*",
    "styles/*",
    "wayland-*/*",
    "xcbglintegrations/*",
)
LEFT_OUT_FILES = (
    "PySide6/opengl32sw.dll",
    "matplotlib/mpl-data/images/*",
    "matplotlib/mpl-data/sample_data/*",
    "numba/np/ufunc/omppool*",  # parallel loops, which the compiled ones here are not
    "numba/np/ufunc/tbbpool*",
    "setuptools/*",
)
# Libraries of these plugins and of nothing else.
LEFT_OUT_LIBRARIES = ("EglFSDeviceIntegration", "EglFsKmsSupport", "Network")
# Of the system's libraries only these, which Python needs, are included. All others (those
# of windows, the C++ runtime) must fit to the system's graphics drivers; packages ask for them.
SYSTEM_LIBRARIES = re.compile(
    r"lib(bz2|crypto|expat|ffi|lzma|mpdec|python3[.\d]*|sqlite3|ssl|uuid|z)\.so"
)
SYSTEM_FOLDERS = ("/lib/", "/lib64/", "/usr/lib/", "/usr/lib64/")
# Their tables of names for debuggers are a fifth of their size.
STRIPPED = ("llvmlite/binding/*.so", "vtkmodules/*.so")


def data_files() -> list[tuple[str, str]]:
    """Return resources and data of the packages: file, folder in the build."""
    found = [
        (path, path.parent) for name in RESOURCES for path in (ROOT / "resources" / name).rglob("*")
    ]
    for package in PACKAGES:
        for pattern in PACKAGE_DATA:
            found += [(path, path.parent) for path in (ROOT / package).rglob(pattern)]
    return [(str(path), str(folder.relative_to(ROOT))) for path, folder in found if path.is_file()]


def documentation() -> list[tuple[str, str]]:
    """Return the files of the documentation: file, folder in the build.

    Raises
    ------
    FileNotFoundError
        If packaging/docs.sh has not made it.
    """
    site = ROOT / "resources" / "site"
    if not (site / "index.html").is_file():
        raise FileNotFoundError(f"no documentation in {site}: make it with packaging/docs.sh")
    found = [path for path in site.rglob("*") if path.is_file() and path.name not in NOT_READ]
    return [(str(path), str(path.parent.relative_to(ROOT))) for path in found]


def is_wanted(entry: Entry) -> bool:
    """Whether a file that PyInstaller found is taken along."""
    place, source = PurePath(entry[0]), PurePath(entry[1]).as_posix()
    if any(place.match(pattern) for pattern in LEFT_OUT_FILES):
        return False
    if re.match(rf"(lib)?Qt6({'|'.join(LEFT_OUT_LIBRARIES)})\b", place.name):
        return False
    parts = place.parts
    if "translations" in parts and "PySide6" in parts:
        return False
    if "plugins" in parts and "PySide6" in parts:
        return any(place.match(f"plugins/{pattern}") for pattern in QT_PLUGINS)
    if source.startswith(SYSTEM_FOLDERS) and re.search(r"\.so(\.|$)", place.name):
        return "lib-dynload" in source or SYSTEM_LIBRARIES.match(place.name) is not None
    return True


def hash_of_sources() -> str:
    """Return a hash of the program's modules: compiled loops of others are not taken for theirs."""
    digest = hashlib.sha256()
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            digest.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def compiled(entries: Iterable[Entry], folder: Path) -> list[Entry]:
    """Return the bytecode of the modules among the entries, made in `folder`."""
    made: list[Entry] = []
    tag = sys.implementation.cache_tag
    for place, source, _ in entries:
        path = PurePath(place)
        if path.suffix == ".py" and path.parts[0] in PACKAGES:
            name = str(path.parent / "__pycache__" / f"{path.stem}.{tag}.pyc")
            # Never compared with its source: a folder that cannot be written need not be asked.
            mode = py_compile.PycInvalidationMode.UNCHECKED_HASH
            py_compile.compile(source, str(folder / name), place, True, invalidation_mode=mode)
            made.append((name, str(folder / name), "DATA"))
    return made


def strip(entries: Iterable[Entry], folder: Path) -> list[Entry]:
    """Return the entries, of large libraries copies in `folder` without debugging names."""
    stripped: list[Entry] = []
    for place, source, kind in entries:
        if kind != "SYMLINK" and any(PurePath(place).match(pattern) for pattern in STRIPPED):
            copy = folder / place
            copy.parent.mkdir(parents=True, exist_ok=True)
            subprocess.run(["strip", "--strip-unneeded", "-o", copy, source], check=True)
            source = str(copy)
        stripped.append((place, source, kind))
    return stripped


def render_icon(picture: Path, size_px: int = 1024) -> str:
    """Write the program's icon as a PNG, from which Windows and macOS make theirs."""
    from PySide6.QtCore import Qt
    from PySide6.QtGui import QImage, QPainter
    from PySide6.QtSvg import QSvgRenderer

    image = QImage(size_px, size_px, QImage.Format.Format_ARGB32)
    image.fill(Qt.GlobalColor.transparent)
    painter = QPainter(image)
    QSvgRenderer(str(ROOT / "resources" / "icons" / "gelpolight.svg")).render(painter)
    painter.end()
    picture.parent.mkdir(parents=True, exist_ok=True)
    if not image.save(str(picture)):
        raise OSError(f"{picture} cannot be written")
    return str(picture)
