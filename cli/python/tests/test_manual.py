"""What the manual tells to type works."""

import re
from pathlib import Path

import numpy as np

MANUAL = Path(__file__).parents[3] / "docs" / "python.md"


def test_the_manual_runs_from_its_first_line_to_its_last(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```python\n(.*?)^```", MANUAL.read_text(), re.MULTILINE | re.DOTALL)
    assert len(blocks) >= 6
    told: dict = {}
    for block in blocks:
        exec(compile(block, str(MANUAL), "exec"), told)
    np.testing.assert_allclose(told["camera"].matrix, told["data"].camera.matrix)
    assert told["result"].status == "ok" and told["errors"]["ate_m"]["rmse"] < 0.01
    assert told["mesh"].is_file() and (told["scene"] / "transforms.json").is_file()
    assert "nowhere" in capsys.readouterr().out
