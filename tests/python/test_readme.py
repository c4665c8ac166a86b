"""The example of the README."""

import shutil

from conftest import ROOT


def test_the_example_of_the_readme(arrays, tmp_path, monkeypatch, capsys):
    readme = (ROOT / "README.md").read_text()
    example = readme.split("\n## Python\n")[1].split("```python\n")[1].split("```")[0]
    shutil.copytree(ROOT / "testdata", tmp_path / "testdata")
    monkeypatch.chdir(tmp_path)
    exec(example, {"t": arrays.t, "accel": arrays.accel, "gyro": arrays.gyro})
    assert "PROVISIONAL" in capsys.readouterr().out
