"""The README's Python runs."""

import pathlib
import re


def test_the_readme_runs():
    readme = (pathlib.Path(__file__).parents[3] / "README.md").read_text()
    (code,) = re.findall(r"```python\n(.*?)```", readme, re.DOTALL)
    scope = {}
    exec(code, scope)
    assert scope["levels"].shape == (3, 480, 640)
