"""The stubs say what there is, and all of it has a docstring."""

import ast
import inspect
import pathlib

import pytest
from conftest import sklearn

import tactus

STUBS = ast.parse(pathlib.Path(tactus.__file__).with_name("__init__.pyi").read_text())


def members(node):
    return {f.name for f in node.body if isinstance(f, ast.FunctionDef)}


def test_the_package_is_typed():
    assert pathlib.Path(tactus.__file__).with_name("py.typed").exists()
    stubbed = {node.name for node in STUBS.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    # what needs scikit-learn is not imported by a star
    assert stubbed | {"__version__", "TEXTURES", "MAX_FEATURES"} == set(tactus.__all__) | {"TactusClassifier"}


def there_is(name):
    if name == "TactusClassifier":
        sklearn()
    return getattr(tactus, name)


def names(arguments):
    return [a.arg for a in arguments.posonlyargs + arguments.args + arguments.kwonlyargs]


@pytest.mark.parametrize("node", [n for n in STUBS.body if isinstance(n, ast.ClassDef)], ids=lambda n: n.name)
def test_a_class_has_the_members_of_its_stub(node):
    there = there_is(node.name)
    assert there.__doc__
    if issubclass(there, Exception):
        return
    public = {name for name in vars(there) if not name.startswith("_")}
    stubbed = {name for name in members(node) if not name.startswith("_")}
    # an inherited one may be in a stub, too, and scikit-learn adds one for each argument that it hands on
    assert public - {"set_score_request"} <= stubbed <= set(dir(there))
    for name in public:
        assert inspect.getdoc(getattr(there, name)), f"{node.name}.{name} has no docstring"


METHODS = [
    (node.name, method)
    for node in STUBS.body
    if isinstance(node, ast.ClassDef)
    for method in node.body
    if isinstance(method, ast.FunctionDef) and not method.name.startswith("__")
    if not any(isinstance(d, ast.Name) and d.id == "property" for d in method.decorator_list)
]


@pytest.mark.parametrize("owner, method", METHODS, ids=[f"{owner}.{method.name}" for owner, method in METHODS])
def test_a_method_takes_what_its_stub_says(owner, method):
    real = inspect.signature(getattr(there_is(owner), method.name))
    stubbed = names(method.args) + [a.arg for a in (method.args.vararg, method.args.kwarg) if a]
    assert stubbed == list(real.parameters)


@pytest.mark.parametrize("node", [n for n in STUBS.body if isinstance(n, ast.FunctionDef)], ids=lambda n: n.name)
def test_a_function_is_stubbed_and_explained(node):
    there = getattr(tactus, node.name)
    assert inspect.getdoc(there)
    parameters = {p.name for p in inspect.signature(there).parameters.values() if p.kind is not p.VAR_KEYWORD}
    stubbed = {a.arg for a in node.args.args + node.args.kwonlyargs}
    assert parameters <= stubbed
    hands_on = any(p.kind is p.VAR_KEYWORD for p in inspect.signature(there).parameters.values())
    known = {*tactus._DEFAULTS, *inspect.signature(tactus.Explorer).parameters} if hands_on else {}
    assert stubbed - parameters <= set(known)
