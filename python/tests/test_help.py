"""What help() says is what editors are told by the stub."""

import ast
import inspect
import pickle

import insonify
from conftest import ROOT
from insonify import _insonify

STUB = ast.parse((ROOT / "python/insonify/_insonify.pyi").read_text())


def documented(body):
    """Names and texts of what a module or class of the stub describes."""
    for node, after in zip(body, [*body[1:], None]):
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and ast.get_docstring(node):
            yield node.name, ast.get_docstring(node)
        elif isinstance(node, ast.AnnAssign) and isinstance(after, ast.Expr):
            yield node.target.id, inspect.cleandoc(after.value.value)


def test_help_and_the_stub_say_the_same():
    classes = {node.name: node.body for node in STUB.body if isinstance(node, ast.ClassDef)}
    seen = 0
    for owner, body in [(_insonify, STUB.body), *((getattr(_insonify, name, None), body) for name, body in classes.items())]:
        for name, text in documented(body):
            # Python has texts of its own for what operators call.
            if name.startswith("__") or owner is None:
                continue
            assert inspect.getdoc(getattr(owner, name)) == text, f"{owner.__name__}.{name}"
            seen += 1
    assert seen > 45


def test_everything_public_has_a_text():
    for name in insonify.__all__:
        thing = getattr(insonify, name)
        assert inspect.getdoc(thing), name
        for part, member in inspect.getmembers(thing):
            if inspect.isclass(thing) and not part.startswith("_") and not isinstance(member, type):
                assert inspect.getdoc(member) or name in ("InsonifyError", "SceneError"), f"{name}.{part}"
    assert "Ellipsis" not in str(inspect.signature(insonify.Simulator.frame))
    assert pickle.loads(pickle.dumps(insonify.Scene)) is insonify.Scene
