"""The stubs say what there is, and all of it has a docstring."""

import ast
import inspect
import pathlib

import pytest

import tactus

STUBS = ast.parse(pathlib.Path(tactus.__file__).with_name("__init__.pyi").read_text())


def members(node):
    return {f.name for f in node.body if isinstance(f, ast.FunctionDef)}


def test_the_package_is_typed():
    assert pathlib.Path(tactus.__file__).with_name("py.typed").exists()
    stubbed = {node.name for node in STUBS.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    assert stubbed | {"__version__", "TEXTURES"} == set(tactus.__all__)


@pytest.mark.parametrize("node", [n for n in STUBS.body if isinstance(n, ast.ClassDef)], ids=lambda n: n.name)
def test_a_class_has_the_members_of_its_stub(node):
    there = getattr(tactus, node.name)
    assert there.__doc__
    if issubclass(there, Exception):
        return
    public = {name for name in vars(there) if not name.startswith("_")}
    assert {name for name in members(node) if not name.startswith("_")} == public
    for name in public:
        assert inspect.getdoc(getattr(there, name)), f"{node.name}.{name} has no docstring"


@pytest.mark.parametrize("node", [n for n in STUBS.body if isinstance(n, ast.FunctionDef)], ids=lambda n: n.name)
def test_a_function_is_stubbed_and_explained(node):
    there = getattr(tactus, node.name)
    assert inspect.getdoc(there)
    parameters = {p.name for p in inspect.signature(there).parameters.values() if p.kind is not p.VAR_KEYWORD}
    stubbed = {a.arg for a in node.args.args + node.args.kwonlyargs}
    assert parameters <= stubbed
    known = tactus._DEFAULTS if any(p.kind is p.VAR_KEYWORD for p in inspect.signature(there).parameters.values()) else {}
    assert stubbed - parameters <= set(known)
