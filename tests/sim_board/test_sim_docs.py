"""The example in docs/emulator.md runs as printed."""

import re
from pathlib import Path

from planarm_wire import messages

ROOT = Path(__file__).parents[2]


def test_the_example_runs(monkeypatch):
    monkeypatch.chdir(ROOT)
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "emulator.md").read_text(), re.S)
    assert len(blocks) == 1
    scope: dict[str, object] = {}
    exec(compile(blocks[0], "docs/emulator.md", "exec"), scope)
    welcome, status = scope["replies"]
    assert isinstance(welcome, messages.Welcome)
    assert welcome.host_nonce == 7
    assert welcome.spec_hash == messages.SPEC_HASH
    assert isinstance(status, messages.Status)
    assert status.state == messages.State.READY
    assert scope["enabled_at"] > 0
