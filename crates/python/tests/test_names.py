"""What the package exports: names, docstrings, examples that are typed and, on the sample data, true."""

from __future__ import annotations

import doctest
import inspect
import os
import pydoc
import re
import textwrap
from pathlib import Path
from typing import Any, Iterator

import pytest

import skysweep
from conftest import ROOT
from test_stubs import mypy

#: Objects whose methods are public.
CLASSES = [skysweep.Rpc, skysweep.HeightSweep, skysweep.CityModel, skysweep.Plan, skysweep.Raster]


def exported() -> Iterator[tuple[str, Any]]:
    for name in skysweep.__all__:
        if not name.startswith("_") and name != "Progress":
            yield name, getattr(skysweep, name)


def methods(owner: type) -> Iterator[tuple[str, Any]]:
    for name, value in vars(owner).items():
        if not name.startswith("_"):
            yield f"{owner.__name__}.{name}", getattr(value, "__func__", value)


def with_examples() -> list[tuple[str, Any]]:
    documented = [*exported(), *(method for owner in CLASSES for method in methods(owner))]
    return [(name, value) for name, value in documented if ">>>" in (inspect.getdoc(value) or "")]


def test_all_names_the_public_ones() -> None:
    assert len(set(skysweep.__all__)) == len(skysweep.__all__)
    public = {name for name, value in vars(skysweep).items() if not name.startswith("_") and not inspect.ismodule(value)}
    assert public <= set(skysweep.__all__)
    names: dict[str, Any] = {}
    exec("from skysweep import *", names)
    assert {"dsm", "evaluate", "Raster", "DatumWarning"} <= set(names)


def test_the_help_is_an_overview_of_all_names() -> None:
    text = pydoc.plain(pydoc.render_doc(skysweep))
    overview = (skysweep.__doc__ or "").split()
    named = {name for word in overview for name in re.findall(r":\w+:`(\w+)`", word)}
    assert named == set(skysweep.__all__) - {"__version__"}
    # The overview comes first, before what help says of each name.
    assert text.index("From surface models") < text.index("CLASSES") and len(overview) < 400


def reference() -> str:
    """The page that names everything public, with the first sentence of its docstring."""

    def rows(entries: list[tuple[str, Any]]) -> str:
        def line(name: str, value: Any) -> str:
            text = re.sub(r":\w+:`~?([\w.]+)`", r"`\1`", (inspect.getdoc(value) or "").split("\n\n")[0])
            first = " ".join(text.replace("``", "`").split()).split(". ")[0].rstrip(".")
            return f"| `{name}` | {first} |\n"

        return "| name | what it is |\n|---|---|\n" + "".join(line(*entry) for entry in entries)

    public = [(name, value) for name, value in exported() if name != "__version__"]
    functions = [(f"{name}()", value) for name, value in public if inspect.isroutine(value)]
    classes = [(name, value) for name, value in public if inspect.isclass(value)]
    owned = "".join(f"\n## {owner.__name__}\n{rows(sorted(methods(owner)))}" for owner in CLASSES)
    return (
        "# Python reference\n\n"
        "Made of the docstrings by `SKYSWEEP_WRITE_REFERENCE=1 make test-python`. `help(skysweep.dsm)` has the keywords of a function with\n"
        "their units and defaults, what it returns, what it raises and an example. The [guide](python.md) shows them at work.\n\n"
        f"## Functions\n{rows(functions)}\n## Classes and exceptions\n{rows(classes)}{owned}"
    )


def test_the_reference_page_is_that_of_the_docstrings() -> None:
    path = ROOT / "docs" / "guide" / "python-reference.md"
    if "SKYSWEEP_WRITE_REFERENCE" in os.environ:
        path.write_text(reference(), encoding="utf-8")
    assert path.read_text(encoding="utf-8") == reference(), "run SKYSWEEP_WRITE_REFERENCE=1 make test-python"


def test_everything_public_has_a_docstring_and_functions_have_an_example() -> None:
    for name, value in exported():
        if name == "__version__":
            continue
        text = inspect.getdoc(value) or ""
        assert text, name
        if inspect.isfunction(value):
            assert "Example:" in text and "Raises:" in text, name
    for owner in CLASSES:
        assert "Example:" in (inspect.getdoc(owner) or ""), owner
        for name, value in methods(owner):
            assert inspect.getdoc(value), name


def test_examples_are_typed(tmp_path: Path) -> None:
    program = ["from __future__ import annotations", "import skysweep"]
    for number, (name, value) in enumerate(with_examples()):
        lines = [example.source for example in doctest.DocTestParser().get_examples(inspect.getdoc(value) or "")]
        program.append(f"def example_{number}() -> None:  # {name}")
        program.append(textwrap.indent("".join(lines), "    "))
    path = tmp_path / "examples.py"
    path.write_text("\n".join(program))
    found = mypy(path)
    assert "Success" in found, found + path.read_text()


@pytest.mark.parametrize("name", [name for name, value in with_examples() if "data-samples" in inspect.getdoc(value)])
def test_examples_on_the_sample_data_are_true(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "data-samples").symlink_to(ROOT / "data-samples")
    monkeypatch.chdir(tmp_path)
    value = dict(with_examples())[name]
    test = doctest.DocTestParser().get_doctest(inspect.getdoc(value) or "", {}, name, None, None)
    results = doctest.DocTestRunner().run(test)
    assert results.attempted > 1 and results.failed == 0
