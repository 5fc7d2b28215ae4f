"""Each command makes one frozen record of its options and hands on that, whole."""

import ast
import dataclasses
import importlib
import inspect
import textwrap

import pytest

from mushrooms.commands import app

COMMANDS = {command.callback.__name__: command.callback for command in app.registered_commands}


def faults(source: str) -> list[str]:
    """List what a command's function does beside making a record of its options and handing it on."""
    [function] = ast.parse(source).body
    assert isinstance(function, ast.FunctionDef)
    parameters = [argument.arg for argument in function.args.args]
    body = [node for node in function.body if not isinstance(node, ast.ImportFrom)]
    match body:
        case [
            ast.Expr(value=ast.Constant()),
            ast.Assign(targets=[ast.Name("options")], value=ast.Call(args=[], keywords=keywords)),
            ast.Expr(value=call) | ast.Return(value=call),
        ]:
            said = [(each.arg, ast.unparse(each.value)) for each in keywords]
            wrong = [f"{name} is {value}" for name, value in said if name != value]
            if [name for name, _ in said] != parameters:
                wrong.append("not all options, or in another order")
            if not (isinstance(call, ast.Call) and [*map(ast.unparse, call.args)] == ["options"]):
                wrong.append("hands on something else")
            return wrong
    return ["does more than that"]


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_makes_a_record_of_its_options_and_no_more(name):
    assert faults(textwrap.dedent(inspect.getsource(COMMANDS[name]))) == []


@pytest.mark.parametrize("name", COMMANDS)
def test_the_record_has_a_field_for_each_option_and_is_frozen(name):
    source = textwrap.dedent(inspect.getsource(COMMANDS[name]))
    parameters = list(inspect.signature(COMMANDS[name]).parameters)
    [record] = [
        getattr(importlib.import_module(str(node.module)), alias.name)
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.name.endswith("Options")
    ]
    fields = dataclasses.fields(record)
    assert [field.name for field in fields] == parameters
    assert all(field.kw_only for field in fields)
    assert all(field.default is dataclasses.MISSING for field in fields), "defaults stand with the options"
    made = record(**dict.fromkeys(parameters))
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(made, parameters[0], "other")
    assert not hasattr(made, "__dict__")
    described = inspect.getdoc(record) or ""
    assert all(parameter in described for parameter in parameters)


HEAD = 'def draw(scene, out):\n    """Draw."""\n    from mushrooms.draw import DrawOptions, draw_scene\n'
MADE = "    options = DrawOptions(scene=scene, out=out)\n"
HANDED = "    draw_scene(options)"
FAULTY = {
    "two options exchanged": "    options = DrawOptions(scene=out, out=scene)\n" + HANDED,
    "an option left out": "    options = DrawOptions(scene=scene)\n" + HANDED,
    "another order": "    options = DrawOptions(out=out, scene=scene)\n" + HANDED,
    "work of its own": "    print(scene)\n" + MADE + HANDED,
    "a changed option": "    options = DrawOptions(scene=scene, out=out or 1)\n" + HANDED,
    "an option beside it": MADE + "    draw_scene(options, out)",
    "no record": "    draw_scene(scene, out)",
}


@pytest.mark.parametrize("body", FAULTY.values(), ids=FAULTY)
def test_a_faulty_command_would_be_seen(body):
    assert faults(HEAD + MADE + HANDED) == []
    assert faults(HEAD + body) != []
