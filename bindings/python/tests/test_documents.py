"""Tests that everything public is documented: classes, functions, fields, options and types."""

import importlib.resources
import inspect
import typing

import pytest

import phasefront
from phasefront._session import Changes

PUBLIC = {name: getattr(phasefront, name) for name in phasefront.__all__ if not name.startswith("_")}
CLASSES = {name: thing for name, thing in PUBLIC.items() if inspect.isclass(thing)}


def kinds(thing):
    """Returns the nested classes of a class of values with fields."""
    return [inner for name, inner in vars(thing).items() if name.islower() and inspect.isclass(inner)]


@pytest.mark.parametrize("name", sorted(set(PUBLIC) - {"Event"}))
def test_it_says_what_it_is(name):
    thing = PUBLIC[name]
    assert inspect.getdoc(thing) and not inspect.getdoc(thing).startswith("alias"), name
    if name in CLASSES:
        methods = [(n, m) for n, m in inspect.getmembers(thing, callable) if not n.startswith(("_", "is_")) and n not in vars(Exception)]
        assert all(inspect.getdoc(method) for _, method in methods if not inspect.isclass(method)), name
        assert all(inspect.getdoc(kind) for kind in kinds(thing)), name


@pytest.mark.parametrize("name", sorted(CLASSES))
def test_every_field_and_argument_is_told_of(name):
    for thing in [CLASSES[name], *kinds(CLASSES[name])]:
        arguments = inspect.signature(thing.__init__).parameters
        named = [n for n, a in arguments.items() if n != "self" and a.kind not in (a.VAR_POSITIONAL, a.VAR_KEYWORD)]
        if thing is not phasefront.Hologram:  # which sessions make
            assert [n for n in named if f"    {n}: " not in thing.__doc__] == [], thing


def test_options_can_all_be_changed():
    fields = set(inspect.signature(phasefront.SessionOptions).parameters) - {"target"}
    assert set(typing.get_type_hints(Changes)) == fields
    with pytest.raises(TypeError, match="no_option"):
        phasefront.session_options(no_option=1)


def test_types_and_version_come_along():
    assert importlib.resources.files(phasefront).joinpath("py.typed").is_file()
    assert phasefront.__version__ == phasefront.version()


def test_what_is_shown_has_its_fields():
    assert repr(phasefront.Display(width=64)).startswith("Display(width=64, height=1080, ")
    assert repr([phasefront.Method.sweep()]) == "[Method.sweep()]"
    assert repr(phasefront.Quality.fixed(quality_level=1)) == "Quality.fixed(quality_level=1)"
