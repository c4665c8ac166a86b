"""What the wheel installs: a command, and a typed module."""

import importlib.metadata
import inspect
import re
from pathlib import Path

import stillpoint


def test_the_command_is_there_with_its_exit_codes(command, tmp_path):
    version = command("--version")
    assert version.stdout == f"stillpoint {stillpoint.__version__}\n"
    assert version.returncode == 0
    assert importlib.metadata.version("stillpoint") == stillpoint.__version__
    assert command("annotate", tmp_path / "missing.mcap").returncode == 1
    assert command("annotate").returncode == 2
    assert command("config", "show").stdout.startswith("# The configuration of Stillpoint")
    assert "\nUsage: stillpoint [OPTIONS] <COMMAND>" in command("--help").stdout


def test_the_module_is_typed_and_documented():
    folder = Path(stillpoint.__file__).parent
    assert (folder / "py.typed").exists()
    stub = (folder / "__init__.pyi").read_text()
    for name in stillpoint.__all__:
        if name.startswith("_"):
            continue
        thing = getattr(stillpoint, name)
        assert re.search(rf"^(class|def) {name}\b", stub, re.MULTILINE), f"{name} has no types"
        assert inspect.getdoc(thing), f"{name} has no documentation"
        members = [] if not inspect.isclass(thing) or issubclass(thing, Exception) else vars(thing)
        for member in (member for member in members if not member.startswith("_")):
            body = stub.split(f"class {name}:")[1].split("\nclass ")[0]
            assert f"def {member}(" in body, f"{name}.{member} has no type"
            assert inspect.getdoc(getattr(thing, member)), f"{name}.{member} has no documentation"
    for function in (stillpoint.calibrate, stillpoint.annotate, stillpoint.read, stillpoint.merge):
        parameters = set(inspect.signature(function).parameters)
        listed = inspect.getdoc(function).split("Parameters\n----------\n")[1].split("\n\n")[0]
        documented = {name for line in re.findall(r"^(\S.*?) : ", listed, re.MULTILINE) for name in line.split(", ")}
        assert parameters == documented
        text = stub.split(f"def {function.__name__}(")[1].split(") ->")[0]
        assert parameters == set(re.findall(r"(\w+): ", text))
