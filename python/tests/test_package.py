"""The package as a whole."""

from __future__ import annotations

import doctest
import subprocess
import sys
from pathlib import Path

import coaxdesign as cx


def test_the_example_of_the_package_holds() -> None:
    assert doctest.testmod(cx).failed == 0


def test_import_needs_numpy_only() -> None:
    """No extra is imported before it is needed."""
    extras = ["control", "xarray", "polars", "pandas", "pyarrow", "matplotlib", "dask", "tqdm"]
    code = f"import sys, coaxdesign; print([m for m in {extras} if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_every_name_has_a_docstring() -> None:
    for name in cx.__all__:
        if not name.startswith("__"):
            assert getattr(cx, name).__doc__, name


def test_stubs_name_what_the_library_has() -> None:
    """Every name of the extension module is in its stub, and the other way round."""
    import ast

    from coaxdesign import _core

    package = Path(cx.__file__).parent
    tree = ast.parse((package / "_core.pyi").read_text())
    stubs: dict[str, set[str]] = {}
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            stubs[node.name] = {item.name for item in node.body if isinstance(item, ast.FunctionDef)
                and not item.name.startswith("_")}
        elif isinstance(node, ast.FunctionDef):
            stubs[node.name] = set()
    there = {name for name in vars(_core) if not name.startswith("_")}
    assert there == set(stubs)
    for name, methods in stubs.items():
        if methods:
            members = {item for item in vars(getattr(_core, name)) if not item.startswith("_")}
            assert members == methods, name
    assert (package / "py.typed").exists()
