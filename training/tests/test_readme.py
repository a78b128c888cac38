import re
from pathlib import Path

README = Path(__file__).resolve().parents[1] / "README.md"


def test_the_code_of_the_readme_runs():
    names = {}
    blocks = re.findall(r"^```python\n(.*?)^```", README.read_text("utf-8"), re.MULTILINE | re.DOTALL)
    for block in blocks:
        exec(block, names)
    assert len(blocks) == 3 and names["field"].isfinite()
    # The phases display the picture. Double phase alone is 38 times as far from it.
    assert names["error"] < 1e-4
    assert names["prediction"].grad.abs().max() > 0
